"""A map as square cells, free or occupied, as ROS draws maps."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.arena import Arena

CELL_M = 0.025
MOST_CELLS = 1_000_000  # a larger map has coarser cells
OCCUPIED = 100  # percent
SHIFT = 8  # bits behind the point in what OpenCV is given


def occupancy(arena: Arena) -> tuple[float, NDArray[np.int8]]:
    """Give the side of a cell in metres, and the cells (rows, columns): 0 or 100.

    The first row is at the smallest y, as in a nav_msgs/OccupancyGrid.
    """
    width_m, depth_m = arena.size_m
    cell_m = max(CELL_M, math.sqrt(width_m * depth_m / MOST_CELLS))
    rows, columns = (max(1, math.ceil(side_m / cell_m - 1e-6)) for side_m in (depth_m, width_m))
    cells = np.zeros((rows, columns), np.uint8)
    for region in arena.obstacles:
        corners = _pixels(region.polygon, arena, cell_m)
        cv2.fillPoly(cells, [corners], OCCUPIED, lineType=cv2.LINE_8, shift=SHIFT)
    for wall in arena.walls:
        start, end = _pixels(wall.reshape(2, 2), arena, cell_m).tolist()
        cv2.line(cells, start, end, OCCUPIED, lineType=cv2.LINE_8, shift=SHIFT)
    return cell_m, cells.astype(np.int8)


def _pixels(points: NDArray[np.float64], arena: Arena, cell_m: float) -> NDArray[np.int32]:
    """Give points (K, 2) as OpenCV wants them: counted from the first cell's center."""
    counted = (points - arena.bounds[:2]) / cell_m - 0.5
    return np.asarray(np.round(counted * 2**SHIFT), np.int32)
