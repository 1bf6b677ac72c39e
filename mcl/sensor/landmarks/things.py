"""Things that can be moved: which obstacle each landmark is on, and which things moved since the survey.

What moved is seen by matches that disagree with a pose, and agree on one shift. A thing on the floor moves
along it, so that two numbers tell where it is now. Every disagreeing match votes for the shifts that would
bring its landmark to where it was seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, I32, Bool, MovedThing, Region
from .camera import PinholeCamera, project

NO_THING = -1  # the number of no obstacle: walls, or a map that does not tell
THING_MARGIN_M = 0.12  # a landmark that is farther outside of an obstacle is not on it


def things_of(points: F64, obstacles: Sequence[Region]) -> I32:
    """Return the number (M,) of the obstacle that each point (M, 3) is on, `NO_THING` for none."""
    thing = np.full(len(points), NO_THING, np.int32)
    for number, obstacle in enumerate(obstacles):
        corners = obstacle.polygon
        low, high = corners.min(axis=0) - THING_MARGIN_M, corners.max(axis=0) + THING_MARGIN_M
        near = np.flatnonzero(((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1))
        thing[near[obstacle.depth_m(points[near, :2]) > -THING_MARGIN_M]] = number
    return thing


def besides_one_thing(right: F64, thing: I32) -> float:
    """Return how many of K matches, each right with a probability, are not on the thing that has the most."""
    on_things: Bool = thing != NO_THING
    most = np.bincount(thing[on_things], right[on_things]).max(initial=0.0)
    return float(right.sum() - most)


# What moved.

MOST_SHIFT_M, SHIFT_STEP_M = 1.2, 0.04  # of shifts that are tried, along each axis
LEAST_SHIFT_M = 0.12  # a smaller shift is an error of the pose
TOLERANCE_PX = 4.0
THING_RADIUS_M = 1.0  # a thing is not larger than this on either side of its middle
LEAST_MATCHES, LEAST_RIGHT_MATCHES = 5, 3.0  # matches, and the expected number of right ones among them
SAME_SHIFT_M = 0.15  # shifts of one thing that turned
MOST_THINGS = 3


def moved_things(
    camera: PinholeCamera, points: F64, pixels: F32, chance: F32, pose: F64
) -> tuple[MovedThing, ...]:
    """Return what moved, of disagreeing landmarks (K, 3) seen at pixels (K, 2) from a pose (3,).

    `chance` (K,) is that of a match to be right, before anything is known of the pose.
    """
    left, things = np.ones(len(points), np.bool_), list[MovedThing]()
    fits = _fits(camera, points, pixels, pose)
    while left.sum() >= LEAST_MATCHES and len(things) < MOST_THINGS:
        chosen, shift = _largest(fits & left, points, chance)
        if chosen.sum() < LEAST_MATCHES or chance[chosen].sum() < LEAST_RIGHT_MATCHES:
            break
        things = _joined(things, MovedThing(points[chosen, :2], shift))
        left &= ~chosen
    return tuple(things)


def _joined(things: list[MovedThing], new: MovedThing) -> list[MovedThing]:
    """Add a group, to one that it is a part of: a thing that turned moved its parts differently."""
    for k, thing in enumerate(things):
        near = np.hypot(*(thing.places.mean(axis=0) - new.places.mean(axis=0))) < THING_RADIUS_M
        if near and np.hypot(*(thing.shift_m - new.shift_m)) < SAME_SHIFT_M:
            both = MovedThing(np.concatenate([thing.places, new.places]), thing.shift_m)
            return [*things[:k], both, *things[k + 1 :]]
    return [*things, new]


def _shifts() -> F64:
    along = np.arange(-MOST_SHIFT_M, MOST_SHIFT_M + SHIFT_STEP_M / 2, SHIFT_STEP_M)
    shifts = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    length = np.hypot(*shifts.T)
    return np.asarray(shifts[(length >= LEAST_SHIFT_M) & (length <= MOST_SHIFT_M)])


SHIFTS = _shifts()  # (S, 2)


def _fits(camera: PinholeCamera, points: F64, pixels: F32, pose: F64) -> Bool:
    """Tell for each shift and match whether the landmark, shifted, is where the keypoint is: (S, K)."""
    # the robot moved the other way sees the same
    poses = np.column_stack([-SHIFTS, np.full(len(SHIFTS), pose[2])]).astype(np.float32)
    projected, _ = project(camera, poses, (points - [pose[0], pose[1], 0.0]).astype(np.float32))
    off = projected - pixels.T[:, None, :]
    return np.asarray(off[0] ** 2 + off[1] ** 2 < TOLERANCE_PX**2)


def _largest(fits: Bool, points: F64, chance: F32) -> tuple[Bool, F64]:
    """Return the group no larger than a thing that agrees on a shift, and is likeliest right; the shift."""
    likely = fits @ chance
    best, most = np.zeros(len(points), np.bool_), 0.0
    for k in np.argsort(-likely, kind="stable"):
        if likely[k] <= most or likely[k] < LEAST_RIGHT_MATCHES:
            break
        members = fits[k] & _together(points, np.flatnonzero(fits[k]))
        if chance[members].sum() > most:
            best, most = members, float(chance[members].sum())
    if not best.any():
        return best, SHIFTS[0]
    return best, np.asarray(SHIFTS[fits[:, best].all(axis=1)].mean(axis=0))


def _together(points: F64, which: NDArray[np.intp]) -> Bool:
    """Tell which points (P,) are near the member that has most of the others near it."""
    distance_m = np.hypot(*(points[which, None, :2] - points[None, which, :2]).T)
    middle = which[int((distance_m < THING_RADIUS_M).sum(axis=0).argmax())]
    return np.asarray(np.hypot(*(points[:, :2] - points[middle, :2]).T) < THING_RADIUS_M)
