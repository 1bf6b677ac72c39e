"""Calibration of belief: clouds whose relation to the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.step_records import made
from maurice_mcl.filter.estimate import heaviest_cluster, weighted_mean
from maurice_mcl.fitting.belief import FITS, NOT_KNOWN, OVER_FLAT, OVER_SHARP, BeliefJudge, share_denser
from maurice_mcl.values.records import Belief, StepRecord, normalize, uniform_log_weights
from maurice_viz.panels.belief import ellipse_of
from maurice_viz.style import UNITS, Scale

PARTICLES, WIDE_M, PRIOR_M = 600, 0.3, 0.6


def cloud(rng: np.random.Generator, sd_m: float, middle: tuple[float, float] = (0.0, 0.0)) -> Belief:
    places = rng.normal(size=(PARTICLES, 2)) * sd_m + middle
    poses = np.column_stack([places, 0.2 * rng.normal(size=PARTICLES)]).astype(np.float32)
    return Belief(poses, np.full(PARTICLES, -np.log(PARTICLES)), np.zeros(2))


def seen(rng: np.random.Generator, step: int, exponent: float) -> tuple[StepRecord, np.ndarray]:
    """Make an update whose likelihood is the right one to the power of an exponent."""
    prior = cloud(rng, PRIOR_M)
    truth = np.array([*(rng.normal(size=2) * PRIOR_M), 0.2 * rng.normal()])
    measured = truth[:2] + rng.normal(size=2) * WIDE_M
    logs = -0.5 * exponent * np.square((prior.poses[:, :2] - measured) / WIDE_M).sum(axis=1)
    weighted = Belief(prior.poses, normalize(prior.log_weights + logs)[0], prior.origin)
    record = made([(0.0, 0.0, 1.0)], step=step)
    record = replace(record, predicted=prior, weighted=weighted, belief=weighted)
    return replace(record, estimate=heaviest_cluster(weighted), mean_estimate=weighted_mean(weighted)), truth


def judged(exponent: float, updates: int = 150) -> BeliefJudge:
    judge, rng = BeliefJudge(), np.random.default_rng(4)
    judge.begin("drive")
    for step in range(4, 4 + updates):
        judge.add(*seen(rng, step, exponent))
    return judge


def test_a_right_likelihood_is_calibrated_and_a_wrong_one_is_told_with_its_exponent():
    found = judged(1.0).result()
    for region in found.regions:
        far = 4 * np.sqrt(region.level * (1 - region.level) / found.updates) + 0.01
        assert region.held.value == pytest.approx(region.level, abs=far)
    assert found.nees.value == pytest.approx(3, abs=0.9)
    assert found.ellipse.value == pytest.approx(0.865, abs=0.09)
    assert found.likelihood == FITS
    assert found.coverage_exponent.low < 1 < found.coverage_exponent.high
    assert found.nees_expected[0] < 3 < found.nees_expected[1]
    sharp = judged(6.0).result()
    assert sharp.likelihood == OVER_SHARP
    assert sharp.regions[1].held.value < 0.8
    assert sharp.nees.value > 4
    assert sharp.coverage_exponent.high < 0.8
    assert sharp.exponent.value * 6 == pytest.approx(1, rel=0.5)
    flat = judged(0.25, 100).result()
    assert flat.likelihood == OVER_FLAT
    assert flat.regions[0].held.value > 0.6
    assert flat.coverage_exponent.low > 1


def test_the_region_of_two_clusters_leaves_out_what_is_between_them():
    rng = np.random.default_rng(0)
    left, right = cloud(rng, 0.1, (-2.0, 0.0)), cloud(rng, 0.1, (2.0, 0.0))
    poses = np.concatenate([left.poses, right.poses])
    both = Belief(poses, np.full(2 * PARTICLES, -np.log(2 * PARTICLES)), left.origin)
    assert share_denser(both, np.array([0.0, 0.0, 0.0]), 0.1) == pytest.approx(1)
    assert share_denser(both, np.array([2.0, 0.0, 0.0]), 0.1) < 0.2
    assert share_denser(both, np.array([-2.3, 0.0, 0.0]), 0.1) > 0.9


def test_the_ellipse_on_the_map_is_the_one_that_is_counted():
    belief = cloud(np.random.default_rng(1), WIDE_M)
    drawn = ellipse_of(belief, Scale(UNITS["m"])) * [1, -1]
    spread = np.cov(belief.poses[:, :2].T, bias=True)
    off = drawn - belief.poses[:, :2].mean(axis=0)
    assert np.sqrt(np.einsum("ni,ij,nj->n", off, np.linalg.inv(spread), off)) == pytest.approx(2, rel=1e-3)
    some, scale = belief.poses[:, 0] > np.median(belief.poses[:, 0]), Scale(UNITS["m"])
    alone = Belief(belief.poses[some], uniform_log_weights(int(some.sum())), belief.origin)
    of_some, of_alone = ellipse_of(belief, scale, some), ellipse_of(alone, scale)
    assert of_some == pytest.approx(of_alone, abs=1e-3)


def test_the_first_three_updates_and_unknown_truth_do_not_count():
    judge, rng = BeliefJudge(), np.random.default_rng(0)
    judge.begin("drive")
    judge.add(*seen(rng, 3, 1.0))
    judge.add(seen(rng, 5, 1.0)[0], None)
    with pytest.raises(ValueError, match="found no update with known truth"):
        judge.result()


def test_runs_of_one_drive_are_not_more_drives():
    rng = np.random.default_rng(2)
    updates = [[seen(rng, step, 1.0) for step in range(4, 64)] for _ in range(6)]

    def result(drives):
        judge = BeliefJudge()
        for drive, run in drives:
            judge.begin(drive)
            for record, truth in run:
                judge.add(record, truth)
        return judge.result()

    def wide(found):
        return [region.held.high - region.held.low for region in found.regions]

    once, copied = result([("a", updates[0])]), result([("a", updates[0])] * 2)
    assert wide(once) == wide(copied)
    several = result([(str(number), run) for number, run in enumerate(updates)])
    assert wide(several) == wide(result([(str(number), run) for number, run in enumerate(updates)] * 2))
    few = result([(str(number), run) for number, run in enumerate(updates[:3])])
    assert np.isnan(few.exponent.low)
    assert few.likelihood == NOT_KNOWN
