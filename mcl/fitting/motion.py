"""Motion constants from trials: what was measured, and what the robot really did (thesis 3.2).

A robot turns until its encoders show the commanded angle, so the scatter is in the actual turn: actual = gain
* measured + bias + noise. Least squares of *actual on measured*, through the origin, gives a header's
`turn_gain`. The slope of the thesis's figure 5, *measured on actual*, is pulled toward zero by the noise; it
is reported for comparison only. Bias and gain can only be separated when turns go both ways.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..values import F64
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
    floors: tuple[str, ...]  # (n,) "" where none is named


@dataclass(frozen=True, slots=True, eq=False)
class Trials:
    """All that a calibration is made from."""

    turns: Turns
    straights: Straights


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
        counts = f"found {_count(turns, 'turn')} and {_count(straights, 'straight')}"
        raise ValueError(f"{counts}, expected {FEWEST_TRIALS} or more of each")
    turned, went = fit_turns(trials.turns), fit_straights(trials.straights)
    return Calibration(turned, went, fit_drifts(trials.straights))


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
    rates = [(name, drift_rates(straights, name)) for name in dict.fromkeys(straights.floors)]
    return tuple(DriftFit(name, spread_of(values)) for name, values in rates if len(values) > 1)


def drift_rates(straights: Straights, floor: str) -> F64:
    """Return the drift (k,) in rad per meter of every straight on a floor whose drift is known.

    Backward the robot turns to the other side: what makes it drift, unequal wheels, bends its path alike.
    """
    on = np.array([name == floor for name in straights.floors], bool)
    on &= np.isfinite(straights.drift_rad) & (straights.actual_m != 0)
    return np.asarray(straights.drift_rad[on] / straights.actual_m[on])


def _through_origin(measured: F64, actual: F64) -> Fitted:
    scale = slope(measured, actual)
    residual = actual - scale * measured
    error = float(np.sqrt(residual @ residual / (len(measured) - 1) / (measured @ measured)))
    return student(scale, error, len(measured) - 1)


def _scale(measured: F64, actual: F64) -> Fitted | None:
    return _through_origin(measured, actual) if len(measured) >= FEWEST_TRIALS else None


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
