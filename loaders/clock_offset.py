"""How far two clocks are apart, told by the movement that was recorded with both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.typing import F64

PERIOD_S = 0.1  # both are looked at so often
WINDOW_S = 0.5  # over which speed and turn rate are taken, so that a tracker's jitter does not count
LONGEST_S = 20_000.0  # of a drive
FEWEST = 50  # moments, five seconds
LEAST_OVERLAP = 0.6  # of the shorter one
LEAST_WAY_M, LEAST_TURN_RAD = 0.5, 0.5  # what moves less tells nothing
ALIKE = 0.7  # correlation from which on they are taken for one movement
CLEARLY = 0.9  # share of it that any other offset may reach
NEAR_S = 3.0  # offsets so near are the same one


@dataclass(frozen=True, slots=True)
class Offset:
    """What has to be added to one clock's times."""

    offset_s: float
    correlation: float  # of the movements then, up to 1


def offset_between(t_s: F64, poses: F64, other_t_s: F64, other: F64) -> Offset | None:
    """Find what the other clock's times need, so that its poses (m, 3) move when the poses (n, 3) do.

    None where either hardly moves, or where no offset is clearly the best. Frames may differ: only speed and
    turn rate count.
    """
    if not (_moves(poses) and _moves(other)):
        return None
    ours, theirs = _rates(t_s, poses), _rates(other_t_s, other)
    if min(len(ours), len(theirs)) < FEWEST:
        return None
    scale = np.maximum(np.sqrt(np.mean(ours**2, axis=0)), 1e-9)
    alike = _correlations(ours / scale, theirs / scale)
    best = int(np.argmax(alike))
    lags = np.arange(len(alike)) - (len(theirs) - 1)
    others = alike[np.abs(lags - lags[best]) * PERIOD_S > NEAR_S]
    if alike[best] < ALIKE or (len(others) and others.max() > CLEARLY * alike[best]):
        return None
    return Offset(float(t_s[0] - other_t_s[0] + lags[best] * PERIOD_S), float(alike[best]))


def _moves(poses: F64) -> bool:
    """Tell whether there is enough movement to go by."""
    if len(poses) < 2:
        return False
    span = np.ptp(poses[:, :2], axis=0).max()
    return bool(span > LEAST_WAY_M or np.ptp(np.unwrap(poses[:, 2])) > LEAST_TURN_RAD)


def _rates(t_s: F64, poses: F64) -> F64:
    """Give speed, less its mean, and turn rate (k, 2) at even times from the first one on."""
    if not PERIOD_S < t_s[-1] - t_s[0] < LONGEST_S:
        return np.zeros((0, 2))
    at = np.arange(t_s[0], t_s[-1], PERIOD_S)
    columns = (poses[:, 0], poses[:, 1], np.unwrap(poses[:, 2]))
    before, after = (
        np.stack([np.interp(at + w, t_s, c) for c in columns]) for w in (-WINDOW_S / 2, WINDOW_S / 2)
    )
    step = (after - before) / WINDOW_S
    speed = np.hypot(step[0], step[1])
    return np.column_stack([speed - speed.mean(), step[2]])


def _correlations(ours: F64, theirs: F64) -> F64:
    """Give how alike two courses (k, 2), (m, 2) are for every shift of the second; 0 where few meet."""
    from scipy.signal import correlate  # slow to import, and every command would wait for it

    both = sum(correlate(ours[:, c], theirs[:, c]) for c in (0, 1))
    ones = np.ones(len(ours)), np.ones(len(theirs))
    ours_power = correlate((ours**2).sum(axis=1), ones[1])
    theirs_power = correlate(ones[0], (theirs**2).sum(axis=1))
    meeting = correlate(*ones)
    power = np.sqrt(np.maximum(ours_power * theirs_power, 1e-12))
    enough = meeting >= LEAST_OVERLAP * min(len(ours), len(theirs))
    # a stretch in which hardly anything moves is like any other
    lively = np.minimum(ours_power, theirs_power) > 0.05 * meeting
    return np.where(enough & lively, both / power, 0.0)
