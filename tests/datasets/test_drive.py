from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.addresses import Purpose
from maurice_datasets.drive import Habits, Update, drive
from maurice_datasets.robot import Chassis, draw_luck
from maurice_datasets.two_rooms import grid_nodes, two_rooms
from maurice_datasets.world import World, clearance, floor_at
from maurice_mcl.geometry import INCH_M, wrap
from maurice_mcl.randomness import Domain, stream

SEEDS = (0, 1, 2, 3)
Drives = list[tuple[World, np.ndarray, list[Update]]]


@pytest.fixture(scope="module")
def drives() -> Drives:
    found = []
    for seed in SEEDS:
        world = two_rooms(seed)
        start, updates = drive(world.arena, seed, 120)
        found.append((world, start, list(updates)))
    return found


def test_it_never_comes_near_anything_solid(drives: Drives) -> None:
    for world, _, updates in drives:
        path = np.concatenate([u.straight.path[:, :2] for u in updates])
        assert clearance(world.arena, path).min() > Habits().keep_m


def test_it_goes_on_from_where_it_was(drives: Drives) -> None:
    for _, start, updates in drives:
        pose = start
        for update in updates:
            assert update.turn.path[0] == pytest.approx(pose)
            assert update.straight.path[0] == pytest.approx(update.turn.path[-1])
            pose = update.pose


def test_120_updates_make_more_than_1000_inches(drives: Drives) -> None:
    for _, _, updates in drives:
        steps = np.concatenate([np.diff(u.straight.path[:, :2], axis=0) for u in updates])
        assert len(updates) == 120
        assert np.linalg.norm(steps, axis=1).sum() > 1000 * INCH_M


def test_it_sees_both_rooms_and_both_floors(drives: Drives) -> None:
    for world, _, updates in drives:
        west = np.mean([u.pose[0] < 107 * INCH_M for u in updates])
        wood = np.mean([floor_at(world.arena, u.pose[0], u.pose[1]) == "wood" for u in updates])
        assert 0.15 < west < 0.85
        assert 0.15 < wood < 0.85


def test_offsets_within_a_cell_and_headings_between_references_are_spread_evenly(drives: Drives) -> None:
    """The driver does not steer to nodes: quarter by quarter, no share is far from a fourth."""
    poses = np.array([u.pose for _, _, updates in drives for u in updates])
    first = grid_nodes()[0]
    offsets = (poses[:, :2] - first) / (18 * INCH_M) % 1
    headings = poses[:, 2:] / np.radians(45) % 1
    for column in np.concatenate([offsets, headings], axis=1).T:
        shares = np.histogram(column, bins=4, range=(0, 1))[0] / len(column)
        assert (shares > 0.15).all()
        assert (shares < 0.35).all()
        assert (np.abs(np.histogram(column, bins=50, range=(0, 1))[0] / len(column) - 0.02) < 0.04).all()


def test_headings_go_all_around_and_turns_are_of_every_size(drives: Drives) -> None:
    headings = np.array([u.pose[2] for _, _, updates in drives for u in updates])
    turns = np.abs([u.turn.measured[2] for _, _, updates in drives for u in updates]) / 1.3695
    assert (np.histogram(headings, bins=8, range=(-np.pi, np.pi))[0] > 0.03 * len(headings)).all()
    assert (np.histogram(turns, bins=4, range=(0, np.pi))[0] > 0.01 * len(turns)).all()


def test_luck_is_the_seed_s_and_does_not_depend_on_what_the_driver_chose(drives: Drives) -> None:
    chassis = Chassis()
    for seed, (_, _, updates) in zip(SEEDS, drives, strict=True):
        for step, update in enumerate(updates, start=1):
            luck = draw_luck(stream(Domain.SIMULATOR, seed, step, Purpose.ROBOT))
            turned = wrap(update.turn.path[-1:, 2] - update.turn.path[0, 2])[0]
            residual = wrap(np.array([turned - update.turn.measured[2] / chassis.turn_over_read]))[0]
            assert residual == pytest.approx(chassis.turn_bias_rad + chassis.turn_sd_rad * luck.turn)


def test_a_longer_drive_begins_with_the_shorter_one() -> None:
    arena = two_rooms(0).arena
    short, long = (list(drive(arena, 5, n)[1]) for n in (6, 12))
    for a, b in zip(short, long[:6], strict=True):
        assert np.array_equal(a.pose, b.pose)
    assert not np.array_equal(next(drive(arena, 6, 1)[1]).pose, short[0].pose)
