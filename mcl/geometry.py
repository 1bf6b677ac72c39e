"""Poses in the plane: wrapping, composing, circular means.

Headings are radians, counter-clockwise from +x (REP-103); poses are (..., 3): x_m, y_m, heading_rad.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .typing import F64

Real = TypeVar("Real", bound=np.floating[Any])

INCH_M = 0.0254


def wrap(angle_rad: NDArray[Real]) -> NDArray[Real]:
    """Bring angles of any size into [-pi, pi); shape and precision are kept."""
    # Python floats keep the precision of a numpy array (NEP 50)
    return np.asarray((angle_rad + math.pi) % (2 * math.pi) - math.pi, angle_rad.dtype)


def angle_between(a_rad: float, b_rad: float) -> float:
    """Give the unsigned angle from one heading to the other, in [0, pi]."""
    return abs((a_rad - b_rad + np.pi) % (2 * np.pi) - np.pi)


def compose(pose: F64, motion: F64) -> F64:
    """Move one pose (3,) by a motion (forward_m, left_m, turn_rad) given in its own frame.

    The straight part is taken along the heading half way through the turn (midpoint integration).
    """
    x, y, heading = (float(v) for v in pose)
    forward, left, turn = (float(v) for v in motion)
    middle = heading + turn / 2
    cos, sin = np.cos(middle), np.sin(middle)
    moved = [x + forward * cos - left * sin, y + forward * sin + left * cos, heading + turn]
    moved[2] = (moved[2] + np.pi) % (2 * np.pi) - np.pi
    return np.array(moved)


def circular_mean(angle_rad: NDArray[Any], weight: NDArray[Any]) -> tuple[float, float]:
    """Give the weighted mean direction and the circular standard deviation, both in radians.

    The deviation is sqrt(-2 ln R) of the mean resultant length R (Mardia and Jupp, Directional
    Statistics, 2.3.4); it is infinite where the directions cancel. Weights (N,) need not sum to one.
    """
    total = float(np.sum(weight, dtype=np.float64))
    s = float(np.sum(weight * np.sin(angle_rad), dtype=np.float64)) / total
    c = float(np.sum(weight * np.cos(angle_rad), dtype=np.float64)) / total
    resultant = min(np.hypot(s, c), 1.0)
    spread = np.sqrt(-2 * np.log(resultant)) if resultant > 0 else np.inf
    return float(np.arctan2(s, c)), float(spread)
