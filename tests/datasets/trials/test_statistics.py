"""Intervals by hand and by chance: coverage within four standard errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import binomtest, ttest_1samp

from benchmarks.thesis.over_particles import log_fit
from maurice_datasets.trials.statistics import (
    Clusters,
    holm,
    jackknife,
    mean,
    p_value,
    rate,
    rate_difference,
    share,
    sign_flip,
    survival,
)


def test_wilson_by_hand() -> None:
    assert (round(rate(18, 20).low, 3), round(rate(18, 20).high, 3)) == (0.699, 0.972)
    assert round(rate(20, 20).low, 3) == 0.839
    assert rate(20, 20).high == pytest.approx(1)
    assert np.isnan(rate(0, 0).value)


def test_the_jackknife_of_a_mean_is_its_interval_and_of_one_drive_there_is_none() -> None:
    values, drives = np.array([1.0, 2, 4, 4, 7, 9]), [1, 1, 2, 2, 3, 3]
    alike = Clusters.of(drives, drives)
    figure = jackknife(lambda used: float(values[used].mean()), alike)
    expected = ttest_1samp(values.reshape(3, 2).mean(axis=1), 0).confidence_interval()
    assert (figure.low, figure.high) == pytest.approx((expected.low, expected.high))
    assert (figure.count, figure.drives) == (6, 3)
    alone = jackknife(lambda used: float(values[used].mean()), Clusters.of([1] * 6, [1] * 6))
    assert alone.value == values.mean()
    assert np.isnan(alone.low)
    assert np.isnan(jackknife(lambda used: 0.0, Clusters.of([])).value)


def test_kaplan_and_meier_by_hand() -> None:
    # at 1: 1 of 5; one is censored at 2; at 3: 1 of 3; one is censored at 4; at 5: 1 of 1
    found = survival(np.array([1, 2, 3, 4, 5]), np.array([True, False, True, False, True]))
    assert found.times.tolist() == [1, 3, 5]
    assert found.share == pytest.approx([0.8, 0.8 * 2 / 3, 0])
    assert found.median == 5
    assert found.events == 3


def test_without_censoring_the_curve_is_the_empirical_one() -> None:
    times = np.random.default_rng(0).integers(1, 20, 200)
    found = survival(times, np.ones(200, bool))
    assert found.share == pytest.approx([np.mean(times > at) for at in found.times])
    assert (found.low <= found.share + 1e-12).all()
    assert (found.share <= found.high + 1e-12).all()


def test_nobody_reached_it() -> None:
    found = survival(np.array([5, 5]), np.array([False, False]))
    assert found.median == np.inf
    assert found.events == 0


def nested(rng: np.random.Generator, counts: tuple[int, int, int], alike: float) -> tuple[Clusters, Any]:
    """Return clusters of places, drives and runs, and values (N,) with mean 0 that are alike in both."""
    places, drives, runs = counts
    place = np.repeat(np.arange(places), drives * runs)
    drive = np.repeat(np.arange(places * drives), runs)
    values = rng.normal(size=len(drive)) + alike * rng.normal(size=drive.max() + 1)[drive]
    return Clusters.of(place, drive), values + (places > 1) * alike * rng.normal(size=places)[place]


@pytest.mark.parametrize(
    "counts", [(2, 1, 5), (3, 2, 2), (5, 4, 1), (5, 2, 4), (1, 8, 3), (10, 8, 1), (1, 1, 12)]
)
@pytest.mark.parametrize("alike", [0.0, 1.5])
def test_intervals_of_clustered_runs_cover_the_truth_as_often_as_they_say(
    counts: tuple[int, int, int], alike: float
) -> None:
    rng, trials = np.random.default_rng(2), 150
    alike *= counts != (1, 1, 12)  # seeds of one drive: the interval is over these
    above = 0.7  # probability of a value above this limit
    limit = ndtri(1 - above) * np.sqrt(1 + alike**2 * (2 if counts[0] > 1 else 1))
    held = np.ones((trials, 4))
    for trial in range(trials):
        clusters, values = nested(rng, counts, alike)
        x, over = 10.0 ** (np.arange(len(values)) % 3), values > limit
        figures = (
            (mean(values, clusters), 0.0),
            (share(over, clusters), above),
            (log_fit(x, values, clusters).slope, 0.0),
        )
        held[trial, :3] = [not figure.excludes(true) for figure, true in figures]
        curve = survival(np.where(over, 2.0, 1.0), ~over, clusters)
        if 0 < curve.events < len(values):
            held[trial, 3] = curve.low[0] <= above <= curve.high[0]
    assert (held.mean(axis=0) > 0.9 - 4 * np.sqrt(0.09 / trials)).all(), held.mean(axis=0)
    assert held[:, 0].mean() <= 0.99


@pytest.mark.parametrize("counts", [(5, 4, 1), (1, 10, 4), (1, 2, 1), (1, 5, 1), (1, 9, 1), (1, 12, 1)])
def test_differences_of_paired_rates_cover_the_truth(counts: tuple[int, int, int]) -> None:
    rng, held = np.random.default_rng(3), []
    for _ in range(300):
        clusters, values = nested(rng, counts, 1.0)
        before, after = (values + rng.normal(size=len(values)) > 1 for _ in range(2))
        held.append(not rate_difference(before, after, clusters).excludes(0))
    assert 0.9 - 4 * np.sqrt(0.09 / 300) < np.mean(held)


def test_copies_of_a_run_tell_nothing_more() -> None:
    rng = np.random.default_rng(1)
    values, drives = rng.normal(size=20), Clusters.of(np.arange(20))
    times, ended = rng.integers(1, 9, 20).astype(float), rng.random(20) < 0.7
    x = 10.0 ** rng.integers(0, 3, 20)
    copies = Clusters.of(np.repeat(np.arange(20), 6), np.repeat(np.arange(20), 6))
    for figure, data in (
        (mean, (values,)),
        (share, (values > 1.5,)),
        (rate_difference, (values > 1, values > 0)),
    ):
        one, many = figure(*data, drives), figure(*(np.repeat(part, 6) for part in data), copies)
        assert (one.value, many.drives, many.count) == (pytest.approx(many.value), 20, 120)
        assert one.high - one.low <= (many.high - many.low) * (1 + 1e-9)
    one, many = survival(times, ended, drives), survival(np.repeat(times, 6), np.repeat(ended, 6), copies)
    assert (one.high - one.low <= (many.high - many.low) * (1 + 1e-9)).all()
    one, many = log_fit(x, values, drives).slope, log_fit(np.repeat(x, 6), np.repeat(values, 6), copies).slope
    assert many.high - many.low == pytest.approx(one.high - one.low)


def test_a_cluster_is_within_the_one_before() -> None:
    clusters = Clusters.of(["a", "a", "b", "b"], [0, 1, 0, 0])
    zero = np.zeros(4)
    assert (clusters.count, clusters.units(zero).tolist()) == (3, [0, 0, 1, 1])  # too few places to tell
    only = Clusters.of(["a", "a"], [0, 0])
    assert (only.count, len(set(only.units(zero[:2]).tolist()))) == (1, 2)  # seeds of one drive
    many = Clusters.of(np.repeat(range(6), 2))
    assert (
        len(set(many.units(np.arange(12) % 2 - 0.5).tolist())) == 12
    )  # drives that differ as much as places
    assert len(set(many.units(np.repeat(range(6), 2) - 2.5).tolist())) == 6
    updates = Clusters.of(["a"] * 3, [0] * 3, [0] * 3)  # updates of one run
    assert np.isnan(share(np.array([True, True, False]), updates).low)
    assert np.isnan(mean(np.array([1.0, 2.0, 3.0]), updates).low)


def test_few_drives_have_no_interval_where_nothing_tells_their_spread() -> None:
    assert np.isnan(mean(np.ones(2)).low)
    assert mean(np.ones(5)).low == mean(np.ones(5)).high == 1
    assert not mean(np.ones(1)).excludes(7)
    assert rate_difference(np.zeros(2, bool), np.ones(2, bool)).low < 0
    assert mean(np.array([1.0, 3.0])).text() == "2.0 (-10.7 to 14.7)"
    assert mean(np.ones(2)).text(100, 0) == "100 (no interval)"
    assert mean(np.zeros(0)).text() == "not known"
    assert mean(np.ones(2)).to_json() == {"value": 1.0, "low": None, "high": None, "count": 2, "drives": 2}


@pytest.mark.parametrize("value", [-0.4, 0.1, 0.9])
def test_p_values_are_those_of_students_test(value: float) -> None:
    values = np.random.default_rng(5).normal(size=9)
    found = p_value(lambda level: mean(values, level=level), value)
    assert found == pytest.approx(ttest_1samp(values, value).pvalue, rel=1e-6)


def test_a_log_fit_finds_the_slope() -> None:
    rng = np.random.default_rng(3)
    x = np.tile([100.0, 1000.0, 10000.0], 30)
    drives = np.repeat(np.arange(30), 3)
    y = 5 - 2 * np.log10(x) + rng.normal(size=30)[drives] + 0.1 * rng.normal(size=90)
    fit = log_fit(x, y, Clusters.of(drives, drives))
    assert fit.slope.low < -2 < fit.slope.high
    assert fit.slope.high - fit.slope.low < 0.2
    assert fit.at(np.array([100.0])) == pytest.approx(1, abs=0.8)


def test_paired_rates_have_the_published_interval():
    before = np.array([1] * 36 + [0] * 12 + [1] * 2, bool)
    after = np.array([1] * 48 + [0] * 2, bool)
    found = rate_difference(before, after)  # Newcombe 1998, table II, method 10: 36, 12, 2, 0
    assert (round(found.value, 4), round(found.low, 4), round(found.high, 4)) == (0.2, 0.0569, 0.3404)
    back = rate_difference(after, before)
    assert (back.low, back.high) == pytest.approx((-found.high, -found.low))


@pytest.mark.parametrize("hits", [0, 1, 3, 6, 10])
def test_flipped_signs_of_hits_are_a_binomial_test(hits):
    differences = np.array([1.0] * hits + [-1.0] * (10 - hits) + [0.0] * 5)
    assert sign_flip(differences) == pytest.approx(binomtest(hits, 10).pvalue)


def test_many_differences_are_flipped_at_random_and_repeatably():
    rng = np.random.default_rng(1)
    assert sign_flip(np.ones(30)) == pytest.approx(1 / 10_001)
    values = [sign_flip(rng.normal(size=20)) for _ in range(200)]
    assert abs(np.mean(np.array(values) < 0.1) - 0.1) < 4 * np.sqrt(0.09 / 200)
    assert sign_flip(np.zeros(4)) == 1


def test_holm_is_between_bonferroni_and_no_adjustment():
    found = holm([0.01, 0.5, 0.02])
    assert found == pytest.approx([0.03, 0.5, 0.04])
    assert holm([]) == []
