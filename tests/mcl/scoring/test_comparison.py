"""Runs against the first one: differences, where they part, and what is said over the whole drive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from helpers.step_records import at, made
from maurice_mcl.scoring.comparison import (
    LEAST_VALUES,
    ComparisonResult,
    autocorrelation,
    block_length,
    compare,
    difference_of,
    mean_interval,
    parting,
)
from maurice_mcl.scoring.events import PARTED, RunEvent
from maurice_mcl.scoring.metrics import FIRST_SCORED
from maurice_mcl.scoring.table import RunTable, TableRows
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.session import Frame, Moment

RECORD = made(at(0.0, 0.0, 1.0))
TRUTH = np.array([3.0, -2.0, 0.5])  # far from the origin, which is nobody's truth


def table(steps: Iterable[tuple[float, float]], truth: Any = TRUTH) -> RunTable:
    """A run whose estimates are so far from TRUTH along x, and turned, at step 1, 2, ..."""
    rows = TableRows()
    for number, (x_m, turned) in enumerate(steps, 1):
        estimate = replace(RECORD.estimate, pose=TRUTH + np.array([x_m, 0.0, turned]))
        frame = Frame(number, 2.0 * number, np.zeros((0, 3)), np.zeros((1, 1, 3), np.uint8), "")
        rows.add(Moment(frame, truth), replace(RECORD, estimate=estimate))
    return rows.table()


def inches(length_m: float) -> str:
    return f"{length_m / INCH_M:.1f} in"


def paired(first: list[float], other: list[float]) -> ComparisonResult:
    return compare(*(table((x_m, 0.0) for x_m in run) for run in (first, other)))


def parted(first: list[float], other: list[float]) -> RunEvent | None:
    """The event by which two runs part."""
    tables = [table((x_m, 0.0) for x_m in run) for run in (first, other)]
    return parting(*tables, ("color", "edges"), inches)


def test_errors_are_compared_with_their_sign():
    result = paired([0.30] * FIRST_SCORED, [-0.10] * FIRST_SCORED)
    assert result.position.mean == pytest.approx(-0.20)
    assert result.apart_mean_m == pytest.approx(0.40)
    assert result.heading.mean == 0.0
    first, other = table([(0.0, np.pi - 0.1)] * 4), table([(0.0, -np.pi + 0.1)] * 4)
    assert compare(first, other).heading.mean == pytest.approx(0.0)
    first, other = table([(0.0, 2 * np.pi + 0.1)] * 4), table([(0.0, -0.4)] * 4)
    assert compare(first, other).heading.mean == pytest.approx(0.3)


def test_runs_part_once_where_they_are_apart_for_two_steps():
    near, far = 11.9 * INCH_M, 12.1 * INCH_M
    runs = [0.0] * 8, [near, far, near, near, far, far, near, far]
    assert paired(*runs).parted_at == 5
    event = parted(*runs)
    assert (event.step, event.time_s, event.kind) == (6, 12.0, PARTED)
    assert event.text == "edges and color are 12.1 in apart, since step 5"
    runs = [0.0] * 6, [1.0, 1.0, 0.0, 1.0, 1.0, 1.0]
    assert (paired(*runs).parted_at, parted(*runs).step) == (1, 2)
    assert parted([0.0] * 4, [1.0, 0.0, 1.0, 0.0]) is None
    same = [0.1, 2.0, 0.3, 0.5], [0.1, 2.0, 0.3, 0.5]
    assert (paired(*same).parted_at, parted(*same)) == (None, None)
    assert paired(*same).position.mean == 0.0


def test_runs_are_compared_as_far_as_the_shorter_goes():
    result = paired([0.0] * 9, [0.5] * 6)
    assert result == paired([0.0] * 6, [0.5] * 9)
    assert (result.position.updates, result.parted_at) == (3, 1)


def noisy(mean: float, seed: int, count: int = 120) -> list[float]:
    """Errors above zero that wander."""
    noise = np.random.default_rng(seed).standard_normal(count)
    walk = [0.0]
    for value in noise:
        walk.append(0.7 * walk[-1] + 0.02 * value)
    return list(mean + np.abs(walk[1:]))


def test_effects_are_found_after_the_first_updates():
    """The interval of a run against its own copy with other noise holds zero; of a worse one it does not."""
    first = noisy(0.1, 0)
    worse = paired(first, noisy(0.2, 1))
    alike = paired(first, noisy(0.1, 1))
    assert 0.05 < worse.position.interval[0] < worse.position.mean < worse.position.interval[1] < 0.15
    assert alike.position.interval[0] < 0 < alike.position.interval[1]
    assert worse.position.worse > worse.position.better
    result = paired([0.0] * 5, [9.0, 9.0, 9.0, 1.0, 2.0])
    assert result.position.updates == 5 - FIRST_SCORED + 1
    assert result.position.mean == pytest.approx(1.5)
    assert result.position.interval is None
    assert (result.position.better, result.position.worse) == (0, 2)
    assert result.apart_most_m == pytest.approx(9.0)
    assert result.apart_mean_m == pytest.approx(30 / 5)


def test_without_truth_only_places_are_compared():
    here, there = (table([(x_m, 0.0)] * 8, truth=None) for x_m in (0.0, 1.0))
    result = compare(here, there)
    assert (result.position, result.heading) == (None, None)
    assert (result.parted_at, result.apart_most_m) == (1, pytest.approx(1.0))
    none = TableRows().table()
    assert compare(none, none) == ComparisonResult(None, None, None, None, None)
    assert parting(none, none, ("a", "b"), inches) is None


def test_runs_of_different_drives_are_compared_by_error_alone():
    """Robots at different places are no news."""
    elsewhere = table([(50.2, 0.0)] * 8, truth=TRUTH + np.array([50.0, 0.0, 0.0]))
    result = compare(table([(0.1, 0.0)] * 8), elsewhere, same_drive=False)
    assert result.position.mean == pytest.approx(0.1)
    assert (result.apart_mean_m, result.apart_most_m, result.parted_at) == (None, None, None)


# The interval for a mean: laws, and how often it holds the mean when neighbors are alike.


UPDATES = 120  # as long as the demo


def series(alike: float, seed: int, count: int = UPDATES) -> F64:
    """Each value is `alike` times the last plus noise; the mean is zero."""
    noise = np.random.default_rng([seed, count]).standard_normal(count + 200)
    return np.asarray(lfilter([1], [1, -alike], noise)[200:])


@pytest.mark.parametrize("alike", [0.0, 0.5, 0.8])
def test_the_interval_holds_the_mean_in_95_of_100_series(alike):
    drives = 200
    ends = [mean_interval(series(alike, seed)) for seed in range(drives)]
    held = np.mean([low <= 0 <= high for low, high in filter(None, ends)])
    assert abs(held - 0.95) < 4 * np.sqrt(0.95 * 0.05 / drives)


def test_the_interval_needs_the_memory_of_the_series():
    """What the blocks are for: with neighbors this much alike it holds the mean in half of all series."""
    drives = [series(0.8, seed) for seed in range(200)]
    held = [abs(one.mean()) < 1.96 * one.std(ddof=1) / np.sqrt(len(one)) for one in drives]
    assert np.mean(held) < 0.65
    lengths = [np.mean([block_length(series(alike, seed)) for seed in range(50)]) for alike in (0, 0.5, 0.8)]
    assert lengths[0] < 3 < 1.5 * lengths[0] + 3 < lengths[1] < lengths[2]
    assert max(block_length(series(0.99, seed)) for seed in range(20)) == UPDATES // 6
    found = [autocorrelation(series(0.6, seed)) for seed in range(400)]
    assert abs(np.mean(found) - 0.6) < 4 * np.std(found) / np.sqrt(len(found)) + 0.01
    assert autocorrelation(np.full(9, 2.5)) == 0.0


def test_the_interval_is_steady():
    one = series(0.5, 3)
    low, high = mean_interval(one) or (0.0, 0.0)
    assert (low + high) / 2 == pytest.approx(one.mean())
    assert mean_interval(-3 * one + 7) == pytest.approx((-3 * high + 7, -3 * low + 7))
    one = series(0.5, 4)
    assert mean_interval(one) == mean_interval(one)
    width = np.diff(mean_interval(one) or (0.0, 0.0))
    assert np.diff(mean_interval(one, seed=1) or (0.0, 0.0)) == pytest.approx(width, rel=0.1)
    assert mean_interval(np.full(LEAST_VALUES, 0.3)) == pytest.approx((0.3, 0.3))
    assert mean_interval(np.zeros(LEAST_VALUES)) == (0.0, 0.0)
    assert mean_interval(np.zeros(LEAST_VALUES - 1)) is None


def test_an_interval_beyond_every_difference_is_none():
    """One event that makes nearly all of the difference: most draws miss it."""
    values = np.full(UPDATES, 1e-3)
    values[40:43] = 1.0
    low, high = mean_interval(values) or (0.0, 0.0)
    assert high - low > 2 * values.max()
    of_event, steady = difference_of(values), difference_of(np.sin(np.arange(UPDATES, dtype=float)))
    assert of_event is not None
    assert of_event.interval is None
    assert steady is not None
    assert steady.interval is not None
