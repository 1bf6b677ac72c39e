"""The cache: built once, by content, fixed when damaged, safe for two at once."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from maurice_loaders.errors import InputError
from maurice_loaders.libraries import store as library_store
from maurice_loaders.libraries.store import build_library, library_key, open_library, save_library
from maurice_mcl.library import Library


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Every survey that was really built."""
    built: list[Path] = []

    def spy(survey: Path, *args: Any, **options: Any) -> Library:
        built.append(survey)
        return build_library(survey, *args, **options)

    monkeypatch.setattr(library_store, "build_library", spy)
    return built


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


def test_content_decides(survey: Path) -> None:
    key = library_key(survey)
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


def test_the_place_does_not(survey: Path, tmp_path: Path) -> None:
    key = library_key(survey)
    (tmp_path / "there").mkdir()
    for name in ("pictures", "survey.log"):
        (survey.parent / name).rename(tmp_path / "there" / name)
    assert library_key(tmp_path / "there/survey.log") == key


@pytest.mark.parametrize("part", ["manifest.json", "entries.parquet", "color-*.npz", "pictures/00000.jpg"])
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


def test_a_session_is_no_library(write_log: Any) -> None:
    with pytest.raises(InputError, match="found a session log, expected a survey log"):
        open_library(write_log())
