"""Off the map is a place, too: a filter drives out of the map's rectangle and comes back."""

from __future__ import annotations

import numpy as np
import pytest

import maurice_mcl as mcl
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from maurice_mcl.values.session import NO_PICTURE, Frame

from .conftest import CELL_M, ZERO, scan_at

MOTION = {"motion": {"model": "odometry"}}
MAPPED = 160  # columns
OUT_AND_BACK = [(0.45, 0.0, 0.0)] * 18 + [(0.1, 0.0, np.pi / 4)] * 4 + [(0.45, 0.0, 0.0)] * 18


@pytest.fixture(scope="module")
def hall():
    """A hall of 16 x 8 m with pillars at irregular places; a map has its left half."""
    cells = np.full((160, 320), FREE, np.uint8)
    cells[[0, -1]], cells[:, [0, -1]] = OCCUPIED, OCCUPIED
    for row, column in ((20, 40), (120, 60), (30, 110), (110, 130), (50, 180), (120, 250), (20, 280)):
        cells[row : row + 12, column : column + 9] = OCCUPIED
    return OccupancyMap(cells, CELL_M, ZERO)


@pytest.fixture(scope="module")
def drive(hall):
    """The frames of a drive out of the left half and back, by wheels that err; and the true poses."""
    random, pose = np.random.default_rng(6), np.array([5.0, 4.0, 0.05])
    frames, truth = [], []
    for step, motion in enumerate([np.zeros(3), *map(np.array, OUT_AND_BACK)], 1):
        pose = compose(pose, motion)
        wheels = motion * random.normal(1, 0.05, 3) + [0, 0, random.normal(0, 0.02)]
        motions = np.zeros((0, 3)) if step == 1 else wheels[None]
        frames.append(Frame(step, float(step), motions, NO_PICTURE, "", scan=scan_at(hall, pose)))
        truth.append(pose)
    return frames, np.array(truth)


@pytest.mark.parametrize("settings", [{}, {"sensor.laser.model": "likelihood_field_prob"}])
def test_a_map_and_the_same_with_a_border_of_unknown_cells_give_the_same_run(hall, drive, settings):
    frames, truth = drive
    half = OccupancyMap(hall.cells[:, :MAPPED], CELL_M, ZERO)
    wide = OccupancyMap(np.pad(half.cells, 200, constant_values=UNKNOWN), CELL_M, ZERO - 200 * CELL_M)
    assert (truth[:, 0] > half.bounds[2] + 2).sum() > 10
    estimates = []
    for grid in (half, wide):
        localizer = mcl.make_localizer(
            map_library(grid, "hall"), preset="laser", particles=500, settings=MOTION | settings
        )
        state, poses = localizer.initialize(truth[0]), []
        for frame in frames:
            state, record = localizer.step(state, frame)
            poses.append(record.estimate.pose)
        estimates.append(np.array(poses))
    off = [np.hypot(*(poses - truth)[:, :2].T) for poses in estimates]
    assert np.max(off) < 0.5
    assert max(each[-1] for each in off) < 0.1
    assert np.abs(off[0] - off[1]).max() < 0.3
