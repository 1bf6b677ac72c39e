"""Odometry from pictures: labelled, with the unknown told as such, refused where it has no place."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from helpers.recordings import Given
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.picture_odometry import FROM_PICTURES, odometry_from_pictures
from maurice_loaders.reading.recording import Motion, Note, OdometryPose, Picture, Record, TruthPose
from maurice_mcl.filter.motion import PictureMotion, PictureMotionParameters, motion_model
from maurice_mcl.values.arrays import U8
from maurice_mcl.values.session import Camera
from maurice_viz.cli.app import app

MADE = Reading(odometry_from_pictures=True, picture_step_m=0.2, camera_fov_rad=0.9)
GIVEN_BY = "--reading picture_step_m=0.2 --reading camera_fov_deg=50"
STILL = np.zeros(3)
FOCAL_PX = 80 / np.tan(0.45)
SCENE = np.random.default_rng(2).integers(0, 255, (20, 60, 3)).astype(np.uint8).repeat(6, 0).repeat(6, 1)


def view(x_px: int) -> U8:
    return SCENE[:, x_px : x_px + 160] if x_px >= 0 else np.full((120, 160, 3), 80, np.uint8)


def nearer(x_px: int) -> U8:
    """What a robot sees that went ahead: everything larger, and the upper half, which is nearer, by more."""
    upper, lower = (cv2.resize(view(x_px), None, fx=by, fy=by)[:, :160] for by in (1.3, 1.1))
    return np.asarray(np.concatenate([upper[18:78], lower[66:126]]), np.uint8)


def zoomed(by: float) -> U8:
    """What a robot sees that comes nearer: its picture, magnified about the middle."""
    return np.asarray(
        cv2.warpAffine(view(60), cv2.getRotationMatrix2D((79.5, 59.5), 0, by), (160, 120)), np.uint8
    )


def turning(shifts_px: list[int], *others: Record) -> Given:
    """A recording of a camera that turns: pieces of one wide picture; -1: a blank wall."""
    return Given([*(Picture(k, partial(view, x), "") for k, x in enumerate(shifts_px)), *others])


def motions(given: Given, options: Reading = MADE) -> list[np.ndarray]:
    found = odometry_from_pictures(given, replace(options, camera_fov_rad=0.9))
    return list(found.odometry.motions)


def test_turns_are_found_and_a_blank_wall_is_unknown() -> None:
    right, left, into_the_wall, out_of_it = motions(turning([60, 85, 60, -1, 60]))
    assert right[2] == pytest.approx(-0.15, abs=0.05)
    assert left[2] == pytest.approx(0.15, abs=0.05)
    for unknown in (into_the_wall, out_of_it):
        assert unknown == pytest.approx([0.2 / 3, 0, 0])  # two of three movements known of went nowhere


def test_a_robot_that_stands_or_turns_in_place_stays_where_it_is() -> None:
    shifts = [60, 60, 62, 64, 66, 90, 90, 60, 60]
    found = odometry_from_pictures(turning(shifts), MADE).odometry
    ways = [float(np.hypot(*motion[:2])) for motion in found.motions]
    assert ways == [0.0] * 8
    assert found.standing == found.measured == 8
    assert "8 of 8 movements found (in 8 the robot stood" in found.statement
    assert "unknown" not in found.statement
    turned = np.cumsum([motion[2] for motion in found.motions])
    expected = (60 - np.array(shifts[1:])) / FOCAL_PX  # near the middle of the picture
    assert turned == pytest.approx(expected, abs=0.02)
    assert all(motion[2] != 0 for motion in found.motions)  # exactly zero would be unknown


def test_many_small_movements_are_seen_together() -> None:
    """Each moves the picture by less than a standing robot's may; the robot went all the way."""
    zooms = [1.0 + 0.004 * k for k in range(20)]
    given = Given([Picture(k, partial(zoomed, by), "") for k, by in enumerate(zooms)])
    found = odometry_from_pictures(given, MADE).odometry
    went = [k for k, motion in enumerate(found.motions) if np.hypot(*motion[:2]) > 0]
    assert found.measured == 19
    assert 0 < len(went) < 10
    gaps = [b - a for a, b in pairwise([-1, *went])]
    assert min(gaps) > 1
    # a step of 0.2 m a picture is longer from one movement that is seen to the next
    assert np.hypot(*found.motions[went[0]][:2]) == pytest.approx(0.2 * np.median(gaps))


def test_turns_that_no_picture_tells_are_like_the_others_where_those_are_small() -> None:
    slow = odometry_from_pictures(turning([60, 62, 64, 66, -1, 66, 68]), replace(MADE, camera_fov_rad=0.9))
    motion = slow.info.motion
    assert motion is not None
    assert motion["unseen_turn_sd_rad"] == pytest.approx(0.05, abs=0.03)
    fast = odometry_from_pictures(turning([0, 60, 0, 60, -1, 0, 60]), replace(MADE, camera_fov_rad=0.9))
    assert fast.info.motion == {"model": "pictures"}


def test_a_standing_robot_is_narrow_in_any_direction() -> None:
    noise = np.random.default_rng(0).standard_normal((4000, 3)).astype(np.float32)
    start, usual = np.zeros((4000, 3), np.float32), PictureMotionParameters()
    stood = PictureMotion().move(start, np.zeros(2), np.array([0.0, 0.0, 1e-9]), noise)
    assert stood[:, :2].std(axis=0) == pytest.approx(usual.standing_way_sd_m, rel=0.1)
    assert stood[:, 2].std() == pytest.approx(usual.standing_turn_sd_rad, rel=0.1)
    turned = PictureMotion().move(start, np.zeros(2), np.array([0.0, 0.0, 0.5]), noise)
    assert turned[:, :2].std(axis=0) == pytest.approx(usual.standing_way_sd_m, rel=0.1)
    assert turned[:, 2].mean() == pytest.approx(0.5, abs=0.01)
    assert turned[:, 2].std() < PictureMotionParameters().turn_sd_rad


def test_what_is_unknown_is_told() -> None:
    given = turning([60, 85], Note(2, "on"))
    with pytest.raises(InputError, match=r"no field of view.*camera_fov_deg"):
        odometry_from_pictures(given, replace(MADE, camera_fov_rad=0.0))
    with pytest.raises(InputError, match=r"no height of the camera.*picture_step_m"):
        motions(turning([60, -1]), Reading())
    with pytest.raises(InputError, match="found no pictures"):
        motions(Given([Note(0, "on"), TruthPose(1, STILL)]))
    for measured in (OdometryPose(2, STILL), Motion(2, STILL)):
        with pytest.raises(InputError, match="leave odometry_from_pictures out"):
            motions(turning([60, 85], measured))


def test_an_unknown_movement_is_wide_and_a_known_one_narrow() -> None:
    model = motion_model({"model": "pictures"}, None)  # type: ignore[arg-type]  # it asks for no map
    assert isinstance(model, PictureMotion)
    noise = np.random.default_rng(0).standard_normal((4000, 3)).astype(np.float32)
    start = np.zeros((4000, 3), np.float32)
    known = model.move(start, np.zeros(2), np.array([0.3, 0.0, 0.5]), noise)
    unknown = model.move(start, np.zeros(2), np.array([0.3, 0.0, 0.0]), noise)
    usual = PictureMotionParameters()
    assert known[:, 2].std() == pytest.approx(usual.turn_sd_rad, rel=0.1)
    assert known[:, 2].mean() == pytest.approx(0.5, abs=0.01)
    assert unknown[:, 2].std() > 10 * known[:, 2].std()
    assert np.median(np.hypot(known[:, 0], known[:, 1])) == pytest.approx(0.3, rel=0.05)
    with pytest.raises(ValueError, match="turn_sd"):
        motion_model({"model": "pictures", "turn_sd_rad": -1.0}, None)  # type: ignore[arg-type]


@pytest.fixture
def bare(small_session: Path) -> Path:
    """A session log without its odometry."""
    kept = [line for line in small_session.read_text().splitlines() if '"odometry"' not in line]
    small_session.write_text("\n".join(kept) + "\n")
    return small_session


def test_the_session_says_where_its_odometry_is_from(bare: Path) -> None:
    session = open_session(bare, MADE)
    moments = list(session.moments())
    assert [len(m.frame.motions) for m in moments] == [0, *[1] * (len(moments) - 1)]
    assert FROM_PICTURES in session.info.name
    assert FROM_PICTURES in session.info.notes[-1]
    assert session.info.motion == {"model": "pictures"}
    assert any(text.startswith(FROM_PICTURES) and "unknown" in text for text in session.warnings)
    with pytest.raises(InputError, match="leave one out"):
        open_session(bare, replace(MADE, odometry_from_truth=True))


def test_the_command_says_so_too_and_a_saved_run_repeats(bare: Path) -> None:
    typed = f"-o none --particles 300 --reading odometry_from_pictures=true {GIVEN_BY}"
    words = [str(bare), *typed.split(), "--json", "--save-run", str(bare.with_name("kept"))]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    assert FROM_PICTURES in done.stderr
    assert any(FROM_PICTURES in note for note in json.loads(done.stdout)["notes"])
    verified = CliRunner().invoke(app, ["verify", str(bare.with_name("kept"))])
    assert verified.exit_code == 0, verified.stderr


def test_the_camera_of_the_header_is_used() -> None:
    given = Given([Picture(0, partial(view, 60), ""), Picture(1, partial(nearer, 60), "")])
    info = replace(given.info, cameras=(Camera("front", horizontal_fov_rad=0.9, yaw_rad=np.pi / 2),))
    options = replace(MADE, camera_fov_rad=0.0)
    made = odometry_from_pictures(replace(given, info=info), options)
    forward, left, _ = made.odometry.motions[0]
    assert np.hypot(forward, left) == pytest.approx(0.2)
    assert abs(left) > abs(forward)  # it looks to the left, and goes where it looks or away from there
