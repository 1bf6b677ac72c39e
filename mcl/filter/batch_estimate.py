"""The estimates of many clouds of one size at once: those of `estimate`, bit for bit, row by row.

Arrays are (R, N): R runs, N particles. For a few hundred particles numpy's calls cost more than its passes;
here a call serves all runs. Sums along a row and products of rows are those of the row alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..values.arrays import F32, F64, Bool
from ..values.radii import Radii
from .estimate import CELLS_A_CLUSTER, CIRCLE_M, MOST_CELLS_A_SIDE, MOST_SHIFTS, SETTLED_M, TIE, disc

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Clouds:
    """R clouds of N particles, column by column."""

    x: F64  # (R, N) relative to the origin
    y: F64
    heading_rad: F32
    sin: F64  # of the headings
    cos: F64
    weights: F64  # each row sums to one
    origin: F64  # (2,)

    @classmethod
    def of(cls, poses: F32, weights: F64, origin: F64) -> Clouds:
        """Take poses (3, R, N) and weights (R, N)."""
        x, y, heading = poses
        wide = [part.astype(np.float64) for part in (x, y, np.sin(heading), np.cos(heading))]
        return cls(wide[0], wide[1], heading, wide[2], wide[3], weights, origin)

    def some(self, runs: Bool) -> Clouds:
        """Return some of the clouds."""
        x, y, sin, cos, weights = (p[runs] for p in (self.x, self.y, self.sin, self.cos, self.weights))
        return Clouds(x, y, self.heading_rad[runs], sin, cos, weights, self.origin)


def are_wide(clouds: Clouds, reach_m: float) -> Bool:
    """Return which (R,) clouds are spread over more than a hundred radii: they need larger cells."""
    most_m = reach_m / CELLS_A_CLUSTER * MOST_CELLS_A_SIDE
    wide: Bool = np.maximum(np.ptp(clouds.x, axis=1), np.ptp(clouds.y, axis=1)) > most_m
    return wide


def batch_estimates(clouds: Clouds, radii: Radii) -> dict[str, F64]:
    """Return the columns of a trace that come from `estimates`, (R,) or (R, K); no cloud may be wide."""
    held = clouds.weights * _heaviest(clouds, radii.cluster_m)
    mass = held.sum(axis=1)
    poses, sd_m, away = _means(clouds, held, mass)
    mean_poses, mean_sd_m, _ = _means(clouds, clouds.weights, clouds.weights.sum(axis=1))
    centers = poses[:, :2] - clouds.origin
    return {
        "poses": poses,
        "sd_m": sd_m,
        "heading_sd_rad": _heading_sd(clouds, held, mass, poses[:, 2]),
        "mass": mass,
        "confidence": _dot(clouds.weights, away <= radii.confidence_m**2),
        "converged": _dot(clouds.weights, away <= radii.cluster_m**2),
        "circle": _dot(clouds.weights, _near(clouds.x, clouds.y, centers.T, CIRCLE_M)),
        "mean_poses": mean_poses,
        "mean_sd_m": mean_sd_m,
    }


def _dot(a: F64, b: F64 | F32 | Bool) -> F64:
    return np.asarray(np.vecdot(a, b), np.float64)


def _near(x: F64, y: F64, centers: F64, radius_m: float) -> Bool:
    """Return which (R, N) lie within a radius of their row's center, (2, R)."""
    away, down = x - centers[0][:, None], y - centers[1][:, None]
    np.square(away, out=away)
    away += np.square(down, out=down)
    near: Bool = away <= radius_m**2
    return near


def _heaviest(clouds: Clouds, reach_m: float) -> Bool:
    centers = _shift(_amid_most(clouds, reach_m), clouds, reach_m)
    return _near(clouds.x, clouds.y, centers, reach_m)


def _amid_most(clouds: Clouds, reach_m: float) -> F64:
    """Return where the mean shifts start (2, R). The rasters lie below one another in one picture."""
    side_m = reach_m / CELLS_A_CLUSTER
    kernel = disc(reach_m / side_m)
    right, down = (part - part.min(axis=1, keepdims=True) for part in (clouds.x, clouds.y))
    cell, row = (right / side_m).astype(np.int64), (down / side_m).astype(np.int64)
    columns, rows = cell.max(axis=1) + 1, row.max(axis=1) + 1
    ends = np.cumsum(rows + len(kernel) // 2)  # below each raster are empty rows, as far as the disc reaches
    firsts, width = np.append(0, ends[:-1]), int(columns.max())
    row += firsts[:, None]
    row *= width
    cell += row
    raster = np.bincount(cell.ravel(), clouds.weights.ravel(), ends[-1] * width).reshape(-1, width)
    held = np.asarray(cv2.filter2D(raster, -1, kernel, borderType=cv2.BORDER_CONSTANT), np.float64)
    fullest_row, fullest_column = _fullest(held, firsts, rows, columns)
    right -= (side_m * (fullest_column + 0.5))[:, None]
    down -= (side_m * (fullest_row + 0.5))[:, None]
    away = np.square(right, out=right)
    away += np.square(down, out=down)
    away[clouds.weights <= 0] = np.inf
    nearest = (away <= away.min(axis=1, keepdims=True) * (1 + TIE)).argmax(axis=1)
    every = np.arange(len(nearest))
    return np.stack([clouds.x[every, nearest], clouds.y[every, nearest]])


def _fullest(held: F64, firsts: Ints, rows: Ints, columns: Ints) -> tuple[Ints, Ints]:
    """Return row and column of the first fullest cell of each raster (R,), within the raster."""
    width, heights = held.shape[1], np.diff(np.append(firsts, len(held)))
    ends = np.stack([columns, 0 * columns], axis=1).ravel()  # none of the empty rows below
    lengths = np.stack([rows, heights - rows], axis=1).ravel()
    held[np.arange(width) >= np.repeat(ends, lengths)[:, None]] = -1
    fullest = np.maximum.reduceat(held.max(axis=1), firsts) * (1 - TIE)
    hits = np.flatnonzero(held >= np.repeat(fullest, heights)[:, None])
    first = hits[np.searchsorted(hits, firsts * width)]
    return first // width - firsts, first % width


def _shift(centers: F64, clouds: Clouds, reach_m: float) -> F64:
    """Shift every center (2, R) to the mean of the particles in reach until it converges."""
    x, y, weights = clouds.x, clouds.y, clouds.weights
    left = np.arange(len(x))  # runs that have not converged
    for _ in range(MOST_SHIFTS):
        last = centers[:, left]
        held = weights * _near(x, y, last, reach_m)
        centers[:, left] = np.stack([_dot(held, x), _dot(held, y)]) / held.sum(axis=1)
        moved = zip(centers[:, left].T.tolist(), last.T.tolist(), strict=True)
        still = np.array([math.dist(now, before) >= SETTLED_M for now, before in moved], bool)
        if not still.any():
            break
        if not still.all():
            left, x, y, weights = left[still], x[still], y[still], weights[still]
    return centers


def _means(clouds: Clouds, held: F64, mass: F64) -> tuple[F64, F64, F64]:
    """Return the mean poses (R, 3) and spreads (R, 2) of a part `held` (R, N) of every cloud.

    Also the squared distances (R, N) of its particles from there.
    """
    x_m, y_m = _dot(held, clouds.x) / mass, _dot(held, clouds.y) / mass
    sums = zip(_dot(held, clouds.sin).tolist(), _dot(held, clouds.cos).tolist(), strict=True)
    heading = np.array([math.atan2(sin, cos) for sin, cos in sums])
    along_x, along_y = clouds.x - x_m[:, None], clouds.y - y_m[:, None]
    np.square(along_x, out=along_x)
    np.square(along_y, out=along_y)
    sd_m = np.sqrt(np.stack([_dot(held, along_x) / mass, _dot(held, along_y) / mass], axis=1))
    poses = np.stack([x_m + clouds.origin[0], y_m + clouds.origin[1], heading], axis=1)
    return poses, sd_m, np.add(along_x, along_y, out=along_x)


def _heading_sd(clouds: Clouds, held: F64, mass: F64, means: F64) -> F64:
    """Return the deviation of `circular_mean_of` of every row (R,), from its means (R,)."""
    half = clouds.heading_rad - means.astype(np.float32)[:, None]
    half /= 2
    np.sin(half, out=half)
    lacks = (2 * _dot(held, np.square(half, out=half)) / mass).tolist()
    return np.array([math.sqrt(-2 * math.log1p(-lack)) if lack < 1 else math.inf for lack in lacks])
