"""Maps from files: wall segments, ROS `map.yaml` with its picture, occupancy grids; how large they may be."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from maurice_mcl.values import (
    F64,
    FREE,
    OCCUPIED,
    Arena,
    Bool,
    OccupancyMap,
    expected_one_of,
    open_arena,
    rotated,
)

from ..errors import FieldError, InputError
from .ros_maps import ENDINGS, grid_of_message, read_grid
from .ros_maps import write_ros_map as write_ros_map
from .text import METERS, MOST, read_number_rows, up_to

# How much ground a survey may cover: one wild pose would make the map's cells larger than the rooms.

MOST_SPAN_M = 10_000.0  # from its middle to its border, float32 still resolves half a millimeter


def check_span(file: Path, poses: F64, arena: Arena | None = None) -> None:
    """Raise InputError if poses (L, 2 or 3) and map are together over 10 km wide or deep."""
    xy = poses[:, :2]
    span_m = _span(xy)
    expected = f"expected at most {MOST_SPAN_M:g} m; are they in meters?"
    if span_m > MOST_SPAN_M:
        off = np.abs(xy - np.median(xy, axis=0)).max(axis=1).argmax()
        at = ", ".join(f"{v:.15g}" for v in xy[off])
        raise InputError(file, f"found poses {span_m:g} m apart, the farthest off at ({at}), {expected}")
    if arena is not None:
        span_m = _span(np.concatenate([xy, _corners(arena)]))
        if span_m > MOST_SPAN_M:
            raise InputError(file, f"found a map and poses that together span {span_m:g} m, {expected}")


def _span(points: F64) -> float:
    return float(np.ptp(points, axis=0).max())


def _corners(arena: Arena) -> F64:
    regions = (*arena.obstacles, *arena.floors, *arena.rooms)
    borders = np.array(arena.bounds).reshape(2, 2)
    return np.concatenate([borders, arena.walls.reshape(-1, 2), *(region.polygon for region in regions)])


# A map that is given with poses: a ROS map if its suffix says so, else a file of wall segments.

UNITS = ("m", "mm")


def read_map(file: Path, unit: str, poses: F64) -> Arena:
    """Read a ROS `map.yaml`, or a file of segments in `unit`, for poses (L, 2 or 3). Raises InputError."""
    if file.suffix.lower() in ENDINGS:
        arena = read_ros_map(file)
        check_span(file, poses, arena)
        return arena
    return arena_from_lines(file, unit, poses)


def arena_from_lines(file: Path, unit: str, poses: F64) -> Arena:
    """Read `x1 y1 x2 y2` per line, in "m" or "mm". InputError names a bad line.

    The bounds reach a margin beyond the poses (L, 2 or 3); walls entirely outside are left out.
    """
    if unit not in UNITS:
        raise ValueError(f"found map unit {unit!r}, {expected_one_of(unit, UNITS)}")
    rows = read_number_rows(file, "a map", "a map", 4, "four numbers x1 y1 x2 y2", commas=True)
    segments = np.array(rows, np.float64).reshape(-1, 4)
    bounds = open_arena(poses, 1.0).bounds
    arena = Arena(bounds, _near(segments * METERS[unit], bounds))
    check_span(file, poses, arena)
    return arena


def _near(walls: F64, bounds: tuple[float, float, float, float]) -> F64:
    x_min, y_min, x_max, y_max = bounds
    x, y = walls[:, [0, 2]], walls[:, [1, 3]]
    meets_x = (x.max(axis=1) >= x_min) & (x.min(axis=1) <= x_max)
    meets_y = (y.max(axis=1) >= y_min) & (y.min(axis=1) <= y_max)
    near: F64 = walls[meets_x & meets_y]
    return near


def read_ros_map(file: Path) -> Arena:
    """Read `map.yaml` and its picture (PGM, PNG and others) as walls. Raises InputError.

    Robots can only be in free cells. Walls run along the borders between free cells and those that are
    occupied or unknown; the bounds are those of the free cells.
    """
    grid = read_grid(file)
    is_free = grid.cells == FREE
    rows, columns = (np.flatnonzero(is_free.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        fault = f"found no free cell ({(grid.cells == OCCUPIED).mean():.0%} occupied)"
        raise InputError(file, f"{fault}, expected some; see negate and free_thresh")
    low = np.array([columns[0], rows[0]], np.float64)
    cropped = is_free[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    walls, frame = cell_walls(cropped, grid.cell_m, low * grid.cell_m, grid.origin, np.all)
    return Arena(frame, walls)


def read_occupancy(file: str | Path) -> OccupancyMap:
    """Read `map.yaml` and its picture as a grid along the map's axes. Raises InputError.

    What map_server's modes trinary, scale and raw leave between free and occupied is unknown, and so are
    transparent pixels. A map with a turned origin is resampled to cells of the same size.

        >>> import numpy as np
        >>> from maurice_loaders.files.maps import read_occupancy, write_ros_map
        >>> from maurice_mcl.values.laser import OccupancyMap
        >>> grid = OccupancyMap(np.array([[0, 1, 2]], np.uint8), 0.05, np.array([-1.5, 2.0]))
        >>> write_ros_map(grid, "office.yaml", force=True)
        >>> read_occupancy("office.yaml").cells.tolist()
        [[0, 1, 2]]
    """
    try:
        return read_grid(Path(file)).aligned()
    except FieldError as problem:
        raise InputError(Path(file), problem.message) from None


def occupancy_of_message(message: Any) -> OccupancyMap:
    """Return the map of an OccupancyGrid: percents, of which -1 is unknown. ValueError for a broken one.

    From 65 a cell is occupied, up to 25 free, as to map_saver; what is between them is unknown.
    """
    return grid_of_message(message).aligned()


def arena_of_message(message: Any) -> Arena:
    """Return the map of an OccupancyGrid with walls along the edges of occupied cells. ValueError."""
    grid = grid_of_message(message)
    walls, bounds = cell_walls(grid.cells == OCCUPIED, grid.cell_m, np.zeros(2), grid.origin, np.any)
    return Arena(bounds, walls)


# Cells as walls.

MOST_WALLS = 20_000  # segments; a finer grid is coarsened


def cell_walls(
    cells: Bool,
    side_m: float,
    low: F64,
    origin: tuple[float, float, float],
    joined: Callable[..., Any],
) -> tuple[F64, tuple[float, float, float, float]]:
    """Return the borders between cells (rows, columns) and others as walls (W, 4), and the cells' bounds.

    `low` (2,) is the cells' corner in the grid's frame, `origin` the pose of that frame in the map. If there
    are too many walls, `joined` (np.any or np.all) merges four cells into one.
    """
    height, width = cells.shape
    size = np.array([[0, 0, width, 0], [width, height, 0, height]], np.float64) * side_m
    while len(edges := _edges(cells)) > MOST_WALLS:
        cells, side_m = _coarser(cells, joined), 2 * side_m
    walls, frame = (_placed(part + np.tile(low, 2), origin) for part in (edges * side_m, size))
    if not np.abs(frame).max() <= MOST:
        raise ValueError(f"found a map at {np.abs(frame).max():g} m, expected {up_to()}")
    x, y = frame[:, 0::2], frame[:, 1::2]
    return walls, (float(x.min()), float(y.min()), float(x.max()), float(y.max()))


def _edges(cells: Bool) -> F64:
    """Return the borders between cells and others as segments (W, 4), each as long as possible."""
    padded = np.pad(cells, 1)
    level = _runs(padded[1:, 1:-1] != padded[:-1, 1:-1])
    upright = _runs((padded[1:-1, 1:] != padded[1:-1, :-1]).T)
    lying = np.column_stack([level[:, 1], level[:, 0], level[:, 2], level[:, 0]])
    return np.concatenate(
        [lying, np.column_stack([upright[:, 0], upright[:, 1], upright[:, 0], upright[:, 2]])]
    )


def _runs(border: Bool) -> F64:
    """Return the runs (K, 3) of a border: its row, where it begins, where it ends."""
    steps = np.diff(np.pad(border, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return np.column_stack([row, begin, end]).astype(np.float64)


def _coarser(cells: Bool, joined: Callable[..., Any]) -> Bool:
    height, width = cells.shape
    even = np.pad(cells, ((0, height % 2), (0, width % 2)))
    return np.asarray(joined(even.reshape(even.shape[0] // 2, 2, -1, 2), axis=(1, 3)))


def _placed(segments: F64, origin: tuple[float, float, float]) -> F64:
    """Transform segments (W, 4) from the grid's frame to the map's."""
    x_m, y_m, heading = origin
    x, y = rotated(segments[:, 0::2], segments[:, 1::2], heading)
    return np.stack([x_m + x, y_m + y], axis=2).reshape(-1, 4)
