"""How a scan fits a map: at the truth, elsewhere, and with the laser mounted otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.sensor.laser.fit import ScanFits
from maurice_mcl.sensor.laser.rays import cast
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.session import NO_PICTURE, Frame

TRUTH, MOUNT = np.array([2.0, 1.5, 0.4]), np.array([0.2, 0.0, 0.3])


@pytest.fixture(scope="module")
def room():
    """A room of 6 x 4 m that looks different to each side, and nothing known around it."""
    cells = np.full((100, 140), UNKNOWN, np.uint8)
    cells[10:90, 10:130] = OCCUPIED
    cells[12:88, 12:128] = FREE
    cells[40:60, 80:84] = cells[12:30, 100:104] = cells[70:74, 20:50] = OCCUPIED
    return OccupancyMap(cells, 0.05, np.array([-0.5, -0.5]))


@pytest.fixture(scope="module")
def scan(room):
    start, step = -np.pi, np.pi / 90
    angles = start + step * np.arange(180)
    ranges = cast(room, compose(TRUTH, MOUNT), angles, 8.0)[0]
    return LaserScan(
        np.where(ranges < 8, ranges + 0.02, np.inf).astype(np.float32), start, step, 0.1, 8.0, MOUNT
    )


@pytest.fixture
def fits(room):
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(0.5, 5, 200), rng.uniform(0.5, 3, 200), rng.uniform(-3, 3, 200)])
    return ScanFits(room, places)


def fitted(fits, scan, estimate=TRUTH, is_off=True):
    reading = fits.read(scan)
    return fits.fit(reading, TRUTH, estimate, lambda poses: 0.1 * fits.nats(reading, poses), is_off)


def test_a_scan_fits_where_it_was_taken_and_nowhere_else(fits, scan):
    wrong = np.array([4.5, 2.5, 2.0])
    fit = fitted(fits, scan, wrong)
    assert fit.off < 0.1
    assert fit.skill > 0.8
    assert fit.ahead > 20
    assert fit.own_ahead == pytest.approx(0.1 * fit.ahead, rel=1e-3)
    assert fit.apart_m == pytest.approx(np.hypot(2.5, 1.0))
    assert fit.rival == (4.5, 2.5)
    assert fit.shares["agrees"] > 0.9


def test_little_is_computed_where_all_is_well(fits, scan):
    fit = fitted(fits, scan, is_off=False)
    assert fit.off < 0.08
    assert not fit.shares


@pytest.mark.parametrize("yaw_deg", [90, -45, 180])
def test_a_laser_that_is_turned_is_found(fits, scan, yaw_deg):
    """What was measured with the laser turned by so much more than it says."""
    fit = fitted(fits, replace(scan, start_rad=scan.start_rad - np.radians(yaw_deg)))
    assert fit.off > 0.2
    assert abs(np.degrees(fit.mounting.yaw_rad)) == pytest.approx(abs(yaw_deg), abs=5)
    assert not fit.mounting.mirrored
    assert fit.mounting.nats > 0.5 * fit.mounting.as_it_is


def test_a_laser_that_is_upside_down_is_found(fits, scan):
    fit = fitted(fits, replace(scan, start_rad=-scan.start_rad, step_rad=-scan.step_rad))
    assert fit.mounting.mirrored
    assert fit.mounting.yaw_rad == pytest.approx(0, abs=0.1)


def test_walls_that_are_not_seen_and_things_that_are_short_are_told_apart(fits, scan):
    blind = fits.unanswered(replace(scan, ranges_m=np.full(180, np.inf, np.float32)), TRUTH)
    assert blind.shares["unseen"] > 0.9
    near = np.minimum(scan.ranges_m, np.where(np.arange(180) < 90, 0.4, np.inf)).astype(np.float32)
    fit = fitted(fits, replace(scan, ranges_m=near))
    assert fit.shares["short"] > 0.35
    assert fit.shares["unseen"] < 0.1
    assert fit.short_m > 0.2


def with_people(scan, share, seed=3):
    """Replace a share of the beams by people who stand in their way."""
    rng = np.random.default_rng(seed)
    blocked = rng.random(scan.size) < share
    return replace(scan, ranges_m=np.where(blocked, scan.ranges_m * 0.4, scan.ranges_m).astype(np.float32))


def test_people_in_view_and_a_little_drift_speak_less_against_it_than_a_wrong_place(room, scan):
    laser = Laser(room)
    reading = laser.read(Frame(1, 0.0, np.zeros((0, 3)), NO_PICTURE, "", scan=with_people(scan, 0.25)))
    drifted, wrong = TRUTH + np.array([0.15, -0.2, 0.05]), np.array([4.5, 2.5, 2.0])
    assert laser.against(reading, drifted) < 0.2
    assert laser.judged(reading, drifted).against > 0.25
    assert laser.against(reading, wrong) > 0.3


def test_the_pose_around_an_estimate_that_a_scan_fits_best(room, scan):
    laser = Laser(room)
    reading = laser.read(Frame(1, 0.0, np.zeros((0, 3)), NO_PICTURE, "", scan=scan))
    pose, nats = laser.settled(reading, TRUTH + np.array([0.2, 0.1, 0.07]))
    assert np.abs(pose - TRUTH)[:2].max() < 0.06
    assert nats > laser.settled(reading, np.array([4.5, 2.5, 2.0]))[1] + 10
