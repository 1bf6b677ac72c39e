from __future__ import annotations

import os
import subprocess
import threading
from pathlib import Path

import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient
from rerun_bindings import check_for_rrd_footer

from helpers import viz_fakes as fakes
from helpers.viz_recordings import scene_of
from maurice_loaders.errors import TakenError
from maurice_viz.layouts.registry import runs_blueprint
from maurice_viz.scene import RunView
from maurice_viz.viewer import blocks, sinks
from maurice_viz.viewer import open_viewers as viewer
from maurice_viz.viewer.snapshot import software_driver

LAYOUT = rrb.Blueprint(rrb.TextDocumentView(origin="/a"))


def write(path: Path, force: bool = False) -> None:
    with sinks.to_file(path, "a session", LAYOUT, force=force) as rec:
        rec.log("/a", rr.TextDocument("hello"))


def write_in_vain(path: Path, remark: sinks.Remark) -> None:
    with sinks.to_file(path, "x", LAYOUT, force=True, remark=remark) as rec:
        rec.log("/a", rr.TextDocument("so far"))
        raise KeyboardInterrupt


def test_recordings_are_whole_or_live(tmp_path):
    write(tmp_path / "a.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["a.rrd"]
    reader = RrdReader(tmp_path / "a.rrd")
    assert reader.recordings()[0].application_id == "maurice-replay"
    assert len(reader.blueprints()) == 1
    with sinks.to_file(tmp_path / "live.rrd", "a", LAYOUT, serve=viewer.free_port()) as rec:
        rec.log("/a", rr.TextDocument("hello"))
    assert [check_for_rrd_footer(tmp_path / name) for name in ("live.rrd", "a.rrd")] == [False, True]


def test_existing_files_need_force(tmp_path):
    (tmp_path / "a.rrd").write_bytes(b"mine")
    with pytest.raises(sinks.SinkError, match="--force"):
        write(tmp_path / "a.rrd")
    assert (tmp_path / "a.rrd").read_bytes() == b"mine"
    (tmp_path / "a.rrd").write_bytes(b"mine")
    write(tmp_path / "a.rrd", force=True)
    assert RrdReader(tmp_path / "a.rrd").recordings()


def test_a_failure_keeps_the_old_file_and_leaves_a_part_that_opens(tmp_path):
    path, said = tmp_path / "a.rrd", list[str]()
    path.write_bytes(b"mine")
    with pytest.raises(KeyboardInterrupt):
        write_in_vain(path, said.append)
    assert path.read_bytes() == b"mine"
    assert f"{sinks.part_of(path).name} holds the recording up to that point" in said[0]
    assert "/a" in {str(chunk.entity_path) for chunk in RrdReader(sinks.part_of(path)).stream()}


def test_the_loser_of_two_that_write_one_recording_says_so_and_leaves_nothing(tmp_path):
    """Neither replaces what the other has written, unless it was told to."""
    path = tmp_path / "a.rrd"
    refused = pytest.raises(sinks.SinkError, match=r"a\.rrd: was written by another process meanwhile")
    with refused, sinks.to_file(path, "a", LAYOUT):
        path.write_bytes(b"theirs")
    assert path.read_bytes() == b"theirs"
    path.unlink()
    with pytest.raises(TakenError), sinks.to_file(path, "a", LAYOUT):
        raise TakenError(tmp_path / "kept", "exists already")  # the saved run beside it
    assert not list(tmp_path.iterdir())
    with sinks.to_file(path, "a", LAYOUT, force=True):
        path.write_bytes(b"theirs")
    assert [file.name for file in tmp_path.iterdir()] == ["a.rrd"]
    assert RrdReader(path).recordings()


@pytest.mark.parametrize("name", ["a.log", "a"])
def test_other_endings_are_refused(tmp_path, name):
    with pytest.raises(sinks.SinkError, match=r"^[^\n]*\.rrd[^\n]*$"):
        write(tmp_path / name)


def test_places_that_cannot_be_written_are_named(tmp_path):
    with pytest.raises(sinks.SinkError, match=r"^[^\n]*nowhere[^\n]*$"):
        write(tmp_path / "nowhere" / "a.rrd")
    (tmp_path / "a.rrd").mkdir()
    with pytest.raises(sinks.SinkError, match="folder"):
        write(tmp_path / "a.rrd", force=True)


def test_a_disk_that_ran_full_is_an_error_and_not_a_recording(tmp_path, monkeypatch):
    monkeypatch.setattr(sinks, "LEAST_FREE_BYTES", 1 << 62)
    with pytest.raises(sinks.SinkError, match=r"/a\.rrd: cannot be written: No space"):  # not its part
        write(tmp_path / "a.rrd")
    assert not (tmp_path / "a.rrd").exists()


@pytest.mark.parametrize("display", ["", ":0"])
def test_a_display_is_what_the_environment_says(monkeypatch, display):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", display)
    assert viewer.has_display() == bool(display)


def test_a_viewer_that_fails_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr("maurice_viz.viewer.open_viewers.viewer_binary", lambda: tmp_path / "no such viewer")
    with pytest.raises(sinks.SinkError, match="No such file"):
        viewer.Window().port()
    monkeypatch.setattr("maurice_viz.viewer.open_viewers.viewer_binary", lambda: Path("/bin/false"))
    with pytest.raises(sinks.SinkError, match="opened no window"):
        viewer.Window().port()


@pytest.mark.skipif(software_driver() is None, reason="no software Vulkan driver to start a viewer with")
def test_a_started_viewer_gets_what_is_logged_and_outlives_the_recording(monkeypatch, tmp_path):
    """The real viewer, without its window: everything else is as where there is a display."""
    started, start = [], viewer.start_viewer

    def headless(port: int, options: list[str]) -> subprocess.Popen[bytes]:
        started.append((port, start(port, [*options, "--headless"])))
        return started[0][1]

    monkeypatch.setattr(viewer, "start_viewer", headless)
    try:
        with sinks.to_viewer(viewer.Window().port(), "a session", LAYOUT) as rec:
            rec.set_time("step", sequence=3)
            rec.log("/a", rr.TextDocument("hello"))
        client = ViewerClient.connect(viewer.address(started[0][0]))
        names = [timeline.name for timeline in client.get_state().recordings[0].timelines]
        assert "step" in names
        assert started[0][1].poll() is None, "the viewer stays open"
    finally:
        for _, process in started:
            process.kill()
            process.wait()


def test_the_disk_is_tried_with_more_than_opening_a_recording_writes(tmp_path):
    """Where a blueprint does not fit on the disk, Rerun never returns from opening the file."""
    channels = ("color", "edges", "smoothed", "blurred", "cumulative", "chromaticity")
    runs = [RunView(f"run-{number}", channels) for number in range(4)]
    recording, path = rr.RecordingStream("test"), tmp_path / "a.rrd"
    recording.save(path, default_blueprint=runs_blueprint(runs, scene_of(fakes.arena(5, 4), "in", True)))
    recording.flush()
    recording.disconnect()
    assert path.stat().st_size < sinks.PROBE_BYTES


def test_a_recording_that_cannot_be_flushed_is_said_in_one_line(tmp_path, monkeypatch):
    """What a full disk does to the file's writer."""

    def flush(self: rr.RecordingStream, **options: object) -> None:
        raise RuntimeError("File-writer thread shut down prematurely")

    monkeypatch.setattr(rr.RecordingStream, "flush", flush)
    with pytest.raises(sinks.SinkError, match="cannot be written to the end"):
        write(tmp_path / "a.rrd")
    assert not (tmp_path / "a.rrd").exists()


def test_a_disk_that_fails_meanwhile_is_told_at_the_end(tmp_path, monkeypatch):
    def fail(self: rr.RecordingStream, **how: float) -> None:
        raise RuntimeError("the disk is gone")

    monkeypatch.setattr(blocks, "UPDATES_A_BLOCK", 1)
    monkeypatch.setattr(rr.RecordingStream, "flush", fail)
    with pytest.raises(sinks.SinkError, match="cannot be written to the end"):
        write(tmp_path / "a.rrd")


def test_a_writer_that_never_answers_is_not_waited_for(tmp_path, monkeypatch):
    """What Rerun's writer does at times, after the disk ran full."""
    forever = threading.Event()
    unregistered: list[bool] = []

    def fail(self: rr.RecordingStream, **how: float) -> None:
        raise RuntimeError("Flush timed out")

    monkeypatch.setattr(sinks, "GIVE_UP_S", 0.1)
    monkeypatch.setattr(rr, "unregister_shutdown", lambda: unregistered.append(True))
    monkeypatch.setattr(rr.RecordingStream, "flush", fail)
    monkeypatch.setattr(rr.RecordingStream, "disconnect", lambda self: forever.wait())
    with pytest.raises(sinks.SinkError, match="cannot be written to the end"):
        write(tmp_path / "a.rrd")
    forever.set()
    assert unregistered == [True]
    assert sinks._GIVEN_UP, "a recording that nobody refers to would be flushed, under Rerun's lock, forever"
    assert not (tmp_path / "a.rrd").exists()


@pytest.mark.skipif(os.name == "nt", reason="limits are of Unix")
def test_a_disk_that_is_full_from_the_start_is_told_at_once(tmp_path):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(sinks.SinkError, match="cannot be written"):
            write(tmp_path / "a.rrd")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []
