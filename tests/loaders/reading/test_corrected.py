"""What was written wrong is read as it should have been: units, signs, frames, clocks, in every format."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count, islice, pairwise
from pathlib import Path

import numpy as np
import pytest

from helpers.format_samples import sample
from helpers.recordings import Given
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading, reading_from_json, reading_to_json
from maurice_loaders.reading.recording import (
    Motion,
    Note,
    OdometryPose,
    Picture,
    Record,
    Recording,
    TruthPose,
)
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import Corrected, corrected
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import compose, motion_between
from maurice_mcl.values.session import Camera, SessionInfo

from ..conftest import WriteLog

AHEAD = math.radians(40)


INFO = SessionInfo("given", cameras=(Camera("front", yaw_rad=0.3),), start=np.array([1.0, 2.0, 0.5]))


def motions() -> F64:
    turns = np.random.default_rng(4).uniform(-1, 1, 20)
    return np.column_stack([np.full(20, 0.3), np.full(20, 0.05), turns])


def poses_of(steps: F64, begin: Sequence[float] = (0, 0, 0)) -> F64:
    found = [np.array(begin, float)]
    for step in steps:
        found.append(compose(found[-1], step))
    return np.array(found[1:])


def read(written: F64, kind: Callable[[float, F64], Record], **how: float | str) -> F64:
    records = [kind(0.1 * number, row) for number, row in enumerate(written)]
    found = all_of(Corrected(Given(records), Reading(**how)))  # type: ignore[arg-type]
    return np.array([one.motion if isinstance(one, Motion) else one.pose for one in found])  # type: ignore[union-attr]


def all_of(recording: Recording) -> list[Record]:
    return list(recording.records(ReadingNotes(keep_going=False)))


def turned(rows: F64, angle_rad: float | F64) -> F64:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.column_stack(
        [rows[:, 0] * cos - rows[:, 1] * sin, rows[:, 0] * sin + rows[:, 1] * cos, rows[:, 2]]
    )


def test_motions_of_other_units_signs_and_frames() -> None:
    right = motions()
    wrong: list[tuple[F64, dict[str, float | str]]] = [
        (right * [1000, 1000, 1], {"odometry_scale": 0.001}),
        (right * [1, 1, -1], {"turn_scale": -1.0}),
        (right * [1, 1, 2], {"turn_gain": 0.5}),
        (turned(right, AHEAD), {"odometry_forward_rad": AHEAD}),
        (poses_of(right), {"odometry_are": "poses"}),
        (turned(right, 0.4 + np.cumsum(right[:, 2]) - right[:, 2]),
         {"odometry_are": "steps", "odometry_forward_rad": 0.4}),
        (poses_of(right) * [100, 100, -180 / np.pi],
         {"odometry_are": "poses", "odometry_scale": 0.01, "turn_scale": -np.pi / 180}),
    ]  # fmt: skip
    for written, how in wrong:
        np.testing.assert_allclose(read(written, Motion, **how), right, atol=1e-9)


def test_poses_as_motions_begin_anywhere_and_keep_turns_of_more_than_half() -> None:
    right = motions()
    found = read(poses_of(right, (50, 40, 1)), Motion, odometry_are="poses")
    np.testing.assert_allclose(found[1:], right[1:], atol=1e-9)
    assert not found[0].any()
    for headings, turns in (  # counted on; wrapped
        ([3.9, 4.9, 0.8, -2.9], [3.9, 1, -4.1, -3.7]),
        ([3.1, -3.1], [3.1, 2 * np.pi - 6.2]),
    ):
        found = read(np.outer(headings, [0, 0, 1]), Motion, odometry_are="poses")
        np.testing.assert_allclose(found, np.outer(turns, [0, 0, 1]), atol=1e-9)


def test_poses_of_other_units_signs_and_frames() -> None:
    right = poses_of(motions())
    wrong: list[tuple[Callable[[float, F64], Record], F64, dict[str, float]]] = [
        (OdometryPose, right * [1000, 1000, 1], {"odometry_scale": 0.001}),
        (OdometryPose, right * [1, 1, -1], {"turn_scale": -1.0}),
        (OdometryPose, right - [0, 0, AHEAD], {"odometry_forward_rad": AHEAD}),
        (
            TruthPose,
            right * [1000, 1000, 180 / np.pi],
            {"truth_scale": 0.001, "truth_turn_scale": np.pi / 180},
        ),
    ]
    for kind, written, how in wrong:
        np.testing.assert_allclose(read(written, kind, **how), right)


def test_the_way_of_poses_is_bent_with_the_gain_and_not_with_the_scale() -> None:
    over = motions() * [1, 0, 2]
    found = read(poses_of(over), OdometryPose, turn_gain=0.5)
    gained = [motion_between(before, after) for before, after in pairwise(found)]
    np.testing.assert_allclose(gained, (over * [1, 1, 0.5])[1:], atol=1e-9)
    scaled = read(poses_of(over), OdometryPose, turn_scale=0.5)
    np.testing.assert_allclose(scaled[:, :2], poses_of(over)[:, :2])


@pytest.mark.parametrize("yaw", [0.0, -1.2])
def test_truth_of_a_mast_is_moved_back_to_the_wheels(yaw: float) -> None:
    """Before the camera's direction is added: the place is from the robot's forward."""
    right, place = poses_of(motions()), np.array([0.3, -0.2, 0.0])
    of_mast = np.array([compose(pose, place) for pose in right])
    found = read(of_mast, TruthPose, truth_ahead_m=0.3, truth_left_m=-0.2, camera_yaw_rad=yaw)
    np.testing.assert_allclose(found[:, :2], right[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.cos(found[:, 2] - right[:, 2] - yaw), 1)
    start = Corrected(Given([], INFO), Reading(truth_ahead_m=0.3)).info.start
    assert INFO.start is not None
    assert start is not None
    np.testing.assert_allclose(compose(start, np.array([0.3, 0, 0])), INFO.start, atol=1e-9)


def test_a_cameras_headings_move_as_the_camera_does() -> None:
    """Poses of the camera are the robot's, turned: motions between them must be those that are given."""
    right, yaw = motions(), math.radians(-70)
    camera = read(poses_of(right), TruthPose, camera_yaw_rad=yaw)
    moves = read(right, Motion, camera_yaw_rad=yaw)
    for k in range(19):
        there = compose(camera[k], moves[k + 1])
        np.testing.assert_allclose(there[:2], camera[k + 1][:2], atol=1e-9)
        assert math.cos(there[2] - camera[k + 1][2]) == pytest.approx(1)
    np.testing.assert_allclose(read(poses_of(right), OdometryPose, camera_yaw_rad=yaw)[:, :2], camera[:, :2])
    info = Corrected(Given([], INFO), Reading(camera_yaw_rad=yaw)).info
    assert info.start is not None
    assert info.start.tolist() == pytest.approx([1, 2, 0.5 + yaw])
    assert info.cameras[0].yaw_rad == 0
    assert info.notes == ("corrected in reading: --reading camera_yaw_deg=-70",)


def picture(t_s: float) -> Picture:
    def read_it() -> U8:
        raise AssertionError("decoded")  # which moving a picture does not need

    return Picture(t_s, read_it, f"{t_s}")


def test_times_are_moved_and_stay_in_order_with_poses_before_pictures() -> None:
    t_s = [0.1 * k + 0.0123456 for k in range(12)]
    records: list[Record] = []
    for t in t_s:
        records += [Motion(t, np.zeros(3)), TruthPose(t, np.zeros(3)), picture(t + 1000.0)]
    records.insert(3, Note(t_s[0], "hello"))
    moved_back = Corrected(Given(records), Reading(picture_offset_s=-1000.0))
    for _ in range(2):  # as often as one likes
        found = all_of(moved_back)
        assert len(found) == 37
        assert [type(one).__name__ for one in found[4:7]] == ["Motion", "TruthPose", "Picture"]
        assert [one.t_s for one in found] == sorted(one.t_s for one in found)
        assert found[4].t_s == found[6].t_s


def test_offsets_hold_no_more_than_a_record_of_each_clock() -> None:
    class Endless:
        path, info = Path("endless"), SessionInfo("endless")
        reached = 0

        def records(self, notes: ReadingNotes) -> Iterator[Record]:
            for number in count():
                self.reached = max(self.reached, number)
                yield Motion(float(number), np.zeros(3)) if number % 2 else picture(float(number))

    endless = Endless()
    found = Corrected(endless, Reading(odometry_offset_s=500.0)).records(ReadingNotes(keep_going=False))
    both = [float(t) for t in range(500, 650)]
    assert [one.t_s for one in islice(found, 400)] == [2.0 * k for k in range(250)] + both
    assert endless.reached < 700


def test_nothing_to_do_leaves_the_recording_itself_and_a_manifest_holds_every_correction() -> None:
    given = Given([])
    assert corrected(given, Reading()) is given
    with pytest.raises(InputError, match="expected one of poses, steps"):
        corrected(given, Reading(odometry_are="motions"))
    steps = Corrected(Given([OdometryPose(0.0, np.zeros(3))]), Reading(odometry_are="steps"))
    with pytest.raises(InputError, match="odometry_are=steps is for motions; leave it out"):
        all_of(steps)
    options = Reading(odometry_are="steps", turn_scale=-1.0, camera_yaw_rad=0.5, picture_offset_s=-3.0)
    assert reading_from_json(json.loads(json.dumps(reading_to_json(options)))) == options


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_a_session_log_in_other_units_of_time(unit: str, write_log: WriteLog, pixel: dict[str, str]) -> None:
    per_s = {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    begin = 1_700_000_000
    lines = [{"t": (begin + k) * per_s, "image": pixel} for k in range(3)]
    session = open_session(write_log(*lines), Reading(time_unit=unit))
    assert [moment.frame.time_s for moment in session.moments()] == [0, 1, 2]
    with pytest.raises(InputError, match="4e9 in size"):
        list(open_session(write_log(*lines)).moments())


@pytest.mark.parametrize("name", ["session-log", "tum", "table", "carmen", "rosbag2", "mcap"])
def test_every_format_is_moved_in_time_once(name: str, tmp_path: Path) -> None:
    if name in ("rosbag2", "mcap"):
        pytest.importorskip("rosbags")
    path = sample(name, tmp_path / "made")

    def times(kind: tuple[type[Record], ...], options: Reading) -> list[float]:
        found = open_recording(path, options).records(ReadingNotes(keep_going=True))
        return sorted(one.t_s for one in found if isinstance(one, kind))

    for kind, option in (
        ((OdometryPose, Motion), "odometry_offset_s"),
        ((TruthPose,), "truth_offset_s"),
        ((Picture,), "picture_offset_s"),
    ):
        before = times(kind, Reading())
        after = times(kind, replace(Reading(), **{option: 0.05}))  # type: ignore[arg-type]
        assert after == pytest.approx([t + 0.05 for t in before], abs=1e-5)


def test_a_session_log_is_put_right_as_a_session(write_log: WriteLog, pixel: dict[str, str]) -> None:
    log = write_log({"t": 0, "odometry": [100, 0, -90]}, {"t": 1, "image": pixel})
    options = Reading(odometry_scale=0.01, turn_scale=-math.pi / 180)
    session = open_session(log, options)
    assert isinstance(session, RecordedSession)
    (moment,) = session.moments()
    np.testing.assert_allclose(moment.frame.motions, [[1, 0, math.pi / 2]])
    typed = "--reading odometry_scale=0.01 --reading turn_scale=-0.0174533"
    assert session.info.notes == (f"corrected in reading: {typed}",)


def test_jumps_are_left_out_of_poses_and_of_motions() -> None:
    steps = motions()
    right, jumping = poses_of(steps), poses_of(steps)
    jumping[12:] += [9.0, -3.0, 0.0]
    found = read(jumping, OdometryPose, odometry_are="jumping")
    for number, (before, after) in enumerate(pairwise(found), start=1):
        expected = np.zeros(3) if number == 12 else motion_between(right[number - 1], right[number])
        np.testing.assert_allclose(motion_between(before, after), expected, atol=1e-9)
    np.testing.assert_allclose(read(right, OdometryPose, odometry_are="jumping"), right, atol=1e-9)
    far = steps.copy()
    far[7, 0] = 65.5
    np.testing.assert_allclose(read(far, Motion, odometry_are="jumping")[7], np.zeros(3), atol=1e-9)
    np.testing.assert_allclose(
        np.delete(read(far, Motion, odometry_are="jumping"), 7, 0), np.delete(steps, 7, 0)
    )
