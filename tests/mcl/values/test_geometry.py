from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.values.geometry import (
    angle_between,
    circular_mean,
    compose,
    compose_motions,
    inverse,
    motion_between,
    motions_between,
    path_of,
    rotated,
    wrap,
)

ANGLES = st.floats(-1000, 1000)


@given(ANGLES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_wrap_lands_in_the_range_and_keeps_the_direction(dtype, angle):
    given_angle = np.array([angle], dtype)
    wrapped = wrap(given_angle)
    assert wrapped.dtype == dtype
    assert -dtype(np.pi) <= wrapped[0] < dtype(np.pi)
    loose = 1e-3 if dtype == np.float32 else 1e-9
    assert np.exp(1j * float(wrapped[0])) == pytest.approx(np.exp(1j * float(given_angle[0])), abs=loose)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_wrap_at_the_seam(dtype):
    pi = dtype(np.pi)
    below, above = np.nextafter(pi, dtype(0)), np.nextafter(pi, dtype(4))
    seam = np.array([pi, -pi, below, -below, above, -above], dtype)
    wrapped = wrap(seam)
    assert np.all((-pi <= wrapped) & (wrapped < pi))
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * seam), abs=1e-6)


def test_wrap_leaves_what_is_in_the_range_as_it_is_and_its_argument_alone():
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, 1000).astype(np.float32)
    kept = angles.copy()
    assert np.array_equal(wrap(angles), kept)
    wrap(angles + 7)
    assert np.array_equal(angles, kept)


@pytest.mark.parametrize(
    ("a", "b", "apart"),
    [(0.1, -0.1, 0.2), (3.1, -3.1, 2 * np.pi - 6.2), (0.0, np.pi, np.pi), (7.0, 7.0 - 4 * np.pi, 0.0)],
)
def test_angle_between(a, b, apart):
    assert angle_between(a, b) == pytest.approx(apart)
    assert angle_between(b, a) == pytest.approx(apart)


@pytest.mark.parametrize(
    ("pose", "motion", "moved"),
    [
        ((1.0, 2.0, 0.0), (0.5, 0.0, 0.0), (1.5, 2.0, 0.0)),
        ((1.0, 2.0, np.pi / 2), (0.5, 0.0, 0.0), (1.0, 2.5, np.pi / 2)),
        ((1.0, 2.0, np.pi / 2), (0.0, 0.5, 0.0), (0.5, 2.0, np.pi / 2)),
        ((1.0, 2.0, 0.0), (-0.5, 0.0, 0.0), (0.5, 2.0, 0.0)),
        ((0.0, 0.0, 3.0), (0.0, 0.0, 0.5), (0.0, 0.0, 3.5 - 2 * np.pi)),
        ((0.0, 0.0, 0.0), (1.0, 0.0, np.pi / 2), (1.0, 0.0, np.pi / 2)),
    ],
    ids=["ahead", "heading north", "sideways", "reverse", "turn over the seam", "straight, then turn"],
)
def test_compose(pose, motion, moved):
    assert compose(np.array(pose), np.array(motion)) == pytest.approx(np.array(moved))


def test_motions_are_a_group_and_agree_one_by_one_and_all_at_once():
    rng = np.random.default_rng(0)
    poses = rng.uniform([-5, -5, -np.pi], [5, 5, np.pi], (50, 3))
    motions = motions_between(poses)
    assert not motions[0].any()
    for before, after, motion in zip(poses, poses[1:], motions[1:], strict=False):
        np.testing.assert_allclose(motion, motion_between(before, after), atol=1e-12)
        np.testing.assert_allclose(compose(before, motion), after, atol=1e-12)
        np.testing.assert_allclose(compose(after, inverse(motion)), before, atol=1e-12)
        joined = compose_motions(motion, inverse(motion))
        np.testing.assert_allclose(np.abs(wrap(joined)), 0, atol=1e-12)
    laid = [compose(poses[0], place) for place in path_of(motions)]
    np.testing.assert_allclose(laid, poses, atol=1e-9)


def test_vectors_turn_counter_clockwise():
    assert rotated(1.0, 0.0, np.pi / 2) == pytest.approx((0.0, 1.0))
    x, y = rotated(np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([np.pi, -np.pi / 2]))
    np.testing.assert_allclose([x, y], [[-1, 1], [0, 0]], atol=1e-12)


def test_circular_means_agree_with_the_resultant():
    mean, sd = circular_mean(np.array([np.pi - 0.1, -np.pi + 0.1]), np.array([1.0, 1.0]))
    assert abs(mean) == pytest.approx(np.pi)
    assert sd == pytest.approx(np.sqrt(-2 * np.log(np.cos(0.1))))
    mean, sd = circular_mean(np.full(1000, 1.234, np.float32), np.full(1000, 0.001))
    assert mean == pytest.approx(1.234, abs=1e-6)
    assert sd < 1e-5
    assert circular_mean(np.array([0.0, np.pi]), np.array([0.5, 0.5]))[1] > 5
    rng = np.random.default_rng(1)
    angles, weights = rng.normal(3.0, 0.7, 500), rng.random(500)
    resultant = (weights * np.exp(1j * angles)).sum() / weights.sum()
    mean, sd = circular_mean(angles, weights)
    assert mean == pytest.approx(np.angle(resultant))
    assert sd == pytest.approx(np.sqrt(-2 * np.log(abs(resultant))))
