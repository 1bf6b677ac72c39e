"""How far beams reach on the map: sphere tracing on the distances from what blocks them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...values.arrays import F32, F64
from ...values.occupancy import OccupancyMap
from .field import cell_distances

LEAST_STEP = 0.5  # cells
ROUNDS = 4  # of steps between two times that rays which ended are put aside
CELL_DIAGONAL = 2**0.5


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """The map as rays see it: how many cells a ray may go on from each cell, and not pass what blocks it."""

    steps: F32  # (H + 2, W + 2) cells; 0: blocked. The border is blocked
    cell_m: float
    corner: F64  # (2,) of the border
    edge_blocks: bool  # rays that leave the map end there; else they reach as far as any

    @classmethod
    def of(cls, occupancy: OccupancyMap, unknown_blocks: bool = False) -> Rays:
        """Return rays that occupied cells end; with `unknown_blocks` also unknown ones and the map's edge."""
        blocked = occupancy.occupied | occupancy.unknown if unknown_blocks else occupancy.occupied
        steps = np.maximum(cell_distances(blocked) - np.float32(CELL_DIAGONAL), np.float32(LEAST_STEP))
        steps = np.pad(np.where(blocked, np.float32(0), steps), 1)
        corner = occupancy.corner - occupancy.cell_m
        return cls(steps, occupancy.cell_m, corner, unknown_blocks)

    def cast(self, poses: F64 | F32, angles_rad: F64, max_m: float) -> F32:
        """Return how far (N, B) rays from poses (N, 3), turned by angles (B,), reach: at most `max_m`."""
        height, width = self.steps.shape
        flat = self.steps.ravel()
        heading = (poses[:, 2, None] + angles_rad).astype(np.float32).ravel()
        along_x, along_y = np.cos(heading), np.sin(heading)
        start = (poses[:, :2].astype(np.float64) - self.corner) / self.cell_m
        x0, y0 = np.repeat(start.astype(np.float32).T, len(angles_rad), axis=1)
        gone, reach = np.zeros(len(heading), np.float32), np.empty(len(heading), np.float32)
        which, most = np.arange(len(heading)), np.float32(max_m / self.cell_m)
        while len(which):
            for _ in range(ROUNDS):
                columns = np.clip(x0 + gone * along_x, 0, width - 1).astype(np.int32)
                rows = np.clip(y0 + gone * along_y, 0, height - 1).astype(np.int32)
                step = flat.take(rows * width + columns, mode="clip")
                gone += step
            ended = (step == 0) | (gone >= most)
            if not self.edge_blocks:
                edge = (columns == 0) | (columns == width - 1) | (rows == 0) | (rows == height - 1)
                gone[edge & ended] = most
            reach[which[ended]] = gone[ended]
            left = ~ended
            x0, y0, gone, which = x0[left], y0[left], gone[left], which[left]
            along_x, along_y = along_x[left], along_y[left]
        return (np.minimum(reach, most) * np.float32(self.cell_m)).reshape(len(poses), len(angles_rad))


def cast(occupancy: OccupancyMap, poses: F64, angles_rad: F64, max_m: float) -> F32:
    """Return how far (N, B) rays from poses (N, 3) reach on a map; for many calls keep `Rays`."""
    return Rays.of(occupancy).cast(np.atleast_2d(poses), angles_rad, max_m)
