"""Numbers with their 95 % confidence intervals: means, standard deviations, slopes through the origin."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, stdtrit

from ..values import F64, Domain, stream

CONFIDENCE_LEVEL = 0.95
TAILS = (1 - CONFIDENCE_LEVEL) / 2, (1 + CONFIDENCE_LEVEL) / 2
RESAMPLES = 2000  # of a bootstrap: enough for the 2.5th and the 97.5th percentile
MOST_ROWS = 1_000_000  # rows of a bootstrap in memory at once
LEAST_NORMAL_P = 0.01  # below this p the normal interval of an sd is not used
MOST_TESTED_VALUES = 5000  # Shapiro and Wilk's p is not accurate for more values


@dataclass(frozen=True, slots=True)
class Fitted:
    """A number that was fitted, and the interval that holds the true one 95 times in 100."""

    value: float
    low: float
    high: float

    def holds(self, true: float) -> bool:
        """Return whether a value lies in the interval, ends included."""
        return self.low <= true <= self.high


@dataclass(frozen=True, slots=True)
class Spread:
    """The distribution of errors, in their own unit."""

    count: int
    mean: Fitted
    sd: Fitted
    normal_p: float | None  # of Shapiro and Wilk's test; None where all values are alike
    beyond_3_sd: int  # how many lie further than three sd from their mean; 0.27 in 100 would be normal


def spread_of(values: F64, fitted: int = 1) -> Spread:
    """Describe errors (n,) of a fit with `fitted` constants: the mean alone, or a slope as well.

    The mean's interval is Student's; the sd's is chi-square's, or a bootstrap's where p of normality is below
    0.01. Raises ValueError if no degree of freedom is left.
    """
    free = len(values) - fitted
    if free < 1:
        raise ValueError(f"found {len(values)} values, expected more than {fitted}")
    mean = float(values.mean())
    sd = math.sqrt(float(((values - mean) ** 2).sum()) / free)
    p = normality(values)
    if p is not None and p < LEAST_NORMAL_P:
        wider = math.sqrt(len(values) / free)
        within = _bootstrap(sd, values[:, None], lambda drawn: drawn[:, :, 0].std(axis=1) * wider)
    else:
        high, low = (float(chdtri(free, tail)) for tail in TAILS)
        within = Fitted(sd, sd * math.sqrt(free / high), sd * math.sqrt(free / low))
    beyond = int((np.abs(values - mean) > 3 * sd).sum()) if p is not None else 0
    return Spread(len(values), student(mean, sd / math.sqrt(len(values)), free), within, p, beyond)


def student(value: float, error: float, free: int) -> Fitted:
    """Return a value with Student's interval, from its standard error and degrees of freedom."""
    reach = float(stdtrit(free, TAILS[1])) * error
    return Fitted(value, value - reach, value + reach)


def normality(values: F64) -> float | None:
    """Return Shapiro and Wilk's p (of the first 5000 values); None for fewer than 3 or all alike."""
    if len(values) < 3 or float(np.ptp(values)) <= 1e-12 * float(np.abs(values).max()):
        return None
    from scipy import stats

    return float(stats.shapiro(values[:MOST_TESTED_VALUES]).pvalue)


def slope(x: F64, y: F64) -> float:
    """Fit y = slope * x through the origin by least squares; x, y are (n,). Raises ValueError if x is 0."""
    square = float(x @ x)
    if square == 0:
        raise ValueError("found only zeros, expected some movement")
    return float(x @ y) / square


def slope_resampled(x: F64, y: F64) -> Fitted:
    """Fit a slope through the origin, with a bootstrap interval over pairs: for an x with errors."""
    return _bootstrap(slope(x, y), np.column_stack([x, y]), _slopes)


def _slopes(pairs: F64) -> F64:
    """Fit a slope through the origin to each of several sets of pairs (b, n, 2); returns (b,)."""
    squares = np.maximum((pairs[:, :, 0] ** 2).sum(axis=1), np.finfo(float).tiny)
    return np.asarray((pairs[:, :, 0] * pairs[:, :, 1]).sum(axis=1) / squares)


def r_squared(y: F64, residual: F64) -> float:
    """Return the share of y's variance (n,) about its mean that a fit explains; nan where y does not vary."""
    total = float(((y - y.mean()) ** 2).sum())
    return 1 - float(residual @ residual) / total if total > 0 else math.nan


def _bootstrap(value: float, rows: F64, statistic: Callable[[F64], F64]) -> Fitted:
    """Return a value with the percentiles of a statistic of 2000 samples (b, n, k) of rows (n, k)."""
    rng = stream(Domain.CALIBRATE, 0, len(rows))
    at_once = max(1, MOST_ROWS // len(rows))
    parts = [
        statistic(rows[rng.integers(0, len(rows), (min(at_once, RESAMPLES - start), len(rows)))])
        for start in range(0, RESAMPLES, at_once)
    ]
    low, high = np.quantile(np.concatenate(parts), TAILS)
    return Fitted(value, min(float(low), value), max(float(high), value))
