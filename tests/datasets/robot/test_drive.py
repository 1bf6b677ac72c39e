from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scipy.stats import chisquare

from maurice_datasets.robot.behaviors import BehaviorProposal, Localize, Wander
from maurice_datasets.robot.drive import KIDNAP_M, DriveUpdate, Robot, drive
from maurice_datasets.robot.motion import Chassis, draw_luck
from maurice_datasets.robot.planner import is_free, raster
from maurice_datasets.tasks import SimPurpose
from maurice_datasets.worlds.build import load_world
from maurice_datasets.worlds.world import World, clearance, floor_at
from maurice_mcl.values.geometry import INCH_M, wrap
from maurice_mcl.values.map import Arena
from maurice_mcl.values.randomness import Domain, stream

SEEDS = (0, 1, 2, 3)
CELL_M = 18 * INCH_M
Drives = list[tuple[World, np.ndarray, list[DriveUpdate]]]


def drive_in(arena: Arena, seed: int, updates: int, **options: int) -> tuple[np.ndarray, list[DriveUpdate]]:
    map_ = raster(arena)
    assert map_ is not None
    start, driven = drive(Robot(arena, seed, Chassis(slip_chance=0.1)), map_, updates, **options)
    return start, list(driven)


@pytest.fixture(scope="module")
def drives() -> Drives:
    found = []
    for seed in SEEDS:
        world = load_world("two-rooms", seed)
        found.append((world, *drive_in(world.arena, seed, 120)))
    return found


def test_it_drives_far_and_never_through_anything(drives):
    for world, _, updates in drives:
        path = np.concatenate([u.straight.path[:, :2] for u in updates])
        assert clearance(world.arena, path).min() >= Chassis().radius_m
    for _, start, updates in drives:
        pose = start
        for update in updates:
            assert update.turn.path[0] == pytest.approx(pose)
            assert update.straight.path[0] == pytest.approx(update.turn.path[-1])
            pose = update.pose
    for _, _, updates in drives:
        steps = np.concatenate([np.diff(u.straight.path[:, :2], axis=0) for u in updates])
        assert len(updates) == 120
        assert np.linalg.norm(steps, axis=1).sum() > 1000 * INCH_M
    for world, _, updates in drives:
        west = np.mean([u.pose[0] < 107 * INCH_M for u in updates])
        wood = np.mean([floor_at(world.arena, u.pose[0], u.pose[1]) == "wood" for u in updates])
        assert 0.15 < west < 0.85
        assert 0.05 < wood < 0.95


def test_offsets_and_headings_are_uniform(drives):
    """Nobody steers to nodes or to their headings: chi-square over all drives together."""
    poses = np.array([u.pose for _, _, updates in drives for u in updates])
    offsets = (poses[:, :2] - 8 * INCH_M) / CELL_M % 1
    headings = poses[:, 2:] / np.radians(45) % 1
    for column in np.concatenate([offsets, headings], axis=1).T:
        assert chisquare(np.histogram(column, bins=6, range=(0, 1))[0]).pvalue > 0.001
        assert np.histogram(column, bins=50, range=(0, 1))[0].max() < 0.06 * len(column)  # and no spikes
    headings = np.array([u.pose[2] for _, _, updates in drives for u in updates])
    turns = np.abs([u.turn.measured[2] for _, _, updates in drives for u in updates]) / 1.3695
    assert (np.histogram(headings, bins=8, range=(-np.pi, np.pi))[0] > 0.03 * len(headings)).all()
    assert (np.histogram(turns, bins=4, range=(0, np.pi))[0] > 0.01 * len(turns)).all()


def test_luck_is_the_seeds(drives):
    chassis = Chassis()
    for seed, (_, _, updates) in zip(SEEDS, drives, strict=True):
        for step, update in enumerate(updates, start=1):
            luck = draw_luck(stream(Domain.SIMULATOR, seed, step, SimPurpose.ROBOT))
            turned = wrap(update.turn.path[-1:, 2] - update.turn.path[0, 2])[0]
            residual = wrap(np.array([turned - update.turn.measured[2] / chassis.turn_over_read]))[0]
            assert residual == pytest.approx(chassis.turn_bias_rad + chassis.turn_sd_rad * luck.turn)
    crossed, slipped = 0, 0
    for world, _, updates in drives:
        for update in updates:
            floors = {floor_at(world.arena, x, y) for x, y, _ in update.straight.path[:-1]}
            assert len(floors) > 1 or not update.straight.slipped_rad
            crossed += len(floors) > 1
            slipped += update.straight.slipped_rad != 0
    assert 0 < slipped < 0.1 * crossed + 4 * np.sqrt(0.09 * crossed)


def test_a_longer_drive_begins_with_the_shorter_one(world):
    short, long = (drive_in(world.arena, 5, n)[1] for n in (6, 12))
    for a, b in zip(short, long[:6], strict=True):
        assert np.array_equal(a.pose, b.pose)
    assert not np.array_equal(drive_in(world.arena, 6, 1)[1][0].pose, short[0].pose)
    _, plain = drive_in(world.arena, 2, 4)
    _, kidnapped = drive_in(world.arena, 2, 4, kidnap_at=2)
    for a, b in zip(plain[:2], kidnapped[:2], strict=True):
        assert np.array_equal(a.pose, b.pose)


def test_a_kidnapped_robot_goes_on_far_away_and_its_wheels_know_nothing(world):
    map_ = raster(world.arena)
    assert map_ is not None
    for seed in range(4):
        _, updates = drive_in(world.arena, seed, 6, kidnap_at=3)
        assert [u.kidnapped_to is not None for u in updates] == [False, False, True, False, False, False]
        there = updates[2].kidnapped_to
        assert np.hypot(*(there - updates[2].pose)[:2]) >= KIDNAP_M
        assert is_free(map_, there[:2])
        assert updates[3].turn.path[0] == pytest.approx(there)
        assert np.abs(updates[3].straight.measured[0]) < 20 * INCH_M


def test_a_given_start_is_where_it_starts(world):
    map_ = raster(world.arena)
    here = np.array([*map_.centers[7], 0.5])
    start, updates = drive(Robot(world.arena, 3), map_, 1, start=here)
    assert np.array_equal(start, here)
    assert np.array_equal(next(updates).turn.path[0], here)


def test_a_movement_is_measured_as_chosen_and_ends_at_walls():
    open_floor, here = Arena((-5, -5, 5, 5), np.zeros((0, 4))), np.zeros(3)
    update = Robot(open_floor, 1).move(1, here, BehaviorProposal("going", 1, 0.5, 0.2))
    assert (update.turn.measured[2] / 1.3695, update.straight.measured[0]) == pytest.approx((0.5, 0.2))
    wall = Arena((-5, -5, 5, 5), np.array([[1.0, -5, 1.0, 5]]))
    update = Robot(wall, 1).move(1, here, BehaviorProposal("going", 1, 0.0, 4.0))
    assert update.straight.bumped
    assert update.pose[0] < 1.0


def test_a_robot_that_nobody_guides_wanders(world):
    map_ = raster(world.arena)
    assert map_ is not None
    robot = Robot(world.arena, 1, behaviors=(Localize(), Wander()))
    updates = list(islice(drive(robot, map_, 20)[1], 20))
    assert {u.behavior for u in updates} == {"wandering"}
    steps = np.diff([u.pose[:2] for u in updates], axis=0)
    assert np.hypot(*steps.T).mean() > 4 * INCH_M
