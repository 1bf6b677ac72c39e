"""Pose sensors: every particle is weighed at its own pose, in nats beside the channels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.config.build import adapted, available
from maurice_mcl.config.parameters import Layer, configure
from maurice_mcl.filter.following import elsewhere
from maurice_mcl.filter.proposal import density, draw_poses
from maurice_mcl.scoring.batch import run_batch
from maurice_mcl.sensor.descriptors.registry import weights_of
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.pose_sensor import EXACT, PoseProposal, Shown
from maurice_mcl.values.randomness import stream

SD_M = 0.05
LEAST = -8.0


@dataclass(frozen=True)
class Position:
    """A sensor that knows where the robot is, but for an error of a few centimeters."""

    truths: dict[int, np.ndarray]
    name: str = "position"
    silent: int = -1  # step at which it says nothing
    proposes: bool = False

    def read(self, frame):
        return None if frame.step == self.silent else self.truths[frame.step]

    def log_likelihood(self, reading, poses, origin, spread=EXACT):
        away = np.hypot(*(poses[:, :2] + origin - reading[:2]).T)
        variance = SD_M**2 + spread.position_m**2
        return np.maximum(-0.5 * away**2 / variance, LEAST).astype(np.float32)

    def propose(self, reading):
        if not self.proposes:
            return None
        return PoseProposal(reading[None], np.diag([SD_M, SD_M, 0.1])[None] ** 2, np.ones(1))

    def shown(self, reading, poses):
        return Shown(f"the robot is at {reading[0]:.2f}, {reading[1]:.2f}")


@pytest.fixture(scope="module")
def drive():
    return mcl.tiny_session()


@pytest.fixture(scope="module")
def truths(drive):
    return {moment.frame.step: moment.truth for moment in drive.moments()}


def _made(sensor, **given):
    return mcl.make_localizer(mcl.tiny_library(), particles=400, sensors=[sensor], **given)


def test_nats_of_all_sensors_add_up(drive, truths):
    sensor = Position(truths)
    plain = mcl.make_localizer(mcl.tiny_library(), particles=400)
    localizer = _made(sensor)
    frame = next(drive.moments()).frame
    state = localizer.initialize(None)
    poses = state.belief.poses
    found, alone = localizer.sensor.see(frame), plain.sensor.see(frame)
    sighting, without = localizer.sensor.at(found, poses), plain.sensor.at(alone, poses)
    nats = sensor.log_likelihood(truths[1], poses, localizer.library.origin)
    assert np.array_equal(sighting.entries, without.entries)
    assert sighting.log_likelihood == pytest.approx(without.log_likelihood + nats, rel=1e-6)
    assert found.cost == pytest.approx(alone.cost + found.sensed[0].cost, rel=1e-6)
    assert found.of_references == pytest.approx(alone.of_references)


@pytest.mark.parametrize("weight", [0.0, 0.5, 3.0])
def test_a_sensor_of_ones_own_can_be_weighted(drive, truths, weight):
    sensor, frame = Position(truths), next(drive.moments()).frame
    weights = {**weights_of("blended"), "position": weight}
    weighted, plain = _made(sensor, settings={"sensor.weights": weights}), _made(sensor)
    assert plain.sensor.weights == weighted.sensor.weights == weights_of("blended")
    poses = plain.initialize(None).belief.poses
    nats = sensor.log_likelihood(truths[1], poses, plain.library.origin)
    found = weighted.sensor.at(weighted.sensor.see(frame), poses).log_likelihood
    usual = plain.sensor.at(plain.sensor.see(frame), poses).log_likelihood
    assert found == pytest.approx(usual + (weight - 1) * nats, abs=1e-3)


def test_a_sensor_that_is_not_there_cannot_be_weighted(truths):
    with pytest.raises(
        mcl.InputError, match=r"sensor\.weights: no channel called 'position'; expected one of"
    ):
        mcl.make_localizer(mcl.tiny_library(), settings={"sensor.weights": {"color": 1, "position": 0.5}})
    with pytest.raises(mcl.InputError, match="its name is 'color', expected a lower-case word"):
        _made(Position(truths, name="color"))


def test_a_sensor_of_ones_own_leaves_the_scales_of_channels_as_they_are(truths):
    """Where places are sparse, scales are widened by the library's own pictures."""
    library = mcl.tiny_library()
    sparse = replace(library, sensors={"position": Position(truths)})
    weights = {**weights_of("blended"), "position": 0.5}
    configuration = configure([Layer("here", {"sensor.weights": weights})], ["position"])
    nearest = nearest_reference(library.poses, library.arena)
    own, plain = adapted(configuration, sparse, nearest), adapted(configure([]), library, nearest)
    assert own[1] is not None
    assert own[1] == plain[1]


def test_a_frame_that_says_nothing_changes_nothing(drive, truths):
    plain = mcl.make_localizer(mcl.tiny_library(), particles=400)
    localizer = _made(Position(truths, silent=1))
    frame = next(drive.moments()).frame
    state = plain.initialize(None)
    expected, found = (
        plain.of_session(drive).step(state, frame),
        localizer.of_session(drive).step(state, frame),
    )
    assert np.array_equal(expected[0].belief.poses, found[0].belief.poses)
    assert expected[1].calibrated_evidence == found[1].calibrated_evidence


def test_it_localizes_without_any_channel(drive, truths):
    library = replace(mcl.tiny_library(), index={})
    localizer = mcl.make_localizer(library, particles=2000, sensors=[Position(truths)])
    assert localizer.sensor.weights == {}
    steps = list(mcl.run(localizer, drive, start=None))
    moment, record = steps[-1]
    assert np.hypot(*(record.estimate.pose - moment.truth)[:2]) < 4 * SD_M
    assert record.sighting.comparison.cost.min() >= 0


def test_evidence_uses_each_particles_own_pose(drive, truths):
    """A cloud at the truth explains a precise sensor, however far the next reference is."""
    frame = next(drive.moments()).frame
    library = replace(mcl.tiny_library(), index={})
    localizer = mcl.make_localizer(library, particles=400, sensors=[Position(truths)]).of_session(drive)
    at_truth = localizer.initialize(truths[1])
    still = replace(frame, motions=np.zeros((0, 3)))
    _, record = localizer.step(at_truth, still)
    assert record.calibrated_evidence == pytest.approx(0, abs=1e-3)
    assert record.log_evidence == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("preset", ["robust", None])
def test_runs_stepped_together_are_those_stepped_alone(drive, truths, preset):
    localizer = _made(Position(truths, silent=3, proposes=True), preset=preset).of_session(drive)
    moments = list(drive.moments())
    (trace, _) = run_batch(localizer, moments, [4, 5], None)
    alone = [record for _, record in mcl.run(replace(localizer, seed=4), drive, start=None)]
    assert trace.poses == pytest.approx(np.array([record.estimate.pose for record in alone]), abs=1e-5)


def test_a_lost_robot_is_found_where_the_sensor_proposes(drive, truths):
    far = np.array([*mcl.tiny_library().poses[-1, :2], 3.0])
    settings = {"recovery.strategy": "mixture"}
    localizer = _made(Position(truths, proposes=True), settings=settings).of_session(drive)
    state = localizer.initialize(far)
    moments = list(drive.moments())
    errors = []
    for moment in moments:
        state, record = localizer.step(state, moment.frame)
        errors.append(np.hypot(*(record.estimate.pose - moment.truth)[:2]))
    assert errors[-1] < 4 * SD_M


def test_poses_are_drawn_with_the_density_they_are_said_to_have():
    """The mean of 1 / density over draws within a box, each counted once, is the volume of that box."""
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.02, 0.005], [0.0, 0.005, 0.03]])
    two = PoseProposal(
        np.array([[1.0, 2.0, 3.1], [1.5, 2.2, -3.0]]), np.stack([covariance] * 2), np.array([0.7, 0.3])
    )
    origin, n = np.array([1.0, 2.0]), 200_000
    poses = draw_poses([two], n, origin, stream(9, 1))
    assert np.abs(poses[:, 2]).max() <= np.pi + 1e-6
    inside = (np.abs(poses[:, :2] - [0.2, 0.1]) < 0.15).all(axis=1) & (np.abs(poses[:, 2]) > 3.0)
    each = 1 / density([two], poses[inside], origin)
    volume = 0.3 * 0.3 * 2 * (np.pi - 3.0)
    found, error = each.sum() / n, np.sqrt((each**2).sum()) / n
    assert abs(found - volume) < 4 * error


def test_a_cloud_that_is_together_does_not_follow_one_thing_alone_and_one_that_searches_does():
    far = np.array([[5.0, 5.0, 0.0], [-5.0, 5.0, 0.0]])
    proposal = PoseProposal(far, np.stack([np.eye(3) * 0.01] * 2), np.full(2, 0.5), np.array([True, False]))
    rng = np.random.default_rng(0)
    for deviation_m, followed in ((0.1, far[1:]), (2.0, far)):
        poses = (rng.standard_normal((500, 3)) * [deviation_m, deviation_m, 0.1]).astype(np.float32)
        cloud = mcl.Belief(poses, np.full(500, -np.log(500)), np.zeros(2))
        [left] = elsewhere([proposal], cloud, 0.5)
        np.testing.assert_array_equal(left.poses, followed)
    unmarked = PoseProposal(far, proposal.covariances, proposal.weights)
    still = mcl.Belief(np.zeros((9, 3), np.float32), np.full(9, -np.log(9)), np.zeros(2))
    np.testing.assert_array_equal(elsewhere([unmarked], still, 0.5)[0].poses, far)


def test_a_cloud_at_the_place_tracks_it_by_itself_unless_its_heading_is_open():
    """With headings all around, a hundredth of the weight near a pose is a handful of particles."""
    pose = PoseProposal(np.zeros((1, 3)), np.eye(3)[None] * 1e-4, np.ones(1))
    rng = np.random.default_rng(0)
    for deviation_rad, joins in ((0.1, 0), (0.4, 0), (1.4, 1)):
        poses = (rng.standard_normal((2000, 3)) * [0.1, 0.1, deviation_rad]).astype(np.float32)
        cloud = mcl.Belief(poses, np.full(2000, -np.log(2000)), np.zeros(2))
        assert len(elsewhere([pose], cloud, 0.5)) == joins


def test_the_mixture_with_a_pose_sensor_is_unbiased(drive, truths):
    """Weights of proposed particles sum to one on average, whatever the sensor proposes."""
    frame = next(drive.moments()).frame
    localizer = _made(Position(truths, proposes=True), settings={"recovery.strategy": "mixture"}).of_session(
        drive
    )
    state = localizer.initialize(None)
    comparison = localizer.sensor.see(frame)
    totals = []
    for seed in range(60):
        prediction = replace(localizer, seed=seed).predict(state.belief, frame)
        proposal = localizer.proposal.propose(prediction, comparison, ())
        inside = localizer.reference.entries(proposal.belief.poses, localizer.library.origin) >= 0
        totals.append(np.exp(proposal.prior_log_weights[inside]).sum() / inside.mean())
    assert abs(np.mean(totals) - 1) < 4 * np.std(totals) / np.sqrt(60) + 0.02


def test_a_library_without_landmarks_is_used_without_them():
    library = mcl.tiny_library()
    asked = configure([Layer("test", {"sensor.weights": {"color": 1.0, "landmarks": 1.0}})])
    found, missing = available(asked, library)
    assert missing == ("landmarks",)
    assert dict(found.parameters.sensor.weights) == {"color": 1.0}
    with pytest.raises(mcl.InputError, match="landmarks"):
        available(configure([Layer("test", {"sensor.weights": {"landmarks": 1.0}})]), library)
    with pytest.raises(mcl.InputError, match="hog"):
        available(configure([Layer("test", {"sensor.weights": {"color": 1.0, "hog": 1.0}})]), library)


def test_a_library_without_landmarks_is_used_without_them_and_a_warning_says_so():
    with pytest.warns(UserWarning, match=r"holds no landmarks: .*with_landmarks of maurice_loaders") as told:
        localizer = mcl.make_localizer(mcl.tiny_library(), preset="precise", particles=100)
    assert "landmarks" not in localizer.sensor.sensors
    assert told[0].filename == __file__
