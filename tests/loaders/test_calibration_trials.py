"""Trials of a robot's odometry from sessions and tables, and pictures of a covered lens."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.trials import write_trials
from maurice_loaders.calibration_trials import (
    AlignedDrive,
    covered_pictures,
    cut,
    floor_between,
    mishaps,
    read_trials,
    trials_from_session,
)
from maurice_loaders.errors import InputError
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.fitting.motion import Straights, Trials, Turns
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import SessionInfo

WOOD = Region("wood", np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]]))
CARPET = Region("carpet", np.array([[2.0, 0], [4, 0], [4, 4], [2, 4]]))
ARENA = Arena((0, 0, 4, 4), np.zeros((0, 4)), floors=(WOOD, CARPET))


def written(folder: Path, records: str) -> Path:
    """Write a session of records such as `1 truth 0 0 0`, separated by semicolons."""
    path = folder / "session.log"
    with SessionWriter(path, SessionInfo("drive", arena=ARENA), force=True) as log:
        for record in records.split("; "):
            t_s, kind, rest = record.split(" ", 2)
            getattr(log, kind)(float(t_s), rest if kind == "event" else list(map(float, rest.split())))
    return path


def test_the_first_truth_after_each_movement_counts(tmp_path: Path) -> None:
    already_on_the_next_way = "1.5 truth 1.1 1.2 1.0"
    records = f"0 truth 1 1 0; 1 odometry 0 0 1.4; 1 truth 1 1 1; {already_on_the_next_way}; "
    trials = trials_from_session(written(tmp_path, records + "2 odometry 0.5 0 0; 2 truth 1 1.5 1.1"))
    assert trials.turns.actual_rad == pytest.approx([1.0])
    assert trials.straights.actual_m == pytest.approx([0.5])
    assert trials.straights.drift_rad == pytest.approx([0.1])
    assert trials.straights.floors == ("wood",)


def test_arcs_are_left_out_and_nothing_is_joined_across_a_kidnapping(tmp_path: Path) -> None:
    records = "0 truth 1 1 0; 1 odometry 0 0 1.4; 1.1 event kidnapped; 1.2 truth 3 3 2; "
    trials = trials_from_session(written(tmp_path, records + "2 odometry 0.5 0 0; 2 truth 3.5 3 0.1"))
    assert len(trials.turns.actual_rad) == 0
    assert trials.straights.floors == ("carpet",)
    records = "0 truth 1 1 0; 1 odometry 0.3 0.1 0.7; 1 truth 1.3 1.1 0.7; "
    trials = trials_from_session(written(tmp_path, records + "2 odometry 0.5 0 0.02; 2 truth 1.68 1.42 0.72"))
    assert (trials.left_out, len(trials.straights.actual_m), len(trials.turns.measured_rad)) == (1, 1, 0)


def test_what_is_nearly_a_turn_is_one_and_what_is_nearly_straight_drifted(tmp_path: Path) -> None:
    records = "0 truth 1 1 0; 1 odometry 0.02 0 1.2; 1 truth 1.02 1 0.9; "
    trials = trials_from_session(
        written(tmp_path, records + "2 odometry 0.5 0.01 0.05; 2 truth 1.02 1.5 1.03")
    )
    assert trials.turns.measured_rad == pytest.approx([1.2])
    assert trials.turns.actual_rad == pytest.approx([0.9])
    assert trials.straights.actual_m == pytest.approx([0.5])
    assert trials.straights.drift_rad == pytest.approx([0.13 - 0.05])


def test_slips_and_bumps_are_counted(tmp_path: Path) -> None:
    told = ("floor wood", "slip +18.3 deg", "bump", "slip -20.1 deg", "slippers found")
    path = written(tmp_path, "; ".join(f"{k} event {text}" for k, text in enumerate(told)))
    assert mishaps(path) == {"slip": 2, "bump": 1}


@pytest.mark.parametrize(
    ("a", "b", "arena", "floor"),
    [
        ((1, 1), (1.5, 1), ARENA, "wood"),
        ((1, 1), (3, 1), ARENA, None),
        ((3, 1), (3, 3), ARENA, "carpet"),
        ((-2, -2), (-1, -1), ARENA, ""),
        ((1, 1), (3, 1), None, ""),
    ],
)
def test_floors_of_ways(a: object, b: object, arena: Arena | None, floor: str | None) -> None:
    assert floor_between(arena, np.array(a), np.array(b)) == floor


def test_no_truth_one_truth_and_a_survey_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "1 odometry 0 0 1.4")
    with pytest.raises(InputError, match="found no truth"):
        trials_from_session(path)
    path.unlink()
    with pytest.raises(InputError, match="found one truth"):
        trials_from_session(written(tmp_path, "0 truth 1 1 0; 1 odometry 0 0 1.4"))
    with pytest.raises(InputError, match="found a survey log"):
        trials_from_session(survey(tmp_path / "survey.log"))


GOOD = """kind,measured,actual,heading_error_deg,floor
turn,137,100,,
straight,10,9.5,3,carpet
straight,20,19,,
"""


def table(folder: Path, text: str) -> Path:
    file = folder / "trials.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_turns_are_degrees_and_lengths_are_in_the_unit_that_was_named(tmp_path: Path) -> None:
    trials = read_trials(table(tmp_path, GOOD), "in")
    assert np.degrees(trials.turns.measured_rad) == pytest.approx([137])
    assert np.degrees(trials.turns.actual_rad) == pytest.approx([100])
    assert trials.straights.measured_m == pytest.approx([0.254, 0.508])
    assert trials.straights.floors == ("carpet", "")
    assert np.degrees(trials.straights.drift_rad[0]) == pytest.approx(3)
    assert np.isnan(trials.straights.drift_rad[1])
    trials = read_trials(table(tmp_path, "actual,kind,measured\n1,turn,2\n"))
    assert np.degrees(trials.turns.measured_rad) == pytest.approx([2])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "found columns none"),
        ("kind,measured,actual\n", "found no rows"),
        ("kind,measured,actual,speed\nturn,1,1,1\n", "found columns kind, measured, actual, speed"),
        ("kind,measured\nturn,1\n", "expected kind, measured, actual"),
        ("kind,measured,actual,actual\nturn,1,1,1\n", "each once"),
        ("kind,measured,actual\nspin,1,1\n", ":2: found kind 'spin'"),
        ("kind,measured,actual\nturn,1,nan\n", ":2: found actual 'nan'"),
        ("kind,measured,actual\nturn,,1\n", "found measured ''"),
        ("kind,measured,actual\nturn,1e300,1\n", "expected a number up to 1e9"),
        ("kind,measured,actual\nturn,0,1\n", "found measured 0"),
        ("kind,measured,actual\nturn,1,1,1\n", "more values than the 3 columns"),
        ("kind;measured;actual\nturn;1;1\n", "found columns kind;measured;actual"),
    ],
)
def test_bad_tables_name_the_row_and_the_column(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said.replace("?", r"\?")):
        read_trials(table(tmp_path, text))


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_trials(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read"):
        read_trials(tmp_path / "b.csv")
    with pytest.raises(ValueError, match="expected one of m, cm, mm, in"):
        read_trials(tmp_path / "b.csv", "feet")


def test_what_is_written_reads_back(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    straights = Straights(np.array([1.0, 2]), np.array([0.9, 1.9]), np.array([0.1, np.nan]), ("a,b", ""))
    trials = Trials(Turns(np.array([1.0]), np.array([0.7])), straights)
    write_trials(file, trials)
    again = read_trials(file)
    assert again.turns.actual_rad == pytest.approx(trials.turns.actual_rad, abs=1e-5)
    assert again.straights.actual_m == pytest.approx(straights.actual_m)
    assert again.straights.drift_rad == pytest.approx(straights.drift_rad, abs=1e-5, nan_ok=True)
    assert again.straights.floors == straights.floors


def survey(path: Path, covered: int = 2) -> Path:
    path.parent.mkdir(exist_ok=True)
    with SessionWriter(path, SessionInfo("s"), "survey") as log:
        for number in range(covered):
            log.image(float(number), np.full((4, 5, 3), 20 + number, np.uint8), covered=True)
        log.image(9.0, np.full((4, 5, 3), 200, np.uint8), pose=[0, 0, 0])
    return path


def levels(path: Path) -> list[int]:
    return [round(float(picture.mean())) for picture in covered_pictures(path)]


def test_only_covered_pictures_of_a_log_and_all_of_a_folder_without_one_are_read(tmp_path: Path) -> None:
    log = survey(tmp_path / "s" / "survey.log")
    assert levels(log) == [20, 21]
    assert levels(log.parent) == [20, 21]
    for name, level in (("b.PNG", 30), ("a.bmp", 25)):
        cv2.imwrite(str(tmp_path / name), np.full((4, 5, 3), level, np.uint8))
    (tmp_path / "notes.txt").write_text("lens cap on")
    assert levels(tmp_path) == [25, 30]


def test_what_holds_no_covered_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found neither pictures nor a log"):
        levels(tmp_path)
    with pytest.raises(InputError, match="expected some taken with the lens cap on"):
        levels(survey(tmp_path / "s" / "survey.log", covered=0))
    with pytest.raises(InputError, match="no such file"):
        levels(tmp_path / "none")
    (tmp_path / "cut.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(InputError, match=r"cut\.png: found a cut PNG"):
        levels(tmp_path)


def test_of_several_logs_survey_log_is_taken_or_one_must_be_named(tmp_path: Path) -> None:
    survey(tmp_path / "s" / "one.log")
    survey(tmp_path / "s" / "two.log", covered=1)
    with pytest.raises(InputError, match="found 2 logs"):
        levels(tmp_path / "s")
    (tmp_path / "s" / "two.log").rename(tmp_path / "s" / "survey.log")
    assert levels(tmp_path / "s") == [20]


def test_a_drive_there_and_back_has_one_drift() -> None:
    """Backward, lengths are negative and the heading changes the other way: the same radians per meter."""
    ahead = np.concatenate([np.linspace(0, 1, 21), np.linspace(1, 0, 21)[1:]])
    odometry = np.column_stack([ahead, np.zeros((41, 2))])
    curved = np.column_stack([np.sin(0.2 * ahead) / 0.2, (1 - np.cos(0.2 * ahead)) / 0.2, 0.2 * ahead])
    straights = cut(AlignedDrive(odometry, curved)).straights
    assert straights.measured_m == pytest.approx([1, -1])
    assert straights.actual_m == pytest.approx([1, -1], rel=0.01)
    assert straights.drift_rad / straights.actual_m == pytest.approx([0.2, 0.2], rel=0.01)
