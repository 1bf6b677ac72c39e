"""The map: walls, obstacles, floors and rooms in meters, and the same as a raster."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, replace

import cv2
import numpy as np

from .arrays import F32, F64, I32, U8, Bool
from .geometry import INCH_M
from .laser import OccupancyMap
from .nearest import spacing


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A named polygon: an obstacle ("sofa"), a floor ("carpet") or a room ("north room")."""

    name: str
    polygon: F64  # (n, 2) x_m, y_m, n >= 3, not closed

    def depth_m(self, points: F64) -> F64:
        """Return how far points (N, 2) are from the outline: above 0 inside, below 0 outside.

        >>> import numpy as np
        >>> from maurice_mcl.values.map import Region
        >>> square = Region("mat", np.array([[0, 0], [2, 0], [2, 2], [0, 2]]) + 5e6)
        >>> square.depth_m(np.array([[0.5, 1], [2.25, 1]]) + 5e6).tolist()
        [0.5, -0.25]
        """
        corner = self.polygon[0]  # float32 has steps of half a meter at UTM coordinates
        outline = (self.polygon - corner).astype(np.float32)
        places = (points - corner).tolist()
        return np.array([cv2.pointPolygonTest(outline, place, measureDist=True) for place in places])


# where a robot is never, to a filter: in walls and obstacles, in walls alone, or nowhere on the map
SOLID, MOVABLE, NO_WALLS = "solid", "movable", "no_walls"
OBSTACLES = (SOLID, MOVABLE, NO_WALLS)


@dataclass(frozen=True, slots=True, eq=False)
class Arena:
    """Where a robot can be, in meters. Without walls everything inside the bounds is free."""

    bounds: tuple[float, float, float, float]  # x_min, y_min, x_max, y_max
    walls: F64  # (W, 4) x1, y1, x2, y2; W may be 0
    obstacles: tuple[Region, ...] = ()
    floors: tuple[Region, ...] = ()  # later ones lie on top of earlier ones
    rooms: tuple[Region, ...] = ()
    _: KW_ONLY
    occupancy: OccupancyMap | None = None  # cell by cell, for a laser, which needs no walls

    @property
    def size_m(self) -> tuple[float, float]:
        """Width along x and depth along y."""
        x_min, y_min, x_max, y_max = self.bounds
        return x_max - x_min, y_max - y_min

    def trusted(self, obstacles: str) -> Arena:
        """Return the map by which a filter rules poses out: without obstacles that may have been moved.

        Without walls, too, only its bounds and floors are left: the library alone is the map.
        """
        if obstacles == NO_WALLS and (self.obstacles or len(self.walls)):
            return replace(self, obstacles=(), walls=np.zeros((0, 4)))
        return replace(self, obstacles=()) if obstacles == MOVABLE and self.obstacles else self


def open_arena(poses: F64, margin_m: float | None = None) -> Arena:
    """Make a map with no walls around poses (L, 2 or 3), for libraries that come without a map.

    Without `margin_m` it reaches as far as the poses tell: two spacings up to 1 m, or one where that is more.
    """
    if margin_m is None:
        apart_m = spacing(np.unique(poses[:, :2], axis=0))
        margin_m = max(min(2 * apart_m, 1.0), apart_m)
    low = poses[:, :2].min(axis=0) - margin_m
    high = poses[:, :2].max(axis=0) + margin_m
    return Arena((float(low[0]), float(low[1]), float(high[0]), float(high[1])), np.zeros((0, 4)))


# The map as a raster: what is free, and which floor is there.

CELLS_PER_SPACING = 18  # an 18 in grid of places gives 1 in cells
LEAST_CELL_M = INCH_M
MOST_CELLS = 1_000_000
WALL_SAMPLES_A_CELL = 16  # points tried along a wall
ROUNDING_CELLS = 1e-6  # of a cell, so that points on a border do not depend on the last bit


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
        """Return the centers (rows * columns, 2) of all cells in the map's frame, row by row."""
        rows, columns = np.indices(self.shape)
        return self.corner + self.cell_m * (np.column_stack([columns.ravel(), rows.ravel()]) + 0.5)

    def cells_of(self, xy: F32, origin: F64) -> I32:
        """Return the flat cell number (N,) of points (N, 2) that are relative to `origin`; -1 outside."""
        low, scale = (self.corner - origin).astype(np.float32), np.float32(1 / self.cell_m)
        rows, columns = self.shape
        # both coordinates at once, in place: for few particles the calls count, for many the passes
        at = xy.T - low[:, None]
        at *= scale
        np.floor(at, out=at)
        within = at >= 0
        within &= at < np.array([[columns], [rows]], np.float32)
        column, row = at
        row *= np.float32(columns)
        row += column  # exact: whole numbers below 2**24
        np.copyto(row, np.float32(-1), where=~(within[0] & within[1]))
        cell: I32 = row.astype(np.int32)
        return cell


def make_grid(arena: Arena, places: F64) -> Grid:
    """Rasterize an arena, with cell borders on the places (P, 2) so that halfway lines are borders too."""
    cell = _cell_size(arena, places)
    x_min, y_min, x_max, y_max = arena.bounds
    anchor = places[0]
    corner = anchor - cell * np.ceil((anchor - (x_min, y_min)) / cell - ROUNDING_CELLS)
    columns = int(np.ceil((x_max - corner[0]) / cell - ROUNDING_CELLS))
    rows = int(np.ceil((y_max - corner[1]) / cell - ROUNDING_CELLS))
    names = ("", *dict.fromkeys(region.name for region in arena.floors))
    floor, blocked, walled = (np.zeros((rows, columns), np.uint8) for _ in range(3))
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
    usual = spacing(places) / CELLS_PER_SPACING if len(places) > 1 else LEAST_CELL_M
    return max(usual, LEAST_CELL_M, coarsest)


def _fill(raster: U8, region: Region, corner: F64, cell: float, value: int) -> None:
    """Set every cell whose center lies in the polygon, and those that its border runs through."""
    points = (region.polygon - corner) / cell - 0.5
    cv2.fillPoly(raster, [np.round(points * 256).astype(np.int32)], value, lineType=cv2.LINE_8, shift=8)


def _line(raster: U8, wall: F64, corner: F64, cell: float) -> None:
    """Set every cell that the wall runs through, so that no cell lies on both sides of it."""
    start, end = (wall.reshape(2, 2) - corner) / cell + ROUNDING_CELLS
    points = np.linspace(start, end, int(WALL_SAMPLES_A_CELL * np.abs(end - start).max()) + 2)
    columns, rows = np.floor(points).astype(int).T
    inside = (columns >= 0) & (columns < raster.shape[1]) & (rows >= 0) & (rows < raster.shape[0])
    raster[rows[inside], columns[inside]] = 1


def _reachable(walled: U8, places: F64, corner: F64, cell: float) -> Bool:
    """Return the cells that are connected to a place without crossing a wall; all cells if none are."""
    _, islands = cv2.connectedComponents(np.asarray(walled == 0, np.uint8), connectivity=4)
    rows, columns = walled.shape
    where = np.floor((places - corner) / cell).astype(int)
    inside = where[(where >= 0).all(axis=1) & (where < (columns, rows)).all(axis=1)]
    numbers = np.unique(islands[inside[:, 1], inside[:, 0]])
    numbers = numbers[numbers > 0]
    return np.isin(islands, numbers) if len(numbers) else np.ones(walled.shape, bool)


# Lines of sight.

PAIRS_AT_ONCE = 2**13  # of segments and walls at a time: a core's own cache holds them


def crosses(start: F64, end: F64, walls: F64) -> Bool:
    """Return which (N,) of the segments from start (N, 2) to end (N, 2) any wall (W, 4) crosses.

    A block of segments against all walls at once: setting up a replay asks this hundreds of times.
    """
    hit = np.zeros(len(start), bool)
    if not len(walls):
        return hit
    block = max(PAIRS_AT_ONCE // len(walls), 1)
    wall_start, wall_end = walls.T[:2], walls.T[2:]  # (2, W)
    for first in range(0, len(start), block):
        some = slice(first, first + block)
        a, b = start[some].T[:, :, None], end[some].T[:, :, None]  # (2, n, 1)
        either_side = _side(wall_start, wall_end, a) * _side(wall_start, wall_end, b) < 0
        straddles = _side(a, b, wall_start) * _side(a, b, wall_end) <= 0
        hit[some] = (either_side & straddles).any(axis=1)
    return hit


def _side(a: F64, b: F64, point: F64) -> F64:
    """Return a number whose sign tells on which side of the line a to b a point is (cross product).

    The first axis of all three holds x and y; the others are broadcast.
    """
    return np.asarray((b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]))
