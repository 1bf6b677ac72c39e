"""A library holds what its channels measure, in the survey's order."""

from pathlib import Path

import numpy as np
import pytest

from maurice_loaders.errors import LogError
from maurice_loaders.library_build import build_library
from maurice_loaders.session_log import SessionLog
from maurice_mcl.channels import CHANNELS

from .conftest import WriteLog


def test_measures_every_picture_with_every_channel(survey: Path) -> None:
    library = build_library(survey)
    pictures = [p for p in SessionLog(survey).survey_pictures() if not p.covered]
    assert set(library.index) == set(CHANNELS)
    for name, index in library.index.items():
        rows = np.array([CHANNELS[name].describe(p.image) for p in pictures])
        assert np.array_equal(index.references, rows)
        assert np.array_equal(index.relevance, rows.max(axis=0))
        assert index.references.dtype == index.noise_floor.dtype == index.relevance.dtype == np.float32
    assert np.allclose(library.poses, [[0.5 * k, 1.0, 0.1 * k] for k in range(5)])
    assert library.pictures == tuple(p.path for p in pictures)
    assert (library.name, library.display_units) == ("place", "in")


def test_the_noise_floor_is_the_mean_of_the_covered_pictures(survey: Path) -> None:
    covered = [p.image for p in SessionLog(survey).survey_pictures() if p.covered]
    library = build_library(survey)
    for name, index in library.index.items():
        expected = np.mean([CHANNELS[name].describe(image) for image in covered], axis=0)
        assert np.allclose(index.noise_floor, expected, atol=1e-4)
    assert library.index["color"].noise_floor.max() > 0


def test_without_covered_pictures_there_is_no_floor_and_a_warning(write_log: WriteLog, pixel: object) -> None:
    path = write_log({"t": 0, "image": pixel, "pose": [1, 2, 0]}, kind="survey")
    warnings: list[str] = []
    library = build_library(path, warn=warnings.append)
    assert not library.index["color"].noise_floor.any()
    assert "lens covered" in warnings[0]
    assert library.pictures == (None,)


def test_without_a_map_all_around_is_free(survey: Path) -> None:
    library = build_library(survey)
    assert library.arena.bounds == (-1.0, 0.0, 3.0, 2.0)
    assert library.arena.walls.shape == (0, 4)


def test_poses_outside_the_map_are_told(write_log: WriteLog, pixel: object) -> None:
    records = [{"t": t, "image": pixel, "pose": [t, 0.5, 0]} for t in range(4)]
    warnings: list[str] = []
    build_library(write_log(*records, kind="survey", map={"bounds_m": [0, 0, 1.5, 1]}), warn=warnings.append)
    assert any("2 of 4 surveyed poses lie outside the map" in text for text in warnings)


def test_progress_counts_to_the_end(survey: Path) -> None:
    seen: list[tuple[int, int]] = []
    build_library(survey, progress=lambda done, total: seen.append((done, total)))
    assert seen == [(k, 7) for k in range(1, 8)]


def test_only_the_channels_asked_for(survey: Path) -> None:
    assert set(build_library(survey, ["edges"]).index) == {"edges"}
    with pytest.raises(ValueError, match="found channel 'smell', expected one of color, edges"):
        build_library(survey, ["smell"])


def test_broken_lines_stop_it_or_are_told(survey: Path) -> None:
    survey.write_text(survey.read_text() + '{"t": 99, "image": "gone.jpg", "pose": [0, 0, 0]}\n')
    with pytest.raises(LogError, match=r"survey\.log:9: gone\.jpg"):
        build_library(survey)
    warnings: list[str] = []
    assert build_library(survey, keep_going=True, warn=warnings.append).size == 5
    assert any("1 broken lines skipped, the first: " in text for text in warnings)


def test_nothing_to_build_from(write_log: WriteLog, pixel: object) -> None:
    with pytest.raises(LogError, match="found no picture with a pose, expected at least one"):
        build_library(write_log({"t": 0, "image": pixel, "covered": True}, kind="survey"))
    with pytest.raises(LogError, match="found a session log, expected a survey log"):
        build_library(write_log({"t": 0, "image": pixel}))
