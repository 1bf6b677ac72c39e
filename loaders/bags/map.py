"""The map that a bag holds as an occupancy grid, as walls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from maurice_mcl.arrays import F64, Bool
from maurice_mcl.map import Arena

OCCUPIED = 65  # percent; map_server's occupied_thresh
MOST_WALLS = 20_000  # segments; a finer grid is made coarser
MOST_CELLS = 2**28
GRID = "nav_msgs/OccupancyGrid"


def arena_of(grid: Any) -> Arena:
    """Give the map of an OccupancyGrid: walls run along the edges of occupied cells. ValueError for none."""
    info = grid.info
    width, height, side_m = int(info.width), int(info.height), float(info.resolution)
    if not (0 < width * height <= MOST_CELLS and math.isfinite(side_m) and side_m > 0):
        raise ValueError(f"found a map of {width} x {height} cells of {side_m} m, expected a grid")
    cells = np.asarray(grid.data, np.int16)
    if len(cells) != width * height:
        raise ValueError(f"found {len(cells)} cells, expected {width} x {height}")
    at, q = info.origin.position, info.origin.orientation
    heading = math.atan2(2 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)
    occupied = cells.reshape(height, width) >= OCCUPIED
    while len(edges := _edges(occupied)) > MOST_WALLS:
        occupied, side_m = _coarser(occupied), 2 * side_m
    corners = np.array([[0, 0, width, 0], [width, height, 0, height]], np.float64) * float(info.resolution)
    walls, frame = (_placed(part, float(at.x), float(at.y), heading) for part in (edges * side_m, corners))
    x, y = frame[:, 0::2], frame[:, 1::2]
    return Arena((float(x.min()), float(y.min()), float(x.max()), float(y.max())), walls)


def _edges(occupied: Bool) -> F64:
    """Give the borders between occupied cells and others as segments (W, 4), each as long as it runs."""
    padded = np.pad(occupied, 1)
    level = _runs(padded[1:, 1:-1] != padded[:-1, 1:-1])
    upright = _runs((padded[1:-1, 1:] != padded[1:-1, :-1]).T)
    lying = np.column_stack([level[:, 1], level[:, 0], level[:, 2], level[:, 0]])
    return np.concatenate(
        [lying, np.column_stack([upright[:, 0], upright[:, 1], upright[:, 0], upright[:, 2]])]
    )


def _runs(border: Bool) -> F64:
    """Give the runs (K, 3) of a border: its row, where it begins, where it ends."""
    steps = np.diff(np.pad(border, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return np.column_stack([row, begin, end]).astype(np.float64)


def _coarser(occupied: Bool) -> Bool:
    """Join cells two by two; one that holds anything occupied is."""
    height, width = occupied.shape
    even = np.pad(occupied, ((0, height % 2), (0, width % 2)))
    return np.asarray(even.reshape(even.shape[0] // 2, 2, -1, 2).any(axis=(1, 3)))


def _placed(segments: F64, x_m: float, y_m: float, heading: float) -> F64:
    """Turn and move segments (W, 4) from the grid's frame into the map's."""
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = segments[:, 0::2], segments[:, 1::2]
    turned = np.stack([x_m + x * cos - y * sin, y_m + x * sin + y * cos], axis=2)
    return turned.reshape(-1, 4)
