"""Trials from a drive: what each movement did, from the poses before and after it.

A leg is what happened between two known poses. When it is a turn, a straight, or one of each, its pose
change (three numbers) tells everything: on a way that drifts evenly the chord points along the heading at
the middle of the way, half the drift beyond its start. So

    turn, then straight:  drift = 2 (heading after - course),  turn = course - drift / 2 - heading before
    straight, then turn:  drift = 2 (course - heading before), turn = heading after - heading before - drift

Legs of more movements cannot be told apart so and are left out. Errors of the truth count fully: 1 cm across
a way of 0.5 m is 1.1 degrees of course and 2.3 degrees of drift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from .calibrate import Straights, Trials, Turns, unwrapped
from .motion import MauriceParameters
from .typing import F64

FloorOf = Callable[[F64, F64], str | None]  # names the floor of a way between two points (2,); None: several


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """What was measured between two known poses."""

    before: F64  # (3,) x_m, y_m, heading_rad
    motions: tuple[F64, ...]  # each (3,) forward_m, left_m, turn_rad
    after: F64  # (3,)


@dataclass(frozen=True, slots=True)
class _Part:
    """A turn or a straight of a leg."""

    straight: bool
    measured: float  # m or rad
    course_rad: float = 0.0  # of a straight, from the robot's forward


def trials_of(legs: Iterable[Leg], floor_of: FloorOf) -> Trials:
    """Sort out what each movement of the legs did. One leg is held at a time, and a few numbers of each."""
    turns: list[tuple[float, float]] = []
    straights: list[tuple[float, float, float]] = []
    floors: list[str | None] = []
    left_out = 0
    for leg in legs:
        parts = [part for motion in leg.motions for part in _parts(motion)]
        kinds = "".join("S" if part.straight else "T" for part in parts)
        if kinds not in ("", "T", "S", "TS", "ST"):
            left_out += len(parts)
            continue
        turn = next((part for part in parts if not part.straight), None)
        straight = next((part for part in parts if part.straight), None)
        turned, drift = _attribute(leg, straight, turn_first=kinds == "TS", turns=turn is not None)
        if turn is not None:
            turns.append((turn.measured, turned))
        if straight is not None:
            straights.append((straight.measured, _length(leg), drift))
            floors.append(floor_of(leg.before[:2], leg.after[:2]))
    measured, turned_rad = np.array(turns, np.float64).reshape(-1, 2).T
    way, went, drift_rad = np.array(straights, np.float64).reshape(-1, 3).T
    return Trials(
        Turns(measured, unwrapped(measured, turned_rad)),
        Straights(way, went, drift_rad, tuple(floors)),
        left_out,
    )


def _parts(motion: F64) -> list[_Part]:
    """Take a movement apart as the filter does, a turn first; what is too small is neither."""
    least = MauriceParameters()
    forward, left, turn = (float(v) for v in motion)
    way = math.hypot(forward, left)
    parts = [_Part(False, turn)] if abs(turn) >= least.turn_from_rad else []
    return parts + ([_Part(True, way, math.atan2(left, forward))] if way >= least.straight_from_m else [])


def _length(leg: Leg) -> float:
    return float(np.hypot(*(leg.after - leg.before)[:2]))


def _attribute(leg: Leg, way: _Part | None, *, turn_first: bool, turns: bool) -> tuple[float, float]:
    """Share the change of heading out: turn (up to whole circles) and drift, both in rad."""
    changed = float(leg.after[2] - leg.before[2])
    if way is None:
        return _wrapped(changed), math.nan
    if not turns:
        return math.nan, _wrapped(changed)
    if _length(leg) < MauriceParameters().straight_from_m:  # no course: the robot did not get away
        return _wrapped(changed), math.nan
    x, y = (float(v) for v in (leg.after - leg.before)[:2])
    forward = math.atan2(y, x) - way.course_rad
    drift = 2 * _wrapped(float(leg.after[2]) - forward if turn_first else forward - float(leg.before[2]))
    return _wrapped(changed - drift), drift


def _wrapped(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi
