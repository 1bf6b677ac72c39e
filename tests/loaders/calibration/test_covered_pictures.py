from pathlib import Path

import cv2
import numpy as np
import pytest

from maurice_loaders.calibration import covered_pictures
from maurice_loaders.errors import InputError
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.session import SessionInfo


def survey(path: Path, covered: int = 2) -> Path:
    path.parent.mkdir(exist_ok=True)
    with SessionWriter(path, SessionInfo("s"), "survey") as log:
        for number in range(covered):
            log.image(float(number), np.full((4, 5, 3), 20 + number, np.uint8), covered=True)
        log.image(9.0, np.full((4, 5, 3), 200, np.uint8), pose=[0, 0, 0])
    return path


def levels(path: Path) -> list[int]:
    return [round(float(picture.mean())) for picture in covered_pictures(path)]


def test_only_covered_pictures_of_a_log_or_its_folder_are_read(tmp_path: Path) -> None:
    log = survey(tmp_path / "s" / "survey.log")
    assert levels(log) == [20, 21]
    assert levels(log.parent) == [20, 21]


def test_all_pictures_of_a_folder_without_a_log_are_read_by_name(tmp_path: Path) -> None:
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


def test_a_broken_picture_is_named(tmp_path: Path) -> None:
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
