"""The simulated laser: ranges in a known room, its map, and the same scans for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.laser import (
    BEAMS,
    LOST_SHARE,
    MOUNT,
    NEAREST_M,
    RANGE_SD_M,
    REACH_M,
    SimulatedLaser,
    occupancy_of,
)
from maurice_datasets.worlds.build import load_world
from maurice_datasets.worlds.world import cast
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED

SQUARE = np.array([[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0]], float)
ANGLES = np.linspace(-np.pi, np.pi, 721)[:-1]


def distance_in_square(start, angles, side):
    """How far it is to the walls of a square from the origin to (side, side)."""
    cos, sin = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        x = np.where(cos > 0, (side - start[0]) / cos, -start[0] / cos)
        y = np.where(sin > 0, (side - start[1]) / sin, -start[1] / sin)
    return np.minimum(np.abs(x), np.abs(y))


@pytest.mark.parametrize("start", [(2.0, 2.0), (0.3, 3.6), (1.7, 0.05)])
def test_rays_in_a_square_reach_its_walls(start):
    reach = cast(np.array(start), ANGLES, SQUARE)
    assert np.abs(reach - distance_in_square(start, ANGLES, 4.0)).max() < 1e-9


def test_a_ray_that_meets_nothing_is_infinite_and_the_nearest_wall_counts():
    walls = np.array([[1.0, -1.0, 1.0, 1.0], [2.0, -1.0, 2.0, 1.0]])
    reach = cast(np.zeros(2), np.array([0.0, np.pi, np.pi / 2]), walls)
    assert reach.tolist() == [1.0, np.inf, np.inf]
    assert cast(np.zeros(2), np.zeros(1), np.zeros((0, 4))).tolist() == [np.inf]


@pytest.fixture(scope="module")
def world():
    return load_world("office", 3)


@pytest.fixture(scope="module")
def pose(world):
    x_min, y_min, x_max, y_max = world.arena.bounds
    grid = occupancy_of(world.arena, np.array([[(x_min + x_max) / 2, (y_min + y_max) / 2]]))
    rows, columns = np.nonzero(grid.free)
    middle = len(rows) // 2
    place = grid.corner + grid.cell_m * (np.array([columns[middle], rows[middle]]) + 0.5)
    return np.array([*place, 0.7])


def test_the_same_seed_gives_the_same_scan_and_another_another(world, pose):
    scans = [
        SimulatedLaser(world, seed).take(number, pose) for seed, number in ((1, 1), (1, 1), (1, 2), (2, 1))
    ]
    ranges = [scan.ranges_m.tobytes() for scan in scans]
    assert ranges[0] == ranges[1]
    assert len(set(ranges)) == 3


def test_ranges_are_those_of_the_walls_and_furniture_with_noise_and_losses(world, pose):
    laser = SimulatedLaser(world, 1)
    scans = [laser.take(number, pose) for number in range(1, 60)]
    place = compose(pose, np.array(MOUNT))
    exact = cast(
        place[:2], place[2] + scans[0].start_rad + scans[0].step_rad * np.arange(BEAMS), laser._segments
    )
    ranges = np.stack([scan.ranges_m for scan in scans]).astype(float)
    near = exact < REACH_M - 5 * RANGE_SD_M
    lost = np.isinf(ranges[:, near])
    assert lost.mean() == pytest.approx(LOST_SHARE, rel=0.3)
    off = (ranges[:, near] - exact[near])[~lost]
    assert off.std() == pytest.approx(RANGE_SD_M, rel=0.05)
    assert abs(off.mean()) < 5 * RANGE_SD_M / np.sqrt(off.size) + 5e-4  # a millimeter's rounding
    assert np.isinf(ranges[:, exact > REACH_M + 5 * RANGE_SD_M]).all()
    assert (scans[0].min_m, scans[0].max_m, scans[0].size) == (NEAREST_M, REACH_M, BEAMS)


def test_people_are_seen_nearer_than_the_walls(world, pose):
    alone, crowded = SimulatedLaser(world, 1), SimulatedLaser(world, 1, people=1.0)
    nearer = [
        (crowded.take(number, pose).ranges_m < alone.take(number, pose).ranges_m - 0.2).sum()
        for number in range(1, 21)
    ]
    farther = [
        (crowded.take(number, pose).ranges_m > alone.take(number, pose).ranges_m + 0.2).sum()
        for number in range(1, 21)
    ]
    assert sum(count > 3 for count in nearer) >= 10
    assert sum(farther) == 0


def test_the_map_is_where_scans_end(world, pose):
    """Beams end at what the map has, within a cell and the noise; between, cells are not occupied."""
    scan = SimulatedLaser(world, 1).take(1, pose)
    grid = occupancy_of(world.arena, pose[None, :2])
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cos, -sin], [sin, cos]])
    ends = scan.points() @ turn.T + pose[:2]
    rows, columns = np.nonzero(grid.occupied)
    occupied = grid.corner + grid.cell_m * (np.column_stack([columns, rows]) + 0.5)
    off = np.sqrt(((ends[:, None] - occupied) ** 2).sum(axis=2)).min(axis=1)
    assert np.quantile(off, 0.95) < grid.cell_m + 3 * RANGE_SD_M
    laser = compose(pose, np.array(MOUNT))[:2]
    between = laser + np.linspace(0.1, 0.9, 9)[:, None, None] * (ends - laser)
    assert (grid.states_at(between.reshape(-1, 2)) == OCCUPIED).mean() < 0.02
    assert grid.states_at(pose[None, :2]) == FREE
