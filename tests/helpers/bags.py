"""Small bags of every kind, written by `rosbags` or, for JSON, byte by byte."""

from __future__ import annotations

import base64
import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NAV2 = {
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight\n",
    "nav2_msgs/msg/ParticleCloud": "std_msgs/Header header\nnav2_msgs/Particle[] particles\n",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
}
BEGIN_NS = 1_700_000_000 * 10**9


@dataclass(frozen=True)
class Said:
    """A message on its way into a bag."""

    topic: str
    type: str
    log_ns: int
    message: Any


class Ros:
    """Makes messages of one ROS."""

    def __init__(self, version: int, distro: str = "ROS2_HUMBLE") -> None:
        self.version = version
        self.store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores[distro])
        for name, text in NAV2.items():
            if name not in self.store.types:
                self.store.register(get_types_from_msg(text, name))

    def new(self, kind: str, **fields: Any) -> Any:
        package, name = kind.split("/")
        return self.store.types[f"{package}/msg/{name}"](**fields)

    def header(self, t_ns: int, frame: str = "map") -> Any:
        seq = {"seq": 0} if self.version == 1 else {}
        stamp = self.store.types["builtin_interfaces/msg/Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        return self.new("std_msgs/Header", stamp=stamp, frame_id=frame, **seq)

    def turned(self, heading: float) -> Any:
        z, w = float(np.sin(heading / 2)), float(np.cos(heading / 2))
        return self.new("geometry_msgs/Quaternion", x=0.0, y=0.0, z=z, w=w)

    def pose(self, x: float, y: float, heading: float) -> Any:
        position = self.new("geometry_msgs/Point", x=x, y=y, z=0.3)
        return self.new("geometry_msgs/Pose", position=position, orientation=self.turned(heading))

    def odometry(self, t_ns: int, pose: Sequence[float], speeds: Sequence[float] = (0.0, 0.0, 0.0)) -> Any:
        linear = self.new("geometry_msgs/Vector3", x=speeds[0], y=speeds[1], z=0.0)
        angular = self.new("geometry_msgs/Vector3", x=0.0, y=0.0, z=speeds[2])
        twist = self.new("geometry_msgs/Twist", linear=linear, angular=angular)
        none = np.zeros(36)
        return self.new(
            "nav_msgs/Odometry",
            header=self.header(t_ns, "odom"),
            child_frame_id="base_link",
            pose=self.new("geometry_msgs/PoseWithCovariance", pose=self.pose(*pose), covariance=none),
            twist=self.new("geometry_msgs/TwistWithCovariance", twist=twist, covariance=none),
        )

    def pose_stamped(self, t_ns: int, pose: Sequence[float]) -> Any:
        return self.new("geometry_msgs/PoseStamped", header=self.header(t_ns), pose=self.pose(*pose))

    def unsure(self, t_ns: int, pose: Sequence[float]) -> Any:
        covariance = np.zeros(36)
        covariance[[0, 7, 35]] = 0.04, 0.09, 0.01
        inner = self.new("geometry_msgs/PoseWithCovariance", pose=self.pose(*pose), covariance=covariance)
        return self.new("geometry_msgs/PoseWithCovarianceStamped", header=self.header(t_ns), pose=inner)

    def transforms(
        self, t_ns: int, parent: str, child: str, pose: Sequence[float], rotation: Any = None
    ) -> Any:
        x, y, heading = pose
        moved = self.new("geometry_msgs/Vector3", x=x, y=y, z=0.0)
        turned = rotation or self.turned(heading)
        transform = self.new("geometry_msgs/Transform", translation=moved, rotation=turned)
        one = self.new(
            "geometry_msgs/TransformStamped",
            header=self.header(t_ns, parent),
            child_frame_id=child,
            transform=transform,
        )
        return self.new("tf2_msgs/TFMessage", transforms=[one])

    def image(self, t_ns: int, data: np.ndarray, encoding: str, **more: Any) -> Any:
        """`data` (H, row bytes) uint8 as it lies in memory."""
        fields = {"width": data.shape[1], "step": data.shape[1], "is_bigendian": 0} | more
        return self.new(
            "sensor_msgs/Image",
            header=self.header(t_ns, "camera"),
            height=data.shape[0],
            encoding=encoding,
            data=data.reshape(-1),
            **fields,
        )

    def compressed(self, t_ns: int, image: np.ndarray, form: str = "png") -> Any:
        _, data = cv2.imencode(".png", image[..., ::-1])
        return self.new(
            "sensor_msgs/CompressedImage",
            header=self.header(t_ns, "camera"),
            format=form,
            data=data.reshape(-1),
        )

    def scan(self, t_ns: int, ranges: Sequence[float], **more: float) -> Any:
        """A scan whose beams go from the right to the left, in steps of a hundredth of half a turn."""
        usual = {"angle_min": -np.pi / 2, "angle_increment": np.pi / 100, "range_min": 0.1, "range_max": 8.0}
        fields = {"angle_max": np.pi / 2, "time_increment": 0.0, "scan_time": 0.1} | usual | more
        return self.new(
            "sensor_msgs/LaserScan",
            header=self.header(t_ns, "laser"),
            ranges=np.array(ranges, np.float32),
            intensities=np.zeros(0, np.float32),
            **fields,
        )

    def grid(self, percents: np.ndarray, cell_m: float = 0.05) -> Any:
        """A map (H, W) whose corner is at the origin."""
        stamp = self.header(BEGIN_NS).stamp
        shape = {"height": percents.shape[0], "width": percents.shape[1]}
        origin = self.pose(0.0, 0.0, 0.0)
        info = self.new(
            "nav_msgs/MapMetaData", map_load_time=stamp, resolution=cell_m, origin=origin, **shape
        )
        data = percents.reshape(-1).astype(np.int8)
        return self.new("nav_msgs/OccupancyGrid", header=self.header(BEGIN_NS), info=info, data=data)

    def pose_array(self, t_ns: int, poses: np.ndarray) -> Any:
        placed = [self.pose(*map(float, pose)) for pose in poses]
        return self.new("geometry_msgs/PoseArray", header=self.header(t_ns), poses=placed)

    def particles(self, t_ns: int, poses: np.ndarray, weights: np.ndarray) -> Any:
        parts = [
            self.new("nav2_msgs/Particle", pose=self.pose(*map(float, pose)), weight=float(weight))
            for pose, weight in zip(poses, weights, strict=True)
        ]
        return self.new("nav2_msgs/ParticleCloud", header=self.header(t_ns), particles=parts)


def picture(number: int) -> np.ndarray:
    """A picture (12, 16, 3) RGB, another one for every number."""
    return np.random.default_rng(number).integers(0, 256, (12, 16, 3), dtype=np.uint8)


def drive(ros: Ros, updates: int = 5) -> list[Said]:
    """A drive along +x: odometry at 10 Hz that slowly turns, truth, and a picture every 0.2 s."""
    said = []
    for number in range(2 * updates):
        t_ns = BEGIN_NS + number * 10**8
        late_ns = t_ns + 2 * 10**6  # recorded a little later than measured
        pose = (0.05 * number, 0.0, 0.01 * number)
        said.append(Said("/odom", "nav_msgs/Odometry", late_ns, ros.odometry(t_ns, pose)))
        true = (1.0 + 0.05 * number, 2.0, 0.5)
        said.append(Said("/ground_truth", "geometry_msgs/PoseStamped", late_ns, ros.pose_stamped(t_ns, true)))
        if number % 2 == 0:
            said.append(replace(seen(ros, t_ns, number // 2), log_ns=late_ns))
    return said


def write_ros1(path: Path, said: Sequence[Said], compression: str = "none") -> Path:
    """Write a ROS 1 bag."""
    store = Ros(1).store
    writer = Writer1(path)
    if compression != "none":
        writer.set_compression(Writer1.CompressionFormat[compression.upper()])
    with writer:
        known: dict[tuple[str, str], Any] = {}
        for one in said:
            kind = _long(one.type)
            key = (one.topic, kind)
            if key not in known:
                known[key] = writer.add_connection(one.topic, kind, typestore=store)
            writer.write(known[key], one.log_ns, store.serialize_ros1(one.message, kind))
    return path


def write_ros2(
    path: Path,
    said: Sequence[Said],
    *,
    storage: str = "sqlite3",
    compression: str | None = None,
    ros: Ros | None = None,
    version: Literal[8, 9] = 9,
) -> Path:
    """Write a ROS 2 bag, which is a folder; `compression`: message, file or (MCAP alone) storage."""
    store = (ros or Ros(2)).store
    writer = Writer2(path, version=version, storage_plugin=StoragePlugin[storage.upper()])
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        known: dict[str, Any] = {}
        for one in said:
            kind = _long(one.type)
            if one.topic not in known:
                known[one.topic] = writer.add_connection(one.topic, kind, typestore=store)
            writer.write(known[one.topic], one.log_ns, store.serialize_cdr(one.message, kind))
    return path


def _long(kind: str) -> str:
    return kind.replace("/", "/msg/")


def write_json_mcap(
    path: Path,
    said: Sequence[Said],
    *,
    chunks: int = 0,
    encoding: str = "json",
    schemas: Mapping[str, str] | None = None,
    schema_encoding: str = "jsonschema",
) -> Path:
    """Write a plain MCAP file of JSON messages, or bytes as they are: in chunks with an index, or without.

    `schemas` by type; with none all are empty.
    """
    described_as = schemas or {}
    topics = {one.topic: number for number, one in enumerate({s.topic: s for s in said}.values())}
    kinds = {s.topic: s.type for s in said}
    described = b"".join(
        _record(
            3,
            struct.pack("<H", number + 1)
            + b"".join(map(_text, (kinds[topic], schema_encoding, described_as.get(kinds[topic], "{}")))),
        )
        + _record(4, struct.pack("<HH", number, number + 1) + _text(topic) + _text(encoding) + _text(""))
        for topic, number in topics.items()
    )
    messages = [(one.log_ns, _message(topics[one.topic], one)) for one in said]
    out = b"\x89MCAP0\r\n" + _record(1, _text("") + _text("test"))
    if not chunks:
        out += described + b"".join(data for _, data in messages) + _record(15, bytes(4))
        path.write_bytes(out + _record(2, bytes(20)) + b"\x89MCAP0\r\n")
        return path
    index = b""
    for part in np.array_split(np.arange(len(messages)), chunks):
        times = [messages[i][0] for i in part]
        body = (described if not index else b"") + b"".join(messages[i][1] for i in part)
        span = struct.pack("<QQ", min(times), max(times))
        chunk = span + struct.pack("<QIIQ", len(body), zlib.crc32(body), 0, len(body)) + body
        where = span + struct.pack("<QQ", len(out), len(chunk) + 9) + struct.pack("<I", 0)
        index += _record(8, where + struct.pack("<QIQQ", 0, 0, len(body), len(body)))
        out += _record(6, chunk)
    out += _record(15, bytes(4))
    footer = struct.pack("<QQI", len(out), 0, 0)
    path.write_bytes(out + described + index + _record(2, footer) + b"\x89MCAP0\r\n")
    return path


def foxglove_drive(updates: int = 4) -> list[Said]:
    """The same kind of drive in Foxglove's JSON types, with transforms for odometry."""
    said = []
    for number in range(updates):
        t_ns = BEGIN_NS + number * 2 * 10**8
        stamp = {"sec": t_ns // 10**9, "nsec": t_ns % 10**9}
        _, data = cv2.imencode(".png", picture(number)[..., ::-1])
        image = {"timestamp": stamp, "format": "png", "data": base64.b64encode(data.tobytes()).decode()}
        turned = {"x": 0, "y": 0, "z": 0, "w": 1}
        link = {"timestamp": stamp, "parent_frame_id": "odom", "child_frame_id": "base_link"}
        link |= {"translation": {"x": 0.1 * number, "y": 0, "z": 0}, "rotation": turned}
        pose = {"position": {"x": 1 + 0.1 * number, "y": 2, "z": 0}, "orientation": turned}
        said.append(Said("/tf", "foxglove.FrameTransform", t_ns, link))
        true = {"timestamp": stamp, "frame_id": "map", "pose": pose}
        said.append(Said("/truth", "foxglove.PoseInFrame", t_ns, true))
        said.append(Said("/image", "foxglove.CompressedImage", t_ns, image))
    return said


def _message(channel: int, one: Said) -> bytes:
    head = struct.pack("<HIQQ", channel, 0, one.log_ns, one.log_ns)
    data = one.message if isinstance(one.message, bytes) else json.dumps(one.message).encode()
    return _record(5, head + data)


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text.encode())) + text.encode()


def _record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def link(ros: Ros, t_ns: int, parent: str, child: str, pose: Sequence[float], topic: str = "/tf") -> Said:
    """One transform, recorded when it was measured."""
    return Said(topic, "tf2_msgs/TFMessage", t_ns, ros.transforms(t_ns, parent, child, pose))


def seen(ros: Ros, t_ns: int, number: int = 0, topic: str = "/camera/image/compressed") -> Said:
    """A picture, recorded when it was taken."""
    return Said(topic, "sensor_msgs/CompressedImage", t_ns, ros.compressed(t_ns, picture(number)))


def amcl_drive(ros: Ros, updates: int = 4, *, weighted: bool = True) -> list[Said]:
    """A drive as `drive`, with a cloud that shrinks about the truth and AMCL's own pose just after it."""
    said = drive(ros, updates)
    random = np.random.default_rng(7)
    for number in range(updates):
        t_ns = BEGIN_NS + number * 2 * 10**8 + 10**7
        middle = np.array([1.0 + 0.1 * number, 2.0, 0.5])
        size = max(200 - 40 * number, 40)
        poses = middle + random.normal(0, 0.5 / (number + 1), (size, 3))
        if weighted:
            cloud = ros.particles(t_ns, poses, random.random(size))
            said.append(Said("/particle_cloud", "nav2_msgs/ParticleCloud", t_ns, cloud))
        else:
            said.append(Said("/particlecloud", "geometry_msgs/PoseArray", t_ns, ros.pose_array(t_ns, poses)))
        own = ros.unsure(t_ns, middle)
        said.append(Said("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", t_ns + 10**6, own))
    return sorted(said, key=lambda one: one.log_ns)


LASER_AT = (0.2, 0.05, 0.1)  # on the robot of `laser_drive`


def laser_drive(ros: Ros, scans: int = 5) -> list[Said]:
    """A drive along +x at 1 m/s: odometry at 10 Hz, and scans at 5 Hz. Ranges say when."""
    said = [
        link(ros, BEGIN_NS, "base_footprint", "base_link", (0.0, 0.0, 0.0), "/tf_static"),
        link(ros, BEGIN_NS, "base_link", "laser", LASER_AT, "/tf_static"),
    ]
    for number in range(2 * scans):
        t_ns = BEGIN_NS + number * 10**8
        said.append(Said("/odom", "nav_msgs/Odometry", t_ns, ros.odometry(t_ns, (0.1 * number, 0.0, 0.0))))
        if number % 2 == 0:
            ranges = np.full(101, 1.0 + 0.1 * number)
            said.append(Said("/scan", "sensor_msgs/LaserScan", t_ns + 10**6, ros.scan(t_ns, ranges)))
    return sorted(said, key=lambda one: one.log_ns)


def laser_amcl_drive(
    ros: Ros, *, weighted: bool = True, truth: bool = True, poses: bool = True, updates: int = 24
) -> list[Said]:
    """A robot with a laser that is carried off half way, and an AMCL that never notices; no pictures.

    In a room of 12 by 8 m; scans say by their ranges which update they belong to, and the map is in the bag.
    """
    random, said = (
        np.random.default_rng(3),
        [link(ros, BEGIN_NS, "base_link", "laser", LASER_AT, "/tf_static")],
    )
    percents = np.zeros((80, 120))
    percents[[0, -1]] = percents[:, [0, -1]] = 100
    said.append(Said("/map", "nav_msgs/OccupancyGrid", BEGIN_NS, ros.grid(percents, cell_m=0.1)))
    for number in range(updates):
        t_ns, way_m = BEGIN_NS + number * 5 * 10**8, 0.25 * number
        believed = (1.0 + way_m, 1.5, 0.0)
        true = believed if number < updates // 2 else (way_m, 6.0, 0.0)
        said.append(Said("/odom", "nav_msgs/Odometry", t_ns, ros.odometry(t_ns, (way_m, 0.0, 0.0))))
        ranges = np.full(101, 1.0 + 0.1 * number)
        said.append(Said("/scan", "sensor_msgs/LaserScan", t_ns + 10**6, ros.scan(t_ns, ranges)))
        if truth:
            said.append(
                Said("/ground_truth", "geometry_msgs/PoseStamped", t_ns, ros.pose_stamped(t_ns, true))
            )
        cloud, late_ns = np.array(believed) + random.normal(0, [0.1, 0.1, 0.03], (60, 3)), t_ns + 2 * 10**7
        if weighted:
            message = ros.particles(late_ns, cloud, np.full(60, 1 / 60))
            said.append(Said("/particle_cloud", "nav2_msgs/ParticleCloud", late_ns, message))
        else:
            message = ros.pose_array(late_ns, cloud)
            said.append(Said("/particlecloud", "geometry_msgs/PoseArray", late_ns, message))
        if poses:  # stamped as the scan that it is of
            own = ros.unsure(t_ns, believed)
            said.append(Said("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", late_ns + 10**6, own))
    return sorted(said, key=lambda one: one.log_ns)
