"""Intervals for what trials show: rates, means over arenas and drives, times that may be censored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.arrays import F64, Bool

SEED, RESAMPLES, Z = 0, 2000, 1.959964  # of the bootstrap; two-sided 95 percent


@dataclass(frozen=True, slots=True)
class Interval:
    """A figure and its 95 percent interval."""

    value: float
    low: float
    high: float
    count: int  # runs

    def excludes(self, value: float) -> bool:
        """Return whether a value lies outside the interval."""
        return not self.low <= value <= self.high


def rate(hits: int, count: int) -> Interval:
    """Return a share with its Wilson interval (Wilson 1927).

    >>> from maurice_datasets.trials.statistics import rate
    >>> found = rate(18, 20)
    >>> round(found.low, 2), round(found.high, 2)
    (0.7, 0.97)
    """
    if count == 0:
        return Interval(np.nan, np.nan, np.nan, 0)
    p, n = hits / count, count
    middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
    reach = Z * np.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n)) / (1 + Z * Z / n)
    return Interval(p, max(float(middle - reach), 0.0), min(float(middle + reach), 1.0), n)


def rate_difference(before: Bool, after: Bool) -> Interval:
    """Return by how much a rate differs between two flags (N,) of the same runs, after less before.

    The interval is Newcombe's for paired rates (1998, method 10), from both Wilson intervals.

    >>> from maurice_datasets.trials.statistics import rate_difference
    >>> import numpy as np
    >>> found = rate_difference(np.ones(20, bool), np.arange(20) < 15)
    >>> found.value, round(found.low, 2), round(found.high, 2)
    (-0.25, -0.47, -0.04)
    """
    before, after = np.asarray(before, bool), np.asarray(after, bool)
    first, second = rate(int(before.sum()), len(before)), rate(int(after.sum()), len(after))
    both, neither = int((before & after).sum()), int((~before & ~after).sum())
    lost, won = int((before & ~after).sum()), int((~before & after).sum())
    margins = float((both + lost) * (won + neither) * (both + won) * (lost + neither))
    alike = 0.0 if margins == 0 else (both * neither - lost * won) / np.sqrt(margins)
    down, up = second.value - second.low, second.high - second.value
    fell, rose = first.high - first.value, first.value - first.low
    low = np.sqrt(max(down**2 - 2 * alike * down * fell + fell**2, 0.0))
    high = np.sqrt(max(up**2 - 2 * alike * up * rose + rose**2, 0.0))
    value = second.value - first.value
    return Interval(value, value - float(low), value + float(high), len(before))


def mean(values: F64, groups: F64 | None = None) -> Interval:
    """Return the mean (N,) with a bootstrap interval that draws groups, then members of each (N,).

    Runs in one arena are alike, so arenas are drawn first. Without groups, or with one, members alone are.
    """
    values = np.asarray(values, np.float64)
    if len(values) == 0:
        return Interval(np.nan, np.nan, np.nan, 0)
    means = _resampled_means(values, np.zeros(len(values)) if groups is None else np.asarray(groups))
    low, high = np.percentile(means, (2.5, 97.5))
    return Interval(float(values.mean()), float(low), float(high), len(values))


def _resampled_means(values: F64, groups: F64) -> F64:
    """Return means (RESAMPLES,) of samples: as many groups as there are, as many members as each has."""
    rng = np.random.default_rng(SEED)
    names, of = np.unique(groups, return_inverse=True)
    sizes = np.bincount(of)
    padded = np.zeros((len(names), sizes.max()))
    for number in range(len(names)):
        padded[number, : sizes[number]] = values[of == number]
    chosen = rng.integers(len(names), size=(RESAMPLES, len(names)))
    sums, counts = np.zeros(RESAMPLES), sizes[chosen].sum(axis=1)
    for group in chosen.T:
        size = sizes[group][:, None]
        drawn = (rng.random((RESAMPLES, padded.shape[1])) * size).astype(int)
        inside = np.arange(padded.shape[1]) < size
        sums += np.where(inside, padded[group[:, None], drawn], 0).sum(axis=1)
    return np.asarray(sums / counts)


@dataclass(frozen=True, slots=True)
class Survival:
    """A Kaplan-Meier curve: the share that is still without the event after each time (K,)."""

    times: F64
    share: F64
    low: F64
    high: F64
    at_risk: int
    events: int

    def time_at(self, share: float) -> float:
        """Return the first time at which the share is that small; inf if it never is."""
        reached = np.flatnonzero(self.share <= share + 1e-12)
        return float(self.times[reached[0]]) if len(reached) else np.inf

    @property
    def median(self) -> float:
        """The time by which half have had the event; inf where fewer have."""
        return self.time_at(0.5)

    @property
    def median_interval(self) -> tuple[float, float]:
        """Where the limits of the curve cross a half (Brookmeyer and Crowley 1982)."""
        early, late = np.flatnonzero(self.low <= 0.5), np.flatnonzero(self.high <= 0.5)
        first, last = (float(self.times[found[0]]) if len(found) else np.inf for found in (early, late))
        return first, last


def survival(times: F64, happened: Bool) -> Survival:
    """Return the Kaplan-Meier curve of times (N,) to an event, or (not `happened`) to the end of watching.

    Limits are Greenwood's on the log-log scale (Kalbfleisch and Prentice 1980).
    """
    times, happened = np.asarray(times, np.float64), np.asarray(happened, bool)
    at = np.unique(times[happened])
    risk = np.array([(times >= one).sum() for one in at], np.float64)
    died = np.array([((times == one) & happened).sum() for one in at], np.float64)
    share: F64 = np.asarray(np.cumprod(1 - died / risk), np.float64)
    low, high = _limits(share, risk, died)
    return Survival(at, share, low, high, len(times), int(happened.sum()))


def _limits(share: F64, risk: F64, died: F64) -> tuple[F64, F64]:
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.sqrt(np.cumsum(died / (risk * (risk - died)))) / np.abs(np.log(share))
        reach = np.exp(Z * spread)
        low, high = share**reach, share ** (1 / reach)
    open_ = (share > 0) & (share < 1) & np.isfinite(spread)
    return np.where(open_, low, 0.0 * share), np.where(
        open_, high, np.where(share > 0, 1.0, high_at_zero(risk))
    )


def high_at_zero(risk: F64) -> F64:
    """Return the upper limit where all have had the event: Wilson's for none of those last at risk."""
    return np.array([rate(0, int(max(one, 1))).high for one in risk], np.float64)


@dataclass(frozen=True, slots=True)
class LogFit:
    """y = intercept + slope * log10(x), by least squares; the slope with a bootstrap interval."""

    intercept: float
    slope: Interval

    def at(self, x: F64) -> F64:
        """Return the fitted values (N,) at some x (N,)."""
        return np.asarray(self.intercept + self.slope.value * np.log10(x))


def log_fit(x: F64, y: F64, groups: F64) -> LogFit:
    """Fit y (N,) against the decimal log of x (N,); the interval draws whole groups (N,), as drives."""
    x, y = np.log10(np.asarray(x, np.float64)), np.asarray(y, np.float64)
    slope, intercept = np.polyfit(x, y, 1)
    rng = np.random.default_rng(SEED)
    names, of = np.unique(groups, return_inverse=True)
    sums = np.stack([np.bincount(of, weights) for weights in (np.ones(len(x)), x, y, x * x, x * y)], axis=1)
    n, sx, sy, sxx, sxy = sums[rng.integers(len(names), size=(RESAMPLES, len(names)))].sum(axis=1).T
    slopes = (n * sxy - sx * sy) / (n * sxx - sx * sx)
    low, high = np.percentile(slopes, (2.5, 97.5))
    return LogFit(float(intercept), Interval(float(slope), float(low), float(high), len(y)))


FLIPS, FEW = 10_000, 13  # of signs; up to so many differences all are tried


def sign_flip(differences: F64) -> float:
    """Return the two-sided p-value of paired differences (N,) having mean 0, by flipping their signs.

    Exact for any distribution that is symmetric about 0 (Fisher 1935); of hits and misses it is McNemar's
    exact test. Beyond 13 differences that are not 0, 10,000 random flips are drawn, always the same.

    >>> import numpy as np
    >>> from maurice_datasets.trials.statistics import sign_flip
    >>> sign_flip(np.ones(6))
    0.03125
    """
    values = differences[differences != 0]
    if not len(values):
        return 1.0
    if len(values) <= FEW:
        signs = 1 - 2 * ((np.arange(2 ** len(values))[:, None] >> np.arange(len(values))) & 1)
        return float((np.abs(signs @ values) >= np.abs(values.sum()) * (1 - 1e-12)).mean())
    signs = np.random.default_rng(SEED).choice((-1, 1), (FLIPS, len(values)))
    beyond = np.count_nonzero(np.abs(signs @ values) >= np.abs(values.sum()) * (1 - 1e-12))
    return float((beyond + 1) / (FLIPS + 1))


def holm(values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for there being several, in the same order (Holm 1979).

    >>> from maurice_datasets.trials.statistics import holm
    >>> holm([0.01, 0.5, 0.02])
    [0.03, 0.5, 0.04]
    """
    order = np.argsort(values, kind="stable")
    adjusted, least = [1.0] * len(values), 0.0
    for rank, number in enumerate(order.tolist()):
        least = max(least, min(values[number] * (len(values) - rank), 1.0))
        adjusted[number] = least
    return adjusted
