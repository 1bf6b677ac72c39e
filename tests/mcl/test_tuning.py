"""Scales and weights against pictures whose right answer is known by construction."""

import numpy as np
import pytest

from maurice_mcl.calibration.tuning import (
    LEAST_PROBABILITY,
    Sample,
    Scores,
    fit_scale,
    fit_weights,
    judge,
    log_scores,
    pooled,
    rows_of,
    score,
    true_entry,
    tune,
)
from maurice_mcl.sensor.references import nearest_reference


def _drawn(rng, scales, pictures=400, entries=30):
    """Pictures whose truth is drawn from the softmax that these scales (C,) say, so they are the best."""
    distances = rng.gamma(2.0, 1.0, (len(scales), pictures, entries)) * np.array(scales)[:, None, None] * 1.5
    cost = np.tensordot(1 / np.array(scales), distances, 1)
    gumbel = rng.gumbel(size=cost.shape)
    return Sample(distances.astype(np.float32), (gumbel - cost).argmax(axis=1).astype(np.int32))


def test_log_score_by_hand():
    cost = np.array([[0.0, np.log(3.0)], [1e6, 0.0]])
    found = log_scores(cost, np.array([0, 0], np.int32))
    assert found == pytest.approx([np.log(0.75), np.log(LEAST_PROBABILITY)])


def test_the_mean_is_over_pictures_not_over_blocks():
    sample = _drawn(np.random.default_rng(0), [1.0], 90)
    blocks = [
        Sample(sample.distances[:, :7], sample.truth[:7]),
        Sample(sample.distances[:, 7:], sample.truth[7:]),
    ]
    per_distance = np.array([0.8])
    assert score(blocks, per_distance) == pytest.approx(score([sample], per_distance))


@pytest.mark.parametrize("scale", [1e-4, 0.3, 50.0])
def test_the_scale_that_drew_the_truth_is_found(scale):
    found, at = fit_scale([_drawn(np.random.default_rng(1), [scale], 3000)])
    assert found == pytest.approx(scale, rel=0.08)
    assert at > -np.log(30)


def test_the_weights_that_drew_the_truth_are_found_and_noise_is_dropped():
    rng = np.random.default_rng(2)
    sample = _drawn(rng, [0.2, 3.0], 3000)
    noise = rng.gamma(2.0, 1.0, (1, 3000, 30)).astype(np.float32)
    all_three = Sample(np.concatenate([sample.distances, noise]), sample.truth)
    weights = fit_weights([all_three], np.array([0.2, 3.0, 1.0]))
    assert weights[:2] == pytest.approx([1, 1], rel=0.1)
    assert weights[2] < 0.06


def test_tuned_is_at_least_as_good_as_each_alone_and_blind():
    samples = [_drawn(np.random.default_rng(seed), [0.2, 3.0], 150) for seed in (3, 4)]
    steps = []
    tuned = tune(("a", "b"), samples, lambda done, total: steps.append((done, total)))
    assert tuned.together >= max(tuned.alone) > tuned.blind == pytest.approx(-np.log(30))
    assert steps == [(0, 3), (1, 3), (2, 3)]


def test_judged_on_what_was_fitted_it_says_what_tuning_said():
    samples = [_drawn(np.random.default_rng(5), [0.2, 3.0], 200)]
    tuned = tune(("a", "b"), samples)
    more = [Sample(np.concatenate([s.distances, s.distances[:1]]), s.truth) for s in samples]
    found = judge(tuned, more, np.array([0.0, 0.0, 1 / tuned.scales[0]]))
    assert found.together == pytest.approx(tuned.together)
    assert found.alone == pytest.approx(tuned.alone)
    assert found.before == pytest.approx(tuned.alone[0]), "a row that was not tuned counts in what was before"
    assert found.pictures == 200
    assert found.gained == pytest.approx(found.together - found.before)


def test_pooling_weighs_by_pictures():
    one, other = Scores(10, (-1.0,), -2.0, -3.0, -4.0), Scores(30, (-5.0,), -6.0, -7.0, -4.0)
    assert pooled([one, other]) == Scores(40, (-4.0,), -5.0, -6.0, -4.0)


def test_rows_of_chooses_channels_in_order():
    sample = _drawn(np.random.default_rng(6), [1.0, 2.0, 3.0], 5)
    (found,) = rows_of([sample], [2, 0])
    assert (found.distances == sample.distances[[2, 0]]).all()


def test_nothing_to_fit_on():
    with pytest.raises(ValueError, match="no picture with a known pose"):
        tune(("a",), [])


def test_the_true_entry_takes_headings_of_any_size(world):
    nearest = nearest_reference(world.library.poses, world.library.arena)
    for number in (0, 77, 150):
        pose = world.library.poses[number]
        expected = true_entry(nearest, world.library, pose)
        assert expected in (number, -1)
        for turns in (-3, 1, 4):
            assert true_entry(nearest, world.library, pose + np.array([0, 0, turns * 2 * np.pi])) == expected
    assert true_entry(nearest, world.library, np.array([-5.0, 1.0, 0.0])) == -1
