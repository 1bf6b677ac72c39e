"""Calibration of belief: how often the regions of a cloud hold the truth, and which exponent would fix it.

- The p region is the highest-density region of the weighted cloud's positions that holds the share p of its
  weight (a kernel density, leaving each particle out of its own). A calibrated filter's 90 % region holds the
  truth in 90 % of the updates.
- NEES, the normalized estimation error squared, e' P^-1 e of position and heading about the cloud's mean: 3
  on average where the covariance P is right, more where the cloud is too narrow (Bar-Shalom et al. 2001).
- The exponent is the power of the likelihood under which single pictures say most about where the robot was:
  below 1 the likelihood is over-sharp, above 1 over-flat.
- The coverage exponent is the power under which clouds would be as wide as their errors. Pictures err alike
  from step to step, so a filter needs a smaller power than its single pictures. It multiplies
  `sensor.sharpness`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import chdtri, ndtr, stdtrit

from ..filter.estimate import covariance
from ..values import F64, I32, INCH_M, Belief, Domain, StepRecord, circular_mean, stream, wrap
from .statistics import RESAMPLES, TAILS, Fitted

LEVELS = (0.5, 0.9, 0.99)
FIRST_UPDATE = 4  # update from which on it counts: the first three are not scored either
MOST_POINTS = 512  # of a cloud that a density is made from
LEAST_SD_M, LEAST_SD_RAD = INCH_M, float(np.deg2rad(1))  # accuracy of the truth, and least width of a cloud
EXPONENTS: F64 = np.geomspace(0.05, 4, 45)
BLOCK_UPDATES = 10  # updates that are drawn together: the next picture's error resembles this one's
ELLIPSE_SIGMAS = 2.0  # of the ellipse on the map
COVERED_SHARE = 0.9  # region whose size the coverage exponent sets right
NARROWING_POWER = 0.8  # a cloud's variance goes as the likelihood to the minus 0.8 (docs/lost-signal.md)
MOST_FACTOR = 2.0  # by which a coverage exponent changes the sharpness: beyond, clouds hardly follow it
OVER_SHARP, OVER_FLAT, FITS, NOT_KNOWN = "over-sharp", "over-flat", "fits", "not known"
FEWEST_CLUSTERS = 5  # drives, or blocks of one: of fewer no interval is given


@dataclass(frozen=True, slots=True, eq=False)
class JudgedUpdate:
    """One update with known truth."""

    denser: float  # share of the weight where the cloud is denser than at the truth: inside p if at most p
    squared_sd: float  # squared Mahalanobis distance of the true position, of two dimensions
    nees: float  # of position and heading, three dimensions
    scores: F64  # nats, log density at the truth under every one of EXPONENTS


def judge_belief(record: StepRecord, truth: F64) -> JudgedUpdate:
    """Judge the weighted cloud of one update by the true pose (3,).

    >>> import maurice_mcl as mcl
    >>> from maurice_mcl.fitting.belief import judge_belief
    >>> moment, record = next(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> bool(0 <= judge_belief(record, moment.truth).denser <= 1)
    True
    """
    belief, width_m = record.weighted, float(np.hypot(*record.estimate.sd_m)) / np.sqrt(2)
    return JudgedUpdate(
        denser=share_denser(belief, truth, width_m),
        squared_sd=_squared(belief, truth, 2),
        nees=_squared(belief, truth, 3),
        scores=_scores(record, truth, width_m),
    )


def share_denser(belief: Belief, truth: F64, width_m: float) -> float:
    """Return the share of weight at which a cloud is denser than at a true pose's position.

    `width_m` is the standard deviation of one mode, from which the kernel's width follows.
    """
    index, weights = _thinned(belief.weights)
    places = belief.poses[index, :2].astype(np.float64)
    kernel_m = _kernel(width_m, LEAST_SD_M, weights)
    x, y = places.T
    between = _bell(x[:, None] - x, kernel_m) * _bell(y[:, None] - y, kernel_m)
    own = 1 - np.minimum(weights, 0.5)
    density = (between @ weights - weights) / own
    there = (truth[:2] - belief.origin) - places
    at_truth = float((_bell(there[:, 0], kernel_m) * _bell(there[:, 1], kernel_m)) @ weights)
    return float(weights[density > at_truth].sum())


def _thinned(weights: F64) -> tuple[I32, F64]:
    """Return the numbers of at most 512 particles, and their weights, evenly drawn by weight."""
    if len(weights) <= MOST_POINTS:
        return np.arange(len(weights), dtype=np.int32), weights
    at = (np.arange(MOST_POINTS) + 0.5) / MOST_POINTS
    drawn = np.minimum(np.searchsorted(np.cumsum(weights), at), len(weights) - 1)
    index, count = np.unique(drawn, return_counts=True)
    return index.astype(np.int32), count / MOST_POINTS


def _kernel(sd: float, least: float, weights: F64) -> float:
    """Return a kernel's width by Silverman's rule in two dimensions, for the effective number of points."""
    return float(max(sd * float(np.square(weights).sum()) ** (1 / 6), least))


def _bell(away: F64, width: float) -> F64:
    return np.asarray(np.exp(-0.5 * np.square(away / width)))


def _squared(belief: Belief, truth: F64, dimensions: int) -> float:
    """Return e' P^-1 e of the cloud's mean, with the accuracy of the truth added to P."""
    weights = belief.weights
    middle, _ = circular_mean(belief.poses[:, 2], weights)
    mean_xy = weights @ belief.poses[:, :2].astype(np.float64) + belief.origin
    error = np.array([*(truth[:2] - mean_xy), wrap(truth[2] - middle)])[:dimensions]
    spread = covariance(belief) + np.diag([LEAST_SD_M**2, LEAST_SD_M**2, LEAST_SD_RAD**2])
    return float(error @ np.linalg.solve(spread[:dimensions, :dimensions], error))


def _scores(record: StepRecord, truth: F64, width_m: float) -> F64:
    """Return the log density at the truth (E,) that this picture leaves under every exponent, nats."""
    prior = record.predicted.log_weights
    nats = record.weighted.log_weights - prior
    known = np.isfinite(nats) & np.isfinite(prior)
    if not known.any():
        return np.zeros(len(EXPONENTS))
    poses, weights = record.weighted.poses[known], record.weighted.weights[known]
    kernel_m = _kernel(width_m, 2 * LEAST_SD_M, weights)
    turned = _kernel(record.estimate.heading_sd_rad, 4 * LEAST_SD_RAD, weights)
    offset = truth[:2] - record.weighted.origin - poses[:, :2]
    squared = np.square(offset / kernel_m).sum(axis=1) + np.square(wrap(truth[2] - poses[:, 2]) / turned)
    logs = prior[known] + EXPONENTS[:, None] * nats[known]
    return np.asarray(_log_sum(logs - squared / 2) - _log_sum(logs))


def _log_sum(logs: F64) -> F64:
    top = logs.max(axis=1)
    return np.asarray(top + np.log(np.exp(logs - top[:, None]).sum(axis=1)))


@dataclass(frozen=True, slots=True)
class RegionCoverage:
    """How often one region held the truth."""

    level: float  # share of the weight in the region
    held: Fitted  # share of the updates, with its 95 % interval


@dataclass(frozen=True, slots=True)
class BeliefCalibration:
    """How well the belief of some runs agrees with the truth."""

    runs: int
    updates: int
    regions: tuple[RegionCoverage, ...]  # by LEVELS
    ellipse: Fitted  # share of updates with the truth within two sigma of the mean; 0.865 if normal
    nees: Fitted  # mean over all updates, with its bootstrap interval
    nees_expected: tuple[float, float]  # chi-square interval of that mean for a consistent cloud
    exponent: Fitted  # of the likelihood, that would describe these pictures best, each by itself
    coverage_exponent: Fitted  # of the likelihood, that would make the 90 % regions as wide as the errors

    @property
    def likelihood(self) -> str:
        """Whether the likelihood is over-sharp, over-flat, or fits; unknown without an interval."""
        if np.isnan(self.exponent.high):
            return NOT_KNOWN
        if self.exponent.high < 1:
            return OVER_SHARP
        return OVER_FLAT if self.exponent.low > 1 else FITS


@dataclass(slots=True)
class BeliefJudge:
    """Judges the belief of some runs, update by update; keeps a few numbers of each and no cloud.

    Updates of one drive are alike, whatever the filter's seed, so intervals are over drives. Those of one
    drive are over blocks of ten updates, the same of all its runs: neighboring updates are alike.
    """

    _runs: list[list[JudgedUpdate]] = field(default_factory=list)
    _drives: list[str] = field(default_factory=list)  # of each run

    def begin(self, drive: str) -> None:
        """Begin the next run, over a drive of that name."""
        self._runs.append([])
        self._drives.append(drive)

    def add(self, record: StepRecord, truth: F64 | None) -> None:
        """Process the next update of this run."""
        if truth is not None and record.frame.step >= FIRST_UPDATE:
            self._runs[-1].append(judge_belief(record, truth))

    def drop(self) -> None:
        """Leave this run out again."""
        self._runs.pop()
        self._drives.pop()

    def result(self) -> BeliefCalibration:
        """Return what was found. Raises ValueError without any update."""
        every = [update for run in self._runs for update in run]
        if not every:
            raise ValueError("found no update with known truth after the first three, expected some")
        blocks = self._clusters()
        values = _table(every)
        sums = np.array([_table(block).sum(axis=0) for block in blocks])
        drawn = _drawn(sums, np.array([len(block) for block in blocks]))
        means = [
            _within(float(value), column, len(blocks))
            for value, column in zip(values.mean(axis=0), drawn.T, strict=True)
        ]
        scores = np.array([sum(update.scores for update in block) for block in blocks])
        low, high = TAILS
        free = 3 * len(every)
        return BeliefCalibration(
            runs=sum(bool(run) for run in self._runs),
            updates=len(every),
            regions=tuple(RegionCoverage(*pair) for pair in zip(LEVELS, means, strict=False)),
            ellipse=means[-2],
            nees=means[-1],
            nees_expected=(float(chdtri(free, high)) / len(every), float(chdtri(free, low)) / len(every)),
            exponent=_exponent(scores),
            coverage_exponent=_coverage_exponent(blocks),
        )

    def _clusters(self) -> list[list[JudgedUpdate]]:
        """Return the updates that are drawn together: those of a drive, or of a block of the only one."""
        drives: dict[tuple[str, int], list[JudgedUpdate]] = {}
        several = len({drive for drive, run in zip(self._drives, self._runs, strict=True) if run}) > 1
        for drive, run in zip(self._drives, self._runs, strict=True):
            for number, update in enumerate(run):
                drives.setdefault((drive, 0 if several else number // BLOCK_UPDATES), []).append(update)
        return list(drives.values())


def _table(updates: list[JudgedUpdate]) -> F64:
    """Return one row per update: whether each region held the truth, whether the ellipse did, NEES."""
    return np.array(
        [
            [*(row.denser <= level for level in LEVELS), row.squared_sd <= ELLIPSE_SIGMAS**2, row.nees]
            for row in updates
        ],
        np.float64,
    )


def _choices(count: int) -> I32:
    rng = stream(Domain.CALIBRATE, 0, count)
    return np.asarray(rng.integers(0, count, (RESAMPLES, count)), np.int32)


def _drawn(sums: F64, sizes: I32) -> F64:
    """Return means (RESAMPLES, k) over clusters drawn with replacement."""
    chosen = _choices(len(sums))
    return np.asarray(sums[chosen].sum(axis=1) / sizes[chosen].sum(axis=1)[:, None])


def _within(value: float, drawn: F64 | list[float], clusters: int) -> Fitted:
    """Return a value with the percentiles of what was drawn (RESAMPLES,).

    They are farther out the fewer clusters there are, as Student's are (Hesterberg 2015).
    """
    if clusters < FEWEST_CLUSTERS:
        return Fitted(value, float("nan"), float("nan"))
    reach = stdtrit(clusters - 1, TAILS[0]) * np.sqrt(clusters / (clusters - 1))
    tail = 100 * float(ndtr(reach))
    low, high = np.percentile(drawn, [tail, 100 - tail])
    return Fitted(value, min(float(low), value), max(float(high), value))


def _exponent(scores: F64) -> Fitted:
    """Return the exponent with the highest sum of scores (B, E), and its bootstrap interval."""
    best = EXPONENTS[scores[_choices(len(scores))].sum(axis=1).argmax(axis=1)]
    return _within(float(EXPONENTS[scores.sum(axis=0).argmax()]), best, len(scores))


def _coverage_exponent(blocks: Sequence[Sequence[JudgedUpdate]]) -> Fitted:
    """Return the exponent that makes the 90 % regions hold the truth in 90 %, and its bootstrap interval."""
    denser = [np.array([update.denser for update in block]) for block in blocks]
    drawn = [_power([denser[number] for number in row]) for row in _choices(len(blocks)).tolist()]
    return _within(_power(denser), drawn, len(blocks))


def _power(denser: Sequence[F64]) -> float:
    """Return the exponent for what regions held, a block each, within a factor of two.

    The region that did hold the truth in 90 % says by how much the variances are too small: about its middle
    a cloud is nearly normal, and the p region of a normal one has a squared radius of -2 log(1 - p).
    """
    threshold = float(np.quantile(np.concatenate(denser), COVERED_SHARE))
    too_small = np.log(max(1 - threshold, 1e-9)) / np.log(1 - COVERED_SHARE)
    power = max(too_small, 1e-9) ** (-1 / NARROWING_POWER)
    return float(np.clip(power, 1 / MOST_FACTOR, MOST_FACTOR))
