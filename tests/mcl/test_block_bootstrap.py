"""The interval for a mean: laws, and how often it holds the mean when neighbors are alike."""

import numpy as np
import pytest
from scipy.signal import lfilter

from maurice_mcl.analysis.run_comparison import LEAST, autocorrelation, block_length, mean_interval
from maurice_mcl.arrays import F64

UPDATES = 120  # as long as the demo


def series(alike: float, seed: int, count: int = UPDATES) -> F64:
    """Each value is `alike` times the last plus noise; the mean is zero."""
    noise = np.random.default_rng([seed, count]).standard_normal(count + 200)
    return np.asarray(lfilter([1], [1, -alike], noise)[200:])


@pytest.mark.parametrize("alike", [0.0, 0.5, 0.8])
def test_the_interval_holds_the_mean_in_95_of_100_series(alike: float) -> None:
    drives = 400
    ends = [mean_interval(series(alike, seed)) for seed in range(drives)]
    held = np.mean([low <= 0 <= high for low, high in filter(None, ends)])
    assert abs(held - 0.95) < 4 * np.sqrt(0.95 * 0.05 / drives)


def test_an_interval_that_took_updates_for_independent_would_not() -> None:
    """What the blocks are for: with neighbors this much alike it holds the mean in half of all series."""
    drives = [series(0.8, seed) for seed in range(200)]
    held = [abs(one.mean()) < 1.96 * one.std(ddof=1) / np.sqrt(len(one)) for one in drives]
    assert np.mean(held) < 0.65


def test_blocks_are_single_values_where_neighbors_are_unlike_and_grow_with_memory() -> None:
    lengths = [np.mean([block_length(series(alike, seed)) for seed in range(50)]) for alike in (0, 0.5, 0.8)]
    assert lengths[0] < 3 < 1.5 * lengths[0] + 3 < lengths[1] < lengths[2]
    assert max(block_length(series(0.99, seed)) for seed in range(20)) == UPDATES // 6


def test_correlation_of_neighbors_is_found_without_bias() -> None:
    found = [autocorrelation(series(0.6, seed)) for seed in range(400)]
    assert abs(np.mean(found) - 0.6) < 4 * np.std(found) / np.sqrt(len(found)) + 0.01
    assert autocorrelation(np.full(9, 2.5)) == 0.0


def test_moving_and_stretching_a_series_does_the_same_to_its_interval() -> None:
    one = series(0.5, 3)
    low, high = mean_interval(one) or (0.0, 0.0)
    assert (low + high) / 2 == pytest.approx(one.mean())
    assert mean_interval(-3 * one + 7) == pytest.approx((-3 * high + 7, -3 * low + 7))


def test_it_is_the_same_every_time_and_hardly_another_with_another_seed() -> None:
    one = series(0.5, 4)
    assert mean_interval(one) == mean_interval(one)
    width = np.diff(mean_interval(one) or (0.0, 0.0))
    assert np.diff(mean_interval(one, seed=1) or (0.0, 0.0)) == pytest.approx(width, rel=0.1)


def test_a_constant_has_no_width_and_a_short_series_no_interval() -> None:
    assert mean_interval(np.full(LEAST, 0.3)) == pytest.approx((0.3, 0.3))
    assert mean_interval(np.zeros(LEAST)) == (0.0, 0.0)
    assert mean_interval(np.zeros(LEAST - 1)) is None
