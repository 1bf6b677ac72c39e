"""Movements between pictures: found from points in space, lengths by the floor, or said to be unknown."""

from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.sensor.visual_odometry import (
    MatchedPoints,
    PicturePoints,
    camera_tilt,
    match_points,
    picture_points,
    relative_motion,
    tells_tilt,
)
from maurice_mcl.values.arrays import F64

PIXEL = 1 / 190
HEIGHT_M = 0.25


def seen(points: F64, motion: F64, tilt_rad: float = 0.0) -> F64:
    """The rays (K, 2) to points in space (K, 3) from a camera that moved and looks up by an angle."""
    forward, left, turn = motion
    moved = points - [forward, left, 0]
    cos, sin = np.cos(turn), np.sin(turn)
    ahead, aside = cos * moved[:, 0] + sin * moved[:, 1], cos * moved[:, 1] - sin * moved[:, 0]
    up = np.cos(tilt_rad) * moved[:, 2] - np.sin(tilt_rad) * ahead
    far = np.cos(tilt_rad) * ahead + np.sin(tilt_rad) * moved[:, 2]
    return np.stack([aside / far, up / far], axis=1)


def matched(motion: F64, seed: int = 0, tilt_rad: float = 0.0, wrong: int = 15) -> MatchedPoints:
    """Matches with a pixel's noise: on walls, on the floor, and some that are wrong."""
    rng = np.random.default_rng(seed)
    ahead = rng.uniform(1, 4, 80)
    points = np.stack([ahead, ahead * rng.uniform(-0.4, 0.4, 80), rng.uniform(-0.2, 1.2, 80)], axis=1)
    points[:30, 2] = -HEIGHT_M
    rays = [seen(points, one, tilt_rad) for one in (np.zeros(3), motion)]
    before, after = (one + rng.normal(0, 0.5 * PIXEL, one.shape) for one in rays)
    after[-wrong:] = rng.uniform(-0.4, 0.4, (wrong, 2))
    return MatchedPoints(before, after, PIXEL)


@pytest.mark.parametrize("turn_deg", [-20, 0, 5, 25])
def test_turn_direction_and_length_are_found(turn_deg: float) -> None:
    turn = np.radians(turn_deg)
    way = np.array([0.3 * np.cos(turn / 2), 0.3 * np.sin(turn / 2), turn])
    found = relative_motion(matched(way), HEIGHT_M)
    assert found is not None
    assert found.turn_rad == pytest.approx(turn, abs=np.radians(1.5))
    assert found.direction_rad == pytest.approx(turn / 2, abs=np.radians(10))
    assert found.step_m == pytest.approx(0.3, rel=0.2)


def test_matches_without_a_movement_in_common_tell_nothing() -> None:
    rng = np.random.default_rng(1)
    before, after = rng.uniform(-0.45, 0.45, (2, 60, 2))
    assert relative_motion(MatchedPoints(before, after, PIXEL), HEIGHT_M) is None
    assert relative_motion(MatchedPoints(before[:7], after[:7], PIXEL)) is None


@pytest.mark.parametrize("turn_deg", [-15, 0, 3, 15])
def test_a_robot_that_stands_or_turns_in_place_goes_nowhere(turn_deg: float) -> None:
    turn = np.radians(turn_deg)
    for seed in range(5):
        pair = matched(np.array([0.0, 0.0, turn]), seed)
        found = relative_motion(pair, HEIGHT_M)
        assert found is not None
        assert found.step_m == 0
        assert found.turn_rad == pytest.approx(turn, abs=np.radians(0.3))
        assert not tells_tilt(pair)


def test_a_robot_that_moves_does_not_stand() -> None:
    for seed in range(5):
        pair = matched(np.array([0.3, 0.0, 0.1]), seed)
        found = relative_motion(pair, HEIGHT_M)
        assert found is not None
        assert found.step_m != 0
        assert tells_tilt(pair)


def test_before_a_bare_wall_a_few_matches_tell_that_a_robot_stands() -> None:
    def few(motion: F64, kept: int) -> MatchedPoints:
        pair = matched(motion)
        rows = np.r_[40 : 40 + kept, 75:80]  # on walls, and five that are wrong
        return MatchedPoints(pair.before[rows], pair.after[rows], PIXEL)

    found = relative_motion(few(np.array([0.0, 0.0, 0.1]), 5))
    assert found is not None
    assert found.step_m == 0
    assert found.turn_rad == pytest.approx(0.1, abs=np.radians(0.6))
    assert relative_motion(few(np.array([0.0, 0.0, 0.1]), 2)) is None
    assert relative_motion(few(np.array([0.5, 0.0, 0.1]), 5)) is None


def test_the_tilt_does_not_make_a_turn_in_place_a_movement() -> None:
    turn = np.radians(8.0)
    assert not tells_tilt(matched(np.array([0.0, 0.0, turn]), tilt_rad=np.radians(15)))


def test_without_a_height_there_is_no_length() -> None:
    found = relative_motion(matched(np.array([0.3, 0.0, 0.1])))
    assert found is not None
    assert found.step_m is None


def test_the_tilt_of_the_camera_is_found() -> None:
    tilt = np.radians(7.0)
    pairs = [matched(np.array([0.3, 0.02, 0.1 * k]), k, tilt, wrong=5) for k in range(3)]
    assert camera_tilt(pairs) == pytest.approx(tilt, abs=np.radians(1.5))
    assert camera_tilt([]) == 0


def test_a_shifted_picture_is_a_turn_and_a_blank_one_nothing() -> None:
    rng = np.random.default_rng(3)
    coarse = rng.integers(0, 255, (18, 40, 3)).astype(np.uint8)
    scene = np.kron(coarse, np.ones((8, 8, 1), np.uint8))
    before, after = (picture_points(scene[:, x : x + 200], 1.0) for x in (60, 40))
    pair = match_points(before, after)
    assert len(pair.before) > 20
    # what the camera sees moves to the right: it turned left
    assert np.median(np.arctan(pair.before[:, 0]) - np.arctan(pair.after[:, 0])) > 0.05
    blank: PicturePoints = picture_points(np.full((48, 64, 3), 90, np.uint8), 1.0)
    assert len(match_points(before, blank).before) == 0
