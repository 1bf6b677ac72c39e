"""A planar laser: scans, which are ranges over evenly spaced beams, and the map they are compared with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .arrays import F32, F64, U8, Bool

MOST_MAP_CELLS = 2**26  # of an occupancy map, however it comes: 400 m by 400 m at 5 cm


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """One scan of B beams, in the plane of the robot.

    A laser that is mounted upside down has a negative `step_rad`: seen from above it turns clockwise.

        >>> import numpy as np
        >>> from maurice_mcl.values.laser import LaserScan
        >>> scan = LaserScan(np.array([1.0, np.inf, 2.0], np.float32), -np.pi / 2, np.pi / 2, 0.1, 8.0)
        >>> scan.points().round(2).tolist()
        [[0.0, -1.0], [0.0, 2.0]]
    """

    ranges_m: F32  # (B,) as measured; at or above `max_m`, infinite: nothing was hit; NaN: no answer
    start_rad: float  # direction of the first beam from the laser's forward, counter-clockwise from above
    step_rad: float  # from one beam to the next; negative for a laser that is mounted upside down
    min_m: float  # ranges below it say nothing
    max_m: float  # the laser's reach
    mount: F64 = field(default_factory=lambda: np.zeros(3))  # (3,) the laser's pose on the robot

    @property
    def size(self) -> int:
        """The number of beams B."""
        return len(self.ranges_m)

    @property
    def angles_rad(self) -> F64:
        """Directions (B,) of the beams in the robot's frame, counter-clockwise from forward."""
        angles: F64 = self.mount[2] + self.start_rad + self.step_rad * np.arange(self.size)
        return angles

    @property
    def hits(self) -> Bool:
        """Which beams (B,) hit something within the laser's reach."""
        with np.errstate(invalid="ignore"):
            return (self.ranges_m >= self.min_m) & (self.ranges_m < self.max_m)

    @property
    def misses(self) -> Bool:
        """Which beams (B,) came back from nothing within the laser's reach."""
        with np.errstate(invalid="ignore"):
            return self.ranges_m >= self.max_m

    def points(self) -> F64:
        """Return where the beams that hit something end, (K, 2) x_m, y_m in the robot's frame."""
        hits = self.hits
        angles, ranges = self.angles_rad[hits], self.ranges_m[hits].astype(np.float64)
        ends: F64 = self.mount[:2] + ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return ends


# The map: which cells are free, occupied or unknown.

FREE, OCCUPIED, UNKNOWN = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyMap:
    """Square cells, aligned with the map's axes; row 0 is the lowest y, column 0 the lowest x.

    >>> import numpy as np
    >>> from maurice_mcl.values.laser import OccupancyMap
    >>> grid = OccupancyMap(np.zeros((20, 40), np.uint8), 0.05, np.array([-1.0, 0.0]))
    >>> grid.bounds
    (-1.0, 0.0, 1.0, 1.0)
    """

    cells: U8  # (H, W) FREE, OCCUPIED or UNKNOWN
    cell_m: float
    corner: F64  # (2,) x_m, y_m of the outer corner of cell (0, 0)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return x_min, y_min, x_max, y_max in meters."""
        rows, columns = self.cells.shape
        x, y = (float(v) for v in self.corner)
        return x, y, x + columns * self.cell_m, y + rows * self.cell_m

    @property
    def free(self) -> Bool:
        """Which cells (H, W) are known to be free."""
        return np.asarray(self.cells == FREE)

    @property
    def occupied(self) -> Bool:
        """Which cells (H, W) are known to be occupied."""
        return np.asarray(self.cells == OCCUPIED)

    @property
    def unknown(self) -> Bool:
        """Which cells (H, W) nobody has seen."""
        return np.asarray(self.cells == UNKNOWN)

    def states_at(self, points: F64) -> U8:
        """Return the states (N,) of the cells at points (N, 2) in meters; UNKNOWN outside."""
        columns, rows = np.floor((points - self.corner) / self.cell_m).astype(np.int64).T
        height, width = self.cells.shape
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        states = np.full(len(points), UNKNOWN, np.uint8)
        states[inside] = self.cells[rows[inside], columns[inside]]
        return states
