"""Intervals for what trials show: rates, means and times of runs that are alike within a drive or a place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtrit

from maurice_mcl.values import F64, I64, Bool, Plain

SEED, LEVEL = 0, 0.95
Z = float(stdtrit(np.inf, (1 + LEVEL) / 2))  # standard deviations: two-sided 95 percent
LEAST_PAIRS = 10  # for which Newcombe's interval is wide enough
FEW = 5  # drives or places: of fewer, equal values have no interval
POOLED = 0.25  # p-value of places being alike, from which on their drives count
EQUAL = 1e-12  # of the largest value: a smaller standard error is a rounding error


@dataclass(frozen=True, slots=True)
class Interval(Plain):
    """A figure and its interval, 95 percent unless stated otherwise; NaN: too few drives for one."""

    value: float
    low: float
    high: float
    count: int  # runs
    drives: int = 0  # that these are runs of

    def excludes(self, value: float) -> bool:
        """Return whether a value lies outside the interval."""
        return value < self.low or value > self.high

    def text(self, factor: float = 1.0, digits: int = 1, sign: str = "") -> str:
        """Write the figure and its limits, all times a factor: "4.4 (4.3 to 4.5)".

        >>> from maurice_datasets.trials.statistics import Interval
        >>> Interval(0.5, 0.25, 0.75, 8).text(100, 0)
        '50 (25 to 75)'
        """
        if not np.isfinite(self.value):
            return "not known"
        numbers = (self.value, self.low, self.high)
        value, low, high = (f"{number * factor:{sign}.{digits}f}" for number in numbers)
        return f"{value} ({low} to {high})" if np.isfinite(self.low) else f"{value} (no interval)"


UNKNOWN = Interval(np.nan, np.nan, np.nan, 0)  # of no runs
Labels = Sequence[object] | NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Clusters:
    """Which of N values are alike: those of one run, one drive, one place (an arena, a recorded session).

    Everything is judged by clusters: a figure of 80 runs over 4 drives is one of 4 drives.
    """

    places: I64  # (N,) numbers from 0
    drives: I64  # (N,) within places
    runs: I64  # (N,) within drives

    @classmethod
    def of(cls, places: Labels, drives: Labels | None = None, runs: Labels | None = None) -> Clusters:
        """Number labels (N,), each within the one before; None: every value has a drive or run of its own.

        >>> from maurice_datasets.trials.statistics import Clusters
        >>> Clusters.of(["hall", "hall", "lab"], [1, 1, 1]).drives.tolist()
        [0, 0, 1]
        """
        levels = [np.zeros(len(places), np.int64)]
        for labels in (places, drives, runs):
            names = np.arange(len(places)) if labels is None else np.asarray(labels)
            own = np.unique(names, return_inverse=True)[1]
            both = np.stack([levels[-1], own], axis=1)
            levels.append(np.unique(both, axis=0, return_inverse=True)[1].ravel())
        return cls(*levels[1:])

    def __getitem__(self, some: Bool) -> Clusters:
        return Clusters(self.places[some], self.drives[some], self.runs[some])

    @property
    def count(self) -> int:
        """The number of drives."""
        return len(set(self.drives.tolist()))

    def units(self, influences: F64) -> I64:
        """Return what counts as independent (N,), by what each run adds to a figure's error (N,).

        These are drives, or the runs of the only one. They are places where the drives of each are alike, by
        an F test with p below 0.25 (Bancroft 1964), or where places are too few for it to tell.
        """
        if self.count < 2:
            return self.runs
        sizes = np.bincount(self.drives)
        means = np.bincount(self.drives, influences) / sizes
        place = np.zeros(len(sizes), np.int64)
        place[self.drives] = self.places
        counts = np.bincount(place)
        middle = np.bincount(place, means) / np.maximum(counts, 1)
        free, rest = int((counts > 0).sum()) - 1, len(sizes) - int((counts > 0).sum())
        if not free or not rest or free + 1 < FEW:
            return self.places if free else self.drives
        within = float(np.square(means - middle[place]).sum()) / rest
        among = float((counts * np.square(middle - means.mean())).sum()) / free
        alike = among > 0 and (within == 0 or float(fdtrc(free, rest, among / within)) < POOLED)
        return self.places if alike else self.drives


def apart(count: int) -> Clusters:
    """Return the clusters of values that have nothing in common: each is from a drive of its own."""
    own = np.arange(count)
    return Clusters(own, own, own)


def of_one_drive(count: int) -> Clusters:
    """Return the clusters of runs over one drive with different seeds: what they show is of that drive."""
    same = np.zeros(count, np.int64)
    return Clusters(same, same, np.arange(count))


def _totals(influences: F64, units: I64) -> tuple[F64, float]:
    """Return the sum over each unit (C,) of influences (N, ...) on a figure, and the degrees of freedom.

    The squares of the sums add up to the figure's variance (Bell and McCaffrey 2002, CR2). Units that differ
    in size count as fewer (Carter, Schnepel and Steigerwald 2017).
    """
    sizes = np.bincount(units).astype(np.float64)
    shares = sizes[sizes > 0] / len(units)
    sums = np.zeros((len(sizes), *influences.shape[1:]))
    np.add.at(sums, units, influences)
    rest = np.maximum(1 - shares, EQUAL).reshape(-1, *[1] * (influences.ndim - 1))
    return np.asarray(sums[sizes > 0] / np.sqrt(rest)), float(1 / np.square(shares).sum() - 1)


def _quantile(free: float, level: float) -> float:
    return float(stdtrit(free, (1 + level) / 2)) if free > 0 else np.inf


def student(value: float, influences: F64, largest: float, clusters: Clusters, level: float) -> Interval:
    """Return a figure with Student's interval, from what each run adds to its error (N,)."""
    sums, free = _totals(influences, clusters.units(influences))
    error = float(np.sqrt(np.square(sums).sum()))
    known = len(sums) > 1 and (error > EQUAL * largest or len(sums) >= FEW)
    reach = _quantile(free, level) * error if known else np.nan
    return Interval(value, value - reach, value + reach, len(influences), clusters.count)


def mean(values: F64, clusters: Clusters | None = None, level: float = LEVEL) -> Interval:
    """Return the mean (N,) with Student's interval over clusters; without clusters, over values.

    >>> import numpy as np
    >>> from maurice_datasets.trials.statistics import Clusters, mean
    >>> figure = mean(np.array([1.0, 1.0, 3.0, 3.0]), Clusters.of([1, 1, 2, 2]))
    >>> figure.value, round(figure.low, 1), round(figure.high, 1)
    (2.0, -10.7, 14.7)
    """
    values = np.asarray(values, np.float64)
    if not len(values):
        return UNKNOWN
    value = float(values.mean())
    of = apart(len(values)) if clusters is None else clusters
    return student(value, (values - value) / len(values), float(np.abs(values).max()), of, level)


def jackknife(figure: Callable[[Bool], float], clusters: Clusters, level: float = LEVEL) -> Interval:
    """Return a figure of some values, a function of which are used (N,), with Student's interval.

    It is from what the figure is without each drive in turn (Efron and Stein 1981), for figures that are no
    means; `clusters` has one drive a place.

    >>> import numpy as np
    >>> from maurice_datasets.trials.statistics import Clusters, jackknife
    >>> values = np.array([1.0, 1.0, 3.0, 3.0])
    >>> figure = jackknife(lambda used: values[used].mean(), Clusters.of([1, 1, 2, 2], [1, 1, 2, 2]))
    >>> figure.value, round(figure.low, 1), round(figure.high, 1)
    (2.0, -10.7, 14.7)
    """
    count = len(clusters.drives)
    if not count:
        return UNKNOWN
    value, units = figure(np.ones(count, bool)), np.unique(clusters.drives)
    without = [figure(clusters.drives != unit) for unit in units.tolist()] if len(units) > 1 else [value]
    apart_by = np.array(without) - np.mean(without)
    error = float(np.sqrt((len(units) - 1) / len(units) * np.square(apart_by).sum()))
    known = len(units) > 1 and (error > EQUAL * abs(value) or len(units) >= FEW)
    reach = _quantile(len(units) - 1, level) * error if known else np.nan
    return Interval(value, value - reach, value + reach, count, clusters.count)


def rate(hits: int, count: int, level: float = LEVEL) -> Interval:
    """Return the share of independent runs that hit, with its Wilson interval (Wilson 1927).

    >>> from maurice_datasets.trials.statistics import rate
    >>> figure = rate(18, 20)
    >>> round(figure.low, 2), round(figure.high, 2)
    (0.7, 0.97)
    """
    return _wilson(hits / max(count, 1), count, level, count, count) if count else UNKNOWN


def share(flags: Bool | F64, clusters: Clusters | None = None, level: float = LEVEL) -> Interval:
    """Return the share of flags (N,) with a Wilson interval for as many runs as the clusters are worth.

    That is the number of independent runs with the same variance (Korn and Graubard 1998). Where all flags
    are equal nothing tells it, and it is the number of drives. Flags may be shares themselves, from 0 to 1:
    of the updates of each run.
    """
    flags = np.asarray(flags, np.float64)
    if not len(flags):
        return UNKNOWN
    of = apart(len(flags)) if clusters is None else clusters
    return _share(flags, of.units(flags - flags.mean()), of.count, level)


def _share(flags: Bool | F64, units: I64, drives: int, level: float, *, few: bool = False) -> Interval:
    worth = _worth(flags, units, level, few=few)
    return _wilson(float(flags.mean()), worth, level, len(flags), drives)


def _worth(flags: Bool | F64, units: I64, level: float, *, few: bool) -> float:
    """Return how many independent runs have the variance of the share of flags (N,) of some units."""
    count, clusters, value = len(flags), len(set(units.tolist())), float(flags.mean())
    partly = bool(((flags > 0) & (flags < 1)).any())  # shares themselves: a run is worth more than one flag
    if clusters == count and not few and not partly:
        return count
    sums, free = _totals((flags - value) / count, units)
    variance, binomial = float(np.square(sums).sum()), value * (1 - value)
    size = clusters if binomial == 0 else count if variance < EQUAL**2 else binomial / variance
    worth = size * (_quantile(np.inf, level) / _quantile(free, level)) ** 2
    return float(worth if partly else min(worth, count))


def _wilson(p: float, n: float, level: float, count: int, drives: int) -> Interval:
    if n <= 0:
        return Interval(p, np.nan, np.nan, count, drives)
    z = _quantile(np.inf, level)
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    reach = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return Interval(p, max(float(middle - reach), 0.0), min(float(middle + reach), 1.0), count, drives)


def rate_difference(
    before: Bool, after: Bool, clusters: Clusters | None = None, level: float = LEVEL
) -> Interval:
    """Return by how much a rate differs between two flags (N,) of the same runs, after less before.

    The interval is Newcombe's for paired rates (1998, method 10), from both shares' intervals and the
    correlation of their clusters. Of fewer than ten pairs his is too narrow, and each share counts as of
    fewer runs, as if its variance were estimated.

    >>> from maurice_datasets.trials.statistics import rate_difference
    >>> import numpy as np
    >>> figure = rate_difference(np.ones(20, bool), np.arange(20) < 15)
    >>> figure.value, round(figure.low, 2), round(figure.high, 2)
    (-0.25, -0.47, -0.04)
    """
    before, after = np.asarray(before, bool), np.asarray(after, bool)
    if not len(before):
        return UNKNOWN
    of = apart(len(before)) if clusters is None else clusters
    apart_by = after.astype(np.float64) - before
    units = of.units(apart_by - apart_by.mean())
    few = len(set(units.tolist())) < LEAST_PAIRS
    first, second = (_share(flags, units, of.count, level, few=few) for flags in (before, after))
    sums, _ = _totals(np.stack([before - first.value, after - second.value], axis=1), units)
    scale = float(np.sqrt(np.prod(np.square(sums).sum(axis=0))))
    alike = float(np.prod(sums, axis=1).sum()) / scale if scale > 0 else 0.0
    down, up = second.value - second.low, second.high - second.value
    fell, rose = first.high - first.value, first.value - first.low
    low = np.sqrt(max(down**2 - 2 * alike * down * fell + fell**2, 0.0))
    high = np.sqrt(max(up**2 - 2 * alike * up * rose + rose**2, 0.0))
    value = second.value - first.value
    return Interval(value, value - float(low), value + float(high), len(before), of.count)


@dataclass(frozen=True, slots=True)
class Survival:
    """A Kaplan-Meier curve: the share that is still without the event after each time (T,)."""

    times: F64
    share: F64
    low: F64
    high: F64
    at_risk: int
    events: int
    drives: int

    @property
    def median(self) -> float:
        """The time by which half have had the event; inf where fewer have."""
        reached = np.flatnonzero(self.share <= 0.5 + 1e-12)
        return float(self.times[reached[0]]) if len(reached) else np.inf


def survival(times: F64, happened: Bool, clusters: Clusters | None = None, level: float = LEVEL) -> Survival:
    """Return the Kaplan-Meier curve of times (N,) to an event, or (not `happened`) to the end of watching.

    Limits are on the log-log scale (Kalbfleisch and Prentice 1980), with Greenwood's variance, or that of the
    clusters where it is larger (Williams 1995).
    """
    times, happened = np.asarray(times, np.float64), np.asarray(happened, bool)
    of = apart(len(times)) if clusters is None else clusters
    at = np.unique(times[happened])
    watched = times[:, None] >= at
    died = (times[:, None] == at) & happened[:, None]
    risk, events = watched.sum(axis=0).astype(np.float64), died.sum(axis=0).astype(np.float64)
    curve: F64 = np.asarray(np.cumprod(1 - events / risk), np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        hazard = events / risk
        influences = np.cumsum((died - watched * hazard) / (risk * (1 - hazard)), axis=1)
        greenwood = np.sqrt(np.cumsum(events / (risk * (risk - events))))
        spread = _quantile(np.inf, level) * greenwood
        units = of.units(np.nan_to_num(influences).sum(axis=1))
        if len(np.unique(units)) < len(times):
            sums, free = _totals(influences, units)
            spread = np.fmax(spread, _quantile(free, level) * np.sqrt(np.square(sums).sum(axis=0)))
        reach = np.exp(spread / np.abs(np.log(curve)))
        low, high = curve**reach, curve ** (1 / reach)
    known = (curve > 0) & (curve < 1) & np.isfinite(reach)
    worth = np.maximum(risk * of.count / max(len(times), 1), 1).tolist()
    none = [_wilson(0.0, left, level, 1, 1).high for left in worth]
    low, high = np.where(known, low, 0.0), np.where(known, high, np.where(curve > 0, 1.0, none))
    return Survival(at, curve, low, high, len(times), int(happened.sum()), of.count)


def p_value(figure: Callable[[float], Interval], value: float) -> float:
    """Return the two-sided p-value of a figure being `value`, from its intervals at all levels.

    It is 1 less the highest level at which the interval leaves the value out; 1e-12 at least.

    >>> import numpy as np
    >>> from maurice_datasets.trials.statistics import mean, p_value
    >>> round(p_value(lambda level: mean(np.array([1.0, 2.0, 4.0]), level=level), 0), 3)
    0.118
    """
    low, high = np.log(1e-12), 0.0  # of p
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (low, middle) if figure(1 - np.exp(middle)).excludes(value) else (middle, high)
    return float(np.exp(high))


FLIPS, MOST_EXACT = 10_000, 13  # of signs; up to so many differences all are tried


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
    if len(values) <= MOST_EXACT:
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
