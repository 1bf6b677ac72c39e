"""Where a run begins: at a known pose, or anywhere."""

from __future__ import annotations

import numpy as np

from .belief import Belief, uniform_log_weights
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
    free = np.flatnonzero(grid.free.ravel())
    if not len(free):
        raise ValueError("no free space to start in: obstacles and walls cover the whole map")
    draws = rng.random((n, 4))
    cell = free[(draws[:, 0] * len(free)).astype(np.int64)]
    columns = grid.shape[1]
    index = np.column_stack([cell % columns, cell // columns])
    xy = grid.corner + grid.cell_m * (index + draws[:, 1:3]) - origin
    heading = draws[:, 3] * (2 * np.pi) - np.pi
    return Belief(np.column_stack([xy, heading]).astype(np.float32), uniform_log_weights(n), origin)
