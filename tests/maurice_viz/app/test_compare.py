"""`maurice-replay compare`, as a person types it: what may differ, what is refused, what is said."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers import expect_facts
from helpers.commands import maurice, one_line, runs_of
from maurice_loaders.formats.registry import open_session
from maurice_loaders.runs.writer import RunWriter
from maurice_viz.app.compare import names_of
from maurice_viz.app.snapshot import draw_saved
from maurice_viz.entities import RESULT, TEXT, cloud_of
from maurice_viz.playback import run_together
from maurice_viz.running.filters import Filter
from maurice_viz.running.open import make_runs, open_library_for

FEW = ("--particles", "150", "-o", "none", "--json")
AGAINST = {"label", "position_error", "heading_error", "apart_mean_m", "apart_most_m", "parted_at_step"}
DIFFERENCE = {"difference_mean_m", "interval_95_m", "block_steps", "steps", "better", "worse"}


def labels_of(out: str) -> list[str]:
    return [run["label"] for run in runs_of(out)]


@pytest.mark.parametrize(
    ("options", "labels"),
    [
        ([], ["color", "blended"]),
        (["--seed", "7"], ["color", "blended"]),
        (["--preset", "robust"], ["color", "blended"]),
        (["--feature", "edges", "--feature", "color"], ["edges", "color"]),
        (["--feature", "edges", "--feature", "edges"], ["edges", "edges-2"]),
        (["--preset", "thesis", "--preset", "robust", "--feature", "color"], ["thesis", "robust"]),
        (
            ["--seed", "0", "--seed", "12", "--seed", "3", "--seed", "4"],
            ["seed 0", "seed 12", "seed 3", "seed 4"],
        ),
        (
            ["--set", "resampling.scheme=systematic", "--set", "resampling.scheme=multinomial"],
            ["systematic", "multinomial"],
        ),
        (["--config", "a.toml", "--config", "b/a.toml", "--seed", "2"], ["a", "b a"]),
        (["--config", "a.toml", "--config", "tür.toml", "--feature", "color"], ["a", "tür"]),
    ],
    ids=str,
)
def test_exactly_one_kind_of_option_differs_and_names_the_runs(small_session, tmp_path, options, labels):
    (tmp_path / "b").mkdir()
    for name, sharpness in (("a", 1), ("b/a", 2), ("tür", 3)):
        (tmp_path / f"{name}.toml").write_text(f"sensor.sharpness = {sharpness}\n")
    first = small_session.read_text().splitlines(keepends=True)[:4]  # the labels need no longer drive
    small_session.write_text("".join(first))
    out, _ = maurice("compare", small_session, *options, *FEW)
    assert labels_of(out) == labels


@pytest.mark.parametrize(("more", "labels"), [([], ["mine"]), (["--amcl", "b.yaml"], ["mine", "b"])])
def test_amcls_parameters_are_compared_with_a_preset(tmp_path, monkeypatch, more, labels):
    monkeypatch.chdir(tmp_path)
    maurice("simulate", "tracking", "--laser", "--world", "office", "--updates", "6", "-o", "office")
    for name, beams in (("mine", 30), ("b", 40)):
        Path(f"{name}.yaml").write_text(
            f"amcl:\n  ros__parameters:\n    max_beams: {beams}\n    alpha1: 0.1\n    z_hit: 0.5\n"
        )
    out, _ = maurice("compare", "office", "--amcl", "mine.yaml", "--preset", "laser", *more, *FEW)
    assert labels_of(out) == [*labels, "laser"]


def test_which_run_uses_other_scans_than_alone_is_said(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    maurice("simulate", "tracking", "--laser", "--world", "office", "--updates", "6", "-o", "office")
    values = {"max_beams": 30, "alpha1": 0.1, "z_hit": 0.5, "update_min_d": 0.6, "update_min_a": 0.5}
    Path("mine.yaml").write_text(json.dumps({"amcl": {"ros__parameters": values}}))
    _, err = maurice("compare", "office", "--amcl", "mine.yaml", "--preset", "laser", *FEW)
    expect_facts(" ".join(err.split()), "all runs use a scan after 0.6 m or 0.5 rad", "alone laser would")
    _, err = maurice("office", "--amcl", "mine.yaml", *FEW)
    assert "all runs" not in err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--feature", "color", "--feature", "edges", "--seed", "1", "--seed", "2"], "--feature and --seed"),
        (["--feature", "color"], "found 1"),
        (["--feature", "color", *(["--seed", "1"] * 5)], "found 5"),
        (
            ["--set", "resampling.scheme=systematic", "--set", "resampling.scheme=fair"],
            "found 'fair', expected one of",
        ),
        (["session.log", "--seed", "1", "--seed", "2"], "give --seed once"),
        (["session.log", "--save-run", "both"], "--save-run saves runs of one session"),
        (["session.log"] * 4, "found 5"),
    ],
    ids=str,
)
def test_what_is_ambiguous_is_a_usage_error(small_session, options, said):
    _, err = maurice("compare", small_session, *options, *FEW, expect=2)
    assert said in " ".join(err.split())


def test_a_filter_in_the_place_of_a_library_is_refused(small_session):
    for show in (mv.replay, mv.compare):
        with pytest.raises(mv.InputError, match="library: found a Filter, expected a path"):
            show(small_session, mv.Filter("robust"))


def test_runs_that_are_compared_have_the_same_noise(small_session):
    session = open_session(small_session)
    library = open_library_for(session, None, keep_going=False)
    wanted = [Filter(feature="color"), Filter(feature="blended"), Filter(feature="color", seed=1)]
    wanted.append(Filter(feature="blended"))
    few = [replace(one, particles=200, start="global") for one in wanted]
    runs = make_runs(session, library, few)
    color, blended, other_seed, again = (run.label for run in runs)
    for number, (_, records) in enumerate(run_together(runs, session.moments())):
        clouds = {label: record.predicted.poses for label, record in records.items()}
        if number == 0:  # nothing has been weighed yet, so that motion noise is all there is
            assert np.array_equal(clouds[color], clouds[blended])
            assert not np.array_equal(clouds[color], clouds[other_seed])
        assert np.array_equal(clouds[blended], clouds[again])
        assert np.array_equal(records[blended].weighted.log_weights, records[again].weighted.log_weights)


def test_json_says_how_runs_compare(small_session):
    first, other = runs_of(maurice("compare", small_session, *FEW)[0])
    assert first["against_first"] is None
    against = other["against_first"]
    assert set(against) == AGAINST
    assert set(against["position_error"]) == DIFFERENCE
    assert against["label"] == "color"
    difference = other["error_mean_m"] - first["error_mean_m"]
    assert against["position_error"]["difference_mean_m"] == pytest.approx(difference)
    difference = other["heading_error_mean_rad"] - first["heading_error_mean_rad"]
    assert against["heading_error"]["difference_mean_rad"] == pytest.approx(difference)
    assert against["position_error"]["steps"] == 11
    assert against["position_error"]["interval_95_m"] is None  # of eleven updates there is none
    assert "against_first" not in runs_of(maurice(small_session, *FEW)[0])[0]
    _, other = runs_of(maurice("compare", small_session, "--seed=5", "--seed=5", *FEW)[0])
    against = other["against_first"]
    assert against["position_error"]["difference_mean_m"] == 0
    assert (against["position_error"]["better"], against["position_error"]["worse"]) == (0, 0)
    assert (against["apart_most_m"], against["parted_at_step"]) == (0, None)


def test_every_value_reaches_its_run_and_the_table(small_session):
    out, _ = maurice("compare", small_session, "--seed", "1", "--seed", "2", "-o", "none", "--all")
    for row in ("error against", "closer to the truth", "parts from seed 1", "of 11"):
        assert row in out
    assert "against" not in maurice("compare", small_session, "--seed=1", "--seed=2", "-o", "none")[0]
    # What a comparison gives for a run is what the run gives alone
    schemes = ["--set=resampling.scheme=residual", "--set=resampling.scheme=multinomial"]
    for options in (["--seed=3", "--seed=4"], schemes):
        together, _ = maurice("compare", small_session, *options, *FEW)
        alone = [runs_of(maurice(small_session, option, *FEW)[0])[0] for option in options]
        for run, lone in zip(runs_of(together), alone, strict=True):
            assert {k: run[k] for k in lone if k != "label"} == {k: lone[k] for k in lone if k != "label"}
        assert alone[0] != alone[1]


def test_without_truth_only_places_are_compared(small_session, tmp_path):
    lines = small_session.read_text().splitlines(keepends=True)
    small_session.write_text("".join(line for line in lines if '"truth"' not in line))
    against = runs_of(maurice("compare", small_session, *FEW)[0])[1]["against_first"]
    assert against["position_error"] is None
    assert against["apart_mean_m"] > 0
    maurice("compare", small_session, "--particles", "50", "-o", "no-truth.rrd")


def test_saved_runs_are_compared_as_if_they_had_gone_together(small_session, monkeypatch):
    together = runs_of(maurice("compare", small_session, *FEW)[0])
    for label in ("color", "blended"):
        maurice(small_session, "--feature", label, "--save-run", f"kept {label}", *FEW)

    from maurice_mcl.filter.localizer import Localizer

    monkeypatch.delattr(Localizer, "step")  # nothing is filtered again
    out, err = maurice("compare", "kept color", "kept blended", "-o", "none", "--json")
    assert err == ""
    assert labels_of(out) == ["kept color", "kept blended"]
    for run, saved in zip(together, runs_of(out), strict=True):
        saved["label"] = run["label"]
        if saved["against_first"]:
            saved["against_first"]["label"] = "color"
        assert saved == run
    maurice("compare", "kept color", "kept blended", "-o", "saved.rrd")


def test_a_saved_comparison_is_shown_with_its_differences(small_session):
    then, _ = maurice("compare", small_session, "--save-run", "both", *FEW)
    assert maurice("compare", "both", "-o", "none", "--json")[0] == then
    out, _ = maurice("compare", "both/blended", "both/color", "-o", "none", "--json")
    assert labels_of(out) == ["blended", "color"]
    forward, backward = runs_of(then)[1]["against_first"], runs_of(out)[1]["against_first"]
    assert backward["position_error"]["difference_mean_m"] == -forward["position_error"]["difference_mean_m"]
    _, err = maurice("compare", "both", "both/color", expect=1)
    expect_facts(one_line(err), "2 runs", "both/color, both/blended")
    _, err = maurice("compare", "both/color", expect=1)
    assert "single saved run" in one_line(err)
    _, err = maurice("compare", "both/color", small_session, expect=2)
    assert "do not mix" in " ".join(err.split())
    maurice("compare", "both/color", "both/blended", "--seed", "1", expect=2)


def test_saved_runs_with_another_library_or_map_are_refused_in_one_line(small_session, tmp_path):
    maurice(small_session, "--save-run", "one", *FEW)
    header, *rest = (tmp_path / "survey.log").read_text().splitlines(keepends=True)
    (tmp_path / "survey.log").write_text("".join([header, *rest[:-1]]))
    maurice(small_session, "--save-run", "two", *FEW)
    assert "another library than one" in one_line(maurice("compare", "one", "two", expect=1)[1])
    info = json.loads(header)
    info["map"]["bounds_m"] = [0, 0, 3, 3]
    (tmp_path / "survey.log").write_text("".join([json.dumps(info) + "\n", *rest]))
    maurice(small_session, "--save-run", "three", *FEW)
    assert "another map than one" in one_line(maurice("compare", "one", "three", expect=1)[1])


def second_session(small_session: Path, tmp_path: Path, updates: int = 10) -> Path:
    """Another drive in the same arena: the first updates of the same one, a picture of it changed."""
    other = tmp_path / "other.log"
    pictures, lines = 0, []
    for line in small_session.read_text().splitlines(keepends=True):
        pictures += '"image"' in line
        if pictures <= updates:
            lines.append(line)
    other.write_text("".join(lines))
    return other


def test_two_sessions_go_side_by_side_as_far_as_the_shorter(small_session, tmp_path):
    other = second_session(small_session, tmp_path)
    out, err = maurice("compare", small_session, other, *FEW)
    assert "compared over the first 10 steps" in one_line(err)
    assert labels_of(out) == ["session.log", "other"]
    session, shorter = runs_of(out)
    assert session["updates"] == shorter["updates"] == 10
    against = shorter.pop("against_first")
    assert against["position_error"]["difference_mean_m"] == 0  # the same pictures and the same noise
    assert (against["apart_mean_m"], against["parted_at_step"]) == (None, None)
    alone = runs_of(maurice(other, *FEW)[0])[0]
    assert {**alone, "label": "other"} == shorter


def test_saved_runs_of_two_sessions_are_compared_too(small_session, tmp_path):
    other = second_session(small_session, tmp_path)
    live = runs_of(maurice("compare", small_session, other, *FEW)[0])
    maurice(small_session, "--save-run", "session-run", *FEW)
    maurice(other, "--save-run", "other-run", *FEW)
    out, err = maurice("compare", "session-run", "other-run", "-o", "none", "--json")
    assert "other-run has no more" in one_line(err)
    assert [run["error_mean_m"] for run in runs_of(out)] == [run["error_mean_m"] for run in live]


def test_sessions_of_different_libraries_are_refused_in_one_line(small_session, tmp_path):
    away = tmp_path / "away"
    shutil.copytree(tmp_path / "pictures", away / "pictures")
    shutil.copyfile(small_session, away / "session.log")
    survey = (tmp_path / "survey.log").read_text().splitlines(keepends=True)
    (away / "survey.log").write_text("".join(survey))
    assert labels_of(maurice("compare", small_session, "away/session.log", *FEW)[0])[1] == "away"
    (away / "survey.log").write_text("".join(survey[:-1]))
    _, err = maurice("compare", small_session, "away/session.log", *FEW, expect=1)
    assert "belongs to another library" in one_line(err)
    maurice("compare", small_session, "away/session.log", "--library", "survey.log", *FEW)


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["a/session", "b/session"], ["a", "b"]),
        (["kept", "other"], ["kept", "other"]),
        (["/x/color", "/y/color", "/y/edges"], ["x color", "y color", "y edges"]),
        (["/x/y/run", "/y/run"], ["x y", "y"]),
        (["run", "run"], ["run", "run"]),
        (["../kept/run", "run"], ["kept run", "run"]),
        (["größe/я", "ひと/я"], ["größe", "ひと"]),
    ],
)
def test_paths_are_named_by_what_tells_them_apart(paths, names, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert names_of([Path(path) for path in paths]) == names


def test_a_session_of_one_picture_is_compared(small_session):
    lines = small_session.read_text().splitlines(keepends=True)
    pictures = [number for number, line in enumerate(lines) if '"image"' in line]
    small_session.write_text("".join(lines[: pictures[1]]))
    out, _ = maurice("compare", small_session, "--particles", "40", "-o", "one.rrd", "--json")
    against = runs_of(out)[1]["against_first"]
    assert against["position_error"] is None  # the first three updates are never scored
    assert against["parted_at_step"] is None


def test_a_stopped_run_is_compared_as_far_as_it_got(small_session, monkeypatch):
    maurice(small_session, "--save-run", "whole", *FEW)
    add = RunWriter.add

    def stop(self: RunWriter, moment: Any, record: Any) -> None:
        if moment.frame.step == 7:
            raise KeyboardInterrupt
        add(self, moment, record)

    monkeypatch.setattr(RunWriter, "add", stop)
    maurice(small_session, "--save-run", "stopped", *FEW, expect=130)
    out, err = maurice("compare", "whole", "stopped", "-o", "none", "--json")
    assert "stopped: the run stopped; it holds 6 of 14 steps" in err
    whole, stopped = runs_of(out)
    assert whole["updates"] == stopped["updates"] == 6
    assert stopped["against_first"]["apart_most_m"] == 0


def test_a_snapshot_of_a_saved_comparison_has_what_the_runs_share(small_session, tmp_path):
    maurice("compare", small_session, "--particles", "40", "--save-run", "both", "-o", "none")
    draw_saved(Path("both"), tmp_path / "both.rrd")
    there = {str(chunk.entity_path) for chunk in RrdReader(tmp_path / "both.rrd").stream()}
    assert {cloud_of("color"), TEXT, RESULT} <= there


@pytest.mark.parametrize("layout", [(), ("--layout", "compare")])
def test_the_command_that_walks_through_a_step_opens_the_tab_that_was_asked_for(small_session, layout):
    _, err = maurice("compare", small_session, "--particles", "40", "-o", "two.rrd", *layout)
    walk = " ".join(err.split()).split("walk through step")[1].split("maurice-replay")[1]
    assert walk.startswith(" open two.rrd --step ")
    assert ("--phase predict --layout compare" in walk) == bool(layout)
