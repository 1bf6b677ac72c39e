"""`library check` as a doctor: it asks for what a survey lacks, and with that gap and error shrink."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import maurice_loaders as ml
import maurice_viz as mv
from helpers.commands import failure, maurice, run
from helpers.small_session import picture_at, small_arena, write_small_session, write_small_survey
from maurice_datasets.surveys import read_poses
from maurice_loaders.session_log.reader import SurveyLog
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.session import SessionInfo

SPACING_M = 0.5


def write_survey(path: Path, poses: list[F64]) -> Path:
    with SessionWriter(path, SessionInfo("kleiner Raum", "m", arena=small_arena()), "survey") as log:
        for t, pose in enumerate(poses):
            log.image(float(t), picture_at(pose), pose=pose)
    return path


@pytest.fixture(scope="module")
def gap(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a survey without the floor that the small session drives over; the session is beside it."""
    folder = tmp_path_factory.mktemp("doctor")
    write_small_survey(folder)
    write_small_session(folder)
    taken = SurveyLog(folder / "survey.log").survey_pictures()
    whole = [one.pose for one in taken if one.pose is not None]
    kept = [pose for pose in whole if np.hypot(*(pose[:2] - (1.6, 1.0))) > 0.7]
    return write_survey(folder / "gap.log", kept)


def test_what_it_asks_for_fills_the_gap_and_lowers_the_error(gap, tmp_path):
    table, more, built = tmp_path / "add.csv", tmp_path / "more.log", tmp_path / "library"
    out, _ = maurice("library", "check", gap, "-o", table, "-o", tmp_path / "map.png")
    assert "in gaps" in out
    assert "add: (" in out
    asked = read_poses(table)
    assert pl.read_csv(table).columns == ["x_m", "y_m", "heading_deg", "why"]
    assert np.hypot(*(asked[:, :2] - (1.6, 1.0)).T).max() < 0.7 + SPACING_M

    write_survey(more, list(asked))
    run("library", "build", gap, "--add", more, "-o", built)
    before, after = (json.loads(maurice("library", "check", one, "--json")[0]) for one in (gap, built))
    assert after["entries"] == before["entries"] + len(asked)
    assert (before["covered_share"], after["covered_share"]) == (pytest.approx(0.85, abs=0.1), 1)
    assert len(before["add"]) == len(asked)
    assert {one["why"] for one in after["add"]} <= {"ambiguity"}
    assert len(after["missing_headings"]) == 0

    drive = gap.with_name("session.log")
    errors = [
        mv.check(
            drive,
            library,
            filter=mv.Filter(start="global", particles=300),
            demands=mv.Demands(max_error_m=9),
            seeds=5,
        )
        .drives[0]
        .runs
        for library in (gap, built)
    ]
    worse = [old.error_mean_m - new.error_mean_m for old, new in zip(*errors, strict=True)]
    assert np.median(worse) > 0.2


def test_a_complete_survey_needs_nothing(small_session):
    survey = small_session.with_name("survey.log")
    out, _ = maurice("library", "check", survey)
    assert "nothing: every heading has a reference near" in out
    assert mv.check_library(survey).advice.added == ()


def test_existing_tables_are_kept_and_bad_ones_are_one_line(gap, tmp_path):
    table = tmp_path / "add.csv"
    table.write_text("x_m,y_m\n1,2\n")
    assert "exists already" in failure("library", "check", gap, "-o", table)
    survey = ("survey", "-o", tmp_path / "out", "--poses", table)
    assert "columns x_m, y_m and heading_deg" in failure(*survey)
    table.write_text("x_m,y_m,heading_deg\n")
    assert "found no pose" in failure(*survey)
    table.write_text("x_m,y_m,heading_deg\n1,2,inf\n")
    assert "out of range" in failure(*survey)
    run(*survey, "--headings", "4", expect=2)


def test_a_simulated_survey_takes_the_poses_of_a_table(tmp_path):
    table = tmp_path / "add.csv"
    table.write_text("x_m,y_m,heading_deg,why\n1.0,1.0,90,gap\n1.2,1.0,-45,heading\n")
    run("survey", "-o", tmp_path / "more", "--poses", table)
    library = ml.build_library(tmp_path / "more" / "survey.log", channels=["color"])
    assert library.poses == pytest.approx(np.array([(1, 1, np.pi / 2), (1.2, 1, -np.pi / 4)]))
