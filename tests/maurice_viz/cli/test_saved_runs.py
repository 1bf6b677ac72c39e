"""`--save-run`, replay of what it wrote, and `verify`, as a person uses them."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from rerun.chunk import RrdReader

from helpers import expect_facts
from helpers.commands import COMMAND, maurice, one_line, runs_of
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.runs.manifest import read_manifest, write_manifest
from maurice_loaders.runs.store import open_run
from maurice_loaders.runs.writer import RunWriter


@pytest.fixture
def saved(small_session: Path) -> str:
    """Save a run to `kept`, and give the JSON of its figures."""
    return maurice(small_session, "--particles", "300", "--save-run", "kept", "-o", "none", "--json")[0]


def content(recording: Path) -> dict[tuple[str, str], list[str]]:
    """Give all that a recording shows: entity and column to values."""
    found: dict[tuple[str, str], list[str]] = {}
    for chunk in RrdReader(recording).stream():
        for column, values in chunk.to_record_batch().to_pydict().items():
            if "RowId" not in column and "start_time" not in column:
                found.setdefault((str(chunk.entity_path), column), []).extend(map(repr, values))
    return {key: sorted(values) for key, values in found.items()}


def test_a_saved_run_replays_to_the_same_figures_and_filters_nothing(saved, monkeypatch):
    assert maurice("kept", "-o", "none", "--json") == (saved, "")
    assert json.loads(saved)["runs"][0]["updates"] == 14
    out, err = maurice("verify", "kept")
    assert (out, err) == ("blended: the same, all 14 steps to the last bit\n", "")
    (run,) = json.loads(maurice("verify", "kept", "--json")[0])["runs"]
    assert run == {
        "label": "blended", "same": True, "steps": 14, "difference": None, "changed_versions": [],
    }  # fmt: skip
    from maurice_mcl.filter.localizer import Localizer

    def refuse(*args: Any) -> None:
        raise AssertionError("a saved run is not to be filtered again")

    monkeypatch.setattr(Localizer, "step", refuse)
    assert maurice("kept", "-o", "none", "--json")[0] == saved


def test_a_saved_run_draws_the_same_recording(small_session, tmp_path):
    maurice(small_session, "--particles", "60", "--save-run", "kept", "-o", "drawn.rrd")
    then = content(tmp_path / "drawn.rrd")
    maurice("kept", "-o", "drawn.rrd", "--force")  # the words of a recording name its file
    now = content(tmp_path / "drawn.rrd")
    assert len(then) > 50
    assert now == then


def test_without_library_and_session_the_figures_stay_and_a_line_says_what_is_empty(saved, tmp_path):
    (tmp_path / "survey.log").rename(tmp_path / "away.log")
    figures = runs_of(saved)
    assert figures[0].pop("odometry_alone")  # needs the motion model, which the session's header names
    out, err = maurice("kept", "-o", "a.rrd", "--json")
    (now,) = runs_of(out)
    assert [now] == [{**figures[0], "odometry_alone": None}]
    assert "survey.log" in err.splitlines()[0]
    assert "panels of comparisons stay empty" in err.splitlines()[0]
    (tmp_path / "session.log").unlink()
    out, err = maurice("kept", "-o", "b.rrd", "--json")
    assert runs_of(out) == [now]
    assert "panels of pictures and comparisons stay empty" in err.splitlines()[0]
    paths = {path for path, _ in content(tmp_path / "b.rrd")}
    assert {"/blended/belief/particles", "/world/walls", "/session/truth"} <= paths
    assert "session.log" in one_line(maurice("verify", "kept", expect=1)[1])


def test_a_run_of_an_older_version_whose_odometry_was_made_from_pictures_shows_its_numbers(saved, tmp_path):
    file = tmp_path / "kept" / "manifest.json"
    older = json.loads(file.read_text())
    older["reading"] |= {"odometry_from_pictures": False, "picture_step_m": 0.0, "camera_height_m": 0.0}
    file.write_text(json.dumps(older))
    assert maurice("kept", "-o", "none", "--json") == (saved, "")
    older["reading"]["odometry_from_pictures"] = True
    older["name"] += " (odometry from pictures)"
    file.write_text(json.dumps(older))
    out, err = maurice("kept", "-o", "none", "--json")
    assert runs_of(out)[0]["updates"] == 14
    expect_facts(one_line(err), "made from pictures", "panels of pictures and comparisons stay empty")
    assert "made from pictures" in one_line(maurice("verify", "kept", expect=1)[1])


def test_a_run_with_a_sensor_of_ones_own_opens_without_it(saved, tmp_path):
    """Its weight is kept with the run; its code is not."""
    folder = tmp_path / "kept"
    file = folder / "configuration.toml"
    text = file.read_text()
    assert "edges = " in text
    file.write_text(text.replace("edges = ", "beacon = 0.5, edges = ", 1))
    manifest = read_manifest(folder)
    write_manifest(folder, replace(manifest, configuration_sha256=hash_file(file)))
    assert open_run(folder).configuration.values()["sensor.weights"]["beacon"] == 0.5
    out, err = maurice("kept", "-o", "none", "--json")
    (found,), (expected,) = runs_of(out), runs_of(saved)
    assert found["error_mean_m"] == expected["error_mean_m"]
    assert "no channel called 'beacon'" in one_line(err)
    assert "panels of comparisons stay empty" in err
    assert "no channel called 'beacon'" in maurice("verify", "kept", expect=1)[1]


def test_a_changed_picture_empties_the_panels_from_there_on(saved, tmp_path):
    pictures = sorted((tmp_path / "pictures").glob("session*"))
    shutil.copyfile(pictures[0], pictures[6])
    out, err = maurice("kept", "-o", "none", "--json")
    assert out == saved
    assert "the picture of step 7 is not the one that the run saw" in one_line(err)
    pictures[9].unlink()
    assert "step 7" in one_line(maurice("kept", "-o", "none", "--json")[1])
    out, _ = maurice("verify", "kept", expect=1)
    assert "step 7, picture" in out


@pytest.mark.parametrize(
    "options",
    [
        ["--preset", "thesis"],
        ["--preset", "robust", "--start", "global"],
        ["--start", "1.6,0.6,17", "--seed", "9", "--set", "resampling.scheme=multinomial"],
    ],
    ids=["thesis", "robust", "options"],
)
def test_verify_puts_any_filter_together_again(small_session, options, monkeypatch):
    maurice(small_session, "--particles", "100", *options, "--save-run", "kept", "-o", "none")
    monkeypatch.setenv("MAURICE_FILTER_SENSOR__SHARPNESS", "3")  # does not reach into a saved run
    assert "the same" in maurice("verify", "kept")[0]


def test_verify_names_changes(saved, tmp_path):
    file = tmp_path / "kept" / "particles" / "00000001.parquet"
    chosen = (pl.col("step") == 5) & (pl.col("index") == 17)
    x = pl.when(chosen).then(pl.col("x_m") + 1e-6).otherwise(pl.col("x_m")).cast(pl.Float32).alias("x_m")
    pl.read_parquet(file).with_columns(x).write_parquet(file)
    out, _ = maurice("verify", "kept", expect=1)
    expect_facts(out, "blended", "first at step 5", "particles.x_m of particle 17")
    assert "with the same versions" in out
    manifest = read_manifest(tmp_path / "kept")
    write_manifest(tmp_path / "kept", replace(manifest, seed=1, versions={**manifest.versions, "numpy": "1"}))
    out, _ = maurice("verify", "kept", expect=1)
    assert "differs first at step 1" in out
    assert "numpy was 1, is " in out


@pytest.mark.parametrize("what", ["session.log", "survey.log"])
def test_verify_says_when_an_input_was_changed(saved, tmp_path, what):
    with (tmp_path / what).open("a") as log:
        log.write("\n")
    assert "was changed after the run was made" in one_line(maurice("verify", "kept", expect=1)[1])


def test_verify_sees_other_survey_pictures(saved, tmp_path):
    pictures = sorted((tmp_path / "pictures").glob("survey*"))
    shutil.copyfile(pictures[3], pictures[100])
    assert "other measurements" in one_line(maurice("verify", "kept", expect=1)[1])


def test_compare_saves_one_folder_a_run(small_session, tmp_path):
    then, _ = maurice("compare", small_session, "--save-run", "both", "-o", "none", "--json")
    now, err = maurice("both", "-o", "none", "--json")
    assert (now, err) == (then, "")
    assert [run["label"] for run in json.loads(now)["runs"]] == ["color", "blended"]
    assert maurice("verify", "both")[0].count("the same") == 2
    assert "the same" in maurice("verify", "both/color")[0]
    assert "--force" in one_line(
        maurice("compare", small_session, "--save-run", "both", "-o", "none", expect=1)[1]
    )
    maurice(small_session, "--save-run", "both", "--force", "-o", "none", "--particles", "20")
    assert not (tmp_path / "both" / "color").exists()


def test_a_folder_that_is_taken_is_refused_before_anything_is_done(saved, small_session, tmp_path):
    _, err = maurice(small_session, "--save-run", "kept", "-o", "x.rrd", expect=1)
    assert "--force" in one_line(err)
    assert not list(tmp_path.glob("x.*"))
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("all of it")
    maurice(small_session, "--save-run", "mine", "--force", "-o", "none", expect=1)
    assert (mine / "thesis.txt").read_text() == "all of it"


def test_what_is_no_saved_run_is_refused(saved, small_session, tmp_path):
    for options in (["--particles", "3"], ["--feature", "color"], ["--save-run", "x"], ["--seed", "1"]):
        maurice("kept", *options, expect=2)
    (tmp_path / "empty").mkdir()
    assert "found an empty folder" in one_line(maurice("verify", "empty", expect=1)[1])
    assert "folder" in one_line(maurice("empty", expect=1)[1])
    maurice("library", "build", "survey.log", "-o", "lib")
    assert "found a library, expected a saved run" in one_line(maurice("lib", expect=1)[1])


def test_a_full_disk_prints_the_figures_so_far_and_one_line(small_session, tmp_path, monkeypatch):
    add = RunWriter.add

    def full(self: RunWriter, moment: Any, record: Any) -> None:
        if moment.frame.step == 9:
            raise OSError(28, "No space left on device")
        add(self, moment, record)

    monkeypatch.setattr(RunWriter, "add", full)
    out, err = maurice(small_session, "--save-run", "kept", "-o", "none", "--json", expect=1)
    assert json.loads(out)["runs"][0]["updates"] == 9
    assert "kept: cannot be written to the end (No space left on device)" in one_line(err)
    manifest = read_manifest(tmp_path / "kept")
    assert (manifest.state, manifest.steps) == ("failed", 8)


def start_slow(small_session: Path, tmp_path: Path) -> subprocess.Popen[bytes]:
    """Start a replay whose every step fills a part, and wait until some are there."""
    args = [*COMMAND, str(small_session), "--particles", "250000", "--save-run", "kept", "-o", "none"]
    going = subprocess.Popen(args, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    for _ in range(6000):
        if len(list((tmp_path / "kept" / "steps").glob("0*.parquet"))) >= 2:
            return going
        assert going.poll() is None, going.communicate()
        time.sleep(0.02)
    raise AssertionError("no part was written")


def test_a_killed_run_keeps_what_was_written(small_session, tmp_path):
    with start_slow(small_session, tmp_path) as going:
        os.kill(going.pid, signal.SIGKILL)
    assert read_manifest(tmp_path / "kept").state == "writing"
    out, err = maurice("kept", "-o", "none", "--json")
    steps = json.loads(out)["runs"][0]["updates"]
    assert 2 <= steps < 14
    expect_facts(one_line(err), "cut off", f"{steps} of 14 steps")
    expect_facts(maurice("verify", "kept")[0], f"the same, all {steps} steps", "of 14")


def test_a_run_without_a_step_is_shown_and_not_verified(small_session, monkeypatch):
    def stop(self: RunWriter, moment: Any, record: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(RunWriter, "add", stop)
    maurice(small_session, "--save-run", "kept", "-o", "none", expect=130)
    out, err = maurice("kept", "-o", "none", "--json")
    assert json.loads(out)["runs"][0]["updates"] == 0
    assert "holds 0 of 14 steps" in one_line(err)
    assert "nothing to verify" in one_line(maurice("verify", "kept", expect=1)[1])
