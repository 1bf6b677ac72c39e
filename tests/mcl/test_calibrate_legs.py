"""What each movement did comes out of the poses around it, exactly where the way drifts evenly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.arrays import F64
from maurice_mcl.calibration.motion import MotionSegment, trials_of


def arc(pose: F64, length_m: float, drift_rad: float) -> F64:
    """Drive an exact arc of a circle."""
    x, y, heading = pose
    chord = length_m * np.sinc(drift_rad / 2 / np.pi)
    course = heading + drift_rad / 2
    return np.array([x + chord * np.cos(course), y + chord * np.sin(course), heading + drift_rad])


def turn(pose: F64, by_rad: float) -> F64:
    return pose + np.array([0.0, 0.0, by_rad])


def wrapped(pose: F64) -> F64:
    return np.array([pose[0], pose[1], (pose[2] + np.pi) % (2 * np.pi) - np.pi])


START = np.array([0.4, -0.2, 2.9])
angles = st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 0.05)
lengths, drifts = st.floats(0.05, 3.0), st.floats(-0.6, 0.6)


@given(angles, lengths, drifts, st.booleans())
def test_a_turn_and_a_straight_are_told_apart_in_either_order(
    by: float, length: float, drift: float, turn_first: bool
) -> None:
    motions = (np.array([0.0, 0.0, by]), np.array([length, 0.0, 0.0]))
    if turn_first:
        after = arc(turn(START, by), length, drift)
    else:
        motions, after = motions[::-1], turn(arc(START, length, drift), by)
    trials = trials_of([MotionSegment(START, motions, wrapped(after))], lambda a, b: "wood")
    assert trials.turns.actual_rad == pytest.approx([by], abs=1e-9)
    assert trials.turns.measured_rad == pytest.approx([by])
    assert trials.straights.drift_rad == pytest.approx([drift], abs=1e-9)
    assert trials.straights.measured_m == pytest.approx([length])
    assert trials.straights.actual_m == pytest.approx([length * np.sinc(drift / 2 / np.pi)])
    assert trials.straights.floors == ("wood",)


def test_a_turn_alone_a_straight_alone_and_a_straight_backward() -> None:
    legs = [
        MotionSegment(START, (np.array([0, 0, 1.4]),), turn(START, 1.0)),
        MotionSegment(START, (np.array([0.5, 0, 0]),), arc(START, 0.4, 0.1)),
        MotionSegment(
            START, (np.array([0, 0, 0.8]), np.array([-0.5, 0, 0])), arc(turn(START, 0.6), -0.4, 0.1)
        ),
    ]
    trials = trials_of(legs, lambda a, b: "")
    assert trials.turns.actual_rad == pytest.approx([1.0, 0.6])
    assert trials.straights.actual_m == pytest.approx([0.4, 0.4], rel=1e-3)
    assert trials.straights.drift_rad == pytest.approx([0.1, 0.1])


def test_several_movements_between_two_poses_are_left_out_and_counted() -> None:
    one, way = np.array([0, 0, 1.0]), np.array([0.5, 0, 0])
    trials = trials_of(
        [MotionSegment(START, (one, way, one), START), MotionSegment(START, (), START)], lambda a, b: ""
    )
    assert trials.left_out == 3
    assert len(trials.turns.measured_rad) == len(trials.straights.measured_m) == 0


def test_a_movement_that_is_both_is_a_turn_first() -> None:
    leg = MotionSegment(START, (np.array([0.5, 0.0, 1.0]),), arc(turn(START, 0.7), 0.5, 0.0))
    trials = trials_of([leg], lambda a, b: "")
    assert trials.turns.actual_rad == pytest.approx([0.7])
    assert trials.straights.actual_m == pytest.approx([0.5])


def test_a_robot_that_did_not_get_away_has_no_known_drift() -> None:
    leg = MotionSegment(START, (np.array([0, 0, 1.0]), np.array([0.5, 0, 0])), turn(START, 0.7))
    trials = trials_of([leg], lambda a, b: "")
    assert trials.turns.actual_rad == pytest.approx([0.7])
    assert np.isnan(trials.straights.drift_rad).all()
