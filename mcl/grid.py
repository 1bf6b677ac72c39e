"""The map as a raster: what is free, which floor lies there, which reference place is nearest.

The nearest place is looked up once per raster cell and then only indexed, so that comparing particles
with references costs the same for any number of walls. A place behind a wall is never nearest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

from .arena import Arena, Region
from .geometry import INCH_M
from .typing import F32, F64, I32, U8, Bool

CELLS_PER_SPACING = 18  # an 18 in grid of places gives 1 in cells
FINEST_M = INCH_M
MOST_CELLS = 4_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Square cells over an arena; cell (row, column) starts at `corner + cell_m * (column, row)`."""

    corner: F64  # (2,) x_m, y_m of the first cell's corner, in the map's frame
    cell_m: float
    free: Bool  # (rows, columns) a robot's center may be there
    walled: Bool  # (rows, columns) a wall runs through
    floor: U8  # (rows, columns) index into `floors`
    floors: tuple[str, ...]  # floor names; 0 is "", where the map names none

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.free.shape[0], self.free.shape[1]

    def centers(self) -> F64:
        """Give the centers (rows * columns, 2) of all cells in the map's frame, row by row."""
        rows, columns = np.indices(self.shape)
        return self.corner + self.cell_m * (np.column_stack([columns.ravel(), rows.ravel()]) + 0.5)

    def cells_of(self, xy: F32, origin: F64) -> I32:
        """Give the flat cell number (N,) of points (N, 2) that are relative to `origin`; -1 outside."""
        low = (self.corner - origin).astype(np.float32)
        index = (xy - low) * np.float32(1 / self.cell_m)
        rows, columns = self.shape
        inside = (index[:, 0] >= 0) & (index[:, 0] < columns) & (index[:, 1] >= 0) & (index[:, 1] < rows)
        whole = index.astype(np.int32)
        return np.where(inside, whole[:, 1] * columns + whole[:, 0], -1).astype(np.int32)


def make_grid(arena: Arena, places: F64) -> Grid:
    """Rasterize an arena, with cell borders on the places (P, 2) so that halfway lines are borders too."""
    cell = _cell_size(arena, places)
    x_min, y_min, x_max, y_max = arena.bounds
    anchor = places[0]
    corner = anchor - cell * np.ceil((anchor - (x_min, y_min)) / cell - 1e-9)
    columns = int(np.ceil((x_max - corner[0]) / cell - 1e-9))
    rows = int(np.ceil((y_max - corner[1]) / cell - 1e-9))
    names = ("", *dict.fromkeys(region.name for region in arena.floors))
    floor = np.zeros((rows, columns), np.uint8)
    blocked = np.zeros((rows, columns), np.uint8)
    walled = np.zeros((rows, columns), np.uint8)
    for region in arena.floors:
        _fill(floor, region, corner, cell, names.index(region.name))
    for region in arena.obstacles:
        _fill(blocked, region, corner, cell, 1)
    for wall in arena.walls:
        _line(walled, wall, corner, cell)
    free = (blocked == 0) & (walled == 0) & _reachable(walled, places, corner, cell)
    return Grid(corner, cell, free, walled > 0, floor, names)


def _cell_size(arena: Arena, places: F64) -> float:
    width, depth = arena.size_m
    coarsest = math.sqrt(width * depth / MOST_CELLS)
    if len(places) < 2:
        return max(FINEST_M, coarsest)
    spacing = float(np.median(np.asarray(cKDTree(places).query(places, k=2)[0])[:, 1]))
    return max(spacing / CELLS_PER_SPACING, FINEST_M, coarsest)


def _fill(raster: U8, region: Region, corner: F64, cell: float, value: int) -> None:
    """Set every cell whose center lies in the polygon, and those that its border runs through."""
    points = (region.polygon - corner) / cell - 0.5
    cv2.fillPoly(raster, [np.round(points * 256).astype(np.int32)], value, lineType=cv2.LINE_8, shift=8)


def _line(raster: U8, wall: F64, corner: F64, cell: float) -> None:
    (x1, y1), (x2, y2) = np.floor((wall.reshape(2, 2) - corner) / cell + 1e-9).astype(int).tolist()
    cv2.line(raster, (x1, y1), (x2, y2), 1, thickness=1, lineType=cv2.LINE_8)


def _reachable(walled: U8, places: F64, corner: F64, cell: float) -> Bool:
    """Tell the cells that hang together with some place without crossing a wall; all, where none do."""
    islands, _ = label(walled == 0)
    rows, columns = walled.shape
    where = np.floor((places - corner) / cell).astype(int)
    held = where[(where >= 0).all(axis=1) & (where < (columns, rows)).all(axis=1)]
    wanted = np.unique(islands[held[:, 1], held[:, 0]])
    wanted = wanted[wanted > 0]
    return np.isin(islands, wanted) if len(wanted) else np.ones(walled.shape, bool)
