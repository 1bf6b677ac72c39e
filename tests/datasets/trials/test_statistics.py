"""Intervals by hand and by chance: coverage within four standard errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from maurice_datasets.trials.statistics import (
    holm,
    log_fit,
    mean,
    rate,
    rate_difference,
    sign_flip,
    survival,
)


def test_wilson_by_hand() -> None:
    assert (round(rate(18, 20).low, 3), round(rate(18, 20).high, 3)) == (0.699, 0.972)
    assert round(rate(20, 20).low, 3) == 0.839
    assert rate(20, 20).high == pytest.approx(1)
    assert np.isnan(rate(0, 0).value)


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


def test_the_mean_of_arenas_is_wider_than_that_of_drives() -> None:
    rng = np.random.default_rng(1)
    arenas = np.repeat(np.arange(10), 20)
    values = rng.normal(size=10)[arenas] + 0.1 * rng.normal(size=200)
    grouped, flat = mean(values, arenas), mean(values)
    assert grouped.value == flat.value == pytest.approx(values.mean())
    assert grouped.high - grouped.low > 2 * (flat.high - flat.low)


def test_the_interval_of_the_mean_covers_the_true_mean_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    found = [mean(rng.normal(size=40)) for _ in range(300)]
    hits = sum(one.low <= 0 <= one.high for one in found)
    assert abs(hits / 300 - 0.94) < 4 * np.sqrt(0.94 * 0.06 / 300)


def test_a_log_fit_finds_the_slope() -> None:
    rng = np.random.default_rng(3)
    x = np.tile([100.0, 1000.0, 10000.0], 30)
    drives = np.repeat(np.arange(30), 3)
    y = 5 - 2 * np.log10(x) + rng.normal(size=30)[drives] + 0.1 * rng.normal(size=90)
    fit = log_fit(x, y, drives)
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
