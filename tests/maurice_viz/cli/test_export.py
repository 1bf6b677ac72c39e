"""`export` and `convert` as a person runs them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from helpers.commands import failure, run
from maurice_datasets.sessions import write_simulation
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_loaders.formats.registry import open_session
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.session import SessionInfo


@pytest.fixture
def saved(small_session: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "kept"
    words = ("replay", small_session, "--particles", "60", "-o", "none", "--save-run", folder)
    run(*words)
    return folder


def test_all_formats_at_once(saved, tmp_path):
    names = ["a.tum", "a.csv", "a.parquet"]
    files = [tmp_path / name for name in names]
    pairs = [word for file in files for word in ("-o", file)]
    done = run("export", saved, *pairs)
    written = [Path(line) for line in done.stdout.splitlines()]
    assert set(written) >= set(files)
    assert {file.name for file in written} >= {"a-truth.tum", "a-odometry.tum"}
    assert all(file.is_file() for file in written)
    assert len((tmp_path / "a.tum").read_text().splitlines()) == 14
    assert "--force" in failure("export", saved, *pairs)
    run("export", saved, *pairs, "--force")


def test_scored_figures_are_those_of_the_table(saved, tmp_path):
    done = run("export", saved, "-o", tmp_path / "a.tum", "--scored", "--json")
    (exported,) = json.loads(done.stdout)["runs"]
    (shown,) = json.loads(run("replay", saved, "-o", "none", "--json").stdout)["runs"]
    assert exported["updates"] == 11
    assert exported["label"] == shown["label"]
    for name in ("mean", "median"):
        assert exported["error_m"][name] == pytest.approx(shown[f"error_{name}_m"])
    run("export", saved, "-o", tmp_path / "t.tum", "--only", "truth")
    assert [file.name for file in tmp_path.glob("t*.tum")] == ["t.tum"]


def later(log: Path, by_s: float) -> Path:
    """Write the drive of a log as one that happened later."""
    header, *lines = log.read_text().splitlines()
    records = [json.loads(line) for line in lines]
    shifted = [json.dumps(record | {"t": record["t"] + by_s}) for record in records]
    (file := log.with_name("later.log")).write_text("\n".join([header, *shifted]) + "\n")
    return file


def test_times_are_the_sessions_own_as_long_as_it_is_there(small_session, tmp_path):
    run("convert", later(small_session, 1000), tmp_path / "c")
    log, kept = tmp_path / "c" / "session.log", tmp_path / "kept"
    words = ("--library", small_session.parent / "survey.log", "--particles", "60", "-o", "none")
    run("replay", log, *words, "--save-run", kept)

    def first_s() -> float:
        run("export", kept, "-o", tmp_path / "a.tum", "--force")
        return float((tmp_path / "a.tum").read_text().split()[0])

    assert first_s() == 1002.0
    log.unlink()
    assert first_s() == 1.0


def test_mcap_without_the_session_has_no_pictures_and_says_so(saved, small_session):
    reading = pytest.importorskip("rosbags.highlevel")
    for name, topics in (("with.mcap", 1), ("without.mcap", 0)):
        file = saved.parent / name
        done = run("export", saved, "-o", file)
        assert ("pictures are left out" in done.stderr) is (topics == 0)
        with reading.AnyReader([file]) as reader:
            assert sum("image" in connection.topic for connection in reader.connections) == topics
        small_session.unlink(missing_ok=True)


def test_of_a_comparison_one_run_is_named(small_session, tmp_path):
    folder = tmp_path / "both"
    options = ("--particles", "30", "-o", "none", "--save-run", folder)
    run("compare", small_session, "--seed", "1", "--seed", "2", *options)
    asked = ("export", folder, "-o", tmp_path / "a.tum")
    first = re.findall(r"name one of them: (.*?),", failure(*asked))[0]
    assert "saved run" in failure("export", folder / "nobody", *asked[2:])
    run("export", first, *asked[2:])


@pytest.mark.parametrize("words", ["", "-o a.txt", "-o a.tum -o b.tum", "-o a.tum --only x"])
def test_bad_options_are_usage_errors(saved, words):
    done = run("export", saved, *words.split(), expect=2)
    assert "Error: " in done.stderr
    assert not done.stdout


def test_exports_that_cannot_be_are_one_line(small_session, tmp_path):
    for path in (small_session, tmp_path, tmp_path / "nothing"):
        assert "saved run" in failure("export", path, "-o", tmp_path / "a.tum")
    lines = small_session.read_text().splitlines()
    small_session.write_text("\n".join(line for line in lines if '"truth"' not in line) + "\n")
    words = ("--particles", "60", "-o", "none", "--save-run", tmp_path / "kept")
    run("replay", small_session, *words)
    options = ("-o", tmp_path / "t.tum", "--only", "truth")
    assert "has no truth" in failure("export", tmp_path / "kept", *options)


def test_a_run_without_steps_writes_nothing(saved, tmp_path):
    for part in saved.rglob("*.parquet"):
        part.unlink()
    manifest = saved / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"steps": 14', '"steps": 0'))
    assert "nothing to export" in failure("export", saved, "-o", tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()


def test_convert_keeps_going_when_told_so(small_session, tmp_path):
    with small_session.open("a") as log:
        log.write("{broken}\n")
    asked = ("convert", small_session, tmp_path / "b.log")
    assert "broken JSON" in failure(*asked)
    done = run(*asked, "--keep-going")
    assert "skipped 1 broken" in done.stderr
    assert open_session(tmp_path / "b.log").count_pictures() == 14


@pytest.mark.parametrize("words", [("b.txt",), ("b.log", "--pictures", "gif")])
def test_convert_refuses_bad_options(small_session, words):
    done = run("convert", small_session, *words, expect=2)
    assert "Error: " in done.stderr
    assert not Path(words[0]).exists()


def test_convert_refuses_what_holds_nothing(tmp_path):
    (tmp_path / "x.log").write_bytes(b"\0\1\2")
    for path in (tmp_path / "x.log", tmp_path / "nothing.log"):
        failure("convert", path, tmp_path / "b.log")
    assert not (tmp_path / "b.log").exists()
    with SessionWriter(tmp_path / "empty.log", SessionInfo("empty")):
        pass
    assert "nothing to write" in failure("convert", tmp_path / "empty.log", tmp_path / "b.log")
    assert not (tmp_path / "b.log").exists()


def without_pictures(folder: Path) -> Path:
    file = folder / "wheels.log"
    with SessionWriter(file, SessionInfo("wheels")) as log:
        log.odometry(1000.0, [0.1, 0.0, 0.2])
        log.truth(1000.5, [1.0, 2.0, 0.5])
        log.event(1001.0, "bump")
        log.odometry(1002.0, [0.3, -0.1, 0.0])
    return file


def test_a_recording_without_pictures_is_converted_record_by_record(tmp_path):
    source = without_pictures(tmp_path)
    done = run("convert", source, tmp_path / "copy")
    assert "0 pictures, 2 motions, 1 true poses, 1 events" in done.stdout
    copy = (tmp_path / "copy" / "session.log").read_text().splitlines()
    assert copy[1:] == source.read_text().splitlines()[1:]


def test_odometry_without_pictures_becomes_a_path_in_mcap(tmp_path):
    reading = pytest.importorskip("rosbags.highlevel")
    source = without_pictures(tmp_path)
    run("convert", source, tmp_path / "a.mcap")
    with reading.AnyReader([tmp_path / "a.mcap"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    told = {name: counts[name] for name in ("/session/motions", "/truth", "/events")}
    assert told == {"/session/motions": 2, "/truth": 1, "/events": 1}


def test_a_lasers_run_is_exported_with_its_scans_and_its_map(tmp_path):
    reading = pytest.importorskip("rosbags.highlevel")
    plan = SimulationPlan(TASKS["tracking"], updates=5, laser=True)
    session = write_simulation(tmp_path / "s", plan).session
    run("replay", session, "--particles", "100", "-o", "none", "--save-run", tmp_path / "run")
    run("export", tmp_path / "run", "-o", tmp_path / "run.mcap")
    with reading.AnyReader([tmp_path / "run.mcap"]) as reader:
        messages = {c.topic: reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()}
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert counts["/scan"] == counts["/estimate"]
    assert len(messages["/scan"].ranges) == 360
    assert messages["/scan"].header.frame_id == "laser"
    assert set(messages["/map"].data.tolist()) == {-1, 0, 100}
