"""A start that somebody gave is kept where another room fits the scans a little better."""

from __future__ import annotations

import numpy as np

import maurice_mcl as mcl
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from maurice_mcl.values.session import NO_PICTURE, Frame

from .conftest import CELL_M, ZERO, scan_at

SETTINGS = {"motion": {"model": "odometry"}, "start.sd_m": 0.1, "start.heading_sd_rad": 0.05}
HERE, MOTION, ROOM = np.array([2.0, 1.5, 0.1]), np.array([0.2, 0.0, 0.05]), 140  # columns from room to room


def rooms(off=0):
    """Two rooms of 6 x 4 m with the same box each.

    Of the first one the map has two walls some cells off, as where scans were not laid out well.
    """
    cells = np.full((80, 2 * ROOM), UNKNOWN, np.uint8)
    for first, moved in ((0, off), (ROOM, 0)):
        cells[moved:, first + moved : first + 120] = OCCUPIED
        cells[1 + moved : -1, first + 1 + moved : first + 119] = FREE
        cells[50:60, first + 80 : first + 90] = OCCUPIED
    return OccupancyMap(cells, CELL_M, ZERO)


def estimates(map_, start, steps=5):
    """How far off a filter that begins at a start is, step by step, as a robot drives in the first room."""
    world, pose, library = rooms(), HERE, map_library(map_, "rooms")
    localizer = mcl.make_localizer(library, preset="laser", particles=500, settings=SETTINGS)
    state, off = localizer.initialize(start), []
    for step in range(1, steps + 1):
        motions = np.zeros((0, 3)) if step == 1 else MOTION[None]
        pose = pose if step == 1 else compose(pose, MOTION)
        frame = Frame(step, float(step), motions, NO_PICTURE, "", scan=scan_at(world, pose))
        state, record = localizer.step(state, frame)
        off.append(np.hypot(*(record.estimate.pose - pose)[:2]))
    return np.array(off)


def test_a_start_is_kept_where_a_twin_fits_better():
    assert estimates(rooms(off=6), HERE).max() < 0.5


def test_a_start_that_fits_nothing_is_given_up():
    assert estimates(rooms(), HERE + np.array([1.0, 1.5, 2.0]))[-1] < 0.3
