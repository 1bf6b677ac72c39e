"""How far beams reach on the map: sphere tracing on the distances from what blocks them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...values import F32, F64, OccupancyMap
from .field import cell_distances, look_up

LEAST_STEP = 0.5  # cells
WALL_MARGIN = 1.0  # cells that a ray ends before the middle of a blocked one; a corner may be cut
STEP_OUTSIDE = 1e6  # cells: the step of a ray outside of a map whose edge does not block it
LEAST_ALONG = 1e-9  # of a direction along an axis
BLOCK_RAYS = 30_000  # that stay in the cache, and fewer than `MOST_CELLS`
STEPS_A_ROUND = 10  # after which rays that ended are put aside


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """The map as rays see it: how many cells a ray may go on from each cell, and not pass what blocks it."""

    steps: F32  # (H, W) cells; 0: blocked
    outside: float  # the same outside of the map
    cell_m: float
    corner: F64  # (2,) of the map

    @classmethod
    def of(cls, occupancy: OccupancyMap, unknown_blocks: bool = False) -> Rays:
        """Return rays that occupied cells end; with `unknown_blocks` also unknown ones and the map's edge."""
        blocked = occupancy.occupied | occupancy.unknown if unknown_blocks else occupancy.occupied
        steps = np.maximum(cell_distances(blocked) - np.float32(WALL_MARGIN), np.float32(LEAST_STEP))
        steps[blocked] = 0
        return cls(steps, 0.0 if unknown_blocks else STEP_OUTSIDE, occupancy.cell_m, occupancy.corner)

    def cast(self, poses: F64, angles_rad: F64, max_m: float) -> F32:
        """Return how far (N, B) rays from poses (N, 3), turned by angles (B,), reach: at most `max_m`."""
        turned = (poses[:, 2, None] + angles_rad).astype(np.float32).ravel()
        start = ((poses[:, :2] - self.corner) / self.cell_m - 0.5).astype(np.float32)
        rays = np.stack([*np.repeat(start.T, len(angles_rad), axis=1), np.cos(turned), np.sin(turned)])
        most = np.float32(max_m / self.cell_m)
        blocks = [self._reach(rays[:, k : k + BLOCK_RAYS], most) for k in range(0, len(turned), BLOCK_RAYS)]
        reach = np.concatenate(blocks) if blocks else np.zeros(0, np.float32)
        return np.asarray(reach * np.float32(self.cell_m)).reshape(len(poses), len(angles_rad))

    def _reach(self, rays: F32, most: np.float32) -> F32:
        """Follow rays (4, R) x, y, cosine, sine until they are blocked, at most this many cells (R,)."""
        reach, gone = np.full(rays.shape[1], most), np.zeros(rays.shape[1], np.float32)
        if self.outside:
            gone = self._to_map(rays)
        which = np.arange(len(reach))
        while len(which):
            x, y, along_x, along_y = rays
            for _ in range(STEPS_A_ROUND):
                step = look_up(self.steps, x + gone * along_x, y + gone * along_y, self.outside).ravel()
                gone += step
            blocked = (step == 0) & (gone < most)
            reach[which[blocked]] = gone[blocked]
            left = (step > 0) & (gone < most)
            which, gone, rays = which[left], gone[left], rays[:, left]
        return reach

    def _to_map(self, rays: F32) -> F32:
        """Return how many cells rays (4, R) go until they are on the map; those that never are go no step."""
        x, y, along_x, along_y = rays
        height, width = self.steps.shape
        off = (x < -0.5) | (x > width - 0.5) | (y < -0.5) | (y > height - 0.5)
        gone = np.zeros(rays.shape[1], np.float32)
        if not off.any():
            return gone
        place, along = np.stack([x, y])[:, off], np.stack([along_x, along_y])[:, off]
        low, high = np.full((2, 1), -0.5), np.array([[width - 0.5], [height - 0.5]])
        along = np.where(np.abs(along) < LEAST_ALONG, LEAST_ALONG, along)
        borders = np.sort(np.stack([low - place, high - place]) / along, axis=0)
        enter, leave = borders[0].max(axis=0), borders[1].min(axis=0)
        gone[off] = np.where((enter < leave) & (enter > 0), enter + LEAST_STEP, 0)
        return gone


def cast(occupancy: OccupancyMap, poses: F64, angles_rad: F64, max_m: float) -> F32:
    """Return how far (N, B) rays from poses (N, 3) reach on a map; for many calls keep `Rays`."""
    return Rays.of(occupancy).cast(np.atleast_2d(poses), angles_rad, max_m)
