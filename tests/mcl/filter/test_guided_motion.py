"""Guided motion: particles moved toward what a sensor proposes, and weighted so that nothing is biased."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.filter.following import DrawnNoise, GuidedMotionParameters, guided_motion
from maurice_mcl.filter.localizer import GUIDED
from maurice_mcl.filter.motion import MauriceMotion, MauriceParameters, MotionOutliers, OdometryMotion, widths
from maurice_mcl.values.geometry import wrap
from maurice_mcl.values.map import Arena, make_grid
from maurice_mcl.values.pose_sensor import PoseProposal
from maurice_mcl.values.randomness import normals, stream

N = 60_000
HERE = np.zeros(2)
GRID = make_grid(Arena((-5.0, -5.0, 5.0, 5.0), np.zeros((0, 4))), np.array([[-4.0, -4.0], [4.0, 4.0]]))
MAURICE = MauriceMotion(MauriceParameters(), GRID)
MOTIONS = ([0.0, 0.0, 0.8], [0.3, 0.0, 0.0])  # a turn, then a straight
OUTLIERS = MotionOutliers(share=0.1, widen=4.0)


def _parents(n=N):
    spread = normals(stream(9, 1, purpose=1), n) * np.array([0.05, 0.05, 0.1], np.float32)
    return spread + np.array([1.0, 0.5, 2.9], np.float32)  # headings on either side of a half turn


def _move(model):
    return lambda number, poses, noise: model.move(poses, HERE, np.array(MOTIONS[number]), noise)


def _drawn(n=N, outliers=OUTLIERS):
    drawn = np.concatenate([normals(stream(9, 2, purpose=k), n) for k in range(2)], axis=1, dtype=np.float64)
    wide = np.stack([widths(n, outliers, stream(9, 3, purpose=k)) for k in range(2)], axis=1)
    return DrawnNoise(drawn, np.repeat(wide, 3, axis=1))


def _plain(parents, move, drawn):
    noise = (drawn.normals * drawn.widths).astype(np.float32)
    return move(1, move(0, parents, noise[:, :3]), noise[:, 3:])


def _values(poses, target):
    """Functions of poses, whose means must not depend on how the poses were drawn."""
    x, y, heading = poses.astype(np.float64).T
    away = np.hypot(x - target[0], y - target[1])
    near = (away < 0.08) & (np.abs(wrap(heading - target[2])) < 0.1)
    return np.stack([np.ones(len(x)), x, y, np.cos(heading), np.sin(heading), away**2, near])


@pytest.mark.parametrize("model", [MAURICE, OdometryMotion()], ids=["maurice", "odometry"])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.05, -0.04, 0.15), (0.6, 0.3, -1.0)], ids=str)
def test_weighted_means_are_those_of_the_motion_model_wherever_the_proposal_is(model, shift):
    parents, move, drawn = _parents(), _move(model), _drawn()
    plain = _plain(parents, move, drawn)
    target = np.median(plain, axis=0).astype(np.float64) + shift
    covariance = np.array([[4e-4, 1e-4, 0.0], [1e-4, 3e-4, 5e-5], [0.0, 5e-5, 1e-4]])
    poses, correction = guided_motion(parents, move, drawn, target, covariance, 0.5, stream(9, 4))
    wanted, each = _values(plain, target), _values(poses, target) * np.exp(correction)
    error = np.sqrt((wanted.var(axis=1) + each.var(axis=1)) / N)
    off = np.abs(each.mean(axis=1) - wanted.mean(axis=1))
    assert (off < 4 * error + 1e-9).all(), off / error


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_no_weight_is_multiplied_by_more_than_the_share_allows(share):
    target, covariance = np.array([0.5, 0.9, -2.0]), 1e-4 * np.eye(3)
    of_model = _parents(5000), _move(MAURICE), _drawn(5000)
    correction = guided_motion(*of_model, target, covariance, share, stream(9, 4))[1]
    assert correction.max() <= np.log(1 / (1 - share)) + 1e-9


def test_more_particles_are_where_a_sharp_sensor_puts_the_robot():
    """Without guidance a handful of particles has all of the weight."""
    of_model = _parents(1000), _move(MAURICE), _drawn(1000, MotionOutliers())
    plain = _plain(*of_model)
    target, sd = plain[17].astype(np.float64), np.array([0.01, 0.01, 0.005])
    poses, correction = guided_motion(*of_model, target, np.diag(sd**2), 0.5, stream(9, 4))

    def size(there, prior):
        off = there - target
        off[:, 2] = wrap(off[:, 2])
        logs = prior - 0.5 * ((off / sd) ** 2).sum(axis=1)
        weights = np.exp(logs - logs.max())
        return weights.sum() ** 2 / (weights**2).sum()

    assert size(poses, correction) > 10 * size(plain, 0.0)


class Fixed:
    """A sensor that proposes one pose, with nats of a normal distribution around it."""

    name = "fixed"
    proposes = True

    def __init__(self, pose):
        self.pose = pose

    def read(self, frame):
        return frame.step

    def log_likelihood(self, reading, poses, origin, spread=None):
        away = np.hypot(poses[:, 0] + origin[0] - self.pose[0], poses[:, 1] + origin[1] - self.pose[1])
        return np.maximum(-0.5 * (away / 0.02) ** 2, -8).astype(np.float32)

    def propose(self, reading):
        return PoseProposal(self.pose[None], np.diag([4e-4, 4e-4, 1e-3])[None], np.ones(1))

    def shown(self, reading, poses):
        return mcl.Shown("fixed")


def _step(settings, pose=None, proposes=True):
    session = mcl.tiny_session()
    first, second = list(session.moments())[:2]
    sensor = Fixed(second.truth if pose is None else pose)
    sensor.proposes = proposes
    made = mcl.make_localizer(mcl.tiny_library(), particles=400, settings=settings, sensors=[sensor])
    made = made.of_session(session)
    return made.step(replace(made.initialize(first.truth), step=1), second.frame)[1]


def test_a_localizer_follows_what_a_sensor_proposes_and_a_share_of_zero_turns_that_off():
    plain, guided = (_step({"guided_motion.share": share}) for share in (0.0, 0.5))
    assert guided.effective_sample_size > plain.effective_sample_size
    assert (GUIDED in guided.events, GUIDED in plain.events) == (True, False)
    np.testing.assert_array_equal(plain.predicted.poses, _step({}, proposes=False).predicted.poses)


def test_a_proposal_that_the_cloud_does_not_track_moves_no_particle():
    far = np.array([*mcl.tiny_library().poses[-1, :2], 3.0])
    plain, guided = (_step({"guided_motion.share": share}, far) for share in (0.0, 0.5))
    np.testing.assert_array_equal(plain.predicted.poses, guided.predicted.poses)


def test_the_same_seed_repeats_a_guided_run_bit_for_bit():
    one, other = _step({}), _step({})
    np.testing.assert_array_equal(one.belief.poses, other.belief.poses)
    assert GuidedMotionParameters().share == 0.5
