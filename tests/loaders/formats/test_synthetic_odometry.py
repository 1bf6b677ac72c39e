"""Synthetic odometry leads from pose to pose, plus just the noise that it states."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.transforms import OdometryNoise, synthetic_motions
from maurice_mcl.geometry import angle_between, compose

QUIET = OdometryNoise(0.0, 0.0, 0.0)
pose = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7)).map(np.array)


@given(pose, pose)
def test_without_noise_it_leads_exactly_there(before: np.ndarray, after: np.ndarray) -> None:
    arrived = before
    for motion in synthetic_motions(before, after, QUIET, 0, 0):
        arrived = compose(arrived, motion)
    assert arrived[:2] == pytest.approx(after[:2], abs=1e-9)
    assert angle_between(arrived[2], after[2]) == pytest.approx(0, abs=1e-9)


@given(pose, pose)
def test_no_movement_is_straight_and_turn_at_once(before: np.ndarray, after: np.ndarray) -> None:
    for motion in synthetic_motions(before, after, QUIET, 0, 0):
        assert (motion[:2] == 0).all() != (motion[2] == 0)


def test_standing_still_is_no_movement() -> None:
    assert synthetic_motions(np.ones(3), np.ones(3), OdometryNoise(), 0, 0) == []


def test_the_noise_is_as_stated() -> None:
    noise = OdometryNoise(way_share=0.05, turn_share=0.1, drift_rad_per_m=0.02)
    n = 4000
    draws = [synthetic_motions(np.zeros(3), np.array([3.0, 4.0, 2.0]), noise, 7, k) for k in range(n)]
    straight, turn = (np.array([motions[k] for motions in draws]) for k in (0, 1))
    way = np.hypot(straight[:, 0], straight[:, 1])
    for sample, mean, sd in ((way, 5, 0.25), (straight[:, 2], 0, 0.1), (turn[:, 2], 2, 0.2)):
        assert abs(sample.mean() - mean) < 4 * sd / np.sqrt(n)
        assert abs(sample.std() - sd) < 4 * sd / np.sqrt(2 * n)
    assert np.allclose(straight[:, 1] / straight[:, 0], 4 / 3)
    assert (turn[:, :2] == 0).all()


def test_the_same_address_draws_the_same() -> None:
    def drawn(seed: int, step: int) -> list[float]:
        (motion,) = synthetic_motions(np.zeros(3), np.array([1.0, 0, 0]), OdometryNoise(), seed, step)
        return list(motion)

    assert drawn(1, 2) == drawn(1, 2)
    assert drawn(1, 2) != drawn(1, 3)
    assert drawn(1, 2) != drawn(2, 2)


def test_it_says_what_it_is() -> None:
    said = OdometryNoise(0.05, 0.06, 0.07).describe(3)
    assert said.startswith("odometry is synthetic")
    assert all(number in said for number in ("0.05", "0.06", "0.07", "seed 3"))
