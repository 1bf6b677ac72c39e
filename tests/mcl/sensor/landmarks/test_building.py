"""Landmarks of a synthetic room are built: where they are, what camera saw them, and when there are none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from helpers import expect_facts
from maurice_mcl.sensor.landmarks import building
from maurice_mcl.sensor.landmarks.building import NoLandmarks, build_landmarks, landmarks_of
from maurice_mcl.sensor.landmarks.camera import linearize
from maurice_mcl.sensor.landmarks.landmark_set import LandmarkSet
from maurice_mcl.sensor.landmarks.matching import (
    MOST_DESCRIPTOR_DISTANCE,
    RATIO_TEST,
    mutual,
    spread_out,
)
from maurice_mcl.sensor.landmarks.sensor import Landmarks

from .conftest import CAMERA, KNOWN, built


def test_landmarks_are_where_the_points_are(landmark_set, room):
    apart = np.linalg.norm(landmark_set.points[:, None] - room.points, axis=2).min(axis=1)
    assert len(apart) > 150
    assert np.median(apart) < 0.01
    assert np.percentile(apart, 95) < 0.06


def test_references_come_nearer_to_where_they_really_were(landmark_set, references):
    stated, true = references
    before, after = (np.abs(poses - true)[:, 2].mean() for poses in (stated, landmark_set.poses))
    assert after < before / 3


def test_tilt_is_fitted(landmark_set):
    assert landmark_set.fit.focal_known
    assert landmark_set.fit.camera.tilt_rad == pytest.approx(CAMERA.tilt_rad, abs=0.003)


def test_an_unknown_focal_length_is_within_its_interval(room, references):
    fit = built(room, references, None).fit
    low, high = fit.focal_interval_px
    assert not fit.focal_known
    assert abs(np.log(fit.camera.focal_px / CAMERA.focal_px)) < 4 * fit.sd[0]
    assert low < fit.camera.focal_px < high
    assert high / low < 1.05


def test_a_record_has_no_more_seen_than_could_be(landmark_set):
    assert (landmark_set.seen >= 2).all()
    assert (landmark_set.seen <= landmark_set.could_see).all()


def test_references_that_see_nothing_have_no_landmarks(tiny, room, references):
    blank = build_landmarks(tiny, None, lambda number: np.zeros((24, 32, 3), np.uint8))
    assert isinstance(blank, NoLandmarks)
    expect_facts(blank.reason, "found 0 references", "8 or more")
    missing = build_landmarks(tiny, None, lambda number: None)
    assert isinstance(missing, NoLandmarks)
    apart = [room.keypoints(pose) for pose in references[1]]
    far = references[0] + np.arange(len(apart))[:, None] * [50.0, 0, 0]
    assert isinstance(landmarks_of(apart, (144, 176), far, KNOWN), NoLandmarks)


@pytest.fixture(scope="module")
def tiny():
    from maurice_mcl.examples import tiny_library

    return tiny_library()


def test_where_no_usual_lens_fits_one_is_assumed_and_said_to_be(room, references):
    """Pictures of a view of 115 degrees, of which no header speaks."""
    seen = [room.keypoints(pose, 0.5, k) for k, pose in enumerate(references[1])]
    for one in seen:
        one.pixels[:] = (one.pixels - [87.5, 71.5]) * 0.3 + [87.5, 71.5]
    found = landmarks_of(seen, (144, 176), references[0], None)
    assert found.fit.focal_assumed
    assert not found.fit.focal_known
    assert np.degrees(found.fit.camera.view_rad) == pytest.approx(60, abs=1)
    low, high = found.fit.focal_interval_px
    assert high / low == pytest.approx(np.exp(2 * 1.96 * 0.15))
    assert Landmarks(found).summary.endswith("px (assumed)")
    assert LandmarkSet.from_arrays(found.to_arrays()).fit.focal_assumed


@pytest.mark.parametrize("known", [KNOWN, None])
def test_matches_that_agree_no_better_than_by_chance_make_no_landmarks(room, references, known):
    """Every look is found in every picture, but somewhere else each time."""
    seen = [room.keypoints(pose, 0.5, k) for k, pose in enumerate(references[1])]
    for k, one in enumerate(seen):
        one.pixels[:] = one.pixels[np.random.default_rng(k).permutation(len(one.pixels))]
    found = landmarks_of(seen, (144, 176), references[0], known)
    assert isinstance(found, NoLandmarks)
    assert "agree, as by chance: check the references' poses" in found.reason


def test_a_large_library_is_used_in_part_evenly_spread():
    grid = np.meshgrid(np.arange(30) * 0.1, np.arange(20) * 0.1, np.arange(4) * np.pi / 2)
    poses = np.stack(grid, axis=-1).reshape(-1, 3)
    np.testing.assert_array_equal(spread_out(poses, 2400), np.arange(2400))
    kept = poses[spread_out(poses, 600)]
    assert 250 < len(kept) <= 600
    places, headings = np.unique(kept[:, :2], axis=0, return_counts=True)
    assert (headings == 4).all()
    apart = np.linalg.norm(poses[:, None, :2] - places, axis=2).min(axis=1)
    assert apart.max() < 0.4


def test_views_of_a_part_of_a_library_are_numbered_as_in_the_library(room, references, monkeypatch):
    stated, true = references
    monkeypatch.setattr(building, "MOST_REFERENCES", 36)
    monkeypatch.setattr(building, "keypoints_of", lambda image: room.keypoints(true[image[0, 0, 0]], 0.5))
    library = SimpleNamespace(poses=stated, size=len(stated))
    numbered = np.ones((len(stated), 144, 176, 3), np.uint8) * np.arange(len(stated))[:, None, None, None]
    told = []
    found = build_landmarks(
        library, KNOWN, lambda number: numbered[number].astype(np.uint8), lambda *of: told.append(of)
    ).map
    used = spread_out(stated, 36)
    assert told[: len(used)] == [(done, len(used), "landmarks") for done in range(1, len(used) + 1)]
    assert told[len(used) :] == [(done, 1, "landmarks adjusted") for done in range(2)]
    assert set(found.view_of[:, 0].tolist()) <= set(used.tolist())
    assert found.poses.shape == stated.shape
    unused = np.setdiff1d(np.arange(len(stated)), used)
    np.testing.assert_array_equal(found.poses[unused], stated[unused])
    seen = linearize(CAMERA, true[found.view_of[:, 0]], found.points[found.view_of[:, 1]]).pixels
    assert np.median(np.hypot(*(seen - found.view_px).T)) < 3


def test_landmarks_are_the_same_to_the_last_bit_on_one_core_and_on_many(room, references, monkeypatch):
    arrays = []
    for cores in (1, 4):
        monkeypatch.setattr("os.cpu_count", lambda cores=cores: cores)
        arrays.append(built(room, references, KNOWN).to_arrays())
    for name, values in arrays[0].items():
        np.testing.assert_array_equal(arrays[1][name], values, err_msg=name)


def test_mutual_matches_are_each_others_nearest_and_clearly_nearer_than_the_next():
    rng = np.random.default_rng(3)
    looks = rng.random((70, 16)) ** 4
    seen = [looks[:50], looks[20:] + 0.05 * rng.random((50, 16))]
    first, second = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in seen)
    product = (first @ second.T).astype(np.float32)
    apart = np.sqrt(2 - 2 * product.astype(np.float64))
    wanted = {
        (a, b)
        for a, b in enumerate(apart.argmin(axis=1).tolist())
        if apart[:, b].argmin() == a
        and apart[a, b] < min(RATIO_TEST * np.sort(apart[a])[1], MOST_DESCRIPTOR_DISTANCE)
    }
    rows, columns, distances = mutual(product.copy())
    assert set(zip(rows.tolist(), columns.tolist(), strict=True)) == wanted
    assert len(wanted) > 15
    np.testing.assert_allclose(distances, apart[rows, columns], atol=1e-3)
