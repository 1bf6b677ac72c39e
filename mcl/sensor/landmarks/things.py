"""Which obstacle of the map each landmark is on: a thing that can be moved, with all of its landmarks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...values.arrays import F64, I32, Bool
from ...values.map import Region

NONE = -1  # the number of no obstacle: walls, or a map that does not tell
REACH_M = 0.12  # a landmark that is farther outside of an obstacle is not on it


def things_of(points: F64, obstacles: Sequence[Region]) -> I32:
    """Return the number (M,) of the obstacle that each point (M, 3) is on, `NONE` for none."""
    thing = np.full(len(points), NONE, np.int32)
    for number, obstacle in enumerate(obstacles):
        low, high = obstacle.polygon.min(axis=0) - REACH_M, obstacle.polygon.max(axis=0) + REACH_M
        near = np.flatnonzero(((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1))
        thing[near[obstacle.depth_m(points[near, :2]) > -REACH_M]] = number
    return thing


def besides_one_thing(right: F64, thing: I32) -> float:
    """Return how many of K matches, each right with a probability, are not on the thing that has the most."""
    on_things: Bool = thing != NONE
    most = np.bincount(thing[on_things], right[on_things]).max(initial=0.0)
    return float(right.sum() - most)
