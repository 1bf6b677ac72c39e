"""A laser on the way: when it scans, where the robot is then, and what of it a filter uses."""

from __future__ import annotations

from functools import cache, reduce
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from maurice_datasets.robot.motion import CALIBRATED, Luck, Movement, drive_by, turn_by
from maurice_datasets.robot.segments import CARRY_S, DRIVE_M_S, SCAN_HZ, TURN_RAD_S, Segment
from maurice_datasets.sessions import simulated_session, simulation_plan, write_simulation
from maurice_datasets.simulation import SimulationPlan, stage
from maurice_datasets.worlds.build import load_world
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.observations import SCAN_GATE
from maurice_loaders.reading.recording import Note, OdometryPose
from maurice_mcl.values import Arena
from maurice_mcl.values.geometry import angle_between, compose, motion_between
from maurice_mcl.values.session import KIDNAPPED, Moment

NO_LUCK, EMPTY = Luck(0.0, 0.0, 0.0, (0.0, 0.0)), Arena((-9, -9, 9, 9), np.zeros((0, 4)))
START = np.array([0.5, -0.2, 3.0])
STEP_S = 1 / SCAN_HZ


def plan(task: str = "kidnapped", **changes: object) -> SimulationPlan:
    return simulation_plan(task, world="office", seed=3, laser=True, **{"updates": 12, **changes})


@cache
def segments(**changes: object) -> tuple[Segment, ...]:
    set_up = stage(plan(**changes), load_world("office", 0))
    return tuple(set_up.course.segments())


@cache
def moments() -> tuple[Moment, ...]:
    return tuple(simulated_session(plan()).moments())


def odometry(segment: Segment) -> np.ndarray:
    (pose,) = (entry.pose for entry in segment.entries if isinstance(entry, OdometryPose))
    return pose


@pytest.mark.parametrize("told_rad", [0.4, -2.0, 3.1, -3.1])
def test_a_movement_is_followed_from_its_begin_to_its_end(told_rad: float) -> None:
    turn = turn_by(START, told_rad, Luck(1.5, 0.0, 0.0, (0.0, 0.0)), CALIBRATED)
    straight = drive_by(turn.path[-1], 0.4, NO_LUCK, EMPTY, CALIBRATED)
    for moved in (turn, straight):
        assert moved.at(0.0) == pytest.approx(moved.path[0])
        assert moved.at(1.0) == pytest.approx(moved.path[-1])
    headings = [float(turn.at(share)[2]) for share in np.linspace(0, 1, 41)]
    steps = [(after - before + np.pi) % (2 * np.pi) - np.pi for before, after in pairwise(headings)]
    assert sum(steps) == pytest.approx(told_rad + 1.5 * CALIBRATED.turn_sd_rad)  # never the other way around
    assert max(np.sign(steps)) == min(np.sign(steps))
    ways = [float(np.hypot(*(straight.at(share) - straight.path[0])[:2])) for share in (0.25, 0.5, 0.75)]
    assert ways == pytest.approx([0.1, 0.2, 0.3], abs=1e-3)
    alone = Movement(np.zeros(3), np.zeros(4), START[None])
    assert alone.at(0.5) == pytest.approx(START)


def test_it_scans_five_times_a_second_but_while_it_is_carried() -> None:
    times = np.array([segment.t_s for segment in segments()])
    gaps = np.round(np.diff(times), 6)
    assert times[0] == 0.0
    assert sorted(set(gaps.tolist())) == [STEP_S, CARRY_S + STEP_S]
    assert (gaps > STEP_S).sum() == 1
    assert sum(segment.is_last for segment in segments()) == 12
    (carried,) = (segment for segment in segments() if segment.kidnapped_to is not None)
    assert carried.is_last
    for segment in segments():
        entries = [entry.t_s for entry in segment.entries]
        assert entries == sorted(entries)
        assert max(entries) <= segment.t_s


def test_from_scan_to_scan_it_goes_no_faster_than_it_drives_and_odometry_tells_how_far() -> None:
    """The odometry is off by the errors of its movements, and by no more."""
    drive = segments(task="tracking")
    true, told = [], []
    for before, after in pairwise(drive):
        true.append(motion_between(before.pose, after.pose))
        told.append(motion_between(odometry(before), odometry(after)))
    way, turn = np.hypot(*np.array(told)[:, :2].T), np.abs(np.array(told)[:, 2])
    assert way.max() <= DRIVE_M_S * STEP_S + 1e-9
    assert turn.max() <= TURN_RAD_S * STEP_S + 1e-9
    assert np.hypot(*np.array(true)[:, :2].T).max() < 1.5 * DRIVE_M_S * STEP_S
    assert reduce(compose, told, np.zeros(3)) == pytest.approx(odometry(drive[-1]), abs=1e-9)
    assert np.array(told)[:, 2].mean() == pytest.approx(np.array(true)[:, 2].mean(), abs=0.02)  # no gain


def test_the_robots_errors_are_those_of_maurice_without_their_means() -> None:
    assert CALIBRATED.turn_over_read == 1.0
    assert (CALIBRATED.turn_bias_rad, CALIBRATED.straight_bias_m) == (0.0, 0.0)
    assert plan().chassis.turn_sd_rad == simulation_plan("tracking").chassis.turn_sd_rad > 0.05
    assert simulation_plan("tracking").chassis.turn_over_read > 1.3
    assert simulated_session(plan()).info.motion is None
    assert simulated_session(plan()).info.display_units == "m"


def test_scans_are_used_after_amcls_distances_and_none_of_the_way_is_lost() -> None:
    used = moments()
    assert 20 < len(used) < len(segments())
    for moment in used[1:]:
        (motion,) = moment.frame.motions
        assert SCAN_GATE.open_after(motion)
        assert np.hypot(*motion[:2]) < SCAN_GATE.min_distance_m + 2 * DRIVE_M_S * STEP_S
        assert abs(motion[2]) < SCAN_GATE.min_angle_rad + 2 * TURN_RAD_S * STEP_S
    (carried,) = (moment.frame.step for moment in used if KIDNAPPED in moment.events)
    before = [moment for moment in used if moment.frame.step < carried]
    way = reduce(compose, (motion for moment in before for motion in moment.frame.motions), np.zeros(3))
    at = next(segment for segment in segments() if segment.t_s == before[-1].frame.time_s)
    assert way == pytest.approx(odometry(at), abs=1e-9)
    assert np.array_equal(at.pose, before[-1].truth)


def test_a_session_in_memory_is_that_of_its_log(tmp_path: Path) -> None:
    read = list(open_session(write_simulation(tmp_path / "drive", plan()).session).moments())
    assert len(read) == len(moments())
    for of_log, made in zip(read, moments(), strict=True):
        assert of_log.events == made.events
        assert np.array_equal(of_log.truth, made.truth)
        assert np.array_equal(of_log.frame.motions, made.frame.motions)
        assert np.array_equal(of_log.frame.scan.ranges_m, made.frame.scan.ranges_m)
        assert (of_log.frame.step, of_log.frame.time_s) == (made.frame.step, made.frame.time_s)


def test_what_happens_on_the_way_is_told_when_it_happens() -> None:
    spun = segments(task="tracking", slip_at="4")
    notes = [
        (entry.text, segment) for segment in spun for entry in segment.entries if isinstance(entry, Note)
    ]
    (slipped,) = (segment for text, segment in notes if "the wheels spin" in text)
    assert slipped.is_last
    number = [segment for segment in spun if segment.is_last].index(slipped) + 1
    assert number == 4
    last = spun[spun.index(slipped) - 1]
    assert angle_between(odometry(slipped)[2], odometry(last)[2]) < 1e-9  # while it drove straight
