"""The laws of the robot's errors, on many draws: means and deviations within four standard errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from maurice_datasets.robot.drive import DriveUpdate
from maurice_datasets.robot.motion import Chassis, Luck, draw_luck, draw_slip, drive_by, turn_by
from maurice_datasets.robot.segments import timed
from maurice_mcl.values.geometry import INCH_M, wrap
from maurice_mcl.values.map import Arena, Region

DRAWS = 4000
CHASSIS = Chassis()
START = np.array([0.0, 0.0, 0.3])
NO_LUCK = Luck(0.0, 0.0, 0.0, (0.0, 0.0))


def plain(floor: str) -> Arena:
    everywhere = np.array([[-9.0, -9], [9, -9], [9, 9], [-9, 9]])
    return Arena((-9, -9, 9, 9), np.zeros((0, 4)), floors=(Region(floor, everywhere),))


def lucks() -> list[Luck]:
    rng = np.random.default_rng(11)
    return [draw_luck(rng) for _ in range(DRAWS)]


def mean_and_sd(values: np.ndarray) -> list[float]:
    return [float(values.mean()), float(values.std())]


def normal(mean: float, sd: float, n: int) -> list[Any]:
    """Return what `mean_and_sd` gives for that many draws of a normal distribution."""
    of_mean = pytest.approx(mean, abs=4 * sd / np.sqrt(n))
    return [of_mean, pytest.approx(sd, abs=4 * sd / np.sqrt(2 * n))]


@pytest.mark.parametrize("told_deg", [90.0, -40.0, 0.0, 170.0])
def test_a_turn_is_measured_over_the_gain_plus_the_residual_of_figure_8(told_deg):
    moves = [turn_by(START, np.radians(told_deg), luck, CHASSIS) for luck in lucks()]
    actual = wrap(np.array([m.path[-1, 2] - START[2] for m in moves]) - np.radians(told_deg))
    measured = np.array([m.measured[2] for m in moves])
    residual = np.degrees(actual) + told_deg - np.degrees(measured) / 1.3695
    assert mean_and_sd(residual) == normal(0.2681, 4.916, DRAWS)
    assert (np.array([m.path[-1, :2] for m in moves]) == START[:2]).all()


@pytest.mark.parametrize("told_in", [6.0, 24.0])
def test_a_straight_falls_short_once_a_movement_as_in_figure_11(told_in):
    moves = [drive_by(START, told_in * INCH_M, luck, plain("wood"), CHASSIS) for luck in lucks()[:1000]]
    length = [np.linalg.norm(np.diff(m.path[:, :2], axis=0), axis=1).sum() for m in moves]
    assert mean_and_sd(np.array(length) / INCH_M - told_in) == normal(-0.6978, 0.6356, len(moves))
    assert {float(m.measured[0]) for m in moves} == {told_in * INCH_M}
    assert all(m.measured[2] == 0 for m in moves)


@pytest.mark.parametrize("luck", lucks()[:5])
def test_backward_keeps_to_the_arc_that_it_came_by(luck):
    """There and back by the same way is where it began: drift is of the path, whichever way it is gone."""
    exact = replace(CHASSIS, straight_bias_m=0.0, straight_sd_m=0.0)
    there = drive_by(START, 0.8, luck, plain("carpet"), exact)
    back = drive_by(there.path[-1], -0.8, luck, plain("carpet"), exact)
    assert back.measured.tolist() == [-0.8, 0.0, 0.0]
    assert back.encoders_m.mean() == pytest.approx(-0.8)
    assert back.path == pytest.approx(there.path[::-1], abs=1e-9)


def test_backward_falls_short_and_bumps_as_forward():
    reverse = [drive_by(START, -0.5, luck, plain("wood"), CHASSIS) for luck in lucks()[:1000]]
    length = np.array([np.linalg.norm(np.diff(m.path[:, :2], axis=0), axis=1).sum() for m in reverse])
    assert mean_and_sd((length - 0.5) / INCH_M) == normal(-0.6978, 0.6356, len(reverse))
    wall = Arena((-1, -1, 1, 1), np.array([[-0.5, -1.0, -0.5, 1.0]]))
    ahead = np.array([0.0, 0.0, 0.0])
    moved = drive_by(ahead, -0.9, NO_LUCK, wall, CHASSIS)
    assert moved.bumped
    assert -0.5 < moved.path[-1, 0] - CHASSIS.radius_m <= -0.5 + 0.02
    assert -0.5 < moved.measured[0] < -0.3
    assert timed(0.0, DriveUpdate(turn_by(ahead, 0.0, NO_LUCK, CHASSIS), moved, "test"), wall).t_s > 5.0


@pytest.mark.slow
@pytest.mark.parametrize(("floor", "bias_deg", "sd_deg"), [("wood", 0.0, 1.0), ("carpet", 8.0, 3.0)])
def test_heading_drifts_by_floor_in_proportion_to_distance(floor, bias_deg, sd_deg):
    for yards in (0.5, 1.0):
        told = yards * 36 * INCH_M - CHASSIS.straight_bias_m  # so that it really goes that far
        lucky = [Luck(0, 0, luck.drift, (0, 0)) for luck in lucks()[:1000]]
        ends = np.array([drive_by(START, told, luck, plain(floor), CHASSIS).path[-1] for luck in lucky])
        turned = np.degrees(ends[:, 2] - START[2])
        assert mean_and_sd(turned) == normal(bias_deg * yards, sd_deg * yards, len(lucky))


def test_drift_pulls_left_and_sums_over_floors():
    end = drive_by(np.zeros(3), 1.0, NO_LUCK, plain("carpet"), CHASSIS).path[-1]
    assert end[2] > 0
    assert end[1] > 0
    half = np.array([[0.5, -9.0], [9, -9], [9, 9], [0.5, 9]])
    both = Arena((-9, -9, 9, 9), np.zeros((0, 4)), floors=(*plain("wood").floors, Region("carpet", half)))
    end = drive_by(np.zeros(3), 1.0 - CHASSIS.straight_bias_m, NO_LUCK, both, CHASSIS).path[-1]
    assert end[2] == pytest.approx(0.5 * CHASSIS.drifts["carpet"].bias_rad_per_m, rel=0.03)


def test_movements_agree_with_encoders_and_change_nothing_given():
    for luck in lucks()[:50]:
        for move in (turn_by(START, 0.7, luck, CHASSIS), drive_by(START, 0.4, luck, plain("wood"), CHASSIS)):
            front_left, front_right, rear_left, rear_right = move.encoders_m
            left, right = (front_left + rear_left) / 2, (front_right + rear_right) / 2
            assert (left + right) / 2 == pytest.approx(move.measured[0], abs=1e-12)
            assert (right - left) / CHASSIS.track_m == pytest.approx(move.measured[2], abs=1e-12)
    pose = START.copy()
    turn_by(pose, 1.0, NO_LUCK, CHASSIS)
    drive_by(pose, 1.0, NO_LUCK, plain("carpet"), CHASSIS)
    assert np.array_equal(pose, START)
    move = drive_by(START, 0.0, Luck(0, 9.0, 0, (0, 0)), plain("wood"), CHASSIS)
    assert np.array_equal(move.path[-1], START)
    assert (move.measured == 0).all()
    assert turn_by(START, 1.0, NO_LUCK, CHASSIS).measured[2] == pytest.approx(1.3695)


def test_the_header_names_what_a_filter_needs_in_its_units():
    header = CHASSIS.motion_header()
    assert header["turn_gain"] == pytest.approx(1 / 1.3695)
    assert np.degrees(header["turn_sd_rad"]) == pytest.approx(4.916)
    assert header["straight_bias_m"] / INCH_M == pytest.approx(-0.6978)
    assert np.degrees(header["drift"]["carpet"]["bias_rad_per_m"] * 36 * INCH_M) == pytest.approx(8)
    assert header["drift"]["wood"] == {
        "bias_rad_per_m": 0.0,
        "sd_rad_per_m": pytest.approx(0.019087, rel=1e-3),
    }


def test_contact_stops_it_and_it_can_leave():
    walled = Arena((-9, -9, 9, 9), np.array([[0.6, -9.0, 0.6, 9.0]]))
    move = drive_by(np.zeros(3), 2.0, NO_LUCK, walled, CHASSIS)
    assert move.bumped
    assert 0.6 - CHASSIS.radius_m - 0.02 < move.path[-1, 0] <= 0.6 - CHASSIS.radius_m
    assert 0 < move.measured[0] - move.path[-1, 0] < CHASSIS.stall_m + 0.02
    assert not drive_by(np.zeros(3), 0.3, NO_LUCK, walled, CHASSIS).bumped
    walled = Arena((-9, -9, 9, 9), np.array([[0.05, -9.0, 0.05, 9.0]]))
    away = drive_by(np.array([0.0, 0.0, np.pi]), 0.5, NO_LUCK, walled, CHASSIS)
    assert not away.bumped
    into = drive_by(np.zeros(3), 0.5, NO_LUCK, walled, CHASSIS)
    assert into.bumped
    assert into.path[-1, 0] == 0
    assert into.measured[0] <= CHASSIS.stall_m


def test_slips_come_as_often_as_said_where_the_floor_changes():
    chassis = Chassis(slip_chance=0.1)
    slips = np.array([draw_slip(np.random.default_rng(k), chassis) for k in range(DRAWS)])
    hit = slips[slips != 0]
    assert len(hit) / DRAWS == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / DRAWS))
    assert (np.abs(hit) > 3 * chassis.turn_sd_rad).all()
    assert (hit > 0).mean() == pytest.approx(0.5, abs=2 / np.sqrt(len(hit)))
    assert draw_slip(np.random.default_rng(1), CHASSIS) == 0
    half = np.array([[0.5, -9.0], [9, -9], [9, 9], [0.5, 9]])
    both = Arena((-9, -9, 9, 9), np.zeros((0, 4)), floors=(*plain("wood").floors, Region("rug", half)))
    luck = Luck(0, 0, 0, (0, 0), slip_rad=0.4)
    move = drive_by(np.zeros(3), 1.0, luck, both, CHASSIS)
    assert move.slipped_rad == 0.4
    assert move.path[-1, 2] == pytest.approx(0.4)
    assert move.path[move.path[:, 0] < 0.5][:, 2].max() == 0
    assert move.measured[2] == 0  # the wheels do not see it
    alone = drive_by(np.zeros(3), 1.0, luck, plain("wood"), CHASSIS)
    assert (alone.slipped_rad, alone.path[-1, 2]) == (0, 0)
    blocked = Arena(both.bounds, np.array([[0.55, -9.0, 0.55, 9.0]]), floors=both.floors)
    assert drive_by(np.zeros(3), 1.0, luck, blocked, CHASSIS).slipped_rad == 0
