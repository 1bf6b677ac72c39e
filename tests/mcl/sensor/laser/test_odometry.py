"""How a robot moved, by its scans: found where wheels are off or slip, and refused where it was carried."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from maurice_mcl.sensor.laser.odometry import LEAST_POINTS, movement_by_scans
from maurice_mcl.values.geometry import compose, motion_between
from maurice_mcl.values.laser import FREE, OCCUPIED, OccupancyMap
from maurice_mcl.values.pose_sensor import Earlier

from .conftest import CELL_M, ZERO, scan_at

START, MOTION = np.array([2.5, 3.0, 0.3]), np.array([0.5, 0.05, 0.2])


@pytest.fixture(scope="module")
def hall():
    """A hall of 16 x 8 m with pillars at irregular places."""
    cells = np.full((160, 320), FREE, np.uint8)
    cells[[0, -1]], cells[:, [0, -1]] = OCCUPIED, OCCUPIED
    for row, column in ((30, 70), (110, 130), (50, 180), (120, 250), (20, 280)):
        cells[row : row + 12, column : column + 9] = OCCUPIED
    return OccupancyMap(cells, CELL_M, ZERO)


def earlier(hall, pose, motion, link=0.0):
    reading = None if pose is None else SimpleNamespace(scan=scan_at(hall, np.asarray(pose)))
    return Earlier(np.asarray(motion)[None], link, reading, np.zeros(3))


@pytest.mark.parametrize(
    ("off", "close_m"),
    [
        ((0.0, 0.0, 0.0), 0.03),
        ((0.08, -0.05, 0.06), 0.03),
        ((0.5, 0.3, 0.0), 0.05),  # wheels that slip
        ((-0.4, 0.0, 0.35), 0.05),
    ],
)
def test_a_movement_is_found_from_what_wheels_measured(hall, off, close_m):
    wheels = MOTION + off
    points = scan_at(hall, compose(START, MOTION)).points()
    movement = movement_by_scans(points, wheels, [earlier(hall, START, wheels)])
    assert movement.is_linked
    assert np.hypot(*(movement.motion - MOTION)[:2]) < close_m
    assert abs(movement.motion[2] - MOTION[2]) < 0.02
    assert np.linalg.eigvalsh(movement.covariance).min() > 0


def test_a_robot_that_was_carried_does_not_see_what_it_saw(hall):
    points = scan_at(hall, np.array([11.0, 2.0, 2.0])).points()
    movement = movement_by_scans(points, MOTION, [earlier(hall, START, MOTION)])
    assert not movement.is_linked
    np.testing.assert_array_equal(movement.motion, MOTION)  # that of its wheels


def test_scans_before_a_break_are_left_out(hall):
    """The scan before the last was seen elsewhere: laid out, it would put walls where there are none."""
    now = compose(START, MOTION)
    here = earlier(hall, START, MOTION)
    broken, whole = (earlier(hall, [11.0, 2.0, 2.0], MOTION, link) for link in (-2.0, 0.0))
    alone, after_break, mixed = (
        movement_by_scans(scan_at(hall, now).points(), MOTION, scans)
        for scans in ([here], [here, broken], [here, whole])
    )
    np.testing.assert_array_equal(alone.motion, after_break.motion)
    assert not np.array_equal(alone.motion, mixed.motion)


def test_too_few_points_tell_nothing(hall):
    points = scan_at(hall, START).points()
    assert movement_by_scans(points[: LEAST_POINTS - 1], MOTION, [earlier(hall, START, MOTION)]) is None
    assert movement_by_scans(points, MOTION, [earlier(hall, None, MOTION)]) is None
    assert movement_by_scans(points, MOTION, []) is None


def test_by_scans_a_drive_drifts_a_fraction_as_far_as_by_wheels(hall):
    """Twenty drives of 24 steps, with the same noise of wheels for both."""
    rng, drifts = np.random.default_rng(3), []
    for _ in range(20):
        pose = wheels = scans = np.array([3.0, 4.0, rng.uniform(-3, 3)])
        past = []
        for _ in range(24):
            truth = compose(pose, np.array([0.25, 0.0, 0.27]))
            measured = motion_between(pose, truth) + rng.normal(0, (0.04, 0.02, 0.04))
            before = [earlier(hall, pose, measured), *past]
            movement = movement_by_scans(scan_at(hall, truth).points(), measured, before)
            past = [earlier(hall, pose, movement.motion, movement.link), *past]
            pose, wheels, scans = truth, compose(wheels, measured), compose(scans, movement.motion)
        drifts.append([np.hypot(*(end - pose)[:2]) for end in (wheels, scans)])
    by_wheels, by_scans = np.mean(drifts, axis=0)
    assert by_scans < by_wheels / 3
