"""Maps from scans with known poses."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.library.occupancy_building import HIT_SHARE, MISS_M, build_occupancy
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan

SIDE_M = 4.0  # of a square room around the map's origin


def room_scan(pose, beams=720, mount=None, reach_m=10.0):
    """What a laser with a view all around measures at the robot's pose in the empty room."""
    mount = np.zeros(3) if mount is None else mount
    x, y, heading = compose(pose, mount)
    angles = heading + np.arange(beams) * 2 * np.pi / beams
    with np.errstate(divide="ignore", invalid="ignore"):
        along_x = (np.sign(np.cos(angles)) * SIDE_M / 2 - x) / np.cos(angles)
        along_y = (np.sign(np.sin(angles)) * SIDE_M / 2 - y) / np.sin(angles)
    ranges = np.fmin(along_x, along_y).astype(np.float32)
    return LaserScan(ranges, 0.0, 2 * np.pi / beams, 0.05, reach_m, mount)


def poses(count=20):
    rng = np.random.default_rng(1)
    return np.column_stack([rng.uniform(-1.5, 1.5, (count, 2)), rng.uniform(-np.pi, np.pi, count)])


@pytest.mark.parametrize("mount", [np.zeros(3), np.array([0.2, -0.1, 2.0])])
def test_a_room_is_free_inside_occupied_at_its_walls_and_unknown_beyond(mount):
    grid = build_occupancy((room_scan(pose, mount=mount), pose) for pose in poses())
    inner = np.random.default_rng(2).uniform(-1.9, 1.9, (500, 2))
    along = np.linspace(-1.9, 1.9, 100)
    walls = np.concatenate(
        [np.column_stack([np.full(100, 2.0), along]), np.column_stack([along, np.full(100, -2.0)])]
    )
    assert (grid.states_at(inner) == FREE).all()
    # a wall on the border of two rows of cells is in either
    near = [
        grid.states_at(walls + shift) == OCCUPIED
        for shift in (np.zeros(2), np.full(2, 0.01), np.full(2, -0.01))
    ]
    assert np.any(near, axis=0).all()
    assert (grid.states_at(1.1 * walls) == UNKNOWN).all()
    np.testing.assert_allclose(grid.bounds, (-2, -2, 2, 2), atol=2 * grid.cell_m)


def test_a_cell_is_occupied_where_a_quarter_of_the_scans_that_saw_it_hit_it():
    near, far = (LaserScan(np.array([reach], np.float32), 0.0, 1.0, 0.1, 8.0) for reach in (1.0, 3.0))
    place = np.array([[1.01, 0.01]])
    for passed, state in [(round(1 / HIT_SHARE) - 1, OCCUPIED), (round(1 / HIT_SHARE), FREE)]:
        grid = build_occupancy([(near, np.zeros(3)), *[(far, np.zeros(3))] * passed])
        assert grid.states_at(place) == state


def test_a_beam_that_hit_nothing_frees_a_little_and_one_without_an_answer_nothing():
    ranges = np.array([np.inf, np.nan, 0.01, 30.0], np.float32)
    scan = LaserScan(ranges, 0.0, np.pi / 2, 0.1, 30.0)
    grid = build_occupancy([(scan, np.array([5.02, 5.02, 0.0]))])
    at = {angle: np.array([[np.cos(angle), np.sin(angle)]]) for angle in scan.angles_rad}
    seen = [
        [int(grid.states_at(5.02 + share * MISS_M * way)[0]) for share in (0.5, 0.9, 1.2)]
        for way in at.values()
    ]
    assert seen == [[FREE, FREE, UNKNOWN], [UNKNOWN] * 3, [UNKNOWN] * 3, [FREE, FREE, UNKNOWN]]


def test_the_map_does_not_depend_on_the_order_of_scans_nor_on_where_the_first_one_was():
    scans = [(room_scan(pose), pose + np.array([30, -20, 0])) for pose in poses(6)]
    grid, other = build_occupancy(scans), build_occupancy(scans[::-1])
    np.testing.assert_array_equal(grid.cells, other.cells)
    np.testing.assert_allclose(grid.corner, other.corner)


def test_no_scan_and_wild_poses_are_refused():
    with pytest.raises(ValueError, match="found no scan with a pose"):
        build_occupancy([])
    scan = room_scan(np.zeros(3))
    with pytest.raises(ValueError, match="67,108,864 cells; is a pose wrong"):
        build_occupancy([(scan, np.zeros(3)), (scan, np.array([1e4, 1e4, 0.0]))])
