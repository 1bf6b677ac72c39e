"""One scan is found on a map, wherever it was taken; where places look alike, all of them are."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.sensor.laser.matching import MOST_CELLS, Matcher
from maurice_mcl.sensor.laser.rays import cast
from maurice_mcl.values.geometry import compose, wrap_angle
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, OccupancyMap

ANGLES = np.radians(np.arange(-135, 135, 3.0))
REACH_M = 20.0


class Plan:
    """A map of rooms, in meters."""

    def __init__(self, width_m: float, height_m: float, cell_m: float = 0.05) -> None:
        self.cell_m = cell_m
        self.cells = np.full((round(height_m / cell_m), round(width_m / cell_m)), UNKNOWN, np.uint8)

    def fill(self, x: float, y: float, width: float, height: float, state: int) -> None:
        left, low, right, high = (round(v / self.cell_m) for v in (x, y, x + width, y + height))
        self.cells[low:high, left:right] = state

    def room(self, x: float, y: float, width: float, height: float) -> None:
        self.fill(x - 0.1, y - 0.1, width + 0.2, height + 0.2, OCCUPIED)
        self.fill(x, y, width, height, FREE)

    @property
    def map(self) -> OccupancyMap:
        return OccupancyMap(self.cells.copy(), self.cell_m, np.array([-3.0, 2.0]))


def at(x: float, y: float, heading: float) -> np.ndarray:
    """A pose by its place on the plan."""
    return np.array([x - 3.0, y + 2.0, heading])


def scanned(grid, pose, rng=None, mount=None, sd_m=0.03):
    """The points that a scan from a pose hits, in the robot's frame."""
    mount = np.zeros(3) if mount is None else mount
    reach = cast(grid, compose(pose, mount), ANGLES, REACH_M)[0].astype(float)
    reach = reach + (0 if rng is None else rng.normal(0, sd_m, len(reach)))
    ends = reach[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    turn = np.array([[np.cos(mount[2]), -np.sin(mount[2])], [np.sin(mount[2]), np.cos(mount[2])]])
    return (mount[:2] + ends @ turn.T)[reach < REACH_M]


def offices() -> OccupancyMap:
    """Three rooms of different shapes along a corridor."""
    plan = Plan(17, 13)
    plan.room(1, 5, 15, 2)
    plan.room(1, 8, 4, 4)
    plan.room(6, 8, 9, 3)
    plan.room(3, 1, 6, 3)
    for x, y in [(2, 6.9), (11, 6.9), (5, 3.9)]:
        plan.fill(x, y, 1.2, 1.3, FREE)
    plan.fill(7, 1.6, 0.6, 1.2, OCCUPIED)
    plan.fill(12, 9.4, 0.4, 0.8, OCCUPIED)
    plan.fill(1, 11, 1.5, 1, OCCUPIED)
    return plan.map


@pytest.fixture(scope="module")
def matcher():
    return Matcher(offices())


def random_poses(grid, count, rng):
    """Poses of a robot that is at least 0.3 m from everything."""
    height, width = grid.cells.shape
    while count:
        pose = np.append(
            grid.corner + rng.uniform(0, 1, 2) * grid.cell_m * [width, height], rng.uniform(-3.1, 3.1)
        )
        around = pose[:2] + 0.3 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        if (grid.states_at(around) == FREE).all():
            count -= 1
            yield pose


def off(poses, pose):
    away = poses - pose
    away[:, 2] = wrap_angle(away[:, 2])
    return away


def test_a_scan_is_found_wherever_it_was_taken_and_as_near_as_the_covariance_says(matcher):
    rng = np.random.default_rng(3)
    first, weight, squared = [], [], []
    for pose in random_poses(matcher.occupancy, 40, rng):
        proposal = matcher.propose(scanned(matcher.occupancy, pose, rng))
        assert proposal.weights.sum() == pytest.approx(1)
        away = off(proposal.poses, pose)
        near = (np.hypot(away[:, 0], away[:, 1]) < 0.5) & (np.abs(away[:, 2]) < 0.2)
        first.append(near[np.argmax(proposal.weights)])
        weight.append(proposal.weights[near].sum())
        for mode in np.flatnonzero(near)[:1]:
            squared.append(away[mode] @ np.linalg.solve(proposal.covariances[mode], away[mode]))
    assert np.mean(first) >= 0.9
    # the weight is the share of scans that are where it says, but for chance
    assert np.mean(weight) == pytest.approx(np.mean(first), abs=0.1)
    assert len(squared) >= 38
    assert np.mean(np.array(squared) < 7.81) >= 0.9  # 95 % of chi2 with three degrees
    assert 0.3 < np.mean(squared) < 4


def test_places_that_look_alike_are_all_proposed_with_equal_weights():
    plan = Plan(10, 7)
    plan.room(1, 1, 8, 5)
    proposal = Matcher(plan.map).propose(scanned(plan.map, at(3, 2.5, 0.7)))
    twins = [at(3, 2.5, 0.7), at(7, 4.5, 0.7 - np.pi)]  # a room looks the same after half a turn
    shares = []
    for twin in twins:
        away = off(proposal.poses, twin)
        near = (np.hypot(away[:, 0], away[:, 1]) < 0.2) & (np.abs(away[:, 2]) < 0.1)
        shares.append(proposal.weights[near].sum())
    assert sum(shares) > 0.9
    np.testing.assert_allclose(shares, 0.5, atol=0.15)


def test_along_a_corridor_the_covariance_is_long():
    plan = Plan(44, 4)
    plan.room(1, 1, 42, 1.5)
    proposal = Matcher(plan.map).propose(scanned(plan.map, at(22, 1.8, 0.0)))
    deviations = np.sqrt(np.einsum("jii->ji", proposal.covariances))
    assert len(proposal.weights) > 8
    assert (proposal.weights @ (deviations[:, 0] / deviations[:, 1])) > 4
    assert np.abs(wrap_angle(2 * proposal.poses[:, 2])).max() < 0.1  # along it, either way


def test_all_of_a_corridor_is_proposed_either_way():
    """Modes that cover its first meters alone would make a robot sure of a wrong place."""
    plan = Plan(44, 4)
    plan.room(1, 1, 42, 1.5)
    proposal = Matcher(plan.map).propose(scanned(plan.map, at(22, 1.8, 0.0)))
    middle = at(22, 1.8, 0.0)[0]
    back = np.abs(proposal.poses[:, 2]) > np.pi / 2
    for share in (proposal.weights[back].sum(), proposal.weights[proposal.poses[:, 0] < middle].sum()):
        assert share == pytest.approx(0.5, abs=0.15)


def test_a_room_is_found_beside_a_yard_where_something_stands_everywhere():
    """In a yard all coarse boxes have the highest rating: there are more of them than are divided."""
    plan = Plan(60, 40)
    plan.room(1, 1, 8, 6)
    plan.fill(3, 2, 1, 0.5, OCCUPIED)
    room, pose = plan.map, at(6, 4, 0.7)
    yard = plan.cells[240:]
    yard[:] = np.where(np.random.default_rng(1).random(yard.shape) < 0.02, OCCUPIED, FREE)
    best = Matcher(plan.map).propose(scanned(room, pose)).poses[0]
    np.testing.assert_allclose(best, pose, atol=0.1)


def test_beams_that_pass_through_walls_count_against_a_pose():
    plan = Plan(16, 7)
    for x in (1, 9):
        plan.room(x, 1, 6, 4.5)
        plan.fill(x + 4, 3, 0.5, 0.5, OCCUPIED)
    open_room = plan.map
    plan.fill(11, 1.5, 0.1, 3, OCCUPIED)
    pose = at(3.2, 3.4, 0.3)
    points = scanned(open_room, pose)
    alike, walled = (Matcher(grid).propose(points) for grid in (open_room, plan.map))
    shares = [p.weights[p.poses[:, 0] < at(8, 0, 0)[0]].sum() for p in (alike, walled)]
    assert shares[0] == pytest.approx(0.5, abs=0.15)
    assert shares[1] > 0.95


def test_where_the_laser_sits_is_heeded(matcher):
    mount = np.array([0.3, -0.1, np.pi])
    pose = at(7.5, 9.5, 0.4)
    proposal = matcher.propose(scanned(matcher.occupancy, pose, mount=mount), mount)
    best = off(proposal.poses[np.argmax(proposal.weights)][None], pose)[0]
    np.testing.assert_allclose(best, 0, atol=0.06)


def test_the_corner_and_the_axes_of_a_map_make_no_difference(matcher):
    grid, pose = matcher.occupancy, at(4, 2, 1.0)
    points = scanned(grid, pose)
    moved = Matcher(OccupancyMap(grid.cells, grid.cell_m, grid.corner + np.array([100.0, -7.0]))).propose(
        points
    )
    plain = matcher.propose(points)
    np.testing.assert_allclose(moved.poses, plain.poses + np.array([100, -7, 0]), atol=1e-6)
    np.testing.assert_allclose(moved.weights, plain.weights)


def test_a_large_map_is_coarsened_and_the_scan_found():
    plan = Plan(150, 150)
    for x in range(3, 140, 12):
        for y in range(3, 140, 12):
            plan.room(x, y, 5 + (x * 7 + y * 3) % 5, 5 + (x * 5 + y * 11) % 5)
            plan.fill(x + 1 + (x + y) % 3, y + 2, 0.5, 0.4 * (1 + (x * y) % 5), OCCUPIED)
    matcher = Matcher(plan.map)
    assert plan.cells.size > 2 * MOST_CELLS
    pose = at(65.5, 41.0, 2.0)
    proposal = matcher.propose(scanned(plan.map, pose))
    away = np.abs(off(proposal.poses, pose))
    assert ((away[:, :2] < 0.2).all(axis=1) & (away[:, 2] < 0.1)).any()


def test_scans_that_tell_nothing_are_told_from_others(matcher):
    assert matcher.propose(np.zeros((0, 2))) is None
    assert matcher.propose(np.full((7, 2), 1.0)) is None
    assert matcher.propose(np.full((50, 2), 1000.0)) is None  # beyond the reach
    blocked = OccupancyMap(np.full((50, 50), UNKNOWN, np.uint8), 0.05, np.zeros(2))
    assert Matcher(blocked).propose(scanned(matcher.occupancy, at(4, 2, 1.0))) is None


def test_ratings_of_boxes_that_are_not_divided_are_told(matcher):
    matches = matcher.search(scanned(matcher.occupancy, at(4, 2, 1.0)))
    assert (np.diff(matches.nats) <= 0).all()
    assert matches.nats[0] <= 0
