"""A planar laser on an occupancy grid: AMCL's formulas as plain loops, and laws that hold for every model."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

import maurice_mcl as mcl
from maurice_mcl.sensor.laser import field as laser_field
from maurice_mcl.sensor.laser.beams import JUDGMENTS
from maurice_mcl.sensor.laser.models import OUTLIER, SIGMA_M, UNKNOWN_NATS, LaserMap
from maurice_mcl.sensor.laser.parameters import MODELS, LaserParameters
from maurice_mcl.sensor.laser.rays import Rays, cast
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.pose_sensor import MOST_APART, PoseSpread, spread_between

from .conftest import CELL_M, MOUNT, TRUTH, ZERO, reading_of, room, scan_at


def around(pose, count=200, seed=3):
    spread = np.random.default_rng(seed).normal(0, [0.3, 0.3, 0.2], (count, 3))
    return (pose + spread).astype(np.float32)


@pytest.fixture(scope="module")
def scan(grid):
    scan = scan_at(grid, TRUTH)
    ranges = scan.ranges_m.copy()
    ranges[[4, 40]], ranges[[9, 64]], ranges[100:106] = np.nan, 8.0, 0.7
    return replace(scan, ranges_m=ranges)


def amcl_field(grid, scan, pose, p, step, value):
    """AMCL's loop over beams, of amcl_laser.cpp and likelihood_field_model.cpp, for one pose."""
    apart = distance_transform_edt(grid.cells != OCCUPIED) * grid.cell_m
    x0, y0, heading = compose(pose, scan.mount)
    for k in range(0, scan.size, step):
        reach = float(scan.ranges_m[k])
        if math.isnan(reach) or reach >= scan.max_m:
            continue
        angle = heading + scan.start_rad + k * scan.step_rad
        column = math.floor((x0 + reach * math.cos(angle) - grid.corner[0]) / grid.cell_m)
        row = math.floor((y0 + reach * math.sin(angle) - grid.corner[1]) / grid.cell_m)
        away = p.laser_likelihood_max_dist
        if 0 <= row < len(apart) and 0 <= column < len(apart[0]):
            away = min(away, apart[row, column])
        pz = p.z_hit * math.exp(-(away**2) / (2 * p.sigma_hit**2)) + p.z_rand / scan.max_m
        value(pz)


@pytest.mark.parametrize("name", ["likelihood_field", "likelihood_field_prob"])
def test_fields_are_amcls_up_to_a_constant(grid, scan, name):
    p = LaserParameters(model=name, max_beams=50)
    laser, poses = Laser(grid, p), around(TRUTH, 40)
    step = (
        (scan.size - 1) // (p.max_beams - 1) if name == "likelihood_field" else -(-scan.size // p.max_beams)
    )
    expected = []
    for pose in poses.astype(float):
        values = []
        amcl_field(grid, scan, pose, p, step, values.append)
        cubes = 1 + sum(pz**3 for pz in values)
        expected.append(math.log(cubes) if name == "likelihood_field" else sum(map(math.log, values)))
    nats = laser.log_likelihood(reading_of(laser, scan), poses, ZERO)
    assert np.ptp(nats) > 0.5
    # an end point at the very edge of a cell may be rounded into the next
    assert np.median(np.abs((nats - nats[0]) - (np.array(expected) - expected[0]))) < 1e-3


def test_the_beam_model_is_amcls_up_to_a_constant(grid, scan):
    p = LaserParameters(model="beam")
    laser, poses = Laser(grid, p), around(TRUTH, 40)
    reading = reading_of(laser, scan)
    lasers = np.array([compose(pose, MOUNT) for pose in poses.astype(float)])
    angles = scan.start_rad + scan.step_rad * reading.beams
    expected = Rays.of(grid, unknown_blocks=True).cast(lasers, angles, scan.max_m)
    total = np.ones(len(poses))
    for b, z in enumerate(reading.ranges_m.astype(float)):
        for n, mapped in enumerate(expected[:, b].astype(float)):
            pz = p.z_hit * math.exp(-((z - mapped) ** 2) / (2 * p.sigma_hit**2))
            pz += p.z_short * p.lambda_short * math.exp(-p.lambda_short * z) if z < mapped else 0
            pz += p.z_max if z >= scan.max_m else p.z_rand / scan.max_m
            total[n] += pz**3
    nats = laser.log_likelihood(reading, poses, ZERO)
    np.testing.assert_allclose(nats - nats[0], np.log(total) - math.log(total[0]), atol=1e-4)


def test_skipped_beams_are_those_that_a_converged_cloud_disagrees_with(grid, scan):
    blocked = replace(scan, ranges_m=np.where(np.arange(scan.size) % 2 == 0, 0.5, scan.ranges_m))
    poses = (TRUTH + np.random.default_rng(1).normal(0, 0.02, (50, 3))).astype(np.float32)
    plain = Laser(grid, LaserParameters(model="likelihood_field_prob"))
    skips = Laser(grid, LaserParameters(model="likelihood_field_prob", do_beamskip=True))
    reading = reading_of(plain, blocked)
    all_beams, kept = (laser.log_likelihood(reading, poses, ZERO) for laser in (plain, skips))
    assert kept.min() > all_beams.max() + 5
    far = np.concatenate([poses, poses + np.float32(1)])
    np.testing.assert_array_equal(*(laser.log_likelihood(reading, far, ZERO) for laser in (plain, skips)))
    # where hardly a beam agrees, none is skipped
    lost = poses + np.array([0.3, 0.4, 1.5], np.float32)
    strict = Laser(grid, replace(skips.parameters, beam_skip_error_threshold=0.1))
    np.testing.assert_allclose(
        strict.log_likelihood(reading, lost, ZERO), plain.log_likelihood(reading, lost, ZERO), atol=1e-3
    )


@pytest.mark.parametrize("model", MODELS)
def test_nats_are_finite_at_most_zero_and_best_near_the_truth(grid, model):
    laser = Laser(grid, LaserParameters(model=model))
    reading = reading_of(laser, scan_at(grid, TRUTH))
    far = np.array([[1e6, -1e6, 3.0], [-0.4, -0.4, 0.0], [6.4, 4.4, -9.0]], np.float32)
    poses = np.concatenate([TRUTH[None].astype(np.float32), around(TRUTH), far])
    for spread in (PoseSpread(), PoseSpread(0.3, 0.2)):
        nats = laser.log_likelihood(reading, poses, ZERO, spread)
        assert nats.dtype == np.float32
        assert nats.shape == (len(poses),)
        assert np.isfinite(nats).all()
        assert nats.max() <= 0
        assert nats[0] > np.percentile(nats, 95)
        assert laser.log_likelihood(reading, poses[:0], ZERO, spread).shape == (0,)


@pytest.mark.parametrize("model", MODELS)
def test_only_where_the_robot_is_on_the_map_counts(grid, scan, model):
    """A map elsewhere, or poses off another origin, are worth the same."""
    laser = Laser(grid, LaserParameters(model=model))
    reading, poses = reading_of(laser, scan), around(TRUTH, 60)
    nats = laser.log_likelihood(reading, poses, ZERO)
    away = np.array([512.0, -1024.0])
    moved = Laser(replace(grid, corner=grid.corner + away), laser.parameters)
    np.testing.assert_allclose(moved.log_likelihood(reading, poses, away), nats, atol=0.3)
    assert np.median(np.abs(moved.log_likelihood(reading, poses, away) - nats)) < 1e-3


@pytest.mark.parametrize("model", MODELS)
def test_a_map_turned_by_a_right_angle_turns_the_poses(grid, model):
    scan, poses = scan_at(grid, TRUTH), around(TRUTH, 100)
    turned_grid = OccupancyMap(np.ascontiguousarray(np.rot90(grid.cells, -1)), CELL_M, np.array([-4.5, -0.5]))
    turned = np.stack([-poses[:, 1], poses[:, 0], poses[:, 2] + np.float32(np.pi / 2)], axis=1)
    both = [Laser(each, LaserParameters(model=model)) for each in (grid, turned_grid)]
    reading = reading_of(both[0], scan)
    nats = both[0].log_likelihood(reading, poses, ZERO)
    again = both[1].log_likelihood(reading, turned, ZERO)
    assert np.corrcoef(nats, again)[0, 1] > 0.999


@pytest.mark.parametrize("model", MODELS)
def test_a_wall_that_moved_lowers_the_likelihood(grid, model):
    scan = scan_at(grid, TRUTH)
    p = LaserParameters(model=model)
    nats = [
        float(laser.log_likelihood(reading_of(laser, scan), TRUTH[None].astype(np.float32), ZERO)[0])
        for laser in (Laser(grid, p), Laser(room(shift=-12), p))
    ]
    assert nats[0] > nats[1] + 0.1


def test_a_mount_turned_over_is_the_same_scan(grid):
    scan = scan_at(grid, TRUTH, mount=np.zeros(3))
    last = scan.angles_rad[-1]
    over = replace(scan, ranges_m=scan.ranges_m[::-1], start_rad=last, step_rad=-scan.step_rad)
    laser, poses = Laser(grid, LaserParameters(max_beams=200)), around(TRUTH, 50)
    nats = [laser.log_likelihood(reading_of(laser, each), poses, ZERO) for each in (scan, over)]
    np.testing.assert_allclose(nats[0], nats[1], atol=0.3)


def test_unknown_space_is_neither_right_nor_wrong(grid):
    """A beam that ends where nobody has been costs less than one in free space, more than one at a wall."""
    laser = Laser(grid)
    lookup = laser._map.field("calibrated", 0.1, 0.0)
    wall, free, behind, outside = lookup.at(np.array([[0.025, 1.0], [2.5, 0.5], [-0.4, -0.4], [-9.0, 3.0]]))
    assert free < behind == outside == np.float32(UNKNOWN_NATS) < wall == 0


def test_a_large_map_in_bytes_says_the_same(grid, scan, monkeypatch):
    fine = Laser(grid)
    reading, poses = reading_of(fine, scan), around(TRUTH)
    nats = fine.log_likelihood(reading, poses, ZERO)
    monkeypatch.setattr(laser_field, "FINE_CELLS", 100)
    coarse = Laser(replace(grid))
    np.testing.assert_allclose(coarse.log_likelihood(reading, poses, ZERO), nats, atol=0.3)
    assert coarse._map.field("calibrated", 0.1, 0.0).values.dtype == np.uint8


def test_a_spread_forgives_a_pose_beside(grid):
    laser = Laser(grid)
    reading = reading_of(laser, scan_at(grid, TRUTH))
    beside = np.add(TRUTH, [0.3, 0.0, 0.0]).astype(np.float32)[None]
    exact, spread = (
        laser.log_likelihood(reading, beside, ZERO, each)[0] for each in (PoseSpread(), PoseSpread(0.3))
    )
    assert spread > exact + 3


def test_a_particle_stands_for_the_poses_to_its_neighbors():
    normal = np.random.default_rng(2).normal(0, [0.1, 0.1, 0.05], (16_000, 3))
    cloud = np.add(normal, [4.0, 5.0, np.pi]).astype(np.float32)
    cloud[:, 2] = np.angle(np.exp(1j * cloud[:, 2]))
    spread, few = spread_between(cloud), spread_between(cloud[:2000])
    assert spread.position_m == pytest.approx(0.01, rel=0.15)
    assert spread.heading_rad == pytest.approx(0.005, rel=0.15)
    assert few.position_m == pytest.approx(0.02, rel=0.15)
    away = np.concatenate([cloud[:2000], cloud[:60] + np.float32(9)])
    assert spread_between(away).position_m < 1.1 * few.position_m
    assert spread_between(cloud[:10]) == PoseSpread()
    lost = np.random.default_rng(7).uniform([0, 0, -3], [30, 20, 3], (5000, 3)).astype(np.float32)
    assert spread_between(lost).position_m > 1
    proposed = np.concatenate([lost, cloud[:400]])
    assert spread_between(proposed).position_m < 0.25
    assert spread_between(cloud * np.float32([1000, 1000, 1])).position_m == MOST_APART.position_m


def test_clouds_weighed_together_are_those_weighed_alone(grid):
    scan, names = scan_at(grid, TRUTH), ("calibrated", "likelihood_field")
    near = (TRUTH + np.random.default_rng(4).normal(0, 0.02, (100, 3))).astype(np.float32)
    clouds, changed = [near, around(TRUTH, 100)], []
    for name in names:
        settings = {"sensor.laser.model": name}
        sensor = mcl.make_localizer(map_library(grid, "room"), settings=settings).sensor
        relative = [cloud - np.array([*sensor.library.origin, 0], np.float32) for cloud in clouds]
        frame = mcl.Frame(1, 0.0, np.zeros((1, 3)), np.zeros((24, 32, 3), np.uint8), "", scan=scan)
        comparison = sensor.see(frame)
        alone = np.concatenate([sensor.sense_at(comparison, cloud) for cloud in relative])
        together = sensor.sense_at(comparison, np.concatenate(relative), 2)
        np.testing.assert_array_equal(together, alone)
        laser = sensor.sensors["laser"]
        exact = laser.log_likelihood(reading_of(laser, scan), relative[1], sensor.library.origin)
        changed.append(float(np.abs(together[100:] - exact).max()))
    assert changed[0] > 5
    assert changed[1] == 0  # as AMCL has it


def test_rays_reach_what_blocks_them(grid):
    poses = np.array([[1.0, 1.0, 0.0], [1.2, 1.0, np.pi / 2], [1.0, 1.0, np.pi], [-0.45, -0.45, -2.0]])
    reach = cast(grid, poses, np.zeros(1), 9.0)[:, 0]
    np.testing.assert_allclose(reach, [4.95, 1.5, 0.95, 9.0], atol=1.1 * CELL_M)
    blocked = Rays.of(grid, unknown_blocks=True).cast(poses, np.zeros(1), 9.0)[:, 0]
    np.testing.assert_allclose(blocked, [4.95, 1.5, 0.95, 0.0], atol=1.1 * CELL_M)
    assert cast(grid, poses[:1], np.zeros(1), 2.0) == 2.0


def test_rays_from_beyond_a_map_reach_what_they_would_through_unknown_cells(grid):
    wide = OccupancyMap(np.pad(grid.cells, 100, constant_values=UNKNOWN), CELL_M, grid.corner - 100 * CELL_M)
    around = np.linspace(-np.pi, np.pi, 40)
    middle, away = np.array([3.0, 2.0]), np.stack([np.cos(around), np.sin(around)], axis=1)
    poses = np.column_stack([middle + 4.5 * away, around + np.pi])
    reach, expected = (cast(map_, poses, np.linspace(-1, 1, 31), 12.0) for map_ in (grid, wide))
    assert (expected < 12).mean() > 0.5
    assert (expected == 12).any()
    # a ray that grazes a corner may slip past it
    assert (np.abs(reach - expected) < 1.5 * CELL_M).mean() > 0.99


def test_rays_are_those_of_small_steps(grid):
    poses = np.random.default_rng(8).uniform([0.1, 0.1, -3], [5.2, 3.2, 3], (40, 3))
    angles = np.linspace(-3, 3, 23)
    reach = Rays.of(grid).cast(poses, angles, 9.0)
    steps = np.arange(0, 9, 0.005)
    for pose, row in zip(poses, reach, strict=True):
        for angle, reached in zip(pose[2] + angles, row, strict=True):
            path = pose[:2] + steps[:, None] * [np.cos(angle), np.sin(angle)]
            there = grid.states_at(path) == OCCUPIED
            assert there.any()
            # a ray may slip past the very corner of a cell
            assert reached > steps[there.argmax()] - 0.01
    first = [
        steps[(grid.states_at(p[:2] + steps[:, None] * [np.cos(p[2]), np.sin(p[2])]) == OCCUPIED).argmax()]
        for p in poses
    ]
    assert np.abs(reach[:, 11] - first).max() < 1.5 * CELL_M


def test_each_beam_is_judged_by_where_it_ends(grid):
    truth = np.array([2.6, 1.7, 0.0])
    scan = scan_at(grid, truth, mount=np.zeros(3), size=60)
    ranges = scan.ranges_m.copy()
    ranges[5:10] *= np.float32(0.5)
    ranges[30] += np.float32(0.4)
    ranges[50:52] = np.inf
    laser = Laser(grid, LaserParameters(model="beam"))
    reading = reading_of(laser, replace(scan, ranges_m=ranges))
    judgment = laser.judged(reading, truth)
    words = [JUDGMENTS[k] for k in judgment.judged]
    assert words[5:10] == ["short"] * 5
    assert words[30] == "beyond"
    assert words[50:52] == ["miss"] * 2
    assert judgment.count("agrees") == 60 - 8
    np.testing.assert_allclose(judgment.expected_m, scan.ranges_m, atol=CELL_M)
    assert (judgment.nats <= 0).all()
    assert judgment.nats[5:10].max() < judgment.nats[judgment.are("agrees")].min()
    open_map = replace(grid, cells=np.where(grid.cells == OCCUPIED, UNKNOWN, grid.cells))
    assert Laser(open_map).judged(reading_of(Laser(open_map), scan), truth).count("unknown") > 50


def test_what_is_shown_says_how_beams_disagree(grid):
    scan = scan_at(grid, TRUTH)
    ranges = np.where(np.arange(scan.size) < 40, np.maximum(scan.ranges_m - 0.4, 0.1), scan.ranges_m)
    laser = Laser(grid)
    reading = reading_of(laser, replace(scan, ranges_m=ranges.astype(np.float32)))
    shown = laser.shown(reading, {"estimate": TRUTH, "truth": np.add(TRUTH, [0.1, 0, 0])})
    assert "before the wall: something stands there" in shown.text("{:.1f} m".format)
    assert "0.4 m" in shown.text("{:.1f} m".format)
    away = laser.shown(reading, {"estimate": np.array([1.0, 2.0, 2.5])}).text("{:.1f} m".format)
    assert "elsewhere" in away  # nothing is said of the map where hardly a beam agrees
    assert "something stands there" not in away
    marks = {mark.name: mark for mark in shown.marks}
    assert marks["scan at the truth"].of == "truth"
    assert len(marks["scan at the estimate"].strips) == reading.scan.hits.sum()
    short = marks["beams judged short"]
    assert short.strips.shape[1:] == (2, 2)
    assert 10 < len(short.strips) <= 20


def test_a_judgment_is_that_of_its_reading_and_pose_however_often_it_is_asked_for(grid):
    laser, pose = Laser(grid), np.array(TRUTH)
    readings = [reading_of(laser, scan_at(grid, where)) for where in (TRUTH, np.array([4.5, 1.0, -2.0]))]
    fresh = [Laser(grid).judged(reading, TRUTH).count("agrees") for reading in readings]
    assert fresh[0] > fresh[1]
    for _ in range(2):
        assert [laser.judged(reading, pose).count("agrees") for reading in readings] == fresh
    pose += [0.5, 0.3, 1.0]  # the caller's array, moved on
    assert laser.judged(readings[0], pose).count("agrees") < fresh[0]


def test_a_scan_with_too_few_hits_says_nothing(grid):
    laser = Laser(grid)
    assert laser.read(SimpleNamespace(scan=None)) is None
    for nothing in (np.inf, np.nan, 0.0, 8.0):
        scan = LaserScan(np.full(100, nothing, np.float32), -1.0, 0.02, 0.05, 8.0)
        assert reading_of(laser, scan) is None


def test_a_map_too_wide_is_one_line():
    wide = OccupancyMap(np.zeros((2, 40_000), np.uint8), CELL_M, ZERO)
    with pytest.raises(mcl.InputError, match=r"found a map of 40000 x 2 cells.*larger cells"):
        Laser(wide)


def test_a_beam_that_ends_beside_unknown_space_may_have_ended_there():
    cells = np.full((60, 60), FREE, np.uint8)
    cells[:, 40:], cells[:, 0] = UNKNOWN, OCCUPIED
    lasers = LaserMap(OccupancyMap(cells, CELL_M, ZERO), LaserParameters())
    ends = np.array([[2.3, 1.5], [1.97, 1.5], [1.8, 1.5], [1.0, 1.5]])
    worth = lasers.field("calibrated", SIGMA_M).at(ends)
    assert worth[0] == pytest.approx(UNKNOWN_NATS)
    assert UNKNOWN_NATS - 0.15 < worth[1] < UNKNOWN_NATS
    assert worth[2] < UNKNOWN_NATS - 1
    assert worth[3] == pytest.approx(math.log(OUTLIER), abs=1e-3)


def test_ranges_in_use_can_be_narrowed(grid):
    scan = scan_at(grid, TRUTH)
    narrow = Laser(grid, LaserParameters(laser_min_range=1.0, laser_max_range=2.0))
    reading = reading_of(narrow, scan)
    assert reading.max_m == 2.0
    assert ((reading.ranges_m > 1) & (reading.ranges_m < 2)).all()


def test_distances_are_the_roots_of_whole_squares_in_every_process():
    """OpenCV's own differ in the last bit between processes, and a run could not be verified."""
    blocked = np.random.default_rng(5).random((150, 217)) < 0.002
    squares = np.rint(distance_transform_edt(~blocked) ** 2).astype(np.float32)
    np.testing.assert_array_equal(laser_field.cell_distances(blocked), np.sqrt(squares))
