"""Poses that no reference is near to, in place or in heading: no picture tells them apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.config.parameters import PRESETS
from maurice_mcl.scoring.batch import run_batch
from maurice_mcl.sensor.references import (
    InterpolatedReference,
    InterpolationParameters,
    NearestReference,
    interpolated_reference,
    knowing_nothing,
    nearest_reference,
)
from maurice_mcl.sensor.virtual_references import virtual_references
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import Arena

ARENA = Arena((0.0, 0.0, 8.0, 3.0), np.array([[5.0, 0.0, 5.0, 2.0]]))
HERE = np.zeros(2)
METHODS = ("nearest", "interpolated", "virtual")


def _poses(headings_deg, width=8.0):
    x, y = np.meshgrid(np.arange(0.25, width, 0.5), np.arange(0.25, 3.0, 0.5))
    turned = np.radians(np.asarray(headings_deg, float))
    places = np.repeat(np.column_stack([x.ravel(), y.ravel()]), len(turned), axis=0)
    return np.column_stack([places, np.tile(turned, x.size)])


def _lookup(poses: F64, method: str) -> tuple[NearestReference | InterpolatedReference, int]:
    nearest = nearest_reference(poses, ARENA)
    if method == "nearest":
        return nearest, len(poses)
    if method == "virtual":
        poses = np.concatenate([poses, virtual_references(poses, ARENA).poses])
    return interpolated_reference(nearest, poses, ARENA, InterpolationParameters()), len(poses)


def _cloud(heading_deg, rng, n=500, low=0.0, high=8.0):
    xy = rng.uniform([low, 0.0], [high, 3.0], (n, 2))
    return np.column_stack([xy, np.full(n, np.radians(heading_deg))]).astype(np.float32)


@pytest.mark.parametrize("method", METHODS)
def test_no_picture_tells_headings_apart_that_no_reference_has(method):
    rng = np.random.default_rng(1)
    lookup, references = _lookup(_poses(np.arange(0, 91, 15)), method)
    for scale in (0.1, 3.0, 60.0):
        picture = (-scale * rng.gamma(2.0, 1.0, references)).astype(np.float32)
        a, b = (lookup.at(picture, _cloud(deg, np.random.default_rng(2)), HERE) for deg in (-160, -110))
        np.testing.assert_array_equal(a, b)
        inside = a[np.isfinite(a)]
        np.testing.assert_allclose(inside, knowing_nothing(picture), rtol=1e-6)
        assert inside.max() <= picture.max()


@pytest.mark.parametrize("method", METHODS)
def test_no_picture_tells_places_apart_that_no_reference_is_near_to(method):
    rng = np.random.default_rng(3)
    lookup, references = _lookup(_poses(np.arange(0, 360, 45), width=2.0), method)
    picture = -rng.gamma(2.0, 3.0, references).astype(np.float32)
    far = lookup.at(picture, _cloud(20, rng, low=3.4), HERE)
    np.testing.assert_allclose(far[np.isfinite(far)], knowing_nothing(picture), rtol=1e-6)
    near = lookup.at(picture, _cloud(20, rng, high=2.0), HERE)
    assert near.std() > 0.5


@pytest.mark.parametrize("headings", [6, 8, 24])
@pytest.mark.parametrize("method", METHODS)
def test_a_survey_of_all_headings_speaks_for_every_pose(method, headings):
    lookup, references = _lookup(_poses(np.arange(headings) * 360 / headings), method)
    assert not lookup.is_partial
    cloud = _cloud(130, np.random.default_rng(4))
    assert lookup.look(np.zeros(references, np.float32), cloud, HERE)[2] is None


@pytest.mark.parametrize("headings_deg", [(0, 90), (0, 90, 180, 270), np.arange(0, 91, 15), (0,)])
def test_what_a_picture_is_worth_does_not_jump_between_headings(headings_deg):
    rng = np.random.default_rng(5)
    lookup, references = _lookup(_poses(headings_deg), "interpolated")
    picture = -rng.gamma(2.0, 3.0, references).astype(np.float32)
    turn = np.radians(np.arange(-179.9, 180, 0.1)).astype(np.float32)
    values = lookup.at(picture, np.column_stack([np.full((len(turn), 2), 1.6, np.float32), turn]), HERE)
    assert np.abs(np.diff(values)).max() < 0.08 * np.ptp(picture)


def _facing_east(library: Library) -> Library:
    """Keep the references with headings from 0 to 90 degrees."""
    kept = library.poses[:, 2] < np.radians(91)
    index = {
        name: replace(one, references=one.references[kept], relevance=one.references[kept].max(axis=0))
        for name, one in library.index.items()
    }
    return replace(library, poses=library.poses[kept], pictures=(None,) * int(kept.sum()), index=index)


@pytest.mark.parametrize("preset", sorted(set(PRESETS) - {"precise", "laser", "amcl"}))
def test_a_filter_in_headings_without_references_goes_by_odometry_and_is_not_reseeded(preset):
    drive = mcl.tiny_session()
    start = np.array([0.4, 0.9, -2.2])  # and so are all pictures, which are of other headings
    localizer = mcl.make_localizer(_facing_east(mcl.tiny_library()), preset=preset).of_session(drive)
    still = [replace(m, frame=replace(m.frame, motions=np.zeros((1, 3)))) for m in drive.moments()]
    state = localizer.initialize(start)
    for moment in still * 4:
        state, record = localizer.step(state, moment.frame)
        assert "reseeded" not in record.events
        assert np.hypot(*(record.estimate.pose[:2] - start[:2])) < 0.1
    (trace,) = run_batch(localizer, still * 4, [0], start)  # the same by another way
    np.testing.assert_allclose(trace.poses[-1], record.estimate.pose)
