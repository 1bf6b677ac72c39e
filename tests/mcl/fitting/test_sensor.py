"""Scales and weights against pictures whose right answer is known by construction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.fitting import sensor as tuning
from maurice_mcl.library.left_out import LEAST_PROBABILITY, LeftOutTable
from maurice_mcl.sensor.model import SensorModel, SensorParameters
from maurice_mcl.sensor.references import nearest_reference
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena


def _drawn(rng, scales, pictures=400, entries=30):
    """Pictures whose truth is drawn from the softmax that these scales (C,) say, so they are the best."""
    distances = rng.gamma(2.0, 1.0, (len(scales), pictures, entries)) * np.array(scales)[:, None, None] * 1.5
    cost = np.tensordot(1 / np.array(scales), distances, 1)
    gumbel = rng.gumbel(size=cost.shape)
    return tuning.Sample(distances.astype(np.float32), (gumbel - cost).argmax(axis=1).astype(np.int32))


def test_scores_by_hand():
    cost = np.array([[0.0, np.log(3.0)], [1e6, 0.0]])
    found = tuning.log_scores(cost, np.array([0, 0], np.int32))
    assert found == pytest.approx([np.log(0.75), np.log(LEAST_PROBABILITY)])
    sample = _drawn(np.random.default_rng(0), [1.0], 90)
    blocks = [
        tuning.Sample(sample.distances[:, :7], sample.truth[:7]),
        tuning.Sample(sample.distances[:, 7:], sample.truth[7:]),
    ]
    per_distance = np.array([0.8])
    assert tuning.score(blocks, per_distance) == pytest.approx(tuning.score([sample], per_distance))
    one, other = tuning.Scores(10, (-1.0,), -2.0, -3.0, -4.0), tuning.Scores(30, (-5.0,), -6.0, -7.0, -4.0)
    assert tuning.pooled([one, other]) == tuning.Scores(40, (-4.0,), -5.0, -6.0, -4.0)
    sample = _drawn(np.random.default_rng(6), [1.0, 2.0, 3.0], 5)
    (found,) = tuning.rows_of([sample], [2, 0])
    assert (found.distances == sample.distances[[2, 0]]).all()
    with pytest.raises(ValueError, match="no picture with a known pose"):
        tuning.tune(("a",), [])


@pytest.mark.parametrize("scale", [1e-4, 0.3, 50.0])
def test_the_scale_that_drew_the_truth_is_found(scale):
    found, at = tuning.fit_scale([_drawn(np.random.default_rng(1), [scale], 3000)])
    assert found == pytest.approx(scale, rel=0.08)
    assert at > -np.log(30)


def test_weights_are_found_and_at_least_as_good_as_each_alone():
    rng = np.random.default_rng(2)
    sample = _drawn(rng, [0.2, 3.0], 3000)
    noise = rng.gamma(2.0, 1.0, (1, 3000, 30)).astype(np.float32)
    all_three = tuning.Sample(np.concatenate([sample.distances, noise]), sample.truth)
    weights = tuning.fit_weights([all_three], np.array([0.2, 3.0, 1.0]))
    assert weights[:2] == pytest.approx([1, 1], rel=0.1)
    assert weights[2] < 0.06
    samples = [_drawn(np.random.default_rng(seed), [0.2, 3.0], 150) for seed in (3, 4)]
    steps = []
    tuned = tuning.tune(("a", "b"), samples, lambda done, total: steps.append((done, total)))
    assert tuned.together >= max(tuned.alone) > tuned.blind == pytest.approx(-np.log(30))
    assert steps == [(0, 3), (1, 3), (2, 3)]


def test_judged_on_what_was_fitted_it_says_what_tuning_said():
    samples = [_drawn(np.random.default_rng(5), [0.2, 3.0], 200)]
    tuned = tuning.tune(("a", "b"), samples)
    more = [tuning.Sample(np.concatenate([s.distances, s.distances[:1]]), s.truth) for s in samples]
    found = tuning.judge(tuned, more, np.array([0.0, 0.0, 1 / tuned.scales[0]]))
    assert found.together == pytest.approx(tuned.together)
    assert found.alone == pytest.approx(tuned.alone)
    assert found.before == pytest.approx(tuned.alone[0]), "a row that was not tuned counts in what was before"
    assert found.pictures == 200
    assert found.gained == pytest.approx(found.together - found.before)


def test_the_true_entry_takes_headings_of_any_size(world):
    nearest = nearest_reference(world.library.poses, world.library.arena)
    for number in (0, 77, 150):
        pose = world.library.poses[number]
        expected = tuning.true_entry(nearest, world.library, pose)
        assert expected in (number, -1)
        for turns in (-3, 1, 4):
            assert (
                tuning.true_entry(nearest, world.library, pose + np.array([0, 0, turns * 2 * np.pi]))
                == expected
            )
    assert tuning.true_entry(nearest, world.library, np.array([-5.0, 1.0, 0.0])) == -1


# Pictures to tune on: from drives, and from the library with each reference left out.


NO_WALLS = np.zeros((0, 4))


def _library(poses, walls=NO_WALLS):
    poses = np.array(poses, float)
    references = np.random.default_rng(0).random((len(poses), 6)).astype(np.float32)
    index = {"color": ChannelIndex(references, np.zeros(6, np.float32), references.max(axis=0))}
    arena = Arena((-9.0, -9.0, 9.0, 9.0), np.array(walls))
    return Library("few", poses, (None,) * len(poses), index, arena)


def _sensor(library, *channels, distances=None):
    nearest = nearest_reference(library.poses, library.arena)
    weights = dict.fromkeys(channels or ("color",), 1.0)
    return SensorModel(library, nearest, SensorParameters(weights, distances=distances or {"color": "l1"}))


def _table(library):
    return LeftOutTable.of(_sensor(library))


def test_stand_ins_by_hand():
    library = _library([[0, 0, 0], [0, 0, 2], [1, 0, 1.9], [1, 0, 0.1], [5, 0, 0]])
    assert _table(library).stand_ins.tolist() == [3, 2, 1, 0, 3]
    library = _library([[0, 0, 0], [1, 0, 0], [-2, 0, 0]], [[0.5, -8, 0.5, 8]])
    assert _table(library).stand_ins.tolist() == [2, -1, 0]
    library = _library([[0, 0, np.pi - 0.1], [1, 0, -np.pi + 0.1], [9, 9, 0]])
    assert _table(library).stand_ins.tolist() == [1, 0, -1]


@pytest.mark.parametrize("poses", [[[0, 0, 0]], [[0, 0, 0], [0, 0, 1]]])
def test_one_place_has_no_neighbor_and_gives_no_sample(poses):
    table = _table(_library(poses))
    assert (table.stand_ins == -1).all()
    assert tuning.library_samples(table) == []


def test_a_place_left_out_is_compared_with_all_others():
    library = _library([[0, 0, 0], [1, 0, 0], [2.5, 0, 0], [3.5, 0, 0], [3.5, 0, 2]])
    few, several = sorted(tuning.library_samples(_table(library)), key=lambda sample: len(sample.truth))
    references = library.index["color"].references
    place_of = np.array([0, 1, 2, 3, 3])
    assert several.distances.shape == (1, 3, 4)
    for sample, entries, truths in ((several, [0, 1, 2], [1, 0, 3]), (few, [3], [2])):
        for row, (entry, truth) in enumerate(zip(entries, truths, strict=True)):
            others = np.flatnonzero(place_of != place_of[entry])
            expected = np.abs(references[others] - references[entry]).mean(axis=1)
            assert sample.distances[0, row] == pytest.approx(expected, rel=1e-5)
            assert others[sample.truth[row]] == truth
    assert tuning.blind_score([few, several]) == pytest.approx(-(3 * np.log(4) + np.log(3)) / 4)


def test_drive_pictures_have_the_entry_nearest_to_their_truth(world):
    sensor = _sensor(world.library, "tiny", "color", distances={"color": "hellinger"})
    nearest = sensor.references
    moments = list(world.drive.moments())
    moments[2] = replace(moments[2], truth=None)
    (sample,) = tuning.drive_samples(sensor, moments, frozenset(range(8)))
    kept = [moment for moment in moments if moment.truth is not None]
    entries = [tuning.true_entry(nearest, world.library, moment.truth) for moment in kept]
    assert sample.truth.tolist() == [entry for entry in entries if entry >= 0]
    assert sample.distances.shape == (2, len(sample.truth), world.library.size)
    assert sample.distances.dtype == np.float32


def test_only_the_pictures_taken_are_measured(world):
    steps = []
    samples = tuning.drive_samples(
        _sensor(world.library), world.drive.moments(), frozenset([1, 5]), lambda d, n: steps.append((d, n))
    )
    assert sum(len(s.truth) for s in samples) <= 2
    assert steps == [(1, 2), (2, 2)]
    assert tuning.spread_out(5, 9) == frozenset(range(5))
    assert tuning.spread_out(100, 3) == frozenset([0, 50, 99])
    assert tuning.spread_out(0, 3) == frozenset()


def test_what_is_held_is_bounded_whatever_the_library(world, monkeypatch):
    sensor = _sensor(world.library, "color", "tiny")
    size = 2 * world.library.size
    monkeypatch.setattr(tuning, "MOST_DISTANCES", 10 * size)
    monkeypatch.setattr(tuning, "MOST_IN_BLOCK", 4 * size)
    assert tuning.most_pictures(sensor) == 10
    samples = tuning.library_samples(LeftOutTable.of(sensor))
    assert sum(len(s.truth) for s in samples) == 10
    assert max(len(s.truth) for s in samples) <= 4
    monkeypatch.setattr(tuning, "MOST_DISTANCES", 1)
    assert tuning.most_pictures(sensor) == 1
