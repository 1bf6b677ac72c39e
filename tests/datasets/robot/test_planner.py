from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.robot.planner import KEEP_M, Placement, Raster, fit, free_pose, is_free, raster
from maurice_datasets.worlds.world import clearance
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.map import Arena, Region


def room(width: float = 2.0, depth: float = 2.0, *obstacles: Region) -> Arena:
    walls = [[0, 0, width, 0], [width, 0, width, depth], [width, depth, 0, depth], [0, depth, 0, 0]]
    return Arena((0.0, 0.0, width, depth), np.array(walls, float), obstacles)


def rastered(arena: Arena) -> Raster:
    found = raster(arena)
    assert found is not None
    return found


def test_cells_keep_their_distance_where_there_is_room():
    split = Region("wall to wall", np.array([[1.4, -0.1], [1.5, -0.1], [1.5, 2.1], [1.4, 2.1]]))
    found = rastered(room(2, 2, split))
    assert (clearance(found.arena, found.centers) > KEEP_M).all()
    assert found.centers[:, 0].max() < 1.4  # the larger part only
    assert raster(room(0.3, 0.3)) is None


def test_the_next_point_goes_around_an_obstacle_and_ends_at_the_goal(world):
    found = rastered(world.arena)
    rng = np.random.default_rng(3)
    for _ in range(5):
        here, goal = free_pose(found, rng)[:2], free_pose(found, rng)[:2]
        way = found.way_to(goal)
        for _ in range(60):
            ahead = found.next_point(here, way)
            between = here + np.linspace(0, 1, 20)[:, None] * (ahead - here)
            assert clearance(world.arena, between).min() > 3 * INCH_M
            here = ahead
        assert np.hypot(*(here - goal)) < 4.5 * INCH_M


def test_free_poses_are_even_far_and_free():
    found = rastered(room())
    rng = np.random.default_rng(4)
    poses = np.array([free_pose(found, rng) for _ in range(1200)])
    assert (clearance(found.arena, poses[:, :2]) > KEEP_M).all()
    low, high = poses[:, :2].min(), poses[:, :2].max()
    for column, (a, b) in zip(poses.T, ((low, high), (low, high), (-np.pi, np.pi)), strict=True):
        counts = np.histogram(column, 6, (a, b))[0]
        assert np.abs(counts - 200).max() < 4 * np.sqrt(200)
    rng = np.random.default_rng(5)
    far = [free_pose(found, rng, np.array([1.0, 1.0, 0]), 0.6) for _ in range(100)]
    assert min(np.hypot(x - 1, y - 1) for x, y, _ in far) >= 0.6
    with pytest.raises(ValueError, match="no free cell"):
        free_pose(found, rng, np.array([1.0, 1.0, 0]), 2.0)
    block = Region("block", np.array([[0.8, 0.8], [1.2, 0.8], [1.2, 1.2], [0.8, 1.2]]))
    found = rastered(room(2, 2, block))
    assert not is_free(found, np.array([1.0, 1.0]))
    assert not is_free(found, np.array([3.0, 1.0]))
    assert is_free(found, np.array([0.4, 0.4]))


def test_placements_keep_scale_and_fit():
    at = Placement(0.5, 1.1, np.array([3.0, -2.0]))
    points = np.array([[0.0, 0], [3, 4]])
    a, b = at.points(points)
    assert np.hypot(*(b - a)) == pytest.approx(2.5)
    assert at.pose(np.array([0.0, 0, 0.2])) == pytest.approx([3.0, -2.0, 1.3])
    assert at.points(np.array([1.0, 0])) == pytest.approx([3 + 0.5 * np.cos(1.1), -2 + 0.5 * np.sin(1.1)])
    found = rastered(room())
    line = np.stack([np.linspace(0, 1, 50), np.zeros(50)], axis=1)
    small = fit(found, line, np.random.default_rng(1))
    assert small.scale == 1
    assert (clearance(found.arena, small.points(line)) > KEEP_M / 2).all()
    large = fit(found, 3 * line, np.random.default_rng(1))
    assert 0.3 <= large.scale <= 0.7
    assert fit(found, 30 * line, np.random.default_rng(1)) is None
