"""Poses in space to poses in the plane: x, y, and where the forward axis points."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from maurice_mcl.typing import F64

LEANING_RAD = math.radians(30)  # more than that off the plane is worth saying


def rotation(quaternion_wxyz: F64) -> F64:
    """Give the rotation matrix (3, 3) of a quaternion (4,). ValueError when its length is not about 1."""
    length = float(np.linalg.norm(quaternion_wxyz))
    if not 0.9 < length < 1.1:
        raise ValueError(f"found a quaternion of length {length:.3g}, expected 1")
    w, x, y, z = (float(v) / length for v in quaternion_wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def forward_axis(rotations: Iterable[F64]) -> str:
    """Tell which axis of a body looks forward, "x" or "z", by the one that stands upright in a z-up world.

    A robot's z is up and its x forward (REP-103); a camera's y is down and its z forward (optical frame),
    and so it is with a camera whose x is up (EuRoC).
    """
    upright = np.mean([np.abs(r[2]) for r in rotations], axis=0)
    return "x" if int(np.argmax(upright)) == 2 else "z"


def planar(position: F64, turned: F64, axis: str) -> F64:
    """Give x, y and the heading of the forward axis (3,) of a pose in a z-up world."""
    ahead = turned[:, 0 if axis == "x" else 2]
    return np.array([position[0], position[1], math.atan2(ahead[1], ahead[0])])


def leaning(turned: F64, axis: str) -> float:
    """Tell how far, in radians, the forward axis points out of the plane."""
    return abs(math.asin(max(-1.0, min(1.0, float(turned[2, 0 if axis == "x" else 2])))))
