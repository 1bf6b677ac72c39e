"""A room that a planar laser sees, with every value known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from maurice_mcl.sensor.laser.rays import cast
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap

CELL_M = 0.05
MOUNT = np.array([0.1, 0.05, 0.2])
TRUTH = np.array([2.6, 1.7, 0.4])
ZERO = np.zeros(2)


def room(shift=0):
    """A room of 6 x 4 m with a box in it; beyond its walls nothing is known."""
    cells = np.full((100, 140), UNKNOWN, np.uint8)
    cells[10:90, 10 : 130 + shift] = OCCUPIED
    cells[11:89, 11 : 129 + shift] = FREE
    cells[60:70, 30:44] = OCCUPIED
    return OccupancyMap(cells, CELL_M, np.array([-0.5, -0.5]))


def scan_at(grid, pose, mount=MOUNT, size=121, max_m=8.0):
    start, step = -2.1, 4.2 / (size - 1)
    angles = start + step * np.arange(size)
    laser = compose(pose, mount)
    ranges = cast(grid, laser, angles, max_m)[0]
    return LaserScan(ranges, start, step, 0.05, max_m, mount)


def reading_of(laser, scan):
    return laser.read(SimpleNamespace(scan=scan))


@pytest.fixture(scope="module")
def grid():
    return room()
