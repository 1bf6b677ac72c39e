"""A laser's scans in bags of every kind, where it sits on the robot, and the map beside them."""

from __future__ import annotations

import os
import sqlite3
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers import bags as making
from helpers.bags import BEGIN_NS, LASER_AT, Ros, Said
from maurice_loaders.bags.maps import map_in
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.files.maps import read_occupancy
from maurice_loaders.formats.registry import open_recording, open_session
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.recording import OdometryPose, Record, Scan, TruthPose, checked

DATA = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "logs"
SCAN = "sensor_msgs/LaserScan"


def records(path: Path, **options: Any) -> list[Record]:
    return list(checked(open_recording(path, Reading(**options)), ReadingNotes(keep_going=False)))


def scans(path: Path, **options: Any) -> list[Scan]:
    return [record for record in records(path, **options) if isinstance(record, Scan)]


def remark(path: Path) -> str:
    return open_recording(path, Reading()).info.notes[0]


def one_scan(folder: Path, ranges: Sequence[float], said: Sequence[Said] = (), **more: float) -> Path:
    message = Ros(2).scan(BEGIN_NS, ranges, **more)
    return making.write_ros2(folder / "bag", [*said, Said("/scan", SCAN, BEGIN_NS, message)])


def rolled(ros: Ros, roll: float, yaw: float) -> Any:
    """Turned about the forward axis and then about the robot's vertical one."""
    cos, sin = np.cos([roll / 2, yaw / 2]), np.sin([roll / 2, yaw / 2])
    parts = {"x": sin[0] * cos[1], "y": sin[0] * sin[1], "z": cos[0] * sin[1], "w": cos[0] * cos[1]}
    return ros.new("geometry_msgs/Quaternion", **{name: float(part) for name, part in parts.items()})


def mounted(ros: Ros, roll: float, yaw: float = 0.0, topic: str = "/tf_static") -> Said:
    turned = ros.transforms(BEGIN_NS, "base_link", "laser", (0.3, -0.1, 0.0), rolled(ros, roll, yaw))
    return Said(topic, "tf2_msgs/TFMessage", BEGIN_NS, turned)


def _ros2(storage: str, compression: str | None = None) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        drive = making.laser_drive(Ros(2))
        return making.write_ros2(folder / "bag", drive, storage=storage, compression=compression)

    return write


def _untyped(folder: Path) -> Path:
    """As before ROS 2 Iron, which wrote no definitions of types into a bag."""
    bag = making.write_ros2(folder / "bag", making.laser_drive(Ros(2)))
    with closing(sqlite3.connect(next(bag.glob("*.db3")))) as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("UPDATE schema SET schema_version = 3")
        database.commit()
    return bag


KINDS: dict[str, Callable[[Path], Path]] = {
    "ROS 1": lambda folder: making.write_ros1(folder / "drive.bag", making.laser_drive(Ros(1))),
    "ROS 1, lz4": lambda folder: making.write_ros1(folder / "drive.bag", making.laser_drive(Ros(1)), "lz4"),
    "ROS 2": _ros2("sqlite3"),
    "ROS 2, packed": _ros2("sqlite3", "message"),
    "ROS 2, MCAP": _ros2("mcap"),
    "ROS 2 without definitions": _untyped,
}


@pytest.mark.parametrize("kind", KINDS)
def test_scans_come_back_in_time_order(kind: str, tmp_path: Path) -> None:
    path = KINDS[kind](tmp_path)
    both = records(path)
    assert Counter(type(record) for record in both) == {OdometryPose: 10, Scan: 5}
    assert [record.t_s for record in both] == sorted(record.t_s for record in both)
    for number, record in enumerate(scans(path)):
        assert record.t_s == pytest.approx(BEGIN_NS / 1e9 + 0.2 * number, abs=1e-6)
        assert record.scan.ranges_m.tolist() == pytest.approx([1.0 + 0.2 * number] * 101)
        np.testing.assert_allclose(record.scan.mount, LASER_AT)
        assert (record.scan.start_rad, record.scan.step_rad) == pytest.approx((-np.pi / 2, np.pi / 100))
        assert (record.scan.min_m, record.scan.max_m) == pytest.approx((0.1, 8.0))
    assert "scans from /scan" in remark(path)
    assert "laser 0.20 m ahead and 0.05 m left of base_link, turned 6 deg" in remark(path)


def test_ranges_are_read_as_rep_117_has_them(tmp_path: Path) -> None:
    path = one_scan(tmp_path, [np.inf, -np.inf, np.nan, 0.0, -1.0, 0.05, 1.0, 8.0, 9.0])
    scan = scans(path)[0].scan
    assert scan.misses.tolist() == [True] + [False] * 6 + [True, True]
    assert scan.hits.tolist() == [False] * 6 + [True, False, False]
    path = one_scan(tmp_path / "zero", [0.0, 1.0], range_min=0.0)
    assert scans(path)[0].scan.hits.tolist() == [False, True]  # though 0 is no less than the least range


@pytest.mark.parametrize("reach_m", [0.0, np.inf, np.nan])
def test_a_reach_that_is_not_stated_is_one_of_30_m(reach_m: float, tmp_path: Path) -> None:
    scan = scans(one_scan(tmp_path, [1.0, 29.0, 31.0, np.inf], range_max=reach_m))[0].scan
    assert scan.max_m == 30
    assert scan.hits.tolist() == [True, True, False, False]


def test_the_beams_of_angle_increment_count_and_another_angle_max_is_told_of(tmp_path: Path) -> None:
    """Drivers that are off by a beam are many, and told of by none."""
    step = np.pi / 100
    for beams_off, told in ((0, False), (1, False), (-1, False), (100, True), (-50, True)):
        path = one_scan(tmp_path / str(beams_off), [1.0] * 101, angle_max=np.pi / 2 + beams_off * step)
        assert scans(path)[0].scan.angles_rad[-1] == pytest.approx(np.pi / 2)
        assert ("end at 90 deg by angle_increment, which is used, and at" in remark(path)) == told


def test_the_time_is_that_of_the_middle_beam(tmp_path: Path) -> None:
    path = one_scan(tmp_path, [1.0] * 101, time_increment=0.002)
    assert scans(path)[0].t_s == pytest.approx(BEGIN_NS / 1e9 + 0.1, abs=1e-6)
    path = one_scan(tmp_path / "wrong", [1.0] * 101, time_increment=2.0)  # a scan of 200 s
    assert scans(path)[0].t_s == pytest.approx(BEGIN_NS / 1e9, abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_beams_of_a_laser_upside_down_run_clockwise(yaw: float, tmp_path: Path) -> None:
    ros, ranges = Ros(2), np.full(101, np.nan)
    ranges[25] = 2.0  # 45 degrees to the right of the laser, which is 45 to the left of the robot
    for roll, side in ((0.0, -1), (np.pi, 1)):
        path = one_scan(tmp_path / str(roll), ranges.tolist(), [mounted(ros, roll, yaw)])
        scan = scans(path)[0].scan
        direction = yaw + side * np.pi / 4
        end = [0.3 + 2 * np.cos(direction), -0.1 + 2 * np.sin(direction)]
        np.testing.assert_allclose(scan.points(), [end], atol=1e-6)
        assert ("upside down" in remark(path)) == (side == 1)
        assert np.sign(scan.step_rad) == -side


def test_a_tilted_laser_is_named(tmp_path: Path) -> None:
    path = one_scan(tmp_path, [1.0], [mounted(Ros(2), np.radians(12))])
    assert "tilted by 12 deg and taken as level" in remark(path)
    assert "tilted" not in remark(one_scan(tmp_path / "level", [1.0], [mounted(Ros(2), np.radians(3))]))


def test_transforms_are_found_by_the_robots_frame(tmp_path: Path) -> None:
    ros = Ros(2)
    path = one_scan(tmp_path, [1.0])
    np.testing.assert_array_equal(scans(path)[0].scan.mount, 0)
    assert "laser at the robot's center and facing forward: no transform from base_link" in remark(path)
    path = one_scan(tmp_path / "moving", [1.0], [mounted(ros, 0.0, topic="/tf")])  # as ROS 1's publisher does
    np.testing.assert_allclose(scans(path)[0].scan.mount, [0.3, -0.1, 0.0], atol=1e-9)
    links = [
        making.link(ros, BEGIN_NS, "robot1/body", "robot1/base_link", (0.5, 0.0, 0.0), "/tf_static"),
        making.link(ros, BEGIN_NS, "robot1/base_link", "mast", (0.0, 0.0, np.pi), "/tf_static"),
        making.link(ros, BEGIN_NS, "mast", "laser", (0.1, 0.0, 0.0), "/tf_static"),
    ]
    path = one_scan(tmp_path / "named", [1.0], links)
    np.testing.assert_allclose(scans(path)[0].scan.mount, [-0.1, 0.0, np.pi], atol=1e-9)
    odometry = ros.odometry(BEGIN_NS, (0.0, 0.0, 0.0))
    body = Said("/odom", "nav_msgs/Odometry", BEGIN_NS, replace(odometry, child_frame_id="robot1/body"))
    path = one_scan(tmp_path / "body", [1.0], [*links, body])
    np.testing.assert_allclose(scans(path)[0].scan.mount, [0.4, 0.0, np.pi], atol=1e-9)


@pytest.mark.parametrize(
    ("topics", "want"),
    [
        (["/front/scan", "/rear/scan"], "/front/scan"),
        (["/scan_raw", "/scan_filtered"], "/scan_filtered"),
        (["/a_laser", "/base_scan"], "/base_scan"),
    ],
)
def test_the_main_laser_is_guessed_and_another_may_be_asked_for(
    topics: list[str], want: str, tmp_path: Path
) -> None:
    ros = Ros(1)
    said = [
        Said(name, SCAN, BEGIN_NS, ros.scan(BEGIN_NS, [1.0 + number])) for number, name in enumerate(topics)
    ]
    path = making.write_ros1(tmp_path / "drive.bag", said)
    assert f"scans from {want}," in remark(path)
    (asked,) = scans(path, scan_topic=topics[1])
    assert asked.scan.ranges_m.tolist() == [2.0]
    with pytest.raises(InputError, match="found no topic of a type that is read"):
        open_recording(path, Reading(scan_topic="none"))
    with pytest.raises(InputError, match="found no topic /nowhere"):
        open_recording(path, Reading(scan_topic="/nowhere"))


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"range_min": 9.0}, "found ranges from 9 to 8 m"),
        ({"angle_increment": 0.0}, "in steps of 0 rad"),
        ({"angle_min": np.nan}, "found beams from nan rad"),
    ],
)
def test_a_broken_scan_is_named_in_one_line(more: dict[str, float], told: str, tmp_path: Path) -> None:
    path = one_scan(tmp_path, [1.0], **more)
    with pytest.raises(InputError, match=f"message 1 of /scan .*{told}.*--keep-going") as refused:
        records(path)
    assert "\n" not in str(refused.value)


def test_foxgloves_scans_have_a_pose_of_their_own(tmp_path: Path) -> None:
    still = {"x": 0, "y": 0, "z": 0}
    turned = {"x": 1, "y": 0, "z": 0, "w": 0}  # upside down
    stamp = {"sec": BEGIN_NS // 10**9, "nsec": 0}
    links = {"timestamp": stamp, "parent_frame_id": "base_link", "child_frame_id": "laser"}
    links |= {"translation": still | {"x": 0.3}, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    scan = {"timestamp": stamp, "frame_id": "laser", "start_angle": -1.0, "end_angle": 1.0}
    scan |= {"pose": {"position": still | {"y": 0.2}, "orientation": turned}}
    scan |= {"ranges": [1, 2.5, None, float("inf")], "intensities": []}
    said = [
        Said("/tf_static", "foxglove.FrameTransform", BEGIN_NS, links),
        Said("/scan", "foxglove.LaserScan", BEGIN_NS, scan),
    ]
    (record,) = scans(making.write_json_mcap(tmp_path / "drive.mcap", said, chunks=1))
    np.testing.assert_allclose(record.scan.mount, [0.3, 0.2, 0.0])
    np.testing.assert_allclose(record.scan.angles_rad, [1.0, 1 / 3, -1 / 3, -1.0])
    assert record.scan.hits.tolist() == [True, True, False, False]
    assert record.scan.misses.tolist() == [False, False, False, True]


def test_the_map_of_a_bag(tmp_path: Path) -> None:
    ros, percents = Ros(1), np.array([[0, 100, -1], [0, 0, 40]])
    grid = Said("/map", "nav_msgs/OccupancyGrid", BEGIN_NS, ros.grid(percents))
    other = Said("/global_costmap/costmap", "nav_msgs/OccupancyGrid", BEGIN_NS, ros.grid(percents[:1]))
    path = making.write_ros1(tmp_path / "drive.bag", [other, grid, *making.laser_drive(ros)])
    occupancy = map_in(path)
    assert occupancy is not None
    assert occupancy.cells.tolist() == [[0, 1, 2], [0, 0, 2]]
    assert occupancy.bounds == pytest.approx((0.0, 0.0, 0.15, 0.1))
    notes = ReadingNotes(keep_going=False)
    assert list(open_recording(path, Reading()).records(notes))
    assert not any("/map" in text for text in notes.warnings)  # it is read, and not named as left out
    assert map_in(making.write_ros1(tmp_path / "none.bag", making.laser_drive(ros))) is None
    grown = replace(grid, log_ns=BEGIN_NS + 10**9, message=ros.grid(np.full((3, 3), 100) * np.eye(3)))
    path = making.write_ros1(tmp_path / "grown.bag", [grid, *making.laser_drive(ros), grown])
    last = map_in(path)  # as of a SLAM, whose map grows
    assert last is not None
    assert last.cells.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert "its map is the last of 2 at /map" in remark(path)
    empty = Said("/map", "nav_msgs/OccupancyGrid", BEGIN_NS, ros.grid(percents * 0))
    with pytest.raises(InputError, match="its map /map cannot be used: found no occupied cell"):
        map_in(making.write_ros1(tmp_path / "empty.bag", [empty]))


def test_where_there_are_only_points_it_is_told_how_to_make_scans(tmp_path: Path) -> None:
    ros, drive = Ros(2), making.laser_drive(Ros(2))
    fields = {"height": 1, "width": 0, "fields": [], "is_bigendian": False, "point_step": 12}
    fields |= {"row_step": 0, "data": np.zeros(0, np.uint8), "is_dense": True}
    points = ros.new("sensor_msgs/PointCloud2", header=ros.header(BEGIN_NS, "laser"), **fields)
    cloud, told = Said("/points", "sensor_msgs/PointCloud2", BEGIN_NS, points), "scans that pointcloud_to_"
    odometry = [said for said in drive if said.topic == "/odom"]
    assert told in remark(making.write_ros2(tmp_path / "moving", [cloud, *odometry]))
    assert told not in remark(making.write_ros2(tmp_path / "scans", [cloud, *drive]))
    with pytest.raises(InputError, match=told):
        open_recording(making.write_ros2(tmp_path / "alone", [cloud]), Reading())


def test_without_odometry_every_scan_is_used_whatever_the_way_between_them(tmp_path: Path) -> None:
    said = [one for one in making.laser_drive(Ros(2)) if one.topic != "/odom"]
    path = making.write_ros2(tmp_path / "b", said)
    for options in (Reading(), Reading(min_distance_m=0.25, min_angle_rad=0.2)):
        assert len(list(open_session(path, options).moments())) == 5


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "rosbag2").is_dir(), reason="needs the recordings by others (MAURICE_DATA)")
def test_a_recorded_robot_sees_the_walls_of_its_map() -> None:
    """A bag of before ROS 2 Iron: types by name alone; its laser is mounted turned to the left."""
    path = DATA / "rosbag2" / "macfirst_floor_take_2"
    both = records(path)
    assert Counter(type(record) for record in both) == {OdometryPose: 920, Scan: 357}
    np.testing.assert_allclose(scans(path)[0].scan.mount, [0.0039, 0.0, np.pi / 2], atol=1e-4)
    grid = read_occupancy(DATA / "rosbag2" / "macfirst_map" / "mac_1st_floor_final.yaml")
    assert (grid.free.sum(), grid.occupied.sum()) == (303533, 16871)


@pytest.mark.parametrize("odometry", ["topic", "transforms", "none"])
@pytest.mark.parametrize(("after_s", "is_start"), [([2], True), ([1, 2, 8], True), ([8], False)])
def test_the_last_pose_given_by_hand_before_the_robot_went_far_is_where_the_drive_starts(
    after_s: list[int], is_start: bool, odometry: str, tmp_path: Path
) -> None:
    """Less what odometry saw until then: the robot goes 1 m/s. Without odometry only the time tells."""
    ros, drive = Ros(2), making.laser_drive(Ros(2), 60)
    if odometry != "topic":
        drive = [said for said in drive if said.topic != "/odom"]
    for number in range(120 if odometry == "transforms" else 0):
        t_ns, pose = BEGIN_NS + number * 10**8, (0.1 * number, 0.0, 0.0)
        drive.append(making.link(ros, t_ns, "odom", "base_footprint", pose))
    for at_s in after_s:
        t_ns = BEGIN_NS + at_s * 10**9 + (30 if odometry == "none" and at_s == 8 else 0) * 10**9
        message = ros.unsure(t_ns, (1, 2, 0.5) if at_s == after_s[-1] or at_s == 2 else (9, 9, 0.0))
        drive.append(Said("/initialpose", "geometry_msgs/PoseWithCovarianceStamped", t_ns + 1000, message))
    bag = making.write_ros2(tmp_path / "b", sorted(drive, key=lambda said: said.log_ns))
    recording = open_recording(bag, Reading())
    assert (recording.info.start is None) == (not is_start)
    if recording.info.start is not None:
        back_m = 0.0 if odometry == "none" else 2.0
        want = [1 - back_m * np.cos(0.5), 2 - back_m * np.sin(0.5), 0.5]
        np.testing.assert_allclose(recording.info.start, want, atol=1e-6)
    assert "/initialpose" not in recording.not_read
    assert any("/initialpose is at 1.00, 2.00 m, 29 deg" in note for note in recording.info.notes)
    assert not any(isinstance(record, TruthPose) for record in recording.records(ReadingNotes(False)))


@pytest.mark.parametrize("frames_alone", [True, False], ids=["odometry in tf", "odometry"])
def test_two_robots_of_one_bag_are_kept_apart(frames_alone: bool, tmp_path: Path) -> None:
    """As Nav2 has several robots: frames of the same names, each robot's on its own /tf."""
    ros = Ros(2)
    first = making.laser_drive(ros)
    for number in range(10):
        t_ns = BEGIN_NS + number * 10**8
        first.append(making.link(ros, t_ns, "odom", "base_footprint", (0.1 * number, 0.0, 0.0)))
    drive = [replace(said, topic=f"/a{said.topic}") for said in first]
    drive.append(making.link(ros, BEGIN_NS, "base_link", "laser", (9.0, 9.0, 2.0), "/b/tf_static"))
    for number in range(30):
        t_ns, pose = BEGIN_NS + number * 3 * 10**7, (7.0, 0.5 * number, 1.0)
        drive.append(making.link(ros, t_ns, "odom", "base_footprint", pose, "/b/tf"))
        drive.append(Said("/b/odom", "nav_msgs/Odometry", t_ns, ros.odometry(t_ns, pose)))
    drive.append(Said("/b/scan", "sensor_msgs/LaserScan", BEGIN_NS, ros.scan(BEGIN_NS, np.full(101, 5.0))))
    if frames_alone:
        drive = [said for said in drive if not said.topic.endswith("odom")]
    both = records(making.write_ros2(tmp_path / "b", sorted(drive, key=lambda said: said.log_ns)))
    poses = np.array([record.pose for record in both if isinstance(record, OdometryPose)])
    np.testing.assert_allclose(poses, [[0.1 * number, 0, 0] for number in range(10)], atol=1e-9)
    (mount,) = {tuple(record.scan.mount) for record in both if isinstance(record, Scan)}
    np.testing.assert_allclose(mount, making.LASER_AT)


def test_of_frames_with_names_of_robots_the_scans_own_are_taken(tmp_path: Path) -> None:
    ros = Ros(2)
    drive = [Said("/b/scan", "sensor_msgs/LaserScan", BEGIN_NS, ros.scan(BEGIN_NS, np.full(101, 5.0)))]
    for robot, x_m in (("a", 1.0), ("b", 2.0)):
        drive.append(making.link(ros, BEGIN_NS, f"{robot}/odom", f"{robot}/base_link", (x_m, 0.0, 0.0)))
    both = records(making.write_ros2(tmp_path / "b", drive))
    (pose,) = [record.pose for record in both if isinstance(record, OdometryPose)]
    np.testing.assert_allclose(pose, [2.0, 0.0, 0.0])
