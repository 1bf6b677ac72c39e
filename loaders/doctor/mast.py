"""Where on the robot the truth is measured, by how it swings as the robot turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maurice_mcl.values import F64

from .findings import Evidence, Finding, Value

LEAST_M, MOST_M = (
    0.02,
    3.0,
)  # a place nearer the wheels' center is no matter; one farther is no robot
SIGMAS = 4.0  # standard errors from which on a place counts as seen
LEAST_ERROR_M = 0.005  # of a segment, below which nothing is wrong
LEFT_ERROR_SHARE = 0.8  # share of the error that may be left when truth is moved back
FEWEST = 8  # segments that turn
LEAST_TURN_RAD = 0.05  # of them
PARTS = 8  # of a drive, over which the place is compared with itself


@dataclass(frozen=True, slots=True)
class Mast:
    """A place on the robot that truth is of, from the wheels' center."""

    ahead_m: float
    left_m: float
    error_m: float  # standard error, of the place on an axis
    before_m: float  # error of a segment (median), with truth taken as of the wheels' center
    after_m: float  # and with truth moved back


def mast_of(measured: NDArray[np.complex128], moved: F64) -> Mast | None:
    """Return where on the robot the truth is measured; None at the wheels' center, or where no turn shows it.

    A place ahead of the wheels swings as the robot turns: the true step (L, 3) is the wheels' (L,), turned
    and scaled by one constant, and the swing e^(i turn) - 1 times the place. Fitted by reweighted least
    squares, so that slips and jumps count little.
    """
    true, swing = moved[:, 0] + 1j * moved[:, 1], np.exp(1j * moved[:, 2]) - 1
    if (np.abs(swing) > LEAST_TURN_RAD).sum() < FEWEST:
        return None
    both = np.column_stack([measured, swing])
    fit, weights = _reweighted(both, true)
    place = complex(fit[1])
    parts = [part for part in np.array_split(np.arange(len(true)), PARTS) if len(part)]
    scores = (both.conj() * (weights * (true - both @ fit))[:, None])[:, :, None]
    turned = np.linalg.pinv((both.conj().T * weights) @ both)
    shifts_m = np.array([abs((turned @ scores[part].sum(axis=0))[1, 0]) for part in parts])
    error_m = float(np.sqrt((shifts_m**2).sum() * len(parts) / max(len(parts) - 1, 1) / 2))
    only, _ = _reweighted(measured[:, None], true)
    swings = np.abs(swing) > LEAST_TURN_RAD
    before_m = float(np.median(np.abs(true - measured * only[0])[swings]))
    after_m = float(np.median(np.abs(true - both @ fit)[swings]))
    if not LEAST_M <= abs(place) <= MOST_M or abs(place) < SIGMAS * error_m:
        return None
    if before_m < LEAST_ERROR_M or after_m > LEFT_ERROR_SHARE * before_m:
        return None
    return Mast(place.real, place.imag, error_m, before_m, after_m)


def _reweighted(
    columns: NDArray[np.complex128], values: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], F64]:
    """Return a linear fit (k,) to values (L,) by columns (L, k), and the weights (L,): Cauchy's."""
    weights = np.ones(len(values))
    for _ in range(10):
        root = np.sqrt(weights)
        fit = np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0]
        away = np.abs(values - columns @ fit)
        weights = 1 / (1 + np.square(away / max(2.0 * float(np.median(away)), 1e-6)))
    return np.asarray(fit), weights


def mast_finding(mast: Mast) -> Finding:
    """Report that truth is of another place than the wheels' center."""
    seen = Evidence("swing", {"before_m": mast.before_m, "after_m": mast.after_m, "error_m": mast.error_m})
    clear_m = max(2 * mast.error_m, 0.005)
    ahead_m, left_m = (round(m, 3) if abs(m) > clear_m else 0.0 for m in (mast.ahead_m, mast.left_m))
    place = {"ahead_m": ahead_m, "left_m": left_m}
    options: dict[str, Value] = {f"truth_{name}": value for name, value in place.items() if value}
    return Finding("truth-mast", (seen,), place, options)
