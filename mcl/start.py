"""Where a run begins: at a known pose, or anywhere."""

from __future__ import annotations

import numpy as np

from .belief import Belief, uniform_log_weights
from .draws import evenly
from .geometry import wrap
from .grid import Grid
from .typing import F64


def at_pose(pose: F64, n: int, origin: F64) -> Belief:
    """Put all n particles on one pose (3,): position tracking, zero variance (thesis 3.6.2)."""
    poses = np.empty((n, 3), np.float32)
    poses[:, :2] = pose[:2] - origin
    poses[:, 2] = wrap(np.asarray(pose[2:3], np.float64))[0]
    return Belief(poses, uniform_log_weights(n), origin)


def anywhere(grid: Grid, n: int, origin: F64, rng: np.random.Generator) -> Belief:
    """Spread n particles evenly over free space and all headings: global localization.

    Drawn row by row, so that a larger n keeps a smaller one's draws. Raises ValueError where nothing is
    free.
    """
    return Belief(evenly(grid, n, origin, rng), uniform_log_weights(n), origin)
