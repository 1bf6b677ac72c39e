"""Poses in the plane (SE(2)): wrapping, turning, composing, motions between poses, circular means.

Headings are radians, counter-clockwise from +x (REP-103); poses are (..., 3): x_m, y_m, heading_rad.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .arrays import F64, dot

Real = TypeVar("Real", bound=np.floating[Any])

INCH_M = 0.0254
_PRECISIONS = (np.float32, np.float64)
# the least and the greatest angle
_ENDS = {np.dtype(kind): (-kind(math.pi), np.nextafter(kind(math.pi), kind(0))) for kind in _PRECISIONS}


def wrap(angle_rad: NDArray[Real]) -> NDArray[Real]:
    """Bring angles of any size into [-pi, pi), shape and precision kept; six times faster than `%`."""
    # Python floats keep the precision of a numpy array (NEP 50)
    turned = np.asarray(angle_rad + math.pi, angle_rad.dtype)
    turned *= 0.5 / math.pi
    np.floor(turned, out=turned)
    turned *= -2 * math.pi
    turned += angle_rad
    # rounding can leave an angle a hair outside
    least, most = _ENDS[angle_rad.dtype]
    np.minimum(turned, most, out=turned)
    np.maximum(turned, least, out=turned)
    return turned


Numbers = TypeVar("Numbers", float, F64)


def wrap_angle(angle_rad: Numbers) -> Numbers:
    """Bring angles into [-pi, pi) by one modulo: for a few angles, where rounding may be visible."""
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi


def angle_between(a_rad: float, b_rad: float) -> float:
    """Return the unsigned angle from one heading to the other, in [0, pi]."""
    return abs(wrap_angle(a_rad - b_rad))


def rotated(x: Numbers, y: Numbers, angle_rad: F64 | float) -> tuple[Numbers, Numbers]:
    """Turn vectors, given by their coordinates, counter-clockwise; arguments are broadcast."""
    cos: Any = np.cos(angle_rad)
    sin: Any = np.sin(angle_rad)
    return x * cos - y * sin, x * sin + y * cos


def compose(pose: F64, motion: F64) -> F64:
    """Move one pose (3,) by a motion (forward_m, left_m, turn_rad) in its own frame; the turn comes last."""
    x, y, heading = pose.tolist()
    forward, left, turn = motion.tolist()
    cos, sin = float(np.cos(heading)), float(np.sin(heading))
    ahead, aside = x + forward * cos - left * sin, y + forward * sin + left * cos
    return np.array([ahead, aside, wrap_angle(heading + turn)])


def compose_motions(first: F64, second: F64) -> F64:
    """Return the motion (3,) of two motions (3,) in sequence; its turn is their sum, not wrapped."""
    x, y, _ = compose(first, second)
    return np.array([x, y, first[2] + second[2]])


def motion_between(before: F64, after: F64) -> F64:
    """Return the motion (3,) from one pose (3,) to another: the inverse of `compose`, its turn wrapped."""
    (x, y, heading), (x_after, y_after, heading_after) = before.tolist(), after.tolist()
    dx, dy, cos, sin = x_after - x, y_after - y, math.cos(heading), math.sin(heading)
    return np.array([dx * cos + dy * sin, dy * cos - dx * sin, wrap_angle(heading_after - heading)])


def inverse(motion: F64) -> F64:
    """Return the motion (3,) that undoes another (3,): `compose(compose(pose, motion), inverse(motion))`."""
    return motion_between(motion, np.zeros(3))


def motions_between(poses: F64) -> F64:
    """Return the motion (T, 3) to each of the poses (T, 3) from the one before it; zero for the first."""
    step = np.diff(poses, axis=0, prepend=poses[:1])
    before = np.concatenate([poses[:1, 2], poses[:-1, 2]])
    ahead, aside = rotated(step[:, 0], step[:, 1], -before)
    return np.column_stack([ahead, aside, wrap_angle(step[:, 2])])


def path_of(motions: F64) -> F64:
    """Return the poses (T, 3) that T motions (T, 3) lead to, from the origin; headings are not wrapped."""
    heading = np.cumsum(motions[:, 2])
    x, y = rotated(motions[:, 0], motions[:, 1], heading - motions[:, 2])
    return np.column_stack([np.cumsum(x), np.cumsum(y), heading])


def circular_mean(angle_rad: NDArray[Any], weight: NDArray[Any]) -> tuple[float, float]:
    """Return the weighted mean direction and the circular standard deviation, both in radians.

    The deviation is sqrt(-2 ln R) of the mean resultant length R (Mardia and Jupp 2.3.4); weights need no sum
    of 1.
    """
    weights = np.asarray(weight, np.float64)
    mean = math.atan2(dot(weights, np.sin(angle_rad)), dot(weights, np.cos(angle_rad)))
    # 1 - R = 2 <sin^2> of half the angles to the mean, which keeps its digits where all angles are alike
    half = angle_rad - mean
    half /= 2
    np.sin(half, out=half)
    lack = 2 * dot(weights, np.square(half, out=half)) / float(weights.sum())
    return mean, math.sqrt(-2 * math.log1p(-lack)) if lack < 1 else math.inf
