"""What inspect says is what is there; broken lines are told, not raised."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from maurice_loaders.doctor.inspection import Inspection, inspect_file
from maurice_loaders.errors import InputError
from maurice_loaders.reading.options import Reading

from ..conftest import WriteLog

Pixel = dict[str, Any]


def inspected(path: Path) -> Inspection:
    return inspect_file(path, Reading(keep_going=True))


def test_a_whole_session(write_log: WriteLog, pixel: Pixel, survey: Path) -> None:
    path = write_log(
        {"t": 10, "truth": [0, 0, 0]},
        {"t": 10, "image": pixel},
        {"t": 11, "odometry": [3, 4, 1]},
        {"t": 12, "odometry": [0, 0, 1]},
        {"t": 12, "truth": [1, 0, 0]},
        {"t": 13, "odometry": [-2, 0, 0]},
        {"t": 13, "image": pixel},
        {"t": 14, "event": "kidnapped"},
        {"t": 14, "truth": [9, 9, 0]},
        {"t": 15, "truth": [9, 7, 0]},
        {"t": 16, "image": pixel, "covered": True},
        {"t": 20, "image": pixel},
        survey="survey.log",
        map={"bounds_m": [0, 0, 1, 1]},
        cameras={"front": {}},
    )
    found = inspected(path)
    assert (found.kind, found.name, found.cameras) == ("session", "test", ("front",))
    assert found.records == {"odometry": 3, "image": 3, "covered": 1, "truth": 4, "event": 1}
    assert found.duration_s == 10
    assert found.picture_rate_hz == pytest.approx(0.2)
    assert found.odometry_rate_hz == pytest.approx(1)
    assert found.pictures == {"PNG 2x1": 4}
    assert found.distance_odometry_m == pytest.approx(7)
    assert found.distance_truth_m == pytest.approx(3)  # being carried is no way driven
    assert found.truth_share == pytest.approx(1 / 3)
    assert found.events == ("kidnapped",)
    assert (found.survey, found.survey_found, found.has_map) == (str(survey), True, True)
    assert (found.problem_count, found.problems, found.warnings) == (0, (), ())
    json.dumps(asdict(found), allow_nan=False)


def test_a_header_alone_and_records_at_one_time_have_no_rate(write_log: WriteLog, pixel: Pixel) -> None:
    found = inspected(write_log())
    assert found.duration_s == 0
    unknown = (found.picture_rate_hz, found.odometry_rate_hz, found.truth_share, found.survey)
    assert {*unknown, found.distance_odometry_m, found.distance_truth_m} == {None}
    assert (found.survey_found, found.has_map) == (None, False)
    assert inspected(write_log(*[{"t": 1, "image": pixel}] * 3)).picture_rate_hz is None


def test_all_problems_with_their_lines(write_log: WriteLog, pixel: Pixel) -> None:
    path = write_log("{", {"t": 1, "image": pixel}, {"t": 0, "event": "late"}, {"t": 2, "image": "no.jpg"})
    found = inspected(path)
    assert found.problem_count == 3
    assert [problem.split(":")[1] for problem in found.problems] == ["2", "4", "5"]
    assert found.records["image"] == 2
    assert found.pictures == {"PNG 2x1": 1}
    found = inspected(write_log(*["?"] * 300))
    assert (found.problem_count, len(found.problems)) == (300, 100)


def test_warnings(write_log: WriteLog, pixel: Pixel, survey: Path) -> None:
    path = write_log(
        {"t": 0, "image": pixel}, {"t": 1, "image": "pictures/survey-00003.jpg"}, survey="gone.log"
    )
    path.write_text(path.read_text() + '{"t": 2, "ev')
    unfinished, gone, differ, *_ = inspected(path).warnings
    assert "unfinished" in unfinished
    assert "gone.log, which is not there" in gone
    assert differ == "pictures differ in format or size: JPEG 16x12, PNG 2x1"


def test_a_survey(survey: Path) -> None:
    found = inspected(survey)
    assert found.kind == "survey"
    assert (found.records["image"], found.records["covered"], found.truth_share) == (5, 2, None)


def test_what_is_no_log_or_never_ends_is_an_error(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    no_file = "found no regular file"
    for path, told in (
        (tmp_path / "no", "found no such file"),
        (tmp_path / "pipe", no_file),
        (Path("/dev/zero"), no_file),
    ):
        with pytest.raises(InputError, match=told):
            inspected(path)


def test_a_broken_line_is_counted_once_and_missing_odometry_is_told(
    write_log: WriteLog, pixel: Pixel
) -> None:
    found = inspected(write_log({"t": 0, "image": pixel}, "{broken", {"t": 1, "image": pixel}))
    assert found.problem_count == 1
    assert any("found no odometry" in warning for warning in found.warnings)


def test_scans_are_counted_with_how_many_a_replay_uses(write_log: WriteLog, pixel: Pixel) -> None:
    scan = {"ranges_m": [1, 2, "inf"], "start_rad": -1.5708, "step_rad": 1.5708, "min_m": 0, "max_m": 8.1}
    drive = [r for k in range(7) for r in ({"t": k, "odometry": [0.1, 0, 0]}, {"t": k, "scan": scan})]
    drive += [{"t": 6, "truth": [0, 0, 0]}]
    laser = {"3 beams over 180 deg, up to 8.1 m": 7}
    found = inspected(write_log(*drive))
    assert (found.records["scan"], found.scans, found.scans_used) == (7, laser, 3)
    assert found.truth_share == pytest.approx(1 / 3)
    found = inspected(write_log(*drive, {"t": 6.05, "image": pixel}, {"t": 9, "image": pixel}))
    assert (found.scans, found.scans_used, found.truth_share) == (laser, 1, 0)
    every = inspect_file(write_log(*drive), Reading(keep_going=True, min_distance_m=0.0))
    assert every.scans_used == 7
    found = inspected(write_log({"t": 0, "image": pixel}))
    assert (found.scans, found.scans_used) == ({}, None)
