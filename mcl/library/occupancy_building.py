"""An occupancy grid from scans with known poses: cells that beams passed are free, where they end occupied.

Counts as in Hähnel et al. (IROS 2003), "Map building with mobile robots in dynamic environments".
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import cv2
import numpy as np

from ..values import (
    F64,
    FREE,
    I32,
    I64,
    MOST_MAP_CELLS,
    OCCUPIED,
    U8,
    UNKNOWN,
    Bool,
    LaserScan,
    OccupancyMap,
    compose,
)

CELL_M = 0.05
HIT_SHARE = 0.25  # of the scans that saw a cell; walls seen at a grazing angle are often passed
MISS_M = 3.0  # a beam that hit nothing frees this much: glass and black things return nothing either
GROWTH = 256  # cells by which a side grows at least
SUBCELL_BITS = 4  # rays are drawn to a sixteenth of a cell
PASSED, HIT = 1, 2


def build_occupancy(scans: Iterable[tuple[LaserScan, F64]], cell_m: float = CELL_M) -> OccupancyMap:
    """Build a map from scans with the robot's poses (3,) in the map's frame, in one pass.

    A cell is occupied where at least a quarter of the scans that saw it hit it, so that people who walked by
    vanish. Memory depends on the area alone. Raises ValueError without a scan, or if the grid would get more
    than 67 million cells.

        >>> import numpy as np
        >>> from maurice_mcl.library.occupancy_building import build_occupancy
        >>> from maurice_mcl.values.laser import LaserScan
        >>> scan = LaserScan(np.array([1.0], np.float32), 0.0, 0.1, 0.1, 8.0)
        >>> grid = build_occupancy([(scan, np.zeros(3))])
        >>> grid.states_at(np.array([[0.5, 0.0], [1.01, 0.0], [1.5, 0.0]])).tolist()
        [0, 1, 2]
    """
    counts = _Counts(cell_m)
    for scan, pose in scans:
        counts.add(scan, pose)
    return counts.map()


@dataclass(slots=True)
class _Counts:
    """In how many scans each cell was passed, and hit; the arrays grow with the area."""

    cell_m: float
    low: I64 = field(default_factory=lambda: np.zeros(2, np.int64))  # (2,) column, row of the arrays' corner
    passes: I32 = field(default_factory=lambda: np.zeros((0, 0), np.int32))
    hits: I32 = field(default_factory=lambda: np.zeros((0, 0), np.int32))

    def add(self, scan: LaserScan, pose: F64) -> None:
        """Count the cells of one scan, each of them once."""
        hits, misses = scan.hits, scan.misses
        seen = hits | misses
        laser = compose(pose, scan.mount)
        reach = np.where(hits, scan.ranges_m, min(MISS_M, scan.max_m))[seen].astype(np.float64)
        angles = scan.angles_rad[seen] - scan.mount[2] + laser[2]
        ends = laser[:2] + reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        points = np.concatenate([laser[None, :2], ends]) / self.cell_m  # (1 + K, 2) in cells
        low = np.floor(points.min(axis=0)).astype(np.int64)
        high = np.floor(points.max(axis=0)).astype(np.int64) + 1
        self._reach(low, high)
        drawn = _drawn(points - low, high - low, hits[seen])
        window = tuple(
            slice(a - c, b - c) for a, b, c in zip(low[::-1], high[::-1], self.low[::-1], strict=True)
        )
        self.passes[window] += drawn == PASSED
        self.hits[window] += drawn == HIT

    def map(self) -> OccupancyMap:
        """Return the map of the cells that were seen."""
        seen = self.passes + self.hits
        rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            raise ValueError("found no scan with a pose, expected some to build a map from")
        part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        seen, hits = seen[part], self.hits[part]
        cells = np.where(hits >= HIT_SHARE * seen, OCCUPIED, FREE).astype(np.uint8)
        cells[seen == 0] = UNKNOWN
        corner = (self.low + np.array([columns[0], rows[0]])) * self.cell_m
        return OccupancyMap(cells, self.cell_m, corner)

    def _reach(self, low: I64, high: I64) -> None:
        """Let the arrays hold the cells from `low` to below `high` (2,): column, row."""
        shape = np.array(self.hits.shape[::-1])
        if not shape.any():
            self.low = low
        before, after = np.maximum(self.low - low, 0), np.maximum(high - self.low - shape, 0)
        if not (before.any() or after.any()):
            return
        before, after = (np.where(more > 0, np.maximum(more, GROWTH), 0) for more in (before, after))
        size = shape + before + after
        if float(size[0]) * float(size[1]) > MOST_MAP_CELLS:
            width, height = size * self.cell_m
            fault = f"found scans over {width:.0f} m by {height:.0f} m at {self.cell_m:g} m a cell"
            least_m = math.ceil(100 * math.sqrt(width * height / MOST_MAP_CELLS)) / 100
            expected = f"expected at most {MOST_MAP_CELLS:,} cells"
            raise ValueError(f"{fault}, {expected}; is a pose wrong? If not, cells of {least_m:g} m would do")
        margins = tuple(zip(before[::-1], after[::-1], strict=True))
        self.passes, self.hits = (np.pad(counts, margins) for counts in (self.passes, self.hits))
        self.low = self.low - before


def _drawn(points: F64, size: I64, hits: Bool) -> U8:
    """Draw rays from the first of points (1 + K, 2), in cells, to the others: PASSED, HIT at their ends."""
    drawn = np.zeros(size[::-1], np.uint8)
    # OpenCV's whole numbers are the middles of its pixels
    fixed = np.round((points - 0.5) * 2**SUBCELL_BITS).astype(np.int32)
    rays = np.stack([np.broadcast_to(fixed[0], fixed[1:].shape), fixed[1:]], axis=1)  # (K, 2, 2)
    cv2.polylines(drawn, list(rays), isClosed=False, color=PASSED, shift=SUBCELL_BITS)
    columns, rows = np.floor(points[1:][hits]).astype(np.int64).T
    drawn[rows, columns] = HIT
    return drawn
