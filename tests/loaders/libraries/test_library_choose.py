"""A drive becomes a library: spaced, turned, sharp, each picture with its own pose."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries import survey as surveys
from maurice_loaders.libraries.files import load_library, save_library
from maurice_loaders.libraries.store import build_library, library_key, open_library
from maurice_loaders.reading.options import Reading
from maurice_loaders.session_log.reader import SurveyLog
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.session import SessionInfo

EVERY = surveys.Spacing(0.4, float(np.radians(45)))


def apart(a: F64, b: F64) -> bool:
    turned = abs((a[2] - b[2] + np.pi) % (2 * np.pi) - np.pi)
    return bool(np.hypot(*(a - b)[:2]) >= 0.4 - 1e-6 or turned >= np.radians(45) - 1e-6)


@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.14, 3.14)), max_size=60),
    st.integers(0, 9),
)
def test_chosen_ones_are_apart_and_all_others_are_near_one(
    rows: list[tuple[float, float, float]], seed: int
) -> None:
    poses = np.array(rows).reshape(-1, 3)
    sharp = np.random.default_rng(seed).random(len(poses))
    taken = surveys.choose(poses, sharp, EVERY).tolist()
    assert taken == sorted(set(taken))
    assert all(apart(poses[a], poses[b]) for a in taken for b in taken if a < b)
    for left in set(range(len(poses))) - set(taken):
        near = [k for k in taken if not apart(poses[left], poses[k]) and sharp[k] >= sharp[left]]
        assert near, "what is left out has a sharper one near"


SPACINGS = [("0.4m,45deg", 0.4, 45), (" 18in , 30deg", 0.4572, 30), ("40cm,180deg", 0.4, 180)]


@pytest.mark.parametrize(("text", "distance_m", "degrees"), [*SPACINGS, ("1ft,9.5deg", 0.3048, 9.5)])
def test_spacing_is_read(text: str, distance_m: float, degrees: float) -> None:
    every = surveys.read_every(text)
    assert every.distance_m == pytest.approx(distance_m)
    assert np.degrees(every.angle_rad) == pytest.approx(degrees)


@pytest.mark.parametrize(
    "text", ["", "0.4m", "0.4,45", "45deg,0.4m", "0m,45deg", "1m,0deg", "1m,200deg", "xm,ydeg"]
)
def test_other_words_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="--every"):
        surveys.read_every(text)


def scene(seed: int) -> U8:
    """Draw boxes and a little noise."""
    rng = np.random.default_rng(seed)
    image = np.full((72, 88, 3), 110, np.uint8)
    for _ in range(12):
        x, y, w, h = rng.integers(0, (70, 55, 40, 30)).tolist()
        cv2.rectangle(image, (x, y), (x + w, y + h), rng.integers(0, 256, 3).tolist(), -1)
    return np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)


def moved(image: U8, seed: int) -> U8:
    """Blur a picture as a turning camera does."""
    noise = np.random.default_rng(seed).normal(0, 2, image.shape)
    return np.clip(cv2.blur(image, (15, 1)) + noise, 0, 255).astype(np.uint8)


def test_blurred_pictures_are_told_from_sharp_ones_of_other_things() -> None:
    sharp = [scene(seed) for seed in range(40)]
    assert not surveys.blurred(np.array([surveys.sharpness(image) for image in sharp])).any()
    spoiled = [moved(image, k) if k % 8 == 0 else image for k, image in enumerate(sharp)]
    found = surveys.blurred(np.array([surveys.sharpness(image) for image in spoiled]))
    assert np.flatnonzero(found).tolist() == list(range(0, 40, 8))


def test_few_pictures_are_not_judged_and_a_little_blur_one_way_only_is_found() -> None:
    assert not surveys.blurred(np.array([[0.0, 0.0]] * 10 + [[-9.0, -9.0]])).any()
    usual = np.random.default_rng(0).normal(-1.0, 0.1, (100, 1)) + np.array([0.0, 0.2])
    little = -1.0 - 0.28
    found = surveys.blurred(np.vstack([usual, [[little, little + 0.2], [little, -0.8], [-1.0, little]]]))
    assert np.flatnonzero(found).tolist() == [101, 102]


def write_drive(folder: Path, *, truth: bool = True) -> Path:
    """Drive straight, a picture every 10 cm; every eighth picture is blurred."""
    path = folder / "drive.log"
    with SessionWriter(path, SessionInfo("drive", "m")) as log:
        for k in range(40):
            image = scene(k)
            log.odometry(k, [0.1, 0.0, 0.0])
            log.image(k, moved(image, k) if k % 8 == 0 else image)
            if truth:
                log.truth(k, [0.1 * k, 1.0, 0.0])
    return path


def test_a_drive_becomes_a_library(tmp_path: Path) -> None:
    log = write_drive(tmp_path)
    survey = surveys.open_survey(log, Reading(), EVERY)
    assert isinstance(survey, surveys.SelectedSurvey)
    chosen = survey.chosen
    assert (chosen.pictures, chosen.without_pose, chosen.blurred) == (40, 0, 5)
    warnings: list[str] = []
    library = build_library(log, ["color"], log=survey, warn=warnings.append)
    assert library.size == chosen.taken == survey.count_pictures()
    assert 6 <= library.size <= 10
    assert str(chosen) in warnings[0]
    steps = np.diff(library.poses[:, 0])
    assert steps.min() >= 0.4 - 1e-9
    assert steps.max() <= 0.9
    for pose, picture in zip(library.poses, library.pictures, strict=True):
        assert picture is not None
        assert picture.is_file()
        number = round(pose[0] / 0.1)
        assert f"{number + 1:05d}" in picture.name
        assert number % 8 != 0


def test_a_drive_without_poses_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found 40 pictures and no pose of any"):
        surveys.open_survey(write_drive(tmp_path, truth=False), Reading())


def test_a_survey_is_taken_whole_unless_asked_and_a_camera_aside_turns_its_headings(survey: Path) -> None:
    assert isinstance(surveys.open_survey(survey, Reading()), SurveyLog)
    thinned = surveys.open_survey(survey, Reading(), surveys.Spacing(0.9, 1.0))
    assert isinstance(thinned, surveys.SelectedSurvey)
    assert 2 <= thinned.chosen.taken <= 3
    assert sum(picture.covered for picture in thinned.survey_pictures()) == 2
    plain = build_library(survey, ["color"])
    turned = build_library(survey, ["color"], yaw_rad=0.3)
    assert np.allclose(turned.poses, plain.poses - [0, 0, 0.3])


def test_pictures_inside_a_log_are_kept(tmp_path: Path) -> None:
    log = write_drive(tmp_path)
    for picture in open_session(log).moments():
        assert (tmp_path / picture.frame.picture).is_file()
    text = log.read_text().replace('"image": "pictures/', '"image": "./pictures/')
    inline = tmp_path / "inline.log"
    inline.write_text(_inlined(text, tmp_path))
    keep = tmp_path / "keep"
    keep.mkdir()
    survey = surveys.open_survey(inline, Reading(), EVERY, keep)
    library = build_library(inline, ["color"], log=survey)
    save_library(library, tmp_path / "library")
    again = load_library(tmp_path / "library")
    assert all(picture is not None and picture.is_file() for picture in again.pictures)


def _inlined(text: str, folder: Path) -> str:
    lines = [json.loads(line) for line in text.splitlines()]
    for line in lines:
        if "image" in line:
            line["image"] = {"base64": base64.b64encode((folder / line["image"]).read_bytes()).decode()}
    return "\n".join(json.dumps(line) for line in lines) + "\n"


def _table(folder: Path, columns: str = "image,x_m,y_m,heading_deg") -> Path:
    folder.mkdir()
    rows = [columns]
    for k in range(24):
        (folder / f"{k:02d}.png").write_bytes(cv2.imencode(".png", scene(k))[1].tobytes())
        rows.append(f"{k:02d}.png,{k % 3},0,{k // 3 * 15}" + (f",{k}" if "t_s" in columns else ""))
    table = folder / "poses.csv"
    table.write_text("\n".join(rows) + "\n")
    return table


def test_a_table_of_surveyed_pictures_opens_as_a_library_and_is_kept_by_its_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
    table, told = _table(tmp_path / "table"), list[str]()
    by_file = open_library(table, ["color"], warn=told.append)
    assert by_file.poses[4] == pytest.approx([1.0, 0.0, math.radians(15)])
    assert [text for text in told if "odometry" in text or "time" in text] == []
    monkeypatch.setattr("maurice_loaders.libraries.store.build_library", None)  # it is in the cache
    by_folder = open_library(table.parent, ["color"])
    assert np.array_equal(by_folder.index["color"].references, by_file.index["color"].references)
    key = library_key(table)
    (table.parent / "03.png").write_bytes((table.parent / "04.png").read_bytes())
    assert library_key(table) != key


def test_a_table_of_a_drive_is_no_library_and_the_message_says_how_to_make_one(tmp_path: Path) -> None:
    table = _table(tmp_path / "drive", "image,x_m,y_m,heading_deg,t_s")
    with pytest.raises(InputError, match=r"found a drive.*library build"):
        open_library(table)


def test_a_table_of_surveyed_pictures_is_taken_whole_and_a_folder_with_a_survey_is_the_survey(
    survey: Path, tmp_path: Path
) -> None:
    table = _table(tmp_path / "table")
    whole = surveys.open_survey(table, Reading())
    assert isinstance(whole, surveys.SelectedSurvey)
    assert whole.chosen.taken == 24
    thinned = surveys.open_survey(table, Reading(), EVERY)
    assert isinstance(thinned, surveys.SelectedSurvey)
    assert thinned.chosen.taken < 24
    assert isinstance(surveys.open_survey(survey.parent, Reading()), SurveyLog)
