"""Fusion of channels, and likelihoods from fused distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.sensor.model import (
    BLENDS,
    LIKELIHOODS,
    Blended,
    calibrated,
    exponential,
    power,
    relative_quality,
    weighted_sum,
)

EACH = pytest.mark.parametrize("name", sorted(BLENDS))
ONES = np.ones(2)


def _distances(seed=3, entries=500):
    rng = np.random.default_rng(seed)
    return np.stack([rng.gamma(2, 0.01, entries), rng.gamma(3, 0.2, entries)]).astype(np.float32)


@given(raw=st.lists(st.floats(0, 2, width=32), min_size=1, max_size=40))
def test_quality_lies_between_zero_and_one_and_falls_with_distance(raw):
    distances = np.array(raw, np.float32)
    found = relative_quality(distances)
    assert np.all((found >= 0) & (found <= 1))
    assert np.all(np.diff(found[distances.argsort()]) <= 0)
    assert np.all(found[distances == 0] == 1)


def test_qualities_and_nats_by_hand():
    assert relative_quality(np.array([0.1, 0.4, 0.2], np.float32)) == pytest.approx([0.75, 0, 0.5])
    assert np.array_equal(relative_quality(np.zeros(3, np.float32)), np.ones(3))
    distances = _distances()
    assert relative_quality(distances * 84) == pytest.approx(relative_quality(distances), abs=1e-6)
    rows = np.stack([relative_quality(row) for row in distances])
    assert np.array_equal(relative_quality(distances), rows)
    distances = np.array([[0.1, 0.2, 0.0], [3.0, 0.0, 1.5]], np.float32)
    found = calibrated(distances, np.array([2.0, 0.5]), np.array([0.1, 1.5]))
    assert found.distance == pytest.approx([2 * 1 + 0.5 * 2, 2 * 2, 0.5 * 1])
    assert found.quality == pytest.approx(1 - found.distance / 4)
    whole = calibrated(_distances(), ONES, ONES).distance
    assert np.array_equal(calibrated(_distances()[:, :10], ONES, ONES).distance, whole[:10])
    blended = _of_quality(1.0, 0.5, 0.25, 0.002)
    assert np.exp(power(blended, 1.0)) == pytest.approx(blended.quality, rel=1e-5)
    assert np.exp(power(blended, 4.0)) == pytest.approx(blended.quality**4.0, rel=1e-4)
    found = power(_of_quality(0.0, 1e-9, 1e-3, 1.0), 8.0)
    assert np.isfinite(found).all()
    assert found == pytest.approx([8 * np.log(1e-3)] * 3 + [0])
    blended = Blended(np.array([0, 0.5, 3], np.float32), np.zeros(3, np.float32))
    assert exponential(blended, 2.0).tolist() == [0, -1, -6]


@EACH
def test_every_blend_is_finite_and_falls_where_all_distances_rise(name):
    distances = np.sort(_distances(), axis=1)
    kept = distances.copy()
    found = BLENDS[name](distances, np.array([0.3, 0.7]), np.array([0.01, 0.2]))
    assert np.array_equal(distances, kept)
    for values in (found.distance, found.quality):
        assert (values.shape, values.dtype) == ((500,), np.float32)
        assert np.isfinite(values).all()
    assert np.all(found.distance >= 0)
    assert np.all((found.quality >= 0) & (found.quality <= 1))
    assert np.all(np.diff(found.distance) >= 0)
    assert np.all(np.diff(found.quality) <= 0)


@EACH
def test_blends_do_not_care_about_order_or_silent_channels(name):
    weights, scales = np.array([0.3, 0.7]), np.array([0.01, 0.2])
    once = BLENDS[name](_distances(), weights, scales)
    other = BLENDS[name](_distances()[::-1], weights[::-1], scales[::-1])
    assert other.distance == pytest.approx(once.distance, rel=1e-5)
    assert other.quality == pytest.approx(once.quality, abs=1e-5)
    scales = np.array([0.01, 0.2])
    both = BLENDS[name](_distances(), np.array([0.0, 1.0]), scales)
    alone = BLENDS[name](_distances()[1:], np.ones(1), scales[1:])
    assert both.quality == pytest.approx(alone.quality, abs=1e-5)


def test_the_sum_gives_each_channel_the_spread_of_its_weight():
    distances = _distances()
    for channel in (0, 1):
        for weight in (0.3, 0.7):
            alone = np.zeros(2)
            alone[channel] = weight
            assert weighted_sum(distances, alone, ONES).distance.std() == pytest.approx(weight, rel=1e-5)
    weights = np.array([0.3, 0.7])
    expected = 0.3 * distances[0] / distances[0].std() + 0.7 * distances[1] / distances[1].std()
    assert weighted_sum(distances, weights, ONES).distance == pytest.approx(expected, rel=1e-5)
    scaled = weighted_sum(distances * np.array([[100], [1]], np.float32), weights, ONES)
    assert scaled.distance == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("dull", [0.2, 0.3, 0.1 + 0.2])
def test_a_channel_that_tells_nothing_apart_has_no_say_in_the_sum(dull):
    distances = np.stack([np.linspace(0.1, 0.4, 50), np.full(50, dull)]).astype(np.float32)
    distances[1, ::2] = np.nextafter(distances[1, ::2], np.float32(1))  # rounding is no difference
    found = weighted_sum(distances, np.array([0.5, 0.5]), ONES)
    assert found.quality == pytest.approx(relative_quality(distances[0]), abs=1e-5)


def test_the_sum_of_one_channel_is_its_own_quality():
    found = weighted_sum(_distances()[:1], np.array([0.4]), np.ones(1))
    assert np.array_equal(found.quality, relative_quality(_distances()[0]))
    found = weighted_sum(np.full((2, 9), 0.2, np.float32), np.array([0.5, 0.5]), ONES)
    assert np.array_equal(found.quality, np.ones(9))


def _of_quality(*values):
    quality = np.array(values, np.float32)
    return Blended(1 - quality, quality)


@pytest.mark.parametrize("name", sorted(LIKELIHOODS))
def test_sharpness_multiplies(name):
    assert np.array_equal(LIKELIHOODS[name](_of_quality(0.0, 0.4, 1.0), 0.0), np.zeros(3))
    blended = _of_quality(0.1, 0.7, 0.9)
    assert LIKELIHOODS[name](blended, 6.0) == pytest.approx(3 * LIKELIHOODS[name](blended, 2.0), rel=1e-5)


@pytest.mark.parametrize("name", sorted(LIKELIHOODS))
@given(raw=st.lists(st.floats(0, 1, width=32), min_size=1, max_size=30), sharpness=st.floats(0.01, 300))
def test_finite_never_over_one_and_rising_with_quality(name, raw, sharpness):
    blended = _of_quality(*sorted(raw))
    found = LIKELIHOODS[name](blended, sharpness)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    assert np.all(found <= 0)
    assert np.all(np.diff(found) >= 0)
