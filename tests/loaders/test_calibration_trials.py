"""Trials of a robot's odometry from tables, and pictures of a covered lens."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.trials import write_trials
from maurice_loaders.calibration_trials import covered_pictures, read_trials
from maurice_loaders.errors import InputError
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.fitting.motion import Straights, Trials, Turns
from maurice_mcl.values.session import SessionInfo

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
