"""Keypoints of a library's pictures: found once, again where the cache is damaged, and none are told."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.small_session import write_small_survey
from maurice_loaders import open_library, with_keypoints
from maurice_loaders.libraries import keypoints as loader
from maurice_loaders.libraries.completed import completed
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.values import SessionInfo


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("MAURICE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def survey(tmp_path):
    """Nine pictures with corners, each at its own place."""
    log = tmp_path / "survey.log"
    with SessionWriter(log, SessionInfo("corners", "m"), "survey") as writer:
        for number in range(9):
            blocks = np.random.default_rng(number).integers(0, 256, (12, 16, 1), np.uint8)
            image = np.repeat(np.kron(blocks, np.ones((10, 10, 1), np.uint8)), 3, axis=2)
            writer.image(float(number), image, pose=np.array([number * 0.5, 0.0, 0.0]))
    return log


def test_they_are_found_once_and_kept(cache, survey, monkeypatch):
    first = with_keypoints(open_library(survey)).sensors["keypoints"]
    assert len(first.pixels) > 9 * 20
    monkeypatch.setattr(loader, "keypoints_of", lambda image: pytest.fail("found again"))
    again = with_keypoints(open_library(survey)).sensors["keypoints"]
    np.testing.assert_array_equal(again.descriptors, first.descriptors)
    library = with_keypoints(open_library(survey))
    assert with_keypoints(library) is library


@pytest.mark.parametrize("damage", [b"", b"PK not a zip", None])
def test_a_damaged_cache_is_found_again(cache, survey, damage):
    first = with_keypoints(open_library(survey)).sensors["keypoints"]
    (file,) = (cache / "keypoints").glob("*.npz")
    file.write_bytes(file.read_bytes()[:-200] if damage is None else damage)
    again = with_keypoints(open_library(survey)).sensors["keypoints"]
    np.testing.assert_array_equal(again.descriptors, first.descriptors)


def test_plain_pictures_have_none_and_that_is_told(cache, tmp_path):
    write_small_survey(tmp_path)
    told = []
    library = with_keypoints(open_library(tmp_path / "survey.log"), warn=told.append)
    (warning,) = told
    assert "no reference is verified" in warning
    assert not len(library.sensors["keypoints"].pixels)


def test_only_filters_that_verify_have_them_and_filters_of_one_kind_share_a_library(cache, survey):
    library = open_library(survey)
    weights = [{"color": 1.0}, {"color": 1.0, "keypoints": 0.1}, {"edges": 1.0, "keypoints": 0.2}]
    asked = [configure([Layer("test", {"sensor.weights": weight})]) for weight in weights]
    plain, verified, alike = completed(asked, library)
    assert plain is library
    assert "keypoints" not in plain.sensors
    assert verified is alike
    assert set(verified.sensors) == {"keypoints"}
