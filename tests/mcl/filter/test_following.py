"""Particles guided toward what a sensor proposes, without bias; and what is kept of updates."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.filter.following import (
    DOUBTED_NATS,
    MOST_TRUST_NATS,
    START_NATS,
    SUPPORT_SHARE,
    GuidedMotionParameters,
    GuidedProposal,
    NormalFactor,
    begun,
    guided_motion,
    is_settled,
    kept,
)
from maurice_mcl.filter.localizer import GUIDED
from maurice_mcl.filter.motion import (
    SPREAD_SHARE,
    MauriceMotion,
    MauriceParameters,
    MotionOutliers,
    OdometryMotion,
    measured_motion,
)
from maurice_mcl.filter.proposal import (
    MixtureProposal,
    MotionProposal,
    Prediction,
    Proposal,
    ProposedParticles,
)
from maurice_mcl.values.geometry import compose, wrap
from maurice_mcl.values.map import Arena, make_grid
from maurice_mcl.values.pose_sensor import MeasuredMovement, PoseProposal
from maurice_mcl.values.randomness import normals, stream
from maurice_mcl.values.records import Belief, Past, uniform_log_weights

N = 60_000
HERE = np.zeros(2)
GRID = make_grid(Arena((-5.0, -5.0, 5.0, 5.0), np.zeros((0, 4))), np.array([[-4.0, -4.0], [4.0, 4.0]]))
MAURICE = MauriceMotion(MauriceParameters(), GRID)
MOTIONS = ([0.0, 0.0, 0.8], [0.3, 0.0, 0.0])  # a turn, then a straight
OUTLIERS = MotionOutliers(share=0.1, widen=4.0)


def _prediction(n=N, model=MAURICE, outliers=OUTLIERS):
    """A cloud with headings on either side of a half turn, before two movements."""
    spread = normals(stream(9, 1, purpose=1), n) * np.array([0.05, 0.05, 0.1], np.float32)
    poses = spread + np.array([1.0, 0.5, 2.9], np.float32)
    frame = SimpleNamespace(step=2, motions=np.array(MOTIONS))
    return Prediction(Belief(poses, uniform_log_weights(n), HERE), frame, model, outliers, seed=9)


def _values(poses, target):
    """Functions of poses, whose means must not depend on how the poses were drawn."""
    x, y, heading = poses.astype(np.float64).T
    away = np.hypot(x - target[0], y - target[1])
    near = (away < 0.08) & (np.abs(wrap(heading - target[2])) < 0.1)
    return np.stack([np.ones(len(x)), x, y, np.cos(heading), np.sin(heading), away**2, near])


@pytest.mark.parametrize("model", [MAURICE, OdometryMotion()], ids=["maurice", "odometry"])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.05, -0.04, 0.15), (0.6, 0.3, -1.0)], ids=str)
def test_weighted_means_are_those_of_the_motion_model_wherever_the_proposal_is(model, shift):
    prediction = _prediction(model=model)
    plain = prediction.belief.poses
    target = np.median(plain, axis=0).astype(np.float64) + shift
    covariance = np.array([[4e-4, 1e-4, 0.0], [1e-4, 3e-4, 5e-5], [0.0, 5e-5, 1e-4]])
    guided = guided_motion(prediction, target, covariance, 0.5)
    wanted, each = (
        _values(plain, target),
        _values(guided.belief.poses, target) * np.exp(guided.correction),
    )
    error = np.sqrt((wanted.var(axis=1) + each.var(axis=1)) / N)
    off = np.abs(each.mean(axis=1) - wanted.mean(axis=1))
    assert (off < 4 * error + 1e-9).all(), off / error


@pytest.mark.parametrize("count", [1, 40])
def test_written_out_factors_solve_and_weigh_as_numpy_does(count):
    """Of one covariance for all, or of one each; correlated ones with deviations from 1 to 1000."""
    rng = np.random.default_rng(5)
    root = rng.normal(0, 1, (count, 3, 3)) * np.array([1e-3, 1.0, 0.03])[:, None]
    covariances = root @ np.swapaxes(root, 1, 2) + 1e-6 * np.eye(3)
    off = rng.normal(0, 0.1, (40, 3))
    factor = NormalFactor.of(covariances.transpose(1, 2, 0))
    solved = np.linalg.solve(covariances, off[:, :, None])[:, :, 0]
    log_density = -0.5 * (np.sum(off * solved, axis=1) + np.log(np.linalg.det(covariances)))
    np.testing.assert_allclose(factor.solved(off.T).T, solved, rtol=1e-7, atol=1e-9 * np.abs(solved).max())
    np.testing.assert_allclose(factor.log_density(off.T), log_density, rtol=1e-7)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_no_weight_is_multiplied_by_more_than_the_share_allows(share):
    target, covariance = np.array([0.5, 0.9, -2.0]), 1e-4 * np.eye(3)
    correction = guided_motion(_prediction(5000), target, covariance, share).correction
    assert correction.max() <= np.log(1 / (1 - share)) + 1e-9


def test_more_particles_are_where_a_sharp_sensor_puts_the_robot():
    """Without guidance a handful of particles has all of the weight."""
    prediction = _prediction(1000, outliers=MotionOutliers())
    plain = prediction.belief.poses
    target, sd = plain[17].astype(np.float64), np.array([0.01, 0.01, 0.005])
    guided = guided_motion(prediction, target, np.diag(sd**2), 0.5)

    def size(there, prior):
        off = there - target
        off[:, 2] = wrap(off[:, 2])
        logs = prior - 0.5 * ((off / sd) ** 2).sum(axis=1)
        weights = np.exp(logs - logs.max())
        return weights.sum() ** 2 / (weights**2).sum()

    assert size(guided.belief.poses, guided.correction) > 10 * size(plain, 0.0)


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


@pytest.mark.parametrize("proposes", [True, False])
@pytest.mark.parametrize("strategy", ["none", "mixture"])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_filter_follows_sensors_only_where_one_proposes_and_keeps_updates_only_then(
    proposes, strategy, share
):
    session, sensor = mcl.tiny_session(), Fixed(np.array([1.0, 1.0, 0.0]))
    sensor.proposes = proposes
    settings = {"recovery.strategy": strategy, "guided_motion.share": share}
    localizer = mcl.make_localizer(mcl.tiny_library(), particles=40, settings=settings, sensors=[sensor])
    localizer = localizer.of_session(session)
    mixed = strategy == "mixture"
    plain = MixtureProposal if mixed else MotionProposal
    assert type(localizer.proposal) is (GuidedProposal if proposes and (mixed or share) else plain)
    assert (localizer.proposal.mixture is not None) == mixed
    state = localizer.initialize(None)
    for moment in session.moments():
        state, _ = localizer.step(state, moment.frame)
    assert bool(state.past) == (type(localizer.proposal) is GuidedProposal)


class Still(Proposal):
    """A proposal of one's own: no particle moves."""

    def propose(self, prediction, comparison, past):
        assert past == (1,) * len(past)
        return ProposedParticles(prediction.before)

    def keep(self, record, movement, past):
        return (1, *past)


def test_a_proposal_of_ones_own_draws_the_particles_and_gets_what_it_kept():
    session = mcl.tiny_session()
    localizer = replace(mcl.make_localizer(mcl.tiny_library(), particles=40), proposal=Still())
    state = localizer.initialize(None)  # needs no motion model
    for moment in session.moments():
        before = state.belief
        state, record = localizer.step(state, moment.frame)
        assert record.predicted is before
    assert state.past == (1,) * 6


# What is kept of updates.

MASS = 0.6  # of the estimate's cluster
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
        estimate=SimpleNamespace(pose=estimate, mass=MASS),
    )


def after(estimate, movement=None, trust=30.0):
    past = (Past(np.zeros((0, 3)), (), BEFORE, 0.0, trust),)
    return kept(record(cloud(1.0), estimate), movement, past)


@pytest.mark.parametrize(("sd_m", "nats"), [(0.1, START_NATS), (5.0, 0.0)])
def test_a_start_that_somebody_gave_speaks_for_itself(sd_m, nats):
    first = kept(record(cloud(sd_m), BEFORE), None, ())
    share = 1.0 if nats else MASS  # of a cloud that searches: the rest of it is elsewhere
    assert first.trust == nats + SUPPORT_SHARE * SUPPORT * share


def test_a_start_that_the_first_reading_does_not_speak_for_is_trusted_less():
    silent = record(cloud(0.1), BEFORE)
    silent.sighting = SimpleNamespace(comparison=SimpleNamespace(sensed=()))
    assert kept(silent, None, ()).trust == DOUBTED_NATS < START_NATS


def test_a_start_that_somebody_gave_is_an_update_before_the_first():
    (start,) = begun(replace(cloud(0.1), origin=np.array([5.0, -3.0])))
    np.testing.assert_allclose(start.estimate, [5, -3, 0], atol=0.05)
    assert (len(start.motions), start.sensed, start.trust) == (0, (), DOUBTED_NATS)
    assert begun(cloud(5.0)) == ()


def test_estimates_tell_a_movement_better_than_wheels_unless_they_jump():
    arc = compose(compose(np.zeros(3), MOTION / 2), MOTION / 2)
    near, jump = (compose(BEFORE, arc + np.array([off_m, 0, 0])) for off_m in (0.1, 3.0))
    np.testing.assert_allclose(after(near).motions, (arc + np.array([0.1, 0, 0]))[None])
    assert after(near).trust == 30 + SUPPORT_SHARE * SUPPORT
    np.testing.assert_allclose(after(jump).motions, arc[None])
    assert after(jump).trust == SUPPORT_SHARE * SUPPORT


@pytest.mark.parametrize(("link", "trust"), [(-0.2, 30.0), (-2.0, 0.0)])
def test_a_movement_that_a_sensor_measured_is_kept_and_a_break_ends_trust(link, trust):
    movement = MeasuredMovement(np.array([0.6, 0.0, 0.0]), np.eye(3), link)
    update = after(compose(BEFORE, movement.motion), movement)
    np.testing.assert_array_equal(update.motions, movement.motion[None])
    assert update.link == link
    assert update.trust == trust + SUPPORT_SHARE * SUPPORT


def test_trust_is_bounded():
    assert after(compose(BEFORE, MOTION), trust=MOST_TRUST_NATS).trust == MOST_TRUST_NATS


def test_particles_follow_a_measured_movement_with_a_share_of_its_noise():
    n, root = 100_000, np.array([[0.3, 0, 0], [0.1, 0.2, 0], [0.05, -0.1, 0.2]])
    movement = MeasuredMovement(MOTION, root @ root.T, 0.0)
    noise = np.random.default_rng(7).standard_normal((n, 3)).astype(np.float32)
    moved = measured_motion(np.zeros((n, 3), np.float32), movement, noise).astype(np.float64)
    covariance = SPREAD_SHARE**2 * movement.covariance
    error = 4 * np.sqrt(np.diag(covariance) / n)
    assert (np.abs(moved.mean(axis=0) - MOTION) < error).all()
    assert np.abs(np.cov(moved.T) - covariance).max() < 4 * 2 * covariance.max() / np.sqrt(n)


@pytest.mark.parametrize(
    ("links", "settled"), [([0.0] * 4, True), ([0.0, 0.0, -0.9, 0.0], False), ([0.0] * 3, False)]
)
def test_a_robot_was_not_carried_where_the_last_readings_fit_each_other(links, settled):
    past = [Past(np.zeros((0, 3)), (), BEFORE, link, 30.0) for link in links[1:]]
    assert is_settled(links[0], past) == settled
