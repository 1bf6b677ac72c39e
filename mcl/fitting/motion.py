"""Motion constants from trials: what was measured, and what the robot really did (thesis 3.2).

A robot turns until its encoders show the commanded angle, so the scatter is in the actual turn: actual = gain
* measured + bias + noise. Least squares of *actual on measured*, through the origin, gives a header's
`turn_gain`. The slope of the thesis's figure 5, *measured on actual*, is pulled toward zero by the noise; it
is reported for comparison only. Bias and gain can only be separated when turns go both ways.

A segment is the movement between two known poses. If it is a turn, a straight, or one of each, its pose
change (three numbers) determines both: with even drift the chord points along the heading halfway, so

    turn, then straight:  drift = 2 (heading after - course),  turn = course - drift / 2 - heading before
    straight, then turn:  drift = 2 (course - heading before), turn = heading after - heading before - drift

Segments of more movements are left out. Errors of the truth count fully: 1 cm in 0.5 m is 2.3 degrees of
drift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..filter.motion import MauriceParameters
from ..values import F64, wrap_angle
from .statistics import Fitted, Spread, r_squared, slope, slope_resampled, spread_of, student

FEWEST_TRIALS = 3  # turns, and straights: gain, bias and sd are three constants
ONE_SIDED_SHARE = 0.5  # |mean| of measured turns over their root mean square; more cannot tell bias from gain


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """Turns on the spot, counter-clockwise, not wrapped."""

    measured_rad: F64  # (n,) by the encoders
    actual_rad: F64  # (n,) by the truth


@dataclass(frozen=True, slots=True, eq=False)
class Straights:
    """Straight movements."""

    measured_m: F64  # (n,) by the encoders; negative backward
    actual_m: F64  # (n,) by the truth; negative backward
    drift_rad: F64  # (n,) how much the heading changed meanwhile, counter-clockwise; nan: unknown
    floors: tuple[str | None, ...]  # (n,) "" where no map names one; None where a way crosses several


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """All that a calibration is made from."""

    turns: Turns
    straights: Straights
    left_out: int = 0  # movements that could not be separated, or whose truth is not credible


@dataclass(frozen=True, slots=True)
class TurnFit:
    """Rotation (thesis 3.2, figures 4 to 8)."""

    count: int
    gain: Fitted  # actual over measured: a header's turn_gain
    figure_5_slope: Fitted  # measured over actual, the thesis's C; only to compare, see above
    r_squared: float  # of actual = gain * measured
    residual: Spread  # rad, actual - gain * measured
    sd_if_multiplied_rad: float  # residual sd if the gain were inverted
    one_sided: bool  # turns go mostly one way, so that gain and bias cannot be separated
    left_gain: Fitted | None  # of the counter-clockwise turns alone; None for fewer than three
    right_gain: Fitted | None  # of the clockwise ones

    @property
    def uneven(self) -> bool:
        """Return whether left and right turns have gains whose intervals do not overlap."""
        left, right = self.left_gain, self.right_gain
        return bool(left and right and (left.low > right.high or right.low > left.high))


@dataclass(frozen=True, slots=True)
class StraightFit:
    """Straight movements (thesis 3.2, figures 9 and 11)."""

    count: int
    error: Spread  # m, actual - measured, a movement
    scale: Fitted  # actual over measured, through the origin: for robots whose error grows with distance
    r_squared: float  # of actual = scale * measured


@dataclass(frozen=True, slots=True)
class DriftFit:
    """How the heading drifts on one floor (thesis 3.2, figure 10)."""

    floor: str
    rate: Spread  # rad per meter really driven, counter-clockwise


@dataclass(frozen=True, slots=True)
class Calibration:
    """Everything that was fitted."""

    turns: TurnFit
    straights: StraightFit
    drifts: tuple[DriftFit, ...]  # by floor, in the order of the trials; only floors with two straights
    left_out: int

    def motion_header(self) -> dict[str, Any]:
        """Return the motion parameters as a session's header holds them under robot.motion."""
        return {
            "model": "maurice",
            "turn_gain": self.turns.gain.value,
            "turn_bias_rad": self.turns.residual.mean.value,
            "turn_sd_rad": self.turns.residual.sd.value,
            "straight_bias_m": self.straights.error.mean.value,
            "straight_sd_m": self.straights.error.sd.value,
            "drift": {
                fit.floor: {"bias_rad_per_m": fit.rate.mean.value, "sd_rad_per_m": fit.rate.sd.value}
                for fit in self.drifts
            },
        }


def calibrate(trials: Trials) -> Calibration:
    """Fit all constants. Raises ValueError, with a message for people, if there are too few trials."""
    turns, straights = len(trials.turns.measured_rad), len(trials.straights.measured_m)
    if turns < FEWEST_TRIALS or straights < FEWEST_TRIALS:
        skipped = f" ({trials.left_out} more left out)" if trials.left_out else ""
        raise ValueError(
            f"found {_count(turns, 'turn')} and {_count(straights, 'straight')}{skipped}, "
            f"expected {FEWEST_TRIALS} or more of each with the truth before and after it"
        )
    turned, went = fit_turns(trials.turns), fit_straights(trials.straights)
    return Calibration(turned, went, fit_drifts(trials.straights), trials.left_out)


def fit_turns(turns: Turns) -> TurnFit:
    """Fit gain and residual. ValueError if nothing turned, or measured and actual turns are opposite."""
    measured, actual = turns.measured_rad, turns.actual_rad
    gain = slope(measured, actual)
    if gain <= 0:
        raise ValueError("found turns measured the other way than they went, expected both counter-clockwise")
    residual = actual - gain * measured
    spread = spread_of(residual, fitted=2)
    error = spread.sd.value / float(np.sqrt(measured @ measured))
    mean, rms = abs(float(measured.mean())), float(np.sqrt((measured**2).mean()))
    return TurnFit(
        count=len(measured),
        gain=student(gain, error, len(measured) - 2),
        figure_5_slope=slope_resampled(actual, measured),
        r_squared=r_squared(actual, residual),
        residual=spread,
        sd_if_multiplied_rad=float((actual - measured / gain).std()),
        one_sided=mean > ONE_SIDED_SHARE * rms,
        left_gain=_scale(measured[measured > 0], actual[measured > 0]),
        right_gain=_scale(measured[measured < 0], actual[measured < 0]),
    )


def fit_straights(straights: Straights) -> StraightFit:
    """Fit the error of one movement, and the scale. Raises ValueError if nothing moved."""
    measured, actual = straights.measured_m, straights.actual_m
    scale = _through_origin(measured, actual)
    residual = actual - scale.value * measured
    return StraightFit(
        count=len(measured),
        # an undershoot is one in the driven direction, also backward
        error=spread_of((actual - measured) * np.sign(measured)),
        scale=scale,
        r_squared=r_squared(actual, residual),
    )


def fit_drifts(straights: Straights) -> tuple[DriftFit, ...]:
    """Fit the drift of every floor with two straights or more; each straight yields one rate."""
    names = dict.fromkeys(floor for floor in straights.floors if floor is not None)
    rates = [(name, drift_rates(straights, name)) for name in names]
    return tuple(DriftFit(name, spread_of(values)) for name, values in rates if len(values) > 1)


def drift_rates(straights: Straights, floor: str) -> F64:
    """Return the drift (k,) in rad per meter of every straight on a floor whose drift is known.

    Backward the robot turns to the other side: what makes it drift, unequal wheels, bends its path alike.
    """
    on = np.array([name == floor for name in straights.floors], bool)
    on &= np.isfinite(straights.drift_rad) & (straights.actual_m != 0)
    return np.asarray(straights.drift_rad[on] / straights.actual_m[on])


def unwrapped(measured_rad: F64, turned_rad: F64) -> F64:
    """Add full circles to wrapped turns (n,), by the ratio to measured turns below 120 degrees."""
    small = (np.abs(turned_rad) < 2 * np.pi / 3) & (np.abs(measured_rad) < np.pi)
    small &= np.abs(measured_rad) > 0
    ratio = float(np.median(turned_rad[small] / measured_rad[small])) if small.any() else 1.0
    circles = np.round((ratio * measured_rad - turned_rad) / (2 * np.pi))
    return np.asarray(turned_rad + 2 * np.pi * circles)


def _through_origin(measured: F64, actual: F64) -> Fitted:
    scale = slope(measured, actual)
    residual = actual - scale * measured
    error = float(np.sqrt(residual @ residual / (len(measured) - 1) / (measured @ measured)))
    return student(scale, error, len(measured) - 1)


def _scale(measured: F64, actual: F64) -> Fitted | None:
    return _through_origin(measured, actual) if len(measured) >= FEWEST_TRIALS else None


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"


# Trials from a drive: what each movement did, from the poses before and after it.

FloorOf = Callable[[F64, F64], str | None]  # names the floor between two points (2,); None: several


@dataclass(frozen=True, slots=True, eq=False)
class MotionSegment:
    """What was measured between two known poses."""

    before: F64  # (3,) x_m, y_m, heading_rad
    motions: tuple[F64, ...]  # each (3,) forward_m, left_m, turn_rad
    after: F64  # (3,)


@dataclass(frozen=True, slots=True)
class _Part:
    """A turn or a straight of a segment."""

    straight: bool
    measured: float  # m or rad
    course_rad: float = 0.0  # of a straight, from the robot's forward

    @property
    def sign(self) -> int:
        """1, or -1 of a straight that goes backward."""
        return -1 if abs(self.course_rad) > math.pi / 2 else 1


def trials_of(segments: Iterable[MotionSegment], floor_of: FloorOf) -> Trials:
    """Return what each movement of the segments did."""
    turns: list[tuple[float, float]] = []
    straights: list[tuple[float, float, float]] = []
    floors: list[str | None] = []
    left_out = 0
    for segment in segments:
        parts = [part for motion in segment.motions for part in _parts(motion)]
        kinds = "".join("S" if part.straight else "T" for part in parts)
        if kinds not in ("", "T", "S", "TS", "ST"):
            left_out += len(parts)
            continue
        turn = next((part for part in parts if not part.straight), None)
        straight = next((part for part in parts if part.straight), None)
        turned, drift = _attribute(segment, straight, turn_first=kinds == "TS", turns=turn is not None)
        if turn is not None:
            turns.append((turn.measured, turned))
        if straight is not None:
            straights.append((straight.sign * straight.measured, straight.sign * _length(segment), drift))
            floors.append(floor_of(segment.before[:2], segment.after[:2]))
    measured, turned_rad = np.array(turns, np.float64).reshape(-1, 2).T
    way, went, drift_rad = np.array(straights, np.float64).reshape(-1, 3).T
    driven = Straights(way, went, drift_rad, tuple(floors))
    return Trials(Turns(measured, unwrapped(measured, turned_rad)), driven, left_out)


def _parts(motion: F64) -> list[_Part]:
    """Split a movement as the filter does, a turn first; what is too small is neither."""
    least = MauriceParameters()
    forward, left, turn = (float(v) for v in motion)
    way = math.hypot(forward, left)
    parts = [_Part(False, turn)] if abs(turn) >= least.turn_from_rad else []
    return parts + ([_Part(True, way, math.atan2(left, forward))] if way >= least.straight_from_m else [])


def _length(segment: MotionSegment) -> float:
    return float(np.hypot(*(segment.after - segment.before)[:2]))


def _attribute(
    segment: MotionSegment, way: _Part | None, *, turn_first: bool, turns: bool
) -> tuple[float, float]:
    """Split the change of heading into turn (up to full circles) and drift, both in rad."""
    changed = float(segment.after[2] - segment.before[2])
    if way is None:
        return wrap_angle(changed), math.nan
    if not turns:
        return math.nan, wrap_angle(changed)
    if _length(segment) < MauriceParameters().straight_from_m:  # no course: the robot hardly moved
        return wrap_angle(changed), math.nan
    x, y = (float(v) for v in (segment.after - segment.before)[:2])
    forward = math.atan2(y, x) - way.course_rad
    before, after = float(segment.before[2]), float(segment.after[2])
    drift = 2 * wrap_angle(after - forward if turn_first else forward - before)
    return wrap_angle(changed - drift), drift
