"""Run comparison: how much better one run is than another, where they diverge, and than odometry alone.

Errors within a drive are not independent, so blocks of neighbors are drawn (Kuensch 1989), and each mean is
divided by its own standard error (Goetze and Kuensch 1996). The interval is for this drive (docs/explain.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ..filter.localizer import Localizer
from ..values import F32, F64, Domain, Moment, StepRecord, stream
from .events import PARTED, RunEvent, Say
from .metrics import FIRST_SCORED, score_step

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

APART_FOR = 2  # steps in a row at which estimates are more than `confidence_m` apart: different places


@dataclass(frozen=True, slots=True)
class StepComparison:
    """One update of a run against the same update of the first run."""

    position_m: float | None  # its position error minus the first run's: below zero is better; None: no truth
    heading_rad: float | None  # the same of the heading error
    apart_m: float | None  # between the two estimates; None for runs of different drives
    event: RunEvent | None  # at the update at which the divergence is certain


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


@dataclass(slots=True)
class RunComparison:
    """Compares one run with the first one, update by update; keeps three numbers per update."""

    first: str  # label of the run that the others are compared with
    other: str
    say: Say  # writes a length in meters, with its unit
    same_drive: bool = True  # otherwise steps are aligned by their number, and places are not compared
    parted_at: int | None = None  # known so far
    _position: list[float] = field(default_factory=list)
    _heading: list[float] = field(default_factory=list)
    _apart: list[float] = field(default_factory=list)
    _seen: int = 0
    _running: int = 0  # updates in a row, up to the last one, at which the estimates were apart

    def see(self, first: Step, other: Step) -> StepComparison:
        """Process the next update of both runs."""
        self._seen += 1
        a, b = (score_step(record.estimate, moment.truth) for moment, record in (first, other))
        position = _difference(a.error_m, b.error_m)
        heading = _difference(a.heading_error_rad, b.heading_error_rad)
        if position is not None and heading is not None and self._seen >= FIRST_SCORED:
            self._position.append(position)
            self._heading.append(heading)
        if not self.same_drive:
            return StepComparison(position, heading, None, None)
        distance_m = float(np.hypot(*(other[1].estimate.pose[:2] - first[1].estimate.pose[:2])))
        self._apart.append(distance_m)
        return StepComparison(position, heading, distance_m, self._parting(distance_m, first))

    def _parting(self, apart_m: float, first: Step) -> RunEvent | None:
        moment, record = first
        self._running = self._running + 1 if apart_m > record.estimate.radii.confidence_m else 0
        if self._running != APART_FOR or self.parted_at is not None:
            return None
        self.parted_at = moment.frame.step - APART_FOR + 1
        what = f"{self.other} and {self.first} are {self.say(apart_m)} apart, since step {self.parted_at}"
        return RunEvent(moment.frame.step, moment.frame.time_s, PARTED, what)

    def result(self) -> ComparisonResult:
        """Return the comparison so far."""
        distances_m = self._apart
        return ComparisonResult(
            difference_of(np.array(self._position)),
            difference_of(np.array(self._heading)),
            float(np.mean(distances_m)) if distances_m else None,
            max(distances_m) if distances_m else None,
            self.parted_at,
        )


def _difference(first: float | None, other: float | None) -> float | None:
    return None if first is None or other is None else other - first


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


@dataclass(slots=True, eq=False)
class DeadReckoning:
    """Moves one pose by the motion model along a drive, and compares its error with a run's."""

    localizer: Localizer
    start: F64  # (3,) in the map's frame
    _pose: F32 = field(init=False)  # (1, 3) relative to the library's origin
    _updates: int = 0
    _errors_m: list[float] = field(default_factory=list)
    _against_m: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pose = (self.start - [*self.localizer.library.origin, 0.0]).astype(np.float32)[None]

    @classmethod
    def of(cls, localizer: Localizer | None, start: F64 | None) -> DeadReckoning | None:
        """Return it for a run whose start and motion model are known; else None."""
        if localizer is None or localizer.motion is None or start is None:
            return None
        return cls(localizer, start)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update of the run."""
        motion, origin = self.localizer.motion, self.localizer.library.origin
        assert motion is not None, "see `of`"
        for movement in moment.frame.motions:
            self._pose = motion.move(self._pose, origin, movement, np.zeros((1, 3), np.float32))
        self._updates += 1
        of_run = score_step(record.estimate, moment.truth).error_m
        if moment.truth is None or of_run is None or self._updates < FIRST_SCORED:
            return
        self._errors_m.append(float(np.hypot(*(self._pose[0, :2] + origin - moment.truth[:2]))))
        self._against_m.append(of_run - self._errors_m[-1])

    def result(self) -> OdometryAlone | None:
        """Return the errors so far; None where no truth was known."""
        against = difference_of(np.array(self._against_m))
        if against is None:
            return None
        sensor = self.localizer.sensor
        sees = bool(sensor.weights) or any(
            getattr(pose_sensor, "pictures", ()) for pose_sensor in sensor.sensors.values()
        )
        mean_m, final_m = float(np.mean(self._errors_m)), self._errors_m[-1]
        return OdometryAlone(mean_m, final_m, against, CAMERA if sees else SENSORS)
