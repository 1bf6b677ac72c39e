"""Path planning: free space on a raster, and the next point on the path to a goal.

SciPy is imported where it is used: trials over a recorded session and a demo from the cache plan no path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.values import F64, I32, INCH_M, Arena, Bool, wrap

from ..worlds.world import clearance

if TYPE_CHECKING:
    from scipy.sparse import csr_array

CELL_M = 3.0 * INCH_M  # of the raster
KEEP_M = 6.0 * INCH_M  # planned ways keep this from the robot's middle to anything solid
AHEAD = 12  # cells looked ahead for the next point: a stride's length and a little more
PART = 2000  # cells whose distances to all walls are computed in one batch
TRIES = 100_000  # draws of a free pose before one gives up
SCALES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)  # at which a recorded path is tried, in this order
PLACES = 4000  # places tried at each scale
TRACK = 400  # points of a path that are looked at first


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """The connected free cells and which of them are neighbors; computed once per drive."""

    arena: Arena
    centers: F64  # (K, 2) of the free cells
    steps: csr_array[np.float64, tuple[int, int]]  # (K, K), each pair once: distances between neighbors
    free: Bool  # (columns along x, rows along y) all cells of the arena's bounds

    def nearest(self, point: F64) -> int:
        """Return the free cell nearest to a point (2,)."""
        return int(np.argmin(np.sum((self.centers - point) ** 2, axis=1)))

    def covers(self, points: F64) -> bool:
        """Return whether all points (K, 2) lie in free cells."""
        cells = ((points - self.arena.bounds[:2]) / CELL_M).astype(int)
        if (cells < 0).any() or (cells >= self.free.shape).any():
            return False
        return bool(self.free[cells[:, 0], cells[:, 1]].all())

    def way_to(self, goal: F64) -> I32:
        """Return for every free cell (K,) the next one on the path to a goal (2,), negative at the goal."""
        from scipy.sparse.csgraph import dijkstra

        goals = np.array([self.nearest(goal)])
        onward = dijkstra(self.steps, directed=False, indices=goals, return_predecessors=True)[1]
        return np.asarray(onward[0], np.int32)

    def next_point(self, point: F64, way: I32) -> F64:
        """Return the farthest point (2,) on a path, not far ahead, in a straight line from a point."""
        cells = [self.nearest(point)]
        while len(cells) < AHEAD and way[cells[-1]] >= 0:
            cells.append(int(way[cells[-1]]))
        ends = self.centers[cells]
        between = point + (ends - point)[:, None] * np.linspace(0.1, 1, 8)[:, None]  # (cells, 8, 2)
        room = clearance(self.arena, between.reshape(-1, 2)).reshape(-1, 8).min(axis=1)
        straight = np.flatnonzero(room > KEEP_M - CELL_M / 2)
        return np.asarray(ends[straight[-1] if len(straight) else 0])


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Moves a path: scaled about the origin, turned, then shifted."""

    scale: float
    turn_rad: float
    shift: F64  # (2,)

    def points(self, points: F64) -> F64:
        """Move points (..., 2)."""
        cos, sin = np.cos(self.turn_rad), np.sin(self.turn_rad)
        return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) * self.scale + self.shift)

    def pose(self, pose: F64) -> F64:
        """Move a pose (3,)."""
        return np.array([*self.points(pose[:2]), *wrap(pose[2:] + self.turn_rad)])


def raster(arena: Arena) -> Raster | None:
    """Cut the arena into cells, keep the connected ones with enough room; None if there are none."""
    from scipy.sparse import coo_array, csr_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    x_min, y_min, x_max, y_max = arena.bounds
    x = np.arange(x_min + CELL_M / 2, x_max, CELL_M)
    y = np.arange(y_min + CELL_M / 2, y_max, CELL_M)
    centers = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    parts = np.array_split(centers, len(centers) // PART + 1)  # or large floors take much memory at once
    centers = centers[np.concatenate([clearance(arena, part) for part in parts]) > KEEP_M]
    if len(centers) < 2:
        return None
    pairs = cKDTree(centers).query_pairs(1.5 * CELL_M, output_type="ndarray")
    gaps = np.linalg.norm(centers[pairs[:, 0]] - centers[pairs[:, 1]], axis=1)
    steps = coo_array((gaps, (pairs[:, 0], pairs[:, 1])), shape=(len(centers), len(centers))).tocsr()
    part = connected_components(steps, directed=False)[1]
    largest = np.flatnonzero(part == np.argmax(np.bincount(part)))
    centers, steps = centers[largest], csr_array(steps[largest][:, largest])
    free = np.zeros((len(x), len(y)), bool)
    free[tuple(((centers - (x_min, y_min)) / CELL_M).astype(int).T)] = True
    return Raster(arena, centers, steps, free)


def free_pose(map_: Raster, rng: np.random.Generator, away_from: F64 | None = None, away_m: float = 0) -> F64:
    """Draw a free pose (3,) evenly, `away_m` from a point (2,) at least; ValueError when there is none."""
    x_min, y_min, x_max, y_max = map_.arena.bounds
    for _ in range(TRIES):
        point = rng.uniform((x_min, y_min), (x_max, y_max))
        heading = rng.uniform(-np.pi, np.pi)
        far = away_from is None or float(np.hypot(*(point - away_from[:2]))) >= away_m
        if far and is_free(map_, point):
            return np.array([*point, heading])
    raise ValueError("found no free cell")


def is_free(map_: Raster, point: F64) -> bool:
    """Return whether the robot can stand at a point (2,) and get from there to everywhere else."""
    gap = map_.centers[map_.nearest(point)] - point
    near = bool(np.hypot(*gap) < CELL_M)
    return near and float(clearance(map_.arena, point[None])[0]) > KEEP_M


def fit(map_: Raster, track: F64, rng: np.random.Generator) -> Placement | None:
    """Find a place where a path (K, 2) keeps clear of everything, as large as it can be; None for none."""
    few = track[:: len(track) // TRACK + 1]
    middle = (track.min(axis=0) + track.max(axis=0)) / 2
    for scale in SCALES:
        for _ in range(PLACES):
            turn = rng.uniform(-np.pi, np.pi)
            center = map_.centers[rng.integers(len(map_.centers))]
            at = Placement(scale, turn, center - Placement(scale, turn, np.zeros(2)).points(middle))
            if map_.covers(at.points(few)) and map_.covers(at.points(track)):
                return at
    return None
