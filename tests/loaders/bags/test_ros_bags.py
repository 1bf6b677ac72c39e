"""Bags of every kind give the drive that was written into them."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers import bags as making
from helpers.bags import BEGIN_NS, Ros, Said
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording, open_session
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recording import Picture

Write = Callable[[Path], Path]
DATA = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "logs"


def _ros1(compression: str) -> Write:
    return lambda folder: making.write_ros1(folder / "drive.bag", making.drive(Ros(1)), compression)


def _ros2(storage: str, compression: str | None = None, file: str = "") -> Write:
    def write(folder: Path) -> Path:
        drive = making.drive(Ros(2))
        bag = making.write_ros2(folder / "drive", drive, storage=storage, compression=compression)
        return next(bag.glob(file)) if file else bag

    return write


KINDS: dict[str, tuple[str, Write]] = {
    "ROS 1": ("rosbag1", _ros1("none")),
    "ROS 1, bz2": ("rosbag1", _ros1("bz2")),
    "ROS 1, lz4": ("rosbag1", _ros1("lz4")),
    "ROS 2, sqlite": ("rosbag2", _ros2("sqlite3")),
    "ROS 2, sqlite, packed messages": ("rosbag2", _ros2("sqlite3", "message")),
    "ROS 2, sqlite, packed file": ("rosbag2", _ros2("sqlite3", "file")),
    "ROS 2, mcap": ("rosbag2", _ros2("mcap")),
    "a lone .db3": ("rosbag2", _ros2("sqlite3", file="*.db3")),
    "a lone .mcap": ("mcap", _ros2("mcap", file="*.mcap")),
    "a lone .mcap, zstd": ("mcap", _ros2("mcap", "storage", file="*.mcap")),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_drive_comes_back(kind: str, tmp_path: Path) -> None:
    name, write = KINDS[kind]
    path = write(tmp_path)
    assert guess(path).name == name
    session = open_session(path)
    assert session.overview() == (5, True)
    for _ in range(2):  # as often as one likes
        moments = list(session.moments())
        assert [m.frame.step for m in moments] == [1, 2, 3, 4, 5]
        np.testing.assert_allclose([m.frame.time_s for m in moments], 0.2 * np.arange(5), atol=1e-6)
        for number, moment in enumerate(moments):
            assert np.array_equal(moment.frame.image, making.picture(number))
            assert moment.truth is not None
            np.testing.assert_allclose(moment.truth, [1 + 0.1 * number, 2.0, 0.5], atol=1e-9)
        turns = [m.frame.motions[:, 2].sum() for m in moments[1:]]
        np.testing.assert_allclose(turns, 0.02, atol=1e-9)


@pytest.mark.parametrize("chunks", [0, 1, 3])
def test_json_messages_come_back(chunks: int, tmp_path: Path) -> None:
    path = making.write_json_mcap(tmp_path / "drive.mcap", making.foxglove_drive(), chunks=chunks)
    session = open_session(path)
    assert session.overview() == (4, True)
    moments = list(session.moments())
    for number, moment in enumerate(moments):
        assert np.array_equal(moment.frame.image, making.picture(number))
        assert moment.truth is not None
        np.testing.assert_allclose(moment.truth, [1 + 0.1 * number, 2, 0], atol=1e-9)
    np.testing.assert_allclose(moments[1].frame.motions, [[0.1, 0, 0]], atol=1e-9)
    assert "/tf:odom.base_link" in session.warnings[0]


def test_ros1_messages_in_mcap_come_back(tmp_path: Path) -> None:
    ros = Ros(1)
    said, schemas = [], {}
    for one in making.drive(ros):
        kind = one.type.replace("/", "/msg/")
        schemas[one.type] = ros.store.generate_msgdef(kind)[0]
        data = bytes(ros.store.serialize_ros1(one.message, kind))
        said.append(Said(one.topic, one.type, one.log_ns, data))
    how: dict[str, Any] = {"encoding": "ros1", "schema_encoding": "ros1msg", "chunks": 2}
    path = making.write_json_mcap(tmp_path / "drive.mcap", said, schemas=schemas, **how)
    session = open_session(path)
    assert session.overview() == (5, True)
    assert all(
        np.array_equal(moment.frame.image, making.picture(number))
        for number, moment in enumerate(session.moments())
    )


@pytest.mark.parametrize(
    ("others", "want"),
    [
        (["/odometry/filtered", "/wheel/odom"], "/wheel/odom"),
        (["/odometry/filtered"], "/odometry/filtered"),
        (["/amcl/odom", "/planar_odom"], "/planar_odom"),
        (["/vicon/robot", "/odom"], "/odom"),
        (["/vicon/robot"], "none"),
    ],
)
def test_the_robots_own_odometry_is_guessed(others: list[str], want: str, tmp_path: Path) -> None:
    ros = Ros(1)
    message = ros.odometry(BEGIN_NS, (0, 0, 0))
    said = [Said(name, "nav_msgs/Odometry", BEGIN_NS, message) for name in others]
    path = making.write_ros1(tmp_path / "drive.bag", said)
    assert f"odometry {'from ' if want != 'none' else ''}{want}," in open_recording(path).info.notes[0]


@pytest.mark.parametrize(
    ("others", "want"),
    [
        (["/camera/depth/image_raw", "/camera/color/image_raw"], "/camera/color/image_raw"),
        (["/cam_right/image", "/cam_left/image"], "/cam_left/image"),
        (["/camera/infra1/image", "/webcam"], "/webcam"),
        (["/camera/depth/image"], "/camera/depth/image"),
    ],
)
def test_the_color_camera_is_guessed(others: list[str], want: str, tmp_path: Path) -> None:
    ros = Ros(1)
    message = ros.compressed(BEGIN_NS, making.picture(0))
    said = [Said(name, "sensor_msgs/CompressedImage", BEGIN_NS, message) for name in others]
    path = making.write_ros1(tmp_path / "drive.bag", said)
    assert f"pictures from {want}," in open_recording(path).info.notes[0]


def test_overlapping_chunks_are_merged_by_time(tmp_path: Path) -> None:
    said = making.foxglove_drive(6)
    shuffled = [*said[0::3], *said[1::3], *said[2::3]]  # a topic a chunk, all over the same time
    path = making.write_json_mcap(tmp_path / "drive.mcap", shuffled, chunks=3)
    assert len(list(open_session(path).moments())) == 6


def test_content_comes_before_the_name(tmp_path: Path) -> None:
    bag = making.write_ros1(tmp_path / "drive.bag", making.drive(Ros(1)))
    renamed = shutil.copy(bag, tmp_path / "drive.mcap")
    assert guess(renamed).name == "rosbag1"
    assert open_session(renamed).overview() == (5, True)
    folder = making.write_ros2(tmp_path / "two", making.drive(Ros(2)))
    database = shutil.copy(next(folder.glob("*.db3")), tmp_path / "drive.log")
    assert guess(database).name == "rosbag2"
    assert open_session(database).overview() == (5, True)


def test_topics_as_asked(tmp_path: Path) -> None:
    ros = Ros(1)
    said = making.drive(ros)
    said += [Said("/other/image", one.type, one.log_ns, one.message) for one in said if "camera" in one.topic]
    path = making.write_ros1(tmp_path / "drive.bag", sorted(said, key=lambda one: one.log_ns))
    asked = ReadingOptions(image_topic="/other/image", odometry_topic="none", truth_topic="/ground_truth")
    recording = open_recording(path, asked)
    records = list(recording.records(ReadingNotes(keep_going=False)))
    assert Counter(type(r).__name__ for r in records) == {"Picture": 5, "TruthPose": 10}
    assert all(r.name.startswith("/other/image") for r in records if isinstance(r, Picture))
    assert recording.info.notes == ()  # nothing was guessed


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (ReadingOptions(image_topic="/nowhere"), "found no topic /nowhere; it holds /camera"),
        (ReadingOptions(image_topic="/odom"), "carries nav_msgs/Odometry, expected"),
        (ReadingOptions(odometry_topic="/camera/image/compressed"), "carries sensor_msgs/CompressedImage"),
        (ReadingOptions(truth_topic="/odom:map.base"), "carries nav_msgs/Odometry, expected"),
    ],
)
def test_wrong_topics_are_named(options: ReadingOptions, told: str, tmp_path: Path) -> None:
    path = making.write_ros1(tmp_path / "drive.bag", making.drive(Ros(1)))
    with pytest.raises(InputError, match=told):
        open_recording(path, options)


def test_transforms_are_chained(tmp_path: Path) -> None:
    """odom -> base_footprint moves, base_footprint -> base_link is fixed, map -> odom is somebody's guess."""
    ros, kind = Ros(2), "tf2_msgs/TFMessage"
    fixed = ros.transforms(BEGIN_NS, "base_footprint", "base_link", (0.5, 0.0, np.pi / 2))
    said = [Said("/tf_static", kind, BEGIN_NS, fixed)]
    for number in range(1, 4):
        t_ns = BEGIN_NS + number * 10**8
        moved = ros.transforms(t_ns, "odom", "base_footprint", (number, 0.0, np.pi / 2))
        said.append(Said("/tf", kind, t_ns, moved))
        said.append(Said("/tf", kind, t_ns, ros.transforms(t_ns, "map", "odom", (9.0, 9.0, 1.0))))
    path = making.write_ros2(tmp_path / "drive", said)
    guessed = open_recording(path)
    assert "/tf:odom.base_footprint" in guessed.info.notes[0]
    recording = open_recording(path, ReadingOptions(odometry_topic="/tf:odom.base_link"))
    poses = [r.pose for r in recording.records(ReadingNotes(keep_going=False))]  # type: ignore[union-attr]  # all are
    want = [(number, 0.5, -np.pi) for number in range(1, 4)]
    np.testing.assert_allclose(np.abs(poses), np.abs(want), atol=1e-9)


def test_a_ring_of_transforms_is_no_endless_loop(tmp_path: Path) -> None:
    ros, kind = Ros(2), "tf2_msgs/TFMessage"
    said = [
        Said("/tf", kind, BEGIN_NS, ros.transforms(BEGIN_NS, a, b, (1.0, 0.0, 0.0)))
        for a, b in (("a", "b"), ("b", "a"))
    ]
    path = making.write_ros2(tmp_path / "drive", said)
    recording = open_recording(path, ReadingOptions(odometry_topic="/tf:odom.b"))
    assert list(recording.records(ReadingNotes(keep_going=False))) == []


def _times(path: Path) -> tuple[list[float], tuple[str, ...]]:
    notes = ReadingNotes(keep_going=False)
    return [r.t_s for r in open_recording(path).records(notes)], notes.warnings


def test_stamps_put_messages_in_order(tmp_path: Path) -> None:
    ros = Ros(1)
    said = making.drive(ros)
    late = [Said(s.topic, s.type, s.log_ns + 3 * 10**8 * ("camera" in s.topic), s.message) for s in said]
    path = making.write_ros1(tmp_path / "drive.bag", sorted(late, key=lambda one: one.log_ns))
    times, _ = _times(path)
    assert times == sorted(times)
    assert min(times) == pytest.approx(BEGIN_NS / 1e9)


def test_without_stamps_the_times_of_recording_count(tmp_path: Path) -> None:
    ros = Ros(1)
    said = [
        Said("/odom", "nav_msgs/Odometry", BEGIN_NS + i * 10**8, ros.odometry(0, (i, 0, 0))) for i in range(3)
    ]
    times, warnings = _times(making.write_ros1(tmp_path / "drive.bag", said))
    np.testing.assert_allclose(times, BEGIN_NS / 1e9 + 0.1 * np.arange(3), atol=1e-6)
    assert any("/odom carry no time" in text for text in warnings)


def test_clocks_that_disagree_are_noticed(tmp_path: Path) -> None:
    ros = Ros(1)
    said = making.drive(ros)
    slow = [
        Said(s.topic, s.type, s.log_ns, ros.odometry(s.log_ns - 80 * 10**9, (0.1 * i, 0, 0)))
        if s.topic == "/odom"
        else s
        for i, s in enumerate(said)
    ]
    path = making.write_ros1(tmp_path / "drive.bag", slow)
    times, warnings = _times(path)
    assert max(times) - min(times) < 2
    assert any("the clocks of /odom" in text and "79.998 s apart" in text for text in warnings)
    assert open_session(path).overview() == (5, True)


def test_offsets_are_added(tmp_path: Path) -> None:
    path = making.write_ros1(tmp_path / "drive.bag", making.drive(Ros(1)))
    recording = open_recording(path, ReadingOptions(odometry_offset_s=100.0))
    records = list(recording.records(ReadingNotes(keep_going=False)))
    times = [r.t_s for r in records]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(BEGIN_NS / 1e9 + 100.9)


def test_texts_at_a_topic_of_events_are_events(tmp_path: Path) -> None:
    ros = Ros(1)
    said = making.drive(ros)
    text = Said("/events", "std_msgs/String", said[9].log_ns, ros.new("std_msgs/String", data="lights off"))
    path = making.write_ros1(tmp_path / "drive.bag", [*said[:10], text, *said[10:]])
    moments = list(open_session(path).moments())
    assert [m.events for m in moments] == [(), (), ("lights off",), (), ()]


def test_bags_without_poses_and_pictures_say_what_they_hold(tmp_path: Path) -> None:
    ros = Ros(1)
    text = ros.new("std_msgs/String", data="hello")
    path = making.write_ros1(tmp_path / "drive.bag", [Said("/chatter", "std_msgs/String", BEGIN_NS, text)])
    with pytest.raises(InputError, match=r"it holds /chatter \(std_msgs/String, 1\)"):
        open_recording(path)


def test_messages_in_an_unknown_encoding_are_named(tmp_path: Path) -> None:
    path = making.write_json_mcap(tmp_path / "drive.mcap", making.foxglove_drive(), encoding="flatbuffer")
    with pytest.raises(InputError, match="encoded as 'flatbuffer'"):
        open_recording(path)
    with pytest.raises(InputError, match="/image cannot be read: its messages are encoded as 'flatbuffer'"):
        open_recording(path, ReadingOptions(image_topic="/image"))


def test_broken_messages_are_counted_when_keeping_going(tmp_path: Path) -> None:
    said = making.foxglove_drive()
    said[1] = Said(said[1].topic, said[1].type, said[1].log_ns, {"timestamp": {"sec": BEGIN_NS // 10**9}})
    nowhere: dict[str, Any] = said[4].message | {"pose": said[4].message["pose"] | {"orientation": {}}}
    said[4] = Said(said[4].topic, said[4].type, said[4].log_ns, nowhere)
    path = making.write_json_mcap(tmp_path / "drive.mcap", said)
    with pytest.raises(InputError, match=r"message 1 of /truth .*found no field"):
        list(open_session(path).moments())
    session = open_session(path, ReadingOptions(keep_going=True))
    assert len(list(session.moments())) == 4
    assert session.problem_count == 2


def test_an_unfilled_quaternion_is_no_heading(tmp_path: Path) -> None:
    ros = Ros(1)
    message = ros.odometry(BEGIN_NS, (0, 0, 0))
    message.pose.pose.orientation.w = 0.0
    path = making.write_ros1(tmp_path / "drive.bag", [Said("/odom", "nav_msgs/Odometry", BEGIN_NS, message)])
    with pytest.raises(InputError, match="quaternion of length 0"):
        list(open_recording(path).records(ReadingNotes(keep_going=False)))


def test_the_camera_is_described_where_the_bag_knows_it(tmp_path: Path) -> None:
    said = making.foxglove_drive()
    calibration = {"width": 640, "height": 480, "K": [320, 0, 320, 0, 320, 240, 0, 0, 1]}
    said.append(Said("/calibration", "foxglove.CameraCalibration", said[-1].log_ns, calibration))
    camera = open_recording(making.write_json_mcap(tmp_path / "drive.mcap", said)).info.cameras[0]
    assert (camera.width_px, camera.height_px) == (640, 480)
    assert camera.horizontal_fov_rad == pytest.approx(np.pi / 2)


def test_without_the_extra_one_line_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = making.write_ros1(tmp_path / "drive.bag", making.drive(Ros(1)))
    log = making.write_json_mcap(tmp_path / "drive.mcap", making.foxglove_drive())
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    for path in (bag, log):
        with pytest.raises(InputError) as refused:
            open_session(path)
        assert str(refused.value).endswith("pip install 'maurice-replay[ros]'")


def test_the_package_is_not_imported_before_a_bag_is_opened() -> None:
    code = """
import sys
from maurice_loaders.formats.registry import formats
formats()
print('rosbags' in sys.modules)
"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"


@pytest.mark.parametrize(
    ("file", "counts"),
    [
        ("rosbag1/robot_localization_test2.bag", {"OdometryPose": 3060}),
        ("rosbag1/webviz_example.bag", {"OdometryPose": 1344}),
        ("rosbag1/webviz_example-bz2.bag", {"OdometryPose": 1344}),
        ("rosbag2/plotjuggler_rosbag2_test", {"OdometryPose": 1565}),
        ("rosbag2/plotjuggler_rosbag2_test/rosbag2_test_0.db3", {"OdometryPose": 1565}),
        ("mcap/lichtblick_custom-camera-model.mcap", {"Picture": 10}),
    ],
)
def test_other_writers_files(file: str, counts: dict[str, int]) -> None:
    """The counts are those that the files' own indexes give for the topics that are read."""
    if not (DATA / file).exists():
        pytest.skip("the recorded data is not here (MAURICE_DATA)")
    notes = ReadingNotes(keep_going=False)
    records = list(open_recording(DATA / file).records(notes))
    assert Counter(type(record).__name__ for record in records) == counts
    for record in records:
        if isinstance(record, Picture):
            assert record.read().shape == (360, 520, 3)
