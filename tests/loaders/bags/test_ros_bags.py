"""Bags of every kind give the drive that was written into them."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers import bags as making
from helpers.bags import BEGIN_NS, Ros, Said
from helpers.recordings import counted, read
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.formats.registry import guess, open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose, Picture, Scan
from maurice_loaders.reading.session import RecordedSession

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
    said = making.foxglove_drive(6)
    shuffled = [*said[0::3], *said[1::3], *said[2::3]]  # a topic a chunk, all over the same time
    path = making.write_json_mcap(tmp_path / "mixed.mcap", shuffled, chunks=chunks)
    assert len(list(open_session(path).moments())) == 6 or not chunks


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
        (["/odometry/filtered", "/wheel/odom"], "odometry from /wheel/odom"),
        (["/odometry/filtered"], "odometry from /odometry/filtered"),
        (["/amcl/odom", "/planar_odom"], "odometry from /planar_odom"),
        (["/vicon/robot", "/odom"], "odometry from /odom"),
        (["/vicon/robot"], "odometry none"),
        (["/camera/depth/image_raw", "/camera/color/image_raw"], "pictures from /camera/color/image_raw"),
        (["/cam_right/image", "/cam_left/image"], "pictures from /cam_left/image"),
        (["/camera/infra1/image", "/webcam"], "pictures from /webcam"),
        (["/camera/depth/image"], "pictures from /camera/depth/image"),
    ],
)
def test_the_robots_own_odometry_and_the_color_camera_are_guessed(
    others: list[str], want: str, tmp_path: Path
) -> None:
    ros = Ros(1)
    odometry = ros.odometry(BEGIN_NS, (0, 0, 0))
    said = [Said(name, "nav_msgs/Odometry", BEGIN_NS, odometry) for name in others]
    if "pictures" in want:
        said = [making.seen(ros, BEGIN_NS, topic=name) for name in others]
    path = making.write_ros1(tmp_path / "drive.bag", said)
    assert f"{want}," in open_recording(path).info.notes[0]


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
    said += [replace(one, topic="/other/image") for one in said if "camera" in one.topic]
    path = making.write_ros1(tmp_path / "drive.bag", sorted(said, key=lambda one: one.log_ns))
    asked = Reading(image_topic="/other/image", odometry_topic="none", truth_topic="/ground_truth")
    recording = open_recording(path, asked)
    records = list(recording.records(ReadingNotes(keep_going=False)))
    assert Counter(type(r).__name__ for r in records) == {"Picture": 5, "TruthPose": 10}
    assert all(r.name.startswith("/other/image") for r in records if isinstance(r, Picture))
    assert recording.info.notes == ()  # nothing was guessed
    notes = ReadingNotes(keep_going=False)
    list(recording.records(notes))
    left = "/odom (10 Odometry), /camera/image/compressed (5 CompressedImage)"
    assert notes.warnings[0] == f"also holds {left}, not read"


@pytest.mark.parametrize("version", [1, 2])
def test_topics_of_sensors_that_are_not_read_are_named(version: int, tmp_path: Path) -> None:
    """As a laser's, also beside corrections; neither what is read nor what it is read with."""
    ros, write = Ros(version), making.write_ros1 if version == 1 else making.write_ros2
    said = making.drive(ros)
    points = [ros.new("geometry_msgs/Point", x=0.1 * k, y=0.0, z=0.0) for k in range(3)]
    said += [Said("/bumps", "geometry_msgs/Point", BEGIN_NS + k, point) for k, point in enumerate(points)]
    session = open_session(write(tmp_path / "drive.bag", said), turn_scale=-1.0)
    assert isinstance(session, RecordedSession)
    assert session.opening_remarks[-1] == "also holds /bumps (3 Point), not read"
    assert not any("also holds" in text for text in session.info.notes)  # no header of a copy says it


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (Reading(image_topic="/nowhere"), "found no topic /nowhere; it holds /camera"),
        (Reading(image_topic="/odom"), "carries nav_msgs/Odometry, expected"),
        (Reading(odometry_topic="/camera/image/compressed"), "carries sensor_msgs/CompressedImage"),
        (Reading(truth_topic="/odom:map.base"), "carries nav_msgs/Odometry, expected"),
    ],
)
def test_wrong_topics_are_named(options: Reading, told: str, tmp_path: Path) -> None:
    path = making.write_ros1(tmp_path / "drive.bag", making.drive(Ros(1)))
    with pytest.raises(InputError, match=told):
        open_recording(path, options)


def test_transforms_are_chained(tmp_path: Path) -> None:
    """odom -> base_footprint moves, base_footprint -> base_link is fixed, map -> odom is somebody's guess."""
    ros = Ros(2)
    fixed = (0.5, 0.0, np.pi / 2)
    said = [making.link(ros, BEGIN_NS, "base_footprint", "base_link", fixed, "/tf_static")]
    for number in range(1, 4):
        t_ns = BEGIN_NS + number * 10**8
        said.append(making.link(ros, t_ns, "odom", "base_footprint", (number, 0.0, np.pi / 2)))
        said.append(making.link(ros, t_ns, "map", "odom", (9.0, 9.0, 1.0)))
    path = making.write_ros2(tmp_path / "drive", said)
    assert "/tf:odom.base_footprint" in open_recording(path).info.notes[0]
    poses = [r.pose for r in read(path, Reading(odometry_topic="/tf:odom.base_link"))[0]]  # type: ignore[union-attr]  # all are
    want = [(number, 0.5, -np.pi) for number in range(1, 4)]
    np.testing.assert_allclose(np.abs(poses), np.abs(want), atol=1e-9)
    ring = [making.link(ros, BEGIN_NS, a, b, (1.0, 0.0, 0.0)) for a, b in (("a", "b"), ("b", "a"))]
    path = making.write_ros2(tmp_path / "ring", ring)  # which is no endless loop
    assert read(path, Reading(odometry_topic="/tf:odom.b"))[0] == []


def test_poses_by_transforms_are_those_of_the_lowest_frame_that_moves(tmp_path: Path) -> None:
    """AMCL stamps map to odom ahead, and static transforms may be as old as the robot's start."""
    ros, said = Ros(2), list[Said]()
    fixed = making.link(ros, BEGIN_NS, "base_footprint", "base_link", (0.1, 0.0, 0.0), "/tf_static")
    for number in range(40):
        t_ns = BEGIN_NS + number * 10**8
        said.append(making.link(ros, t_ns, "odom", "base_footprint", (0.1 * number, 0.0, 0.0)))
        if number % 5 == 1:
            ahead = ros.transforms(t_ns + 5 * 10**8, "map", "odom", (0.001 * number, 2.0, 0.0))
            said.append(Said("/tf", "tf2_msgs/TFMessage", t_ns + 10**6, ahead))
            old = ros.transforms(BEGIN_NS - 10**12, "base_footprint", "base_link", (0.1, 0.0, 0.0))
            said.append(Said("/tf_static", "tf2_msgs/TFMessage", t_ns + 2 * 10**6, old))
    path = making.write_ros2(tmp_path / "b", [fixed, *said])
    options = Reading(odometry_topic="/tf:map.base_link", truth_topic="none")
    records, _ = read(path, options)
    times = np.array([record.t_s for record in records]) - BEGIN_NS / 1e9
    moving = times > 0.35  # before that nothing has moved yet
    np.testing.assert_allclose(times[moving], 0.1 * np.arange(4, 40), atol=1e-6)
    poses = np.array([record.pose for record in records if isinstance(record, OdometryPose)])
    np.testing.assert_allclose(poses[moving, 0], 0.1 + times[moving], atol=0.04)


def test_stamps_put_messages_in_order_and_offsets_are_added(tmp_path: Path) -> None:
    said = making.drive(Ros(1))
    late = [replace(s, log_ns=s.log_ns + 3 * 10**8 * ("camera" in s.topic)) for s in said]
    path = making.write_ros1(tmp_path / "drive.bag", sorted(late, key=lambda one: one.log_ns))
    for options, first, last in ((None, 0, 0.9), (Reading(odometry_offset_s=100.0), 0, 100.9)):
        times = [r.t_s for r in read(path, options)[0]]
        assert times == sorted(times)
        assert (times[0], times[-1]) == pytest.approx((BEGIN_NS / 1e9 + first, BEGIN_NS / 1e9 + last))


def test_missing_stamps_and_clocks_that_disagree_are_told_of(tmp_path: Path) -> None:
    ros = Ros(1)
    kind, t_ns = "nav_msgs/Odometry", [BEGIN_NS + i * 10**8 for i in range(3)]
    said = [Said("/odom", kind, t, ros.odometry(0, (i, 0, 0))) for i, t in enumerate(t_ns)]
    records, warnings = read(making.write_ros1(tmp_path / "none.bag", said))
    np.testing.assert_allclose([r.t_s for r in records], BEGIN_NS / 1e9 + 0.1 * np.arange(3), atol=1e-6)
    assert any("/odom carry no time" in text for text in warnings)
    slow = making.drive(ros)
    for i, s in enumerate(slow):
        if s.topic == "/odom":
            slow[i] = replace(s, message=ros.odometry(s.log_ns - 80 * 10**9, (0.1 * i, 0, 0)))
    path = making.write_ros1(tmp_path / "drive.bag", slow)
    records, warnings = read(path)
    assert max(r.t_s for r in records) - min(r.t_s for r in records) < 2
    assert any("the clocks of /odom" in text and "79.998 s apart" in text for text in warnings)
    assert open_session(path).overview() == (5, True)


@pytest.mark.parametrize("slowness", [1, 30])
@pytest.mark.parametrize("write", [making.write_ros1, making.write_ros2])
def test_what_has_no_stamp_is_put_on_the_clock_of_a_simulation(
    write: Callable[..., Path], slowness: int, tmp_path: Path
) -> None:
    """Stamps count from the simulation's start, and the recording's clock is that of the wall."""
    ros, wall_ns = Ros(1 if write is making.write_ros1 else 2), 3 * 10**17
    said = making.laser_drive(ros)
    for t_ns in [one.log_ns + 1000 for one in said if one.topic == "/odom"]:
        said.append(Said("/battery", "std_msgs/Float32", t_ns, ros.new("std_msgs/Float32", data=12.0)))
        said.append(Said("/events", "std_msgs/String", t_ns, ros.new("std_msgs/String", data="a bump")))
    said.sort(key=lambda one: one.log_ns)
    plain, _ = read(write(tmp_path / "plain.bag", said))
    simulated = [replace(one, log_ns=BEGIN_NS + wall_ns + slowness * (one.log_ns - BEGIN_NS)) for one in said]
    records, warnings = read(write(tmp_path / "sim.bag", simulated))
    assert not any("left out" in text for text in warnings)
    assert Counter(map(type, records)) == Counter(map(type, plain))
    for kind in {type(record) for record in plain}:
        times, wanted = ([one.t_s for one in some if isinstance(one, kind)] for some in (records, plain))
        exact = kind in (OdometryPose, Scan)
        np.testing.assert_allclose(times, wanted, atol=1e-6 if exact else 2e-6 * slowness)


def test_of_two_drives_in_a_bag_the_first_is_read_and_the_other_told_of(tmp_path: Path) -> None:
    """As of a simulation that was started again: stamps begin anew, and go on for longer than at first."""
    ros, first = Ros(2), making.laser_drive(Ros(2), 60)
    second = making.laser_drive(ros, 90)
    said = first + [replace(one, log_ns=one.log_ns + 13 * 10**9) for one in second]
    whole, _ = read(making.write_ros2(tmp_path / "one", first))
    records, warnings = read(making.write_ros2(tmp_path / "two", said))
    assert [record.t_s for record in records] == [record.t_s for record in whole]
    (scans,) = [text for text in warnings if "(Scan) were left out: their times begin again" in text]
    assert scans.startswith("90 records")
    assert "record each drive to a bag of its own" in scans
    stray = [
        replace(one, message=ros.odometry(BEGIN_NS, (0, 0, 0))) for one in first[-3:] if "odom" in one.topic
    ]
    records, warnings = read(making.write_ros2(tmp_path / "stray", [*first[:-30], *stray, *first[-30:]]))
    assert len(records) == len(whole)  # a few wrong stamps are no other drive
    hour_ns = 3600 * 10**9
    ahead = replace(first[40], message=ros.odometry(BEGIN_NS + hour_ns, (0, 0, 0)), topic="/odom")
    ahead = replace(ahead, type="nav_msgs/Odometry")
    records, warnings = read(making.write_ros2(tmp_path / "ahead", [*first[:40], ahead, *first[40:]]))
    assert [record.t_s for record in records[:-1]] == [record.t_s for record in whole]
    assert records[-1].t_s == pytest.approx((BEGIN_NS + hour_ns) / 1e9)


def test_events_are_texts_and_the_camera_is_described_where_the_bag_knows_it(tmp_path: Path) -> None:
    ros = Ros(1)
    said = making.drive(ros)
    text = Said("/events", "std_msgs/String", said[9].log_ns, ros.new("std_msgs/String", data="lights off"))
    path = making.write_ros1(tmp_path / "drive.bag", [*said[:10], text, *said[10:]])
    moments = list(open_session(path).moments())
    assert [m.events for m in moments] == [(), (), ("lights off",), (), ()]
    said = making.foxglove_drive()
    calibration = {"width": 640, "height": 480, "K": [320, 0, 320, 0, 320, 240, 0, 0, 1]}
    said.append(Said("/calibration", "foxglove.CameraCalibration", said[-1].log_ns, calibration))
    camera = open_recording(making.write_json_mcap(tmp_path / "drive.mcap", said)).info.cameras[0]
    assert (camera.width_px, camera.height_px) == (640, 480)
    assert camera.horizontal_fov_rad == pytest.approx(np.pi / 2)


def test_bags_that_cannot_be_read_say_what_they_hold(tmp_path: Path) -> None:
    text = Ros(1).new("std_msgs/String", data="hello")
    path = making.write_ros1(tmp_path / "drive.bag", [Said("/chatter", "std_msgs/String", BEGIN_NS, text)])
    packed = making.write_json_mcap(tmp_path / "drive.mcap", making.foxglove_drive(), encoding="flatbuffer")
    unknown = "/image cannot be read: its messages are encoded as 'flatbuffer'"
    for bag, options, told in (
        (path, None, r"it holds /chatter \(std_msgs/String, 1\)"),
        (packed, None, "encoded as 'flatbuffer'"),
        (packed, Reading(image_topic="/image"), unknown),
    ):
        with pytest.raises(InputError, match=told):
            open_recording(bag, options)


def test_broken_messages_are_counted_and_an_unfilled_quaternion_is_no_heading(tmp_path: Path) -> None:
    said = making.foxglove_drive()
    said[1] = Said(said[1].topic, said[1].type, said[1].log_ns, {"timestamp": {"sec": BEGIN_NS // 10**9}})
    nowhere: dict[str, Any] = said[4].message | {"pose": said[4].message["pose"] | {"orientation": {}}}
    said[4] = Said(said[4].topic, said[4].type, said[4].log_ns, nowhere)
    path = making.write_json_mcap(tmp_path / "drive.mcap", said)
    with pytest.raises(InputError, match=r"message 1 of /truth .*found no field"):
        list(open_session(path).moments())
    session = open_session(path, Reading(keep_going=True))
    assert len(list(session.moments())) == 4
    assert session.problem_count == 2
    ros = Ros(1)
    message = ros.odometry(BEGIN_NS, (0, 0, 0))
    message.pose.pose.orientation.w = 0.0
    path = making.write_ros1(tmp_path / "drive.bag", [Said("/odom", "nav_msgs/Odometry", BEGIN_NS, message)])
    with pytest.raises(InputError, match="quaternion of length 0"):
        list(open_recording(path).records(ReadingNotes(keep_going=False)))


def test_the_package_is_needed_and_imported_only_when_a_bag_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = making.write_ros1(tmp_path / "drive.bag", making.drive(Ros(1)))
    log = making.write_json_mcap(tmp_path / "drive.mcap", making.foxglove_drive())
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    for path in (bag, log):
        with pytest.raises(InputError) as refused:
            open_session(path)
        assert str(refused.value).endswith("pip install 'maurice-replay[ros]'")
    code = "import sys; from maurice_loaders.formats.registry import formats; formats(); "
    code += "print('rosbags' in sys.modules)"
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
    assert counted(DATA / file) == counts
    for record in read(DATA / file)[0]:
        if isinstance(record, Picture):
            assert record.read().shape == (360, 520, 3)
