"""What is kept of updates: movements as they are best known, and what speaks for the estimates."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from maurice_mcl.filter.following import MOST_NATS, SHARE, START_NATS, kept
from maurice_mcl.filter.motion import DRIFT, measured_motion
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.pose_sensor import MeasuredMovement
from maurice_mcl.values.records import Belief, Past, uniform_log_weights

SUPPORT, MOTION, BEFORE = 20.0, np.array([0.5, 0.0, 0.1]), np.array([1.0, 2.0, 0.3])
COMPARISON = SimpleNamespace(sensed=(SimpleNamespace(support=lambda pose: SUPPORT),))


def cloud(sd_m):
    poses = np.random.default_rng(1).normal(0, sd_m, (100, 3)).astype(np.float32)
    return Belief(poses, uniform_log_weights(100), np.zeros(2))


def record(predicted, estimate):
    return SimpleNamespace(
        frame=SimpleNamespace(motions=np.stack([MOTION / 2, MOTION / 2])),
        sighting=SimpleNamespace(comparison=COMPARISON),
        predicted=predicted,
        estimate=SimpleNamespace(pose=estimate),
    )


def after(estimate, movement=None, trust=30.0):
    past = (Past(np.zeros((0, 3)), (), BEFORE, 0.0, trust),)
    return kept(record(cloud(1.0), estimate), movement, past)


@pytest.mark.parametrize(("sd_m", "nats"), [(0.1, START_NATS), (5.0, 0.0)])
def test_a_start_that_somebody_gave_speaks_for_itself(sd_m, nats):
    first = kept(record(cloud(sd_m), BEFORE), None, ())
    assert first.trust == nats + SHARE * SUPPORT


def test_estimates_tell_a_movement_better_than_wheels_unless_they_jump():
    arc = compose(compose(np.zeros(3), MOTION / 2), MOTION / 2)
    near, jump = (compose(BEFORE, arc + np.array([off_m, 0, 0])) for off_m in (0.1, 3.0))
    np.testing.assert_allclose(after(near).motions, (arc + np.array([0.1, 0, 0]))[None])
    assert after(near).trust == 30 + SHARE * SUPPORT
    np.testing.assert_allclose(after(jump).motions, arc[None])
    assert after(jump).trust == SHARE * SUPPORT


@pytest.mark.parametrize(("link", "trust"), [(-0.2, 30.0), (-2.0, 0.0)])
def test_a_movement_that_a_sensor_measured_is_kept_and_a_break_ends_trust(link, trust):
    movement = MeasuredMovement(np.array([0.6, 0.0, 0.0]), np.eye(3), link)
    update = after(compose(BEFORE, movement.motion), movement)
    np.testing.assert_array_equal(update.motions, movement.motion[None])
    assert update.link == link
    assert update.trust == trust + SHARE * SUPPORT


def test_trust_is_bounded():
    assert after(compose(BEFORE, MOTION), trust=MOST_NATS).trust == MOST_NATS


def test_particles_follow_a_measured_movement_with_a_share_of_its_noise():
    n, root = 100_000, np.array([[0.3, 0, 0], [0.1, 0.2, 0], [0.05, -0.1, 0.2]])
    movement = MeasuredMovement(MOTION, root @ root.T, 0.0)
    noise = np.random.default_rng(7).standard_normal((n, 3)).astype(np.float32)
    moved = measured_motion(np.zeros((n, 3), np.float32), movement, noise).astype(np.float64)
    covariance = DRIFT**2 * movement.covariance
    error = 4 * np.sqrt(np.diag(covariance) / n)
    assert (np.abs(moved.mean(axis=0) - MOTION) < error).all()
    assert np.abs(np.cov(moved.T) - covariance).max() < 4 * 2 * covariance.max() / np.sqrt(n)
