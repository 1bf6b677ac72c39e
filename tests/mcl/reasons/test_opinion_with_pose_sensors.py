"""What is said of a run whose pose sensors know every particle's own pose: channels alone are compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.reasons.diagnosis import DiagnosisBuilder
from maurice_mcl.reasons.explanation import explain_step
from maurice_mcl.reasons.second_opinion import SecondOpinion
from maurice_mcl.reasons.surroundings import Surroundings
from maurice_mcl.scoring.lost_signal import BeliefNumbers, LostSignal
from maurice_mcl.values.pose_sensor import EXACT, Shown


class Position:
    """A sensor that knows where the robot is, to five centimeters."""

    name = "position"

    def __init__(self, truths):
        self.truths = truths

    def read(self, frame):
        return self.truths[frame.step]

    def log_likelihood(self, reading, poses, origin, spread=EXACT):
        away = np.hypot(*(poses[:, :2] + origin - reading[:2]).T)
        return np.maximum(-0.5 * away**2 / (0.05**2 + spread.position_m**2), -8).astype(np.float32)

    def propose(self, reading):
        return None

    def shown(self, reading, poses):
        return Shown("")


@pytest.fixture(scope="module")
def drive():
    return mcl.tiny_session()


@pytest.fixture(scope="module")
def sensor(drive):
    return Position({moment.frame.step: moment.truth for moment in drive.moments()})


def made(sensor, drive, library=None):
    return mcl.make_localizer(library or mcl.tiny_library(), particles=400, sensors=sensor).of_session(drive)


def test_the_evidence_of_a_cloud_is_that_of_its_channels(drive, sensor):
    frame, found = next(drive.moments()).frame, []
    for sensors in ([], [sensor]):
        localizer = made(sensors, drive)
        found.append(localizer.step(localizer.initialize(None), frame)[1])
    alone, both = map(BeliefNumbers.of, found)
    assert found[1].calibrated_evidence < found[0].calibrated_evidence - 1
    assert both.evidence == pytest.approx(alone.evidence, abs=1e-4)
    assert both.library_mean == pytest.approx(alone.library_mean, abs=1e-4)
    assert both.library_best == pytest.approx(alone.library_best, abs=1e-4)


def test_the_second_filter_reads_channels_alone(drive, sensor):
    found = []
    for sensors in ([], [sensor]):
        localizer = made(sensors, drive)
        opinion = SecondOpinion.of(localizer)
        for _, record in mcl.run(localizer, drive):
            assert opinion.add(record) is not None
        found.append(opinion.second)
    assert found[1].weights == pytest.approx(found[0].weights, rel=1e-3)


def test_without_a_channel_nothing_is_known_without_truth(drive, sensor):
    localizer = made([sensor], drive, replace(mcl.tiny_library(), index={}))
    opinion, signal = SecondOpinion.of(localizer), LostSignal()
    steps = []
    for moment, record in mcl.run(localizer, drive):
        steps.append((replace(moment, truth=None), record))
        assert opinion.added_to(record).opinion is None
        assert signal.add(record) is None
    assert signal.summary() is None
    builder = DiagnosisBuilder(localizer)
    for moment, record in steps:
        builder.add(moment, record)
    assert builder.result() == ()


def test_references_are_judged_by_channels_and_poses_by_all(drive, sensor):
    moment = next(drive.moments())
    poses = mcl.tiny_library().poses
    away = poses[np.hypot(*(poses - moment.truth)[:, :2].T).argmax()]
    fits = []
    for sensors in ([], [sensor]):
        model = made(sensors, drive).sensor
        fits.append(Surroundings(model, 0.9).fit(model.see(moment.frame), moment.truth, away))
    alone, both = fits
    assert (both.cost, both.behind) == pytest.approx((alone.cost, alone.behind), abs=1e-4)
    assert (both.rank, both.rivals) == (alone.rank, alone.rivals)
    assert both.estimate_behind < alone.estimate_behind - 1


def test_an_explanation_says_what_a_pose_sensor_gives_of_a_weight(drive, sensor):
    moment = next(drive.moments())
    alone, both = made([], drive), made([sensor], drive)
    steps = []
    for localizer in (alone, both):
        record = localizer.step(localizer.initialize(None), moment.frame)[1]
        asked = moment.truth + np.array([0.1, 0.0, 0.0])
        steps.append(explain_step(record, localizer.sensor, moment.truth, asked, weigh=True).shown[0])
    assert steps[0].sensed == {}
    assert steps[1].sensed["position"] == pytest.approx(-2.0 * both.sensor.parameters.sharpness, abs=1e-3)
    assert steps[1].weighed - steps[1].sensed["position"] == pytest.approx(steps[0].weighed, abs=1e-3)


def test_a_pose_sensor_speaks_for_an_estimate_where_channels_tell_nothing(drive, sensor):
    def opinions(sensors, moved_m=0.0):
        localizer, found = made(sensors, drive), []
        opinion = SecondOpinion.of(localizer)
        for moment, record in mcl.run(localizer, drive):
            pose = moment.truth + np.array([moved_m, 0.0, 0.0])
            record = replace(record, estimate=replace(record.estimate, pose=pose))
            found.append(opinion.add(record))
        return np.array(found)

    def odds(shares):
        return np.log(shares / (1 - shares))

    assert (odds(opinions([sensor])) - odds(opinions([])))[3:].min() > 1.5  # the camera is not used
    assert opinions([sensor], 1.5) == pytest.approx(opinions([], 1.5), abs=0.05)
