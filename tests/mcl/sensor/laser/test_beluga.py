"""Beluga's models of a laser give the values of Beluga's own suite, and its formulas as plain loops."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from maurice_mcl.sensor.laser import beluga
from maurice_mcl.sensor.laser.models import LaserMap
from maurice_mcl.sensor.laser.parameters import BELUGAS, LaserParameters
from maurice_mcl.sensor.laser.reading import read_scan
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap

from .conftest import MOUNT, TRUTH, ZERO, reading_of, scan_at

HERE = np.zeros((1, 3), np.float32)
SUITES = {"z_hit": 0.5, "z_rand": 0.5, "z_short": 0.05, "z_max": 0.05, "sigma_hit": 0.2, "lambda_short": 0.1}


@pytest.fixture(scope="module")
def suites_grid():
    """Five by five cells of half a meter, of which the middle one is occupied."""
    cells = np.full((5, 5), FREE, np.uint8)
    cells[2, 2] = OCCUPIED
    return OccupancyMap(cells, 0.5, np.zeros(2))


def weight(weigh, grid, ends, pose=HERE, max_m=20.0, **changed):
    """What a model makes of beams that end at points (K, 2) in the robot's frame."""
    p = LaserParameters(**SUITES | {"laser_max_range": max_m} | changed)
    reading = SimpleNamespace(ends=np.array(ends, float), max_m=30.0)
    return math.exp(float(weigh(LaserMap(grid, p), reading, pose, ZERO, 0.0)[0]))


@pytest.mark.parametrize(
    ("ends", "field", "prob"),
    [
        ([[1.25, 1.25]], 2.068, 1.022),
        ([[2.25, 2.25]], 1.000, 0.025),
        ([[-50.0, 50.0]], 1.000, 0.050),  # off the map
        ([[1.20, 1.20], [1.25, 1.25], [1.30, 1.30]], 4.205, 1.068),
    ],
)
def test_fields_have_the_values_of_belugas_suite(suites_grid, ends, field, prob):
    assert weight(beluga.likelihood_field, suites_grid, ends) == pytest.approx(field, abs=0.003)
    assert weight(beluga.likelihood_field_prob, suites_grid, ends) == pytest.approx(prob, abs=0.01)


def test_a_field_is_where_the_robot_is(suites_grid):
    moved = np.array([[1.25, 1.25, 0.0]], np.float32)
    assert weight(beluga.likelihood_field, suites_grid, [[0.0, 0.0]], moved) == pytest.approx(
        2.068, abs=0.003
    )


@pytest.mark.parametrize(
    ("end", "expected"),
    [(1.0, 1.0171643824743635), (0.75, 0.015905891701088148), (2.25, 0.0), (60.0, 0.000125)],
)
def test_the_beam_model_has_the_values_of_belugas_suite(suites_grid, end, expected, monkeypatch):
    """Its rays go from the middle of a cell to that of another, ours from the robot to the first wall."""
    middle_to_middle = SimpleNamespace(cast=lambda *_: np.full((1, 1), math.sqrt(2), np.float32))
    monkeypatch.setattr(LaserMap, "rays", middle_to_middle)
    assert weight(beluga.beam, suites_grid, [[end, end]], max_m=60.0) == pytest.approx(expected, abs=1e-6)


def test_unknown_cells_are_as_far_off_or_as_off_the_map(suites_grid):
    cells = suites_grid.cells.copy()
    cells[2, 3] = UNKNOWN  # beside the wall
    grid, ends = replace(suites_grid, cells=cells), [[1.75, 1.25]]
    near = 0.5 * math.exp(-0.5 * (0.5 / 0.2) ** 2) / (0.2 * math.sqrt(2 * math.pi)) + 0.5 / 20
    assert weight(beluga.likelihood_field_prob, grid, ends) == pytest.approx(near)
    modeled = weight(beluga.likelihood_field_prob, grid, ends, model_unknown_space=True)
    assert modeled == pytest.approx(1 / 20)
    # no farther than `laser_likelihood_max_dist`
    cut = weight(
        beluga.likelihood_field_prob, grid, ends, model_unknown_space=True, laser_likelihood_max_dist=0.1
    )
    assert cut == pytest.approx(0.5 * math.exp(-0.125) / (0.2 * math.sqrt(2 * math.pi)) + 0.5 / 20)


def test_beams_are_spread_evenly_and_those_at_a_limit_count():
    ranges = np.full(100, 5.0, np.float32)
    ranges[[0, 99]], ranges[11], ranges[22] = 8.0, 9.0, np.inf
    scan = LaserScan(ranges, 0.0, 0.01, 0.1, 8.0)
    reading = read_scan(scan, LaserParameters(model="beluga_likelihood_field", max_beams=10))
    assert reading is not None
    assert reading.beams.tolist() == [0, 11, 22, 33, 44, 55, 66, 77, 88, 99]  # ceil(k * 99 / 9)
    assert np.flatnonzero(~reading.hits).tolist() == [1, 2]
    more = read_scan(scan, LaserParameters(model="beluga_likelihood_field", max_beams=400))
    assert more is not None
    assert more.beams.tolist() == list(range(100))


@pytest.mark.parametrize("model", BELUGAS[:2])
def test_fields_are_those_of_a_plain_loop_up_to_a_constant(grid, model):
    p = LaserParameters(model=model, max_beams=40, laser_max_range=50.0)
    laser, scan = Laser(grid, p), scan_at(grid, TRUTH)
    poses = (TRUTH + np.random.default_rng(3).normal(0, [0.3, 0.3, 0.2], (30, 3))).astype(np.float32)
    reading = reading_of(laser, scan)
    apart = distance_transform_edt(grid.cells != OCCUPIED) * grid.cell_m
    expected = []
    for pose in poses.astype(float):
        x, y, heading = compose(pose, MOUNT)
        values = []
        for k in reading.beams[reading.hits]:
            angle, reach = heading + scan.start_rad + k * scan.step_rad, float(scan.ranges_m[k])
            column = math.floor((x + reach * math.cos(angle) - grid.corner[0]) / grid.cell_m)
            row = math.floor((y + reach * math.sin(angle) - grid.corner[1]) / grid.cell_m)
            if not (0 <= row < len(apart) and 0 <= column < len(apart[0])):
                values.append(1 / 50.0)
                continue
            away = min(apart[row, column], p.laser_likelihood_max_dist) / p.sigma_hit
            values.append(p.z_hit * math.exp(-(away**2) / 2) / (0.2 * math.sqrt(2 * math.pi)) + p.z_rand / 50)
        cubes = math.log(1 + sum(value**3 for value in values))
        expected.append(cubes if model == "beluga_likelihood_field" else sum(map(math.log, values)))
    nats = laser.log_likelihood(reading, poses, ZERO)
    assert np.ptp(nats) > 0.5
    # an end point at the very edge of a cell may be rounded into the next
    assert np.median(np.abs((nats - nats[0]) - (np.array(expected) - expected[0]))) < 1e-3
