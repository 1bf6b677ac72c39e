"""A drive that no library goes with is shown by itself: every log opens."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from helpers.commands import run
from maurice_loaders.errors import ReadingNotes
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.reading.recording import PLACEHOLDER
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import Placeholders
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.map import Arena
from maurice_mcl.values.session import NO_PICTURE, Frame, Moment, SessionInfo
from maurice_viz.errors import SILENT
from maurice_viz.panels import drive as drive_ways
from maurice_viz.panels.drive import DriveView, drive_paths, reach
from maurice_viz.running import drive as drive_alone

Poses = st.tuples(*[st.floats(-5, 5)] * 2, st.floats(-3, 3)).map(np.array)


def drawn(path: Path) -> dict[str, set[int]]:
    """The steps at which each entity was drawn."""
    found: dict[str, set[int]] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        steps = set(batch.column("step").to_pylist()) if "step" in batch.schema.names else {0}
        found.setdefault(str(chunk.entity_path), set()).update(steps)
    return found


@pytest.fixture
def bare(small_session: Path) -> Path:
    """The small session, whose header names no survey."""
    header, *rest = small_session.read_text().splitlines()
    kept = {key: value for key, value in json.loads(header).items() if key != "survey"}
    path = small_session.with_name("bare.log")
    path.write_text("\n".join([json.dumps(kept), *rest]) + "\n")
    return path


def carmen(folder: Path) -> Path:
    """Two metres forward, then a turn, by odometry alone."""
    ways = [(k / 10, 0.0, 0.0) for k in range(21)] + [(2.0, 0.0, k / 10) for k in range(1, 16)]
    rows = [f"ODOM {x} {y} {turn} 0 0 0 {k}.0 robot {k}.0" for k, (x, y, turn) in enumerate(ways)]
    path = folder / "drive.log"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_a_session_without_a_survey_is_drawn_and_what_is_missing_is_said(bare, tmp_path):
    done = run(bare, "-o", tmp_path / "a.rrd")
    assert f"maurice-replay library build {bare}" in done.output
    found = drawn(tmp_path / "a.rrd")
    pictures = RecordedSession(open_recording(bare)).overview()[0]
    for path in ("camera", "edges", "histogram/color/2", "odometry", "truth", "trace/forward/odometry"):
        assert found[f"/session/{path}"] >= set(range(1, pictures + 1)), path
    assert "/session/trace/apart" in found
    assert not any("belief" in path for path in found)


@pytest.mark.parametrize("asked", [["--feature", "color"], ["-o", "none"], ["--json"], ["--seed", "3"]])
def test_who_asks_for_a_filter_or_figures_is_told_that_a_library_is_missing(bare, tmp_path, asked):
    assert "--library" in run(bare, *asked, expect=1).output
    assert not list(tmp_path.glob("*.rrd"))


def test_odometry_alone_has_moments_where_the_robot_moved(tmp_path):
    path = carmen(tmp_path)
    moments = list(RecordedSession(Placeholders(open_recording(path))).moments())
    assert {moment.frame.picture for moment in moments} == {PLACEHOLDER}
    gone = [float(moment.frame.motions[:, 0].sum()) for moment in moments[1:]]
    turned = [float(moment.frame.motions[:, 2].sum()) for moment in moments[1:]]
    assert all(0.25 <= way < 0.35 or turn >= 0.26 for way, turn in zip(gone, turned, strict=True))
    done = run(path, "-o", tmp_path / "a.rrd")
    assert "no pictures" in done.output
    found = drawn(tmp_path / "a.rrd")
    assert len(found["/session/odometry"] - {0}) == len(moments)
    assert "/session/histogram/color/0" not in found


def test_little_movement_is_one_moment_and_nothing_is_refused(tmp_path):
    rows = [f"ODOM 0 0 {k % 2}e-6 0 0 0 {k}.0 robot {k}.0" for k in range(20_000)]  # as gyros tremble
    path = tmp_path / "still.log"
    path.write_text("\n".join(rows) + "\n")
    assert RecordedSession(Placeholders(open_recording(path))).overview()[0] == 1
    path = tmp_path / "a.log"
    path.write_text('{"format": "maurice-session-log", "version": 1, "kind": "session", "name": "a"}\n')
    done = run(path, "-o", tmp_path / "a.rrd", expect=1)
    assert "nothing to show" in done.output


def test_pictures_alone_are_drawn(tmp_path):
    folder = tmp_path / "pictures"
    folder.mkdir()
    rows = ["t,file"]
    for k in range(3):
        cv2.imwrite(str(folder / f"{k}.png"), np.full((20, 30, 3), 40 * k, np.uint8))
        rows.append(f"{k}.0,{k}.png")
    (folder / "list.csv").write_text("\n".join(rows) + "\n")
    columns = ["--reading", "columns=time=t:s,image=file"]
    run(folder, "--reading", f"table={folder / 'list.csv'}", *columns, "-o", tmp_path / "a.rrd")
    found = drawn(tmp_path / "a.rrd")
    assert found["/session/camera"] >= {1, 2, 3}
    assert "/world/floors" not in found


def test_of_a_long_drive_some_moments_are_drawn_and_no_movement_is_lost(bare, tmp_path, monkeypatch):
    monkeypatch.setattr(drive_alone, "MOST_DRAWN", 5)
    done = run(bare, "-o", tmp_path / "a.rrd")
    assert "drawing one of every" in done.output
    session = RecordedSession(open_recording(bare))
    fewer = list(drive_alone._thinned(session, session.overview()[0], SILENT).moments())
    every = list(session.moments())
    assert 1 < len(fewer) <= 5
    together = np.concatenate([moment.frame.motions for moment in fewer])
    np.testing.assert_array_equal(
        together, np.concatenate([one.frame.motions for one in every])[: len(together)]
    )
    assert fewer[1].frame.picture != every[1].frame.picture


def _moved(motions, truth=None):
    return Moment(Frame(1, 0.0, motions, NO_PICTURE, ""), truth)


@given(start=Poses, steps=st.lists(Poses, min_size=1, max_size=8), known=st.integers(0, 8))
def test_perfect_odometry_lies_on_the_truth(start, steps, known):
    """Wherever the truth begins to be known."""
    poses = [start]
    for step in steps:
        poses.append(compose(poses[-1], step))
    known = min(known, len(steps))
    glances = [
        _moved(np.array(motions).reshape(-1, 3), pose if k >= known else None)
        for k, (motions, pose) in enumerate(zip([[], *([step] for step in steps)], poses, strict=True))
    ]
    ways = drive_paths(glances, SessionInfo("a"))
    np.testing.assert_allclose(ways.measured, [pose[:2] for pose in poses], atol=1e-9)
    np.testing.assert_allclose(ways.true, [pose[:2] for pose in poses[known:]], atol=1e-9)


def test_ways_are_few_points_in_a_roomy_map(monkeypatch):
    monkeypatch.setattr(drive_ways, "MOST_POINTS", 100)
    glances = (_moved(np.array([[1.0, 0.0, 0.0]])) for _ in range(10_000))
    ways = drive_paths(glances, SessionInfo("a"))
    assert ways.moments == 10_000
    assert 50 <= len(ways.measured) <= 100
    assert np.ptp(np.diff(ways.measured[:-1, 0])) == 0
    assert ways.measured[-1, 0] == 10_000
    glances = [_moved(np.array([[3.0, 0.0, 0.0]])) for _ in range(2)]
    arena = drive_paths(glances, SessionInfo("a")).arena
    assert arena.bounds == (2.0, -1.0, 7.0, 1.0)
    assert drive_paths([_moved(np.zeros((0, 3)))], SessionInfo("a")).arena is None
    # Where odometry leaves the map, too: the disk at the end of the way is not cut
    small = Arena((0.0, 0.0, 2.0, 2.0), np.zeros((0, 4)))
    info = SessionInfo("a", arena=small)
    glances = [_moved(np.array([[0.0, 0.0, 0.0]])), _moved(np.array([[9.0, 0.0, 0.0]]))]
    drive = DriveView(info, drive_paths(glances, info), pictures=False)
    seen = reach(drive)
    assert seen.left < 0 < 9 < seen.right
    assert seen.top < -2 < 0 < seen.bottom


def test_glances_are_moments_without_their_pictures(small_session):
    session = RecordedSession(open_recording(small_session))
    for glance, moment in zip(session.glances(ReadingNotes(False)), session.moments(), strict=True):
        np.testing.assert_array_equal(glance.frame.motions, moment.frame.motions)
        assert (glance.frame.step, glance.frame.time_s) == (moment.frame.step, moment.frame.time_s)
        assert glance.events == moment.events
        assert (glance.truth is None) == (moment.truth is None)
