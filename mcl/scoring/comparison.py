"""Run comparison: how much better one run is than another, where they diverge, and than odometry alone.

Errors within a drive are not independent, so blocks of neighbors are drawn (Kuensch 1989), and each mean is
divided by its own standard error (Goetze and Kuensch 1996). The interval is for this drive (docs/explain.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..filter.localizer import Localizer
from ..values import F64, Domain, Moment, StepRecord, stream
from .events import PARTED, RunEvent, Say
from .metrics import FIRST_SCORED
from .table import RunTable, in_a_row

# An interval for the mean of an autocorrelated series: the studentized moving-block bootstrap.

LEVEL = 0.95
LEAST_VALUES = 24  # values; with fewer no interval is given
LEAST_BLOCKS = 6  # a block is at most a sixth of the series
DRAWS = 2000  # the ends of an interval move by about a fiftieth of its width from one seed to another
MOST_CORRELATION = 0.97  # correlation of neighbors: no drive is long enough to estimate a higher one


def autocorrelation(values: F64) -> float:
    """Return the bias-corrected correlation of neighbors in a series (n,) (Kendall 1954); 0 if constant."""
    off = values - values.mean()
    total = float(off @ off)
    if total <= 0:
        return 0.0
    correlation = float(off[1:] @ off[:-1]) / total
    return correlation + (1 + 3 * correlation) / len(values)


def block_length(values: F64) -> int:
    """Return 1.1447 (a n)^(1/3), a = 4 r^2 / (1 - r^2)^2, rounded up (Andrews 1991): 1 to a sixth of n."""
    alike = min(max(autocorrelation(values), 0.0), MOST_CORRELATION)
    memory = 4 * alike**2 / (1 - alike**2) ** 2
    length = int(np.ceil(1.1447 * (memory * len(values)) ** (1 / 3)))
    return min(max(length, 1), max(len(values) // LEAST_BLOCKS, 1))


def mean_interval(values: F64, seed: int = 0) -> tuple[float, float] | None:
    """Return a repeatable 95 % interval about the mean of a series (n,); None for fewer than 24 values."""
    if len(values) < LEAST_VALUES:
        return None
    length = block_length(values)
    sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    blocks = (sums[length:] - sums[:-length]) / length  # (n - length + 1,) about the mean of all
    error = float(np.sqrt(np.square(blocks).mean() * length / len(values)))
    reach = error * _critical(blocks, len(values) // length, seed)
    mean = float(values.mean())
    return mean - reach, mean + reach


def _critical(blocks: F64, count: int, seed: int) -> float:
    """Return how many standard errors 95 % of the means of `count` drawn blocks are within."""
    chosen = stream(Domain.COMPARE, seed).integers(0, len(blocks), (DRAWS, count))
    drawn = blocks[chosen]
    away = np.abs(drawn.mean(axis=1) - blocks.mean())
    error = drawn.std(axis=1) / np.sqrt(count)
    deviations = np.divide(away, error, out=np.zeros(DRAWS), where=error > 0)
    return float(np.quantile(deviations, LEVEL))


Step: TypeAlias = tuple[Moment, StepRecord]

APART_FOR = 2  # updates in a row at which estimates are more than `confidence_m` apart: different places


@dataclass(frozen=True, slots=True)
class ErrorDifference:
    """A run's error minus the first run's over the scored updates of a drive, in meters or radians."""

    mean: float
    interval: tuple[float, float] | None  # 95 %; None: too few updates, or one stretch of them decides
    block: int  # updates in a block of it
    updates: int  # that both runs have, with truth, from the fourth on
    better: int  # updates at which the run was closer to the truth than the first
    worse: int  # updates at which it was further from it

    @property
    def agrees(self) -> bool:
        """Whether one run was closer at every update: then what counts is how many blocks that is."""
        return self.updates > 0 and self.updates in (self.better, self.worse)

    @property
    def blocks(self) -> int:
        """How many blocks of updates there are, each of which counts as one."""
        return self.updates // max(self.block, 1)

    @property
    def is_sure(self) -> bool:
        """Whether chance hardly made the difference, on this drive.

        Where every update agrees, that is so from six blocks on: by a sign test p = 2 x 0.5^6 = 0.03.
        """
        if self.agrees:
            return self.blocks >= LEAST_BLOCKS
        return self.interval is not None and not self.interval[0] <= 0 <= self.interval[1]


@dataclass(frozen=True, slots=True)
class ComparisonResult:
    """A complete run against the first run."""

    position: ErrorDifference | None  # None where the truth is not known
    heading: ErrorDifference | None
    apart_mean_m: float | None  # of the estimates, over all updates; None for different drives
    apart_most_m: float | None
    parted_at: int | None  # the first update of those at which the estimates were apart; None: never


def compare(first: RunTable, other: RunTable, *, same_drive: bool = True) -> ComparisonResult:
    """Compare a run with the first one, as far as the shorter goes.

    Runs of different drives are aligned by the number of their updates, and their places not compared.
    """
    both = min(first.updates, other.updates)
    scored = first.known[:both] & other.known[:both] & (np.arange(both) >= FIRST_SCORED - 1)
    apart_m = _apart_m(first, other) if same_drive else np.zeros(0)
    parted = _parted(first, other) if same_drive else None
    return ComparisonResult(
        difference_of((other.error_m[:both] - first.error_m[:both])[scored]),
        difference_of((other.heading_error_rad[:both] - first.heading_error_rad[:both])[scored]),
        float(apart_m.mean()) if len(apart_m) else None,
        float(apart_m.max()) if len(apart_m) else None,
        None if parted is None else _since(first, parted),
    )


def parting(first: RunTable, other: RunTable, labels: tuple[str, str], say: Say) -> RunEvent | None:
    """Return the event by which two runs of one drive part, at the update that makes it certain.

    `labels` are the names of both, and `say` writes a length in meters with its unit.
    """
    parted = _parted(first, other)
    if parted is None:
        return None
    apart = say(float(_apart_m(first, other)[parted]))
    what = f"{labels[1]} and {labels[0]} are {apart} apart, since step {_since(first, parted)}"
    return RunEvent(int(first.steps[parted]), float(first.times_s[parted]), PARTED, what)


def _apart_m(first: RunTable, other: RunTable) -> F64:
    """Return how far apart the estimates of two runs are (U,)."""
    both = min(first.updates, other.updates)
    away = other.poses[:both] - first.poses[:both]
    return np.hypot(away[:, 0], away[:, 1])


def _parted(first: RunTable, other: RunTable) -> int | None:
    """Return the update, counted from 0, at which it is certain that two runs parted."""
    certain = in_a_row(_apart_m(first, other) > first.radii.confidence_m) == APART_FOR
    return int(certain.argmax()) if certain.any() else None


def _since(first: RunTable, parted: int) -> int:
    return int(first.steps[parted]) - APART_FOR + 1


def difference_of(values: F64) -> ErrorDifference | None:
    """Sum up differences of errors (n,) at the updates of one drive; None for none.

    An interval that reaches further than the largest difference is none: where one event makes nearly all
    of the difference, most draws miss it, and their standard errors are next to zero.
    """
    if not len(values):
        return None
    mean, better, worse = float(values.mean()), int((values < 0).sum()), int((values > 0).sum())
    interval = mean_interval(values)
    if interval is not None and interval[1] - mean > np.abs(values).max():
        interval = None
    return ErrorDifference(mean, interval, block_length(values), len(values), better, worse)


# Dead reckoning: how far off odometry alone would have been, from the same known start.
#
# The pose is moved by the motion model without its noise: what a filter without sensors estimates, without a
# second filter. A sensor that does worse than this should not have been used.

CAMERA, SENSORS = "camera", "sensors"  # what a run had besides odometry
WORSE_FACTOR = 1.1  # times the error of odometry alone, from which on a run is worse


@dataclass(frozen=True, slots=True)
class OdometryAlone:
    """What a run would have had without its sensors, over the same updates."""

    error_mean_m: float
    error_final_m: float
    against: ErrorDifference  # the run's position error minus this
    sensors: str = CAMERA  # what it would have been without: CAMERA or SENSORS

    @property
    def is_better(self) -> bool:
        """Whether the sensors made it worse: by more than a tenth, with 95 % confidence on this drive."""
        interval = self.against.interval
        sure = interval is not None and interval[0] > 0
        return sure and self.against.mean > (WORSE_FACTOR - 1) * self.error_mean_m


def odometry_alone(run: RunTable, localizer: Localizer) -> OdometryAlone | None:
    """Return how far off odometry alone would have been; None where no start or no truth is known."""
    scored = run.known & ~np.isnan(run.reckoned[:, 0]) & (np.arange(run.updates) >= FIRST_SCORED - 1)
    off = (run.reckoned - run.truths[:, :2])[scored]
    errors_m = np.hypot(off[:, 0], off[:, 1])
    against = difference_of(run.error_m[scored] - errors_m)
    if against is None:
        return None
    sensor = localizer.sensor
    sees = bool(sensor.weights) or any(
        getattr(pose_sensor, "pictures", ()) for pose_sensor in sensor.sensors.values()
    )
    return OdometryAlone(float(errors_m.mean()), float(errors_m[-1]), against, CAMERA if sees else SENSORS)
