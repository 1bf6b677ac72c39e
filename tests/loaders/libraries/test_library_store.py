"""Libraries hold what their channels measure; the cache builds them once, by content, for two at once."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.libraries import store as library_store
from maurice_loaders.libraries.store import build_library, library_key, open_library, save_library
from maurice_loaders.session_log.reader import SurveyLog
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.library import Library

from ..conftest import WriteLog


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Every survey that was really built."""
    built: list[Path] = []

    def spy(survey: Path, *args: Any, **options: Any) -> Library:
        built.append(survey)
        return build_library(survey, *args, **options)

    monkeypatch.setattr(library_store, "build_library", spy)
    return built


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))


def kept_in(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "cache" / "libraries").iterdir())


def test_a_survey_is_built_once(survey: Path, builds: list[Path], tmp_path: Path) -> None:
    first, second = open_library(survey), open_library(survey)
    assert builds == [survey]
    assert np.array_equal(first.index["color"].references, second.index["color"].references)
    assert first.pictures == second.pictures
    assert first.pictures[0] is not None
    assert first.pictures[0].is_relative_to(tmp_path / "cache")


def test_a_folder_with_a_survey_is_the_survey(survey: Path, builds: list[Path]) -> None:
    log = survey.rename(survey.with_name("survey.log"))
    assert open_library(log.parent).size == open_library(log).size
    assert builds == [log]


def test_warnings_are_told_every_time(survey: Path) -> None:
    lines = survey.read_text().splitlines(keepends=True)
    survey.write_text("".join(line for line in lines if "covered" not in line))
    told: list[list[str]] = [[], []]
    for warnings in told:
        open_library(survey, warn=warnings.append)
    assert told[0] == told[1] != []


def test_a_library_folder_is_loaded(survey: Path, builds: list[Path], tmp_path: Path) -> None:
    save_library(build_library(survey), tmp_path / "library")
    assert open_library(tmp_path / "library").size == 5
    assert builds == []


def test_what_decides_is_content_and_not_the_place(survey: Path, tmp_path: Path) -> None:
    key = library_key(survey)
    (tmp_path / "there").mkdir()
    for name in ("pictures", "survey.log"):
        (survey.parent / name).rename(tmp_path / "there" / name)
    assert library_key(tmp_path / "there/survey.log") == key
    survey = tmp_path / "there/survey.log"
    assert library_key(survey, keep_going=True) != key
    assert library_key(survey, ["color"]) != key
    picture = survey.parent / "pictures/survey-00004.jpg"
    data = picture.read_bytes()
    picture.write_bytes((survey.parent / "pictures/survey-00005.jpg").read_bytes())
    assert library_key(survey) != key
    picture.write_bytes(data)
    assert library_key(survey) == key
    survey.write_text(survey.read_text() + "\n")
    assert library_key(survey) != key


@pytest.mark.parametrize("part", ["manifest.json", "entries.parquet", "color-*.npy", "pictures/00000.jpg"])
@pytest.mark.parametrize("damage", ["remove", "cut"])
def test_a_damaged_cache_is_built_again(
    survey: Path, builds: list[Path], tmp_path: Path, part: str, damage: str
) -> None:
    open_library(survey)
    (kept,) = kept_in(tmp_path)
    (file,) = kept.glob(part)
    if damage == "remove":
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:30])
    assert open_library(survey).size == 5
    fixed = part != "pictures/00000.jpg" or damage == "remove"  # a picture's content is not looked at
    assert len(builds) == (2 if fixed else 1)
    builds.clear()
    open_library(survey)
    assert builds == []
    assert kept_in(tmp_path) == [kept]


def test_a_broken_survey_leaves_nothing_in_the_cache(survey: Path, tmp_path: Path) -> None:
    survey.write_text(survey.read_text() + "broken\n")
    with pytest.raises(InputError, match=r"survey\.log:9"):
        open_library(survey)
    assert not (tmp_path / "cache").exists()
    assert open_library(survey, keep_going=True).size == 5
    with pytest.raises(InputError, match=r"survey\.log:9"):
        open_library(survey)


def test_a_cache_that_cannot_be_written_is_done_without(survey: Path, tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("in the way")
    warnings: list[str] = []
    library = open_library(survey, warn=warnings.append)
    assert library.size == 5
    assert "not kept for next time" in warnings[-1]


def test_a_quicker_process_is_no_harm(survey: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def overtaken(*args: Any, **options: Any) -> Library:
        monkeypatch.undo()
        monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
        open_library(survey)  # the other one, all the way
        (kept_in(tmp_path)[0] / "mark").touch()
        return build_library(*args, **options)

    monkeypatch.setattr(library_store, "build_library", overtaken)
    library = open_library(survey)
    assert library.size == 5
    (kept,) = kept_in(tmp_path)
    assert (kept / "mark").exists()  # left alone: others read it
    assert all(picture is not None and picture.is_file() for picture in library.pictures)


def test_two_processes_at_once(survey: Path, tmp_path: Path) -> None:
    code = "import sys, pathlib; from maurice_loaders.libraries.store import open_library as o; "
    code += "print(o(pathlib.Path(sys.argv[1]), warn=print).size)"
    command = [sys.executable, "-c", code, str(survey)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate()[0] for process in both] == ["5\n", "5\n"]
    assert len(kept_in(tmp_path)) == 1


def test_measures_every_picture_with_every_channel_and_the_covered_ones_are_the_floor(survey: Path) -> None:
    library = build_library(survey)
    pictures = [p for p in SurveyLog(survey).survey_pictures() if not p.covered]
    assert set(library.index) == set(CHANNELS)
    for name, index in library.index.items():
        rows = np.array([CHANNELS[name].describe(p.image) for p in pictures])
        assert np.array_equal(index.references, rows)
        assert np.array_equal(index.relevance, rows.max(axis=0))
        assert index.references.dtype == index.noise_floor.dtype == index.relevance.dtype == np.float32
    assert np.allclose(library.poses, [[0.5 * k, 1.0, 0.1 * k] for k in range(5)])
    assert library.pictures == tuple(p.path for p in pictures)
    assert (library.name, library.display_units) == ("place", "in")
    covered = [p.image for p in SurveyLog(survey).survey_pictures() if p.covered]
    for name, index in library.index.items():
        expected = np.mean([CHANNELS[name].describe(image) for image in covered], axis=0)
        assert np.allclose(index.noise_floor, expected, atol=1e-4)
    assert library.index["color"].noise_floor.max() > 0


def test_without_covered_pictures_and_a_map_there_is_no_floor_a_warning_and_all_around_is_free(
    write_log: WriteLog, pixel: object, survey: Path
) -> None:
    path = write_log({"t": 0, "image": pixel, "pose": [1, 2, 0]}, kind="survey")
    warnings: list[str] = []
    library = build_library(path, warn=warnings.append)
    assert not library.index["color"].noise_floor.any()
    assert "lens covered" in warnings[0]
    assert library.pictures == (None,)
    library = build_library(survey)
    assert library.arena.bounds == (-1.0, 0.0, 3.0, 2.0)
    assert library.arena.walls.shape == (0, 4)


def test_poses_outside_the_map_are_told(write_log: WriteLog, pixel: object) -> None:
    records = [{"t": t, "image": pixel, "pose": [t, 0.5, 0]} for t in range(4)]
    warnings: list[str] = []
    build_library(write_log(*records, kind="survey", map={"bounds_m": [0, 0, 1.5, 1]}), warn=warnings.append)
    assert any("2 of 4 surveyed poses lie outside the map" in text for text in warnings)


def test_only_the_channels_asked_for_and_progress_to_the_end(survey: Path) -> None:
    assert set(build_library(survey, ["edges"]).index) == {"edges"}
    with pytest.raises(ValueError, match="found channel 'smell', expected one of color, edges"):
        build_library(survey, ["smell"])
    seen: list[tuple[int, int]] = []
    build_library(survey, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(k, 7) for k in range(1, 8)]


def test_broken_lines_stop_it_or_are_told(survey: Path) -> None:
    survey.write_text(survey.read_text() + '{"t": 99, "image": "gone.jpg", "pose": [0, 0, 0]}\n')
    with pytest.raises(InputError, match=r"survey\.log:9: gone\.jpg"):
        build_library(survey)
    warnings: list[str] = []
    assert build_library(survey, keep_going=True, warn=warnings.append).size == 5
    assert any("1 broken records skipped, the first: " in text for text in warnings)


@pytest.mark.parametrize("far", [[1e8, 1e7, 0], [1e9, -1e9, 0], [0, 1e4 + 0.6, 0]])
def test_a_wild_pose_is_named_and_no_map_is_rastered(write_log: WriteLog, pixel: object, far: object) -> None:
    poses = [[0, 0, 0], [0.5, 0, 0], far, [0, 0.5, 0]]
    records = [{"t": t, "image": pixel, "pose": pose} for t, pose in enumerate(poses)]
    survey = write_log(*records, name="survey.log", kind="survey")
    session = write_log(name="session.log", survey="survey.log")
    at = re.escape(f"({far[0]:.15g}, {far[1]:.15g})") if isinstance(far, list) else ""
    for build in (build_library, open_library):
        with pytest.raises(InputError, match=f"found poses .* m apart, the farthest off at {at}") as caught:
            build(open_session(session).info.survey or session)
        assert caught.value.file == survey


def test_ten_kilometers_anywhere_become_a_raster(write_log: WriteLog, pixel: object) -> None:
    poses = [[1e8, -1e8, 0], [1e8 + 0.5, -1e8, 0], [1e8 + 9_990, -1e8 + 9_990, 0]]
    records = [{"t": t, "image": pixel, "pose": pose} for t, pose in enumerate(poses)]
    library = build_library(write_log(*records, kind="survey"))
    reference = nearest_reference(library.poses, library.arena)
    assert np.prod(reference.grid.shape) < 1.1e6
    at = (library.poses - [*library.origin, 0.0]).astype(np.float32)
    assert reference.entries(at, library.origin)[2] == 2


@pytest.mark.parametrize(
    "change",
    [
        {"bounds_m": [0, 0, 1e7, 1]},
        {"walls_m": [[0, 0, 1e8, 0]]},
        {"floors": [{"name": "f", "polygon_m": [[0, 0], [1, 0], [-2e4, 1]]}]},
        {"bounds_m": [2e4, 0, 2e4 + 1, 1]},
    ],
    ids=["bounds", "wall", "floor", "far from the poses"],
)
def test_a_map_too_large_names_the_survey(write_log: WriteLog, pixel: object, change: dict[str, Any]) -> None:
    plan = {"bounds_m": [0, 0, 1, 1]} | change
    path = write_log({"t": 0, "image": pixel, "pose": [0, 0, 0]}, kind="survey", map=plan)
    with pytest.raises(InputError, match=r"span .* meters") as caught:
        build_library(path)
    assert caught.value.file == path


def test_nothing_to_build_from(write_log: WriteLog, pixel: object) -> None:
    with pytest.raises(InputError, match="found no picture with a pose, expected at least one"):
        build_library(write_log({"t": 0, "image": pixel, "covered": True}, kind="survey"))
    with pytest.raises(InputError, match="found a session log, expected a survey log"):
        build_library(write_log({"t": 0, "image": pixel}))
    with pytest.raises(InputError, match="found a session log, expected a survey log"):
        open_library(write_log())
