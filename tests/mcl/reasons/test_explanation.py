"""Explanations add up to what the filter used, and rank as sorting ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import FilterParameters
from maurice_mcl.reasons.explanation import (
    ASKED,
    ESTIMATE,
    TRUTH,
    WINNER,
    explain_all,
    explain_step,
    nearest_entries,
    offset,
)
from maurice_mcl.sensor.distances import DISTANCES
from maurice_mcl.sensor.model import BLENDS, LIKELIHOODS, SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.library import Library

WEIGHTS = {"edges": 0.7, "color": 0.3, "tiny": 0.2}
SCALES = {"edges": 0.2, "color": 3.0, "tiny": 2.0}


def _model(world, **changes):
    parameters = replace(SensorParameters(WEIGHTS, scales=SCALES), **changes)
    return SensorModel(world.library, nearest_reference(world.library.poses, world.library.arena), parameters)


def _compare(model, world, step=0):
    return model.compare(model.measure(world.drive.all_moments[step].frame.image))


def _stepped(world, **changes):
    localizer = build_localizer(world.library, world.drive, FilterParameters(particles=200, **changes))
    moment = world.drive.all_moments[0]
    _, record = localizer.step(localizer.initialize(None), moment.frame)
    return localizer.sensor, moment, record


@pytest.mark.parametrize("blend", sorted(BLENDS))
@pytest.mark.parametrize("likelihood", sorted(LIKELIHOODS))
def test_the_losses_of_all_channels_are_minus_the_log_likelihood(world, blend, likelihood):
    model = _model(world, blend=blend, likelihood=likelihood, sharpness=2.5)
    comparison = _compare(model, world)
    for found in explain_all(comparison, model, range(0, world.library.size, 7)):
        assert sum(c.loses for c in found.channels) == pytest.approx(-found.log_likelihood, abs=1e-4)
        assert min(c.loses for c in found.channels) >= 0


def test_calibrated_losses_by_hand(world):
    model = _model(world, sharpness=2.5)
    found = explain_all(_compare(model, world), model, [11])[0]
    for channel in found.channels:
        expected = 2.5 * WEIGHTS[channel.channel] * channel.calibrated
        assert channel.loses == pytest.approx(expected, rel=1e-4)
        assert channel.calibrated == pytest.approx(channel.distance / SCALES[channel.channel], rel=1e-5)
    model = _model(world)
    exact = {name: world.library.index[name].references[17] for name in WEIGHTS}
    found = explain_all(model.compare(exact), model, [17])[0]
    assert (found.rank, found.behind) == (1, 0)
    for channel in found.channels:
        assert channel.loses == pytest.approx(0, abs=1e-4)
        assert channel.rank == 1


@pytest.mark.parametrize("distance", sorted(DISTANCES))
def test_the_losses_of_all_elements_are_the_channels(world, distance):
    model = _model(world, distances=dict.fromkeys(WEIGHTS, distance))
    for channel in explain_all(_compare(model, world), model, [5])[0].channels:
        assert float(channel.nats.sum()) == pytest.approx(channel.loses, rel=1e-4)
        assert (channel.nats >= 0).all()
        mean = float(channel.contributions.mean())
        root = distance in ("l2", "hellinger")
        assert (mean**0.5 if root else mean) == pytest.approx(channel.distance, rel=1e-3)


def test_what_channels_cost_against_the_winner_is_the_whole_gap(world):
    model = _model(world)
    comparison = _compare(model, world)
    winner = explain_all(comparison, model, [int(comparison.quality.argmax())])[0]
    assert (winner.behind, winner.rank) == (0, 1)
    assert not winner.lost_to(winner).any()
    for entry in (0, 40, 300):
        found = explain_all(comparison, model, [entry])[0]
        lost = found.lost_to(winner)
        assert lost.sum() == pytest.approx(found.behind, abs=1e-4)
        assert found.costliest(winner) is found.channels[int(lost.argmax())]


def test_ranks_are_those_of_a_sorted_list(world):
    model = _model(world)
    comparison = _compare(model, world)
    by_likelihood = np.argsort(-comparison.log_likelihood, kind="stable")
    for place in (0, 3, 100, len(by_likelihood) - 1):
        assert explain_all(comparison, model, [int(by_likelihood[place])])[0].rank == place + 1
    for number in range(len(WEIGHTS)):
        nearest = np.argsort(comparison.distances[number], kind="stable")
        for place in (0, 5, 200):
            assert explain_all(comparison, model, [int(nearest[place])])[0].channels[number].rank == place + 1
    alike = replace(comparison, log_likelihood=np.full_like(comparison.log_likelihood, -1.0))
    assert {found.rank for found in explain_all(alike, model, [0, 9, 20])} == {1}


@pytest.mark.parametrize("entry", [-1, 10**6])
def test_an_entry_that_there_is_not_is_refused(world, entry):
    model = _model(world)
    with pytest.raises(IndexError, match="there are 0 to"):
        explain_all(_compare(model, world), model, [entry])[0]


def test_a_step_shows_truth_estimate_and_winner_by_the_filters_own_rule(world):
    sensor, moment, record = _stepped(world)
    step = explain_step(record, sensor, moment.truth)
    assert [e.who for e in step.shown] == [TRUTH, ESTIMATE, WINNER]
    comparison = record.sighting.comparison
    assert step.winner.entry == int(comparison.quality.argmax())
    for who, pose in ((TRUTH, moment.truth), (ESTIMATE, record.estimate.pose)):
        found = step.of(who)
        relative = np.asarray(pose - np.append(world.library.origin, 0), np.float32)
        expected = int(sensor.references.entries(relative[None], world.library.origin)[0])
        assert (found.entry.entry if found.entry else -1) == expected
    assert step.of(TRUTH).from_truth.apart_m == 0
    assert step.of(ESTIMATE).from_estimate.apart_m == 0
    assert step.of(WINNER).from_truth == offset(step.winner.pose, moment.truth)
    sensor, _, record = _stepped(world)
    step = explain_step(record, sensor, None)
    assert [e.who for e in step.shown] == [ESTIMATE, WINNER]
    assert all(e.from_truth is None for e in step.shown)


def test_an_entry_or_a_pose_asked_for_comes_first(world):
    sensor, moment, record = _stepped(world)
    by_number = explain_step(record, sensor, moment.truth, 33).shown[0]
    assert (by_number.who, by_number.entry.entry) == (ASKED, 33)
    pose = world.library.poses[50] + (0.01, -0.01, 0.02)
    by_pose = explain_step(record, sensor, moment.truth, pose).shown[0]
    assert by_pose.entry.entry == nearest_entries(sensor, pose[None])[0] == 50
    x, y = world.library.arena.bounds[:2]
    step = explain_step(record, sensor, moment.truth, np.array([x - 9, y - 9, 0.0]), weigh=True)
    assert step.shown[0].entry is None
    assert step.shown[0].weighed == -np.inf
    number = int(np.argmax(record.sighting.entries >= 0))
    pose = record.predicted.world_poses[number]
    step = explain_step(record, sensor, moment.truth, pose, weigh=True)
    assert step.shown[0].weighed == pytest.approx(float(record.sighting.log_likelihood[number]), abs=1e-3)
    assert step.shown[0].entry.entry == record.sighting.entries[number]


def test_a_library_of_one_entry(world):
    whole = world.library
    index = {n: replace(i, references=i.references[:1]) for n, i in whole.index.items()}
    alone = Library(whole.name, whole.poses[:1], whole.pictures[:1], index, whole.arena)
    localizer = build_localizer(alone, world.drive, FilterParameters(particles=50))
    moment = world.drive.all_moments[0]
    _, record = localizer.step(localizer.initialize(None), moment.frame)
    step = explain_step(record, localizer.sensor, moment.truth, weigh=True)
    assert {e.entry.entry for e in step.shown if e.entry} == {0}
    assert step.winner.rank == step.winner.entries == 1
