"""An occupancy grid: which cells of a map are free, occupied or unknown; the map of a laser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import F64, U8, Bool

FREE, OCCUPIED, UNKNOWN = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyMap:
    """Square cells, aligned with the map's axes; row 0 is the lowest y, column 0 the lowest x.

    >>> import numpy as np
    >>> from maurice_mcl.values.occupancy import OccupancyMap
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
