"""The second opinion: a filter that finds the robot by itself, and contradicts an estimate elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.reasons.second_opinion import (
    LOST_BELOW,
    LOST_BELOW_ANY,
    UNUSED,
    SecondFilter,
    SecondOpinion,
    Shares,
    recalibrated,
)
from maurice_mcl.scoring.lost_signal import LostSignal
from maurice_mcl.values.records import Opinion, StepRecord


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return mcl.make_localizer(mcl.tiny_library(), particles=300).of_session(mcl.tiny_session())


@pytest.fixture(scope="module")
def records(localizer) -> list[StepRecord]:
    return [record for _, record in mcl.run(localizer, mcl.tiny_session())]


def seen(localizer: Localizer, records: list[StepRecord]) -> SecondFilter:
    second = SecondFilter.of(localizer)
    for record in records:
        second.see(record.frame.motions, record.sighting.comparison.explained.relative[0])
    return second


def away(record: StepRecord) -> np.ndarray:
    """Return a pose across the map that looks the other way."""
    middle = np.append(record.weighted.origin, 0.0)
    x, y, heading = record.estimate.pose
    return np.array([2 * middle[0] - x, 2 * middle[1] - y, heading + np.pi])


def test_it_finds_the_robot_without_being_told_where_it_begins(localizer, records):
    second = seen(localizer, records)
    right, wrong = second.shares(records[-1].estimate.pose), second.shares(away(records[-1]))
    assert right.near > wrong.near
    assert wrong.elsewhere > right.elsewhere
    assert second.weights.sum() == pytest.approx(1)


def test_the_same_records_give_the_same_shares(localizer, records):
    pose = records[-1].estimate.pose
    assert seen(localizer, records).shares(pose) == seen(localizer, records).shares(pose)


def test_a_picture_that_fits_nowhere_and_a_robot_that_leaves_the_map_are_survived(localizer, records):
    second = seen(localizer, records)
    far = np.array([[1e4, 0.0, 0.0]])
    second.see(far, records[-1].sighting.comparison.explained.relative[0])
    found = second.shares(records[-1].estimate.pose)
    assert np.isfinite([found.near, found.elsewhere]).all()
    second.see(np.empty((0, 3)), records[-1].sighting.comparison.explained.relative[0])
    assert second.shares(records[-1].estimate.pose).near > 0


def test_an_estimate_that_it_contradicts_is_less_probable(localizer, records):
    def last(wrong: bool) -> float:
        opinion = SecondOpinion.of(localizer)
        for record in records:
            estimate = replace(record.estimate, pose=away(record)) if wrong else record.estimate
            found = opinion.add(replace(record, estimate=estimate))
        assert found is not None
        assert opinion.lost == (found < LOST_BELOW)
        return found

    assert last(wrong=True) < last(wrong=False)


def test_what_contradicts_lowers_it():
    from maurice_mcl.reasons.second_opinion import OPINION, OpinionReader
    from maurice_mcl.scoring.lost_signal import BeliefNumbers

    numbers = BeliefNumbers(-2.0, -7.0, -1.0, 1.0, 0.3, 0.3)
    agrees, contradicts = (
        sum(OPINION[name] * value for name, value in OpinionReader().features(numbers, shares).items())
        for shares in (Shares(0.9, 0.01), Shares(0.0, 0.9))
    )
    assert agrees > contradicts + 3


def test_a_localizer_without_motion_model_is_refused():
    with pytest.raises(mcl.InputError, match="found no motion model"):
        SecondOpinion.of(mcl.make_localizer(mcl.tiny_library()))


def test_the_lost_signal_is_the_second_opinion_where_a_record_has_one(localizer, records):
    opinion, signal = SecondOpinion.beside(localizer), LostSignal()
    assert opinion is not None
    for record in records:
        found = opinion.added_to(record)
        assert found.opinion is not None
        assert signal.add(found) == found.opinion.not_lost
        assert not signal.probably_lost
    assert signal.add(replace(record, opinion=Opinion(0.4, LOST_BELOW))) == 0.4
    assert signal.probably_lost


def test_what_is_probably_lost_stays_so_until_it_knows_again(records):
    signal, said = LostSignal(), []
    for not_lost in (0.9, 0.3, 0.11, 0.3, 0.45, 0.11, 0.3, 0.6, 0.3):
        signal.add(replace(records[0], opinion=Opinion(not_lost, LOST_BELOW_ANY)))
        said.append(signal.probably_lost)
    assert said == [False, False, True, True, True, True, True, False, False]


def test_a_search_that_never_knew_where_it_was_is_not_lost(records):
    signal = LostSignal()
    signal.add(replace(records[0], opinion=Opinion(0.01, LOST_BELOW)))
    assert not signal.probably_lost


def test_a_picture_that_gives_no_numbers_has_no_opinion(localizer, records):
    opinion, comparison = SecondOpinion.beside(localizer), records[0].sighting.comparison
    assert opinion is not None
    broken = replace(comparison, cost=np.full_like(comparison.cost, np.nan))
    sighting = replace(records[0].sighting, comparison=broken)
    record = replace(records[0], sighting=sighting, library_evidence=broken.library_evidence)
    assert opinion.added_to(record).opinion is None
    assert opinion.added_to(records[0]).opinion is not None


def test_no_second_opinion_beside_a_filter_that_does_not_know_how_it_moves():
    assert SecondOpinion.beside(mcl.make_localizer(mcl.tiny_library())) is None


def widened(localizer: Localizer, widening: float) -> Localizer:
    parameters = replace(localizer.sensor.parameters, widening=widening)
    return replace(localizer, sensor=replace(localizer.sensor, parameters=parameters))


def stated(localizer: Localizer) -> list[tuple[float, float]]:
    """Return the log odds by channels alone and what is stated, update by update."""
    opinion, found = SecondOpinion.of(localizer), []
    for _, record in mcl.run(localizer, mcl.tiny_session()):
        found.append((opinion.add(record), opinion.raw)[::-1])
    return found


def test_a_camera_that_was_widened_states_what_it_was_measured_to_be_and_one_not_used_never_knows(localizer):
    plain = stated(widened(localizer, 1.0))
    assert all(said == pytest.approx(1 / (1 + np.exp(-raw))) for raw, said in plain)
    for raw, said in stated(widened(localizer, 4.0)):
        assert said == pytest.approx(recalibrated(raw, 4.0))
        assert said != pytest.approx(1 / (1 + np.exp(-raw)))
    assert recalibrated(8.0, 4.0) < 1 / (1 + np.exp(-8.0))  # less sure at the top
    for factor in (UNUSED, 1e4):
        assert all(said <= 0.5 for _, said in stated(widened(localizer, factor)))
