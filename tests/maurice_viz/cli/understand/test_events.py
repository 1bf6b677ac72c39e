"""`events` and `jump` as a person types them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rerun.experimental import ViewerClient

from helpers.commands import maurice, one_line
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders.runs.store import bookmarks_file
from maurice_mcl.analysis.events import RunEvent
from maurice_viz.app.events import is_named, names_in
from maurice_viz.viewer import open_viewers, sinks
from maurice_viz.viewer import open_viewers as viewer
from maurice_viz.viewer.snapshot import software_driver


@pytest.fixture(autouse=True)
def _no_viewers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(open_viewers.STATE, str(tmp_path / "state"))


def told(log: Path) -> None:
    """Let the log tell of things that happened before the fifth and the tenth picture."""
    lines = log.read_text().splitlines(keepends=True)
    pictures = [number for number, line in enumerate(lines) if '"image"' in line]
    for picture, text in ((9, "lights off"), (4, "kidnapped")):
        at = json.loads(lines[pictures[picture]])["t"]
        lines.insert(pictures[picture], json.dumps({"t": at, "event": text}) + "\n")
    log.write_text("".join(lines))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a session, a saved run `kept` and a saved comparison `both`."""
    folder = tmp_path_factory.mktemp("made")
    write_small_survey(folder)
    log = write_small_session(folder)
    told(log)
    two = ["--feature", "color", "--feature", "edges"]
    for args in (
        [log, "--particles", 200, "--run", folder / "kept"],
        ["compare", log, *two, "--particles", 100, "--run", folder / "both"],
    ):
        maurice(*args, "--no-recording")
    return folder


@pytest.fixture
def runs(made: Path, tmp_path: Path) -> Path:
    """Copy what was made into the test's folder."""
    for name in ("kept", "both"):
        shutil.copytree(made / name, tmp_path / name)
    return tmp_path


def listed(*args: str | Path | int) -> list[dict[str, object]]:
    (run,) = json.loads(maurice("events", *args, "--json")[0])["runs"]
    found: list[dict[str, object]] = run["events"]
    return found


def test_events_are_a_table_and_json(runs):
    out, err = maurice("events", "kept")
    assert err == ""
    assert "kleine Fahrt" in out
    assert "time (s)" in out
    assert "the robot was carried away" in out
    assert "resampled" not in out
    found = listed("kept")
    assert {"step": 5, "kind": "kidnapped", "text": "the robot was carried away"}.items() <= found[
        [one["kind"] for one in found].index("kidnapped")
    ].items()
    assert [set(one) for one in found] == [{"step", "time_s", "kind", "text"}] * len(found)
    assert [one["step"] for one in found] == sorted(int(str(one["step"])) for one in found)
    out, err = maurice("events", "kept", "--kind", "expanded")
    assert out == ""
    assert one_line(err) == "kept: no event of that kind"
    assert listed("kept", "--kind", "expanded") == []


def test_kinds_choose_in_runs_and_comparisons(runs):
    chosen = listed("kept", "--kind", "kidnapped", "--kind", "lights-changed")
    assert [(one["step"], one["kind"]) for one in chosen] == [(5, "kidnapped"), (10, "lights-changed")]
    resampled = listed("kept", "--kind", "resampled")
    assert resampled
    everything = listed("kept", "--all")
    assert [one for one in everything if one["kind"] == "resampled"] == resampled
    assert (
        "there are failure, kidnapped, lights-changed"
        in maurice("events", "kept", "--kind", "b", expect=2)[1]
    )
    out, _ = maurice("events", "both")
    (line,) = [line for line in out.splitlines() if "kidnapped" in line]
    assert "all" in line, "what happened to both stands once"
    labels = [run["label"] for run in json.loads(maurice("events", "both", "--json")[0])["runs"]]
    assert labels == ["color", "edges"]
    assert "run" not in maurice("events", "both/color")[0].splitlines()[1].split()


def test_bookmarks_are_added_listed_and_removed(runs):
    assert "bookmark at step 12: odd turn" in one_line(
        maurice("events", "kept", "--add", 12, " odd  turn ")[1]
    )
    maurice("events", "kept", "--add", 3, "späte Bilder")
    found = listed("kept", "--kind", "bookmark")
    assert [(one["step"], one["text"]) for one in found] == [(3, "späte Bilder"), (12, "odd turn")]
    assert float(str(found[0]["time_s"])) > 0
    assert "1 bookmark removed" in maurice("events", "kept", "--remove", 12)[1]
    assert "1 bookmark removed" in maurice("events", "kept", "--remove", "späte Bilder")[1]
    assert listed("kept", "--kind", "bookmark") == []
    assert "there are at steps: none" in one_line(maurice("events", "kept", "--remove", 3, expect=1)[1])
    maurice("events", "both", "--add", 4, "shared")
    maurice("events", "both/edges", "--add", 4, "own")
    parts = json.loads(maurice("events", "both", "--kind", "bookmark", "--json")[0])["runs"]
    assert [[one["text"] for one in part["events"]] for part in parts] == [["shared"], ["shared", "own"]]
    assert [one["text"] for one in listed("both/edges", "--kind", "bookmark")] == ["own"]


def test_broken_bookmarks_are_said_and_kept(runs):
    maurice("events", "kept", "--add", 2, "good")
    file = bookmarks_file(runs / "kept")
    file.write_bytes(file.read_bytes() + b"{broken\n")
    out, err = maurice("events", "kept", "--kind", "bookmark")
    assert "bookmarks.jsonl:2" in one_line(err)
    assert "good" in out
    maurice("events", "kept", "--remove", 2)
    assert file.read_bytes() == b"{broken\n"


@pytest.mark.parametrize(
    ("args", "status", "said"),
    [
        (["nowhere"], 1, "expected a saved run's folder"),
        (["kept", "--add", 15, "late"], 1, "expected one from 1 to 14"),
        (["kept", "--add", 0, "early"], 1, "expected one from 1 to 14"),
        (["kept", "--add", "x", "early"], 2, "--add"),
        (["kept", "--add", 3, "  "], 2, "has a text"),
        (["kept", "--add", 3, "a", "--remove", "3"], 2, "not both"),
        (["nowhere", "--add", 3, "a"], 1, "expected a saved run's folder"),
    ],
)
def test_what_is_wrong_is_said(args, status, said, runs):
    assert said in " ".join(maurice("events", *args, expect=status)[1].split())
    assert not bookmarks_file(runs / "kept").exists()


def test_replay_and_verify_do_not_mind_bookmarks(runs, made):
    for name in ("kept", "both"):
        maurice("events", name, "--add", 4, "note")
    whole = {
        name: json.loads(maurice(name, "--no-recording", "--json")[0])["runs"] for name in ("kept", "both")
    }
    assert [run["updates"] for some in whole.values() for run in some] == [14, 14, 14]
    shutil.copytree(runs / "kept", made / "noted")
    assert "the same, all 14 steps" in maurice("verify", made / "noted")[0]


def test_without_truth_nothing_is_judged(runs, made):
    log = made / "no truth.log"
    lines = (made / "session.log").read_text().splitlines(keepends=True)
    log.write_text("".join(line for line in lines if '"truth"' not in line))
    maurice(log, "--particles", 50, "--run", "blind", "--no-recording")
    assert {"lost", "localized", "recovered", "beyond-three-sigma"}.isdisjoint(
        str(one["kind"]) for one in listed("blind", "--all")
    )


@pytest.mark.parametrize(
    ("args", "status", "said"),
    [
        (["kept", "--to", "kidnapped"], 1, "no viewer is open; open one with: maurice-replay kept"),
        (["kept", "--to", "kidnapped", "--nth", 2], 1, "1 times, so there is no --nth 2"),
        (["kept", "--to", "all-weights-zero"], 1, "what happened in it: kidnapped, lights-changed"),
        (["kept", "--step", 15], 1, "expected one from 1 to 14"),
        (["both", "--to", "kidnapped", "--run-label", "blue"], 1, "expected one of color, edges"),
        (["kept", "--step", 3, "--port", 9], 1, "no viewer on port 9"),
        (["kept"], 2, "--to KIND, or --step N"),
        (["kept", "--to", "lost", "--step", 3], 2, "--to KIND, or --step N"),
        (["kept", "--step", 3, "--phase", "dream"], 2, "there are predict, measure, weight"),
        (["nowhere", "--step", 3], 1, "expected a saved run's folder"),
    ],
)
def test_what_is_wrong_with_a_jump_is_said(args, status, said, runs):
    assert said in " ".join(maurice("jump", *args, expect=status)[1].split())


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Let viewers be the real ones, without their windows; end them afterwards."""
    started: list[subprocess.Popen[bytes]] = []
    place = {
        "HOME": str(tmp_path),
        "XDG_RUNTIME_DIR": str(tmp_path),
        "VK_ICD_FILENAMES": str(software_driver()),
    }

    def headless(port: int, options: list[str]) -> subprocess.Popen[bytes]:
        started.append(viewer.start_viewer(port, [*options, "--headless"], place))
        return started[-1]

    monkeypatch.setattr(sinks, "start_viewer", headless)
    yield started
    for process in started:
        process.kill()
        process.wait()


def cursor(port: int) -> tuple[str | None, int | None]:
    """Ask the viewer itself where its cursor stands."""
    shown = ViewerClient.connect(viewer.address(port)).get_state().recordings[0]
    return shown.current_timeline, shown.current_time


def settled(port: int, place: tuple[str, int]) -> bool:
    deadline = time.monotonic() + 60
    while cursor(port) != place and time.monotonic() < deadline:
        time.sleep(0.1)
    return cursor(port) == place


@pytest.mark.skipif(software_driver() is None, reason="no software Vulkan driver to start a viewer with")
def test_jump_moves_the_viewer_that_replay_opened(runs, screen, monkeypatch):
    monkeypatch.setattr(sinks, "has_display", lambda: True)
    maurice("kept")
    (open_one,) = open_viewers.open_viewers()
    assert (open_one.pid, open_one.name) == (screen[0].pid, "kleine Fahrt")
    maurice("events", "kept", "--add", 12, "odd turn")
    for args, place in (
        (("--to", "kidnapped"), ("step", 5)),
        (("--to", "lights-changed", "--phase", "weight"), ("phase", 62)),
        (("--to", "odd turn"), ("step", 12)),
        (("--step", 7), ("step", 7)),
        (("--step", 3, "--phase", "predict", "--port", open_one.port), ("phase", 18)),
    ):
        out, err = maurice("jump", "kept", *args)
        assert (out.count("\n"), err) == (1, "")
        assert settled(open_one.port, place), args
    screen[0].kill()
    screen[0].wait()
    assert "no viewer is open" in one_line(maurice("jump", "kept", "--step", 7, expect=1)[1])


def test_a_viewer_of_another_session_is_not_moved(runs):
    import socket

    with socket.create_server((viewer.HOST, 0)) as listener:
        port = int(listener.getsockname()[1])
        open_viewers.remember(os.getpid(), port)
        open_viewers.remember_recording(port, "another drive", "an id")
        line = one_line(maurice("jump", "kept", "--step", 7, expect=1)[1])
    assert "the open viewers show 'another drive', not 'kleine Fahrt'" in line


def test_a_run_that_ended_early_does_not_cut_the_others_short(runs, made):
    whole = json.loads(maurice("events", "both", "--all", "--json")[0])["runs"]
    for table in ("particles", "renewed", "steps"):
        (part,) = (runs / "both" / "edges" / table).glob("*.parquet")
        part.unlink()
    manifest = runs / "both" / "edges" / "manifest.json"
    held = json.loads(manifest.read_text()) | {"state": "writing", "steps": None}
    manifest.write_text(json.dumps(held))
    cut = json.loads(maurice("events", "both", "--all", "--json")[0])["runs"]
    assert cut[0] == whole[0]
    assert cut[1] == {"label": "edges", "events": []}


def test_parted_runs_say_so_at_the_second(runs):
    """Moved apart by hand: from step 6 on the second run's estimate is a metre away."""
    import polars as pl

    (file,) = (runs / "both" / "edges" / "steps").glob("*.parquet")
    (other,) = (runs / "both" / "color" / "steps").glob("*.parquet")
    table, first = pl.read_parquet(file), pl.read_parquet(other)
    moved = first["estimate_x_m"] + pl.Series([0.0] * 5 + [1.0] * 9)
    table.with_columns(moved.alias("estimate_x_m"), first["estimate_y_m"]).write_parquet(file)
    parts = json.loads(maurice("events", "both", "--kind", "parted", "--json")[0])["runs"]
    (event,) = parts[1]["events"]
    assert parts[0]["events"] == []
    assert event["step"] == 7
    assert event["text"] == "edges and color are 1.00 m apart, since step 6"


def test_what_the_log_says_is_found_by_its_first_word():
    bump, lost = (
        RunEvent(41, 332.5, "session", "bump into a wall"),
        RunEvent(50, 400.0, "lost", "since step 47"),
    )
    assert is_named(bump, "bump")
    assert not is_named(bump, "wall")
    assert is_named(bump, "session")
    assert is_named(lost, "lost")
    assert names_in([bump, lost]) == ["session", "lost", "bump"]
