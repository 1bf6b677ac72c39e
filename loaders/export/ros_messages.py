"""ROS 2 messages, serialized: poses, clouds, pictures, map, camera, paths.

Headings become quaternions about z; everything lies in the plane z = 0. Needs rosbags
(`maurice-replay[ros]`), so it is imported only where messages are written.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from maurice_mcl.values import F64, Arena, Camera, LaserScan, OccupancyMap, SessionInfo

from ..bags.source import EXTRA_TYPES
from ..session_log.header import header_to_json

NO_TIME = QosTime(0, 0)
LATCHED = Qos(  # late subscribers receive the last message
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    NO_TIME,
    NO_TIME,
    QosLiveliness.SYSTEM_DEFAULT,
    NO_TIME,
    avoid_ros_namespace_conventions=False,
)
PLUMB_BOB = "plumb_bob"  # ROS's name of a pinhole camera, distorted or not
ENCAPSULATION = 4  # bytes in front of a CDR body; alignment is counted behind them


@cache
def message_types() -> Typestore:
    """Return the message types: those of ROS 2 Humble, and Nav2's weighted cloud."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in EXTRA_TYPES.items():
        store.register(get_types_from_msg(definition, name))
    return store


class Messages:
    """Makes the messages of one time; every method returns serialized bytes (CDR, little endian)."""

    def __init__(self, store: Typestore, nanoseconds: int) -> None:
        self._store = store
        self._ns = nanoseconds

    def pose(self, frame: str, pose: F64) -> bytes:
        """Return a geometry_msgs/PoseStamped of a pose (3,)."""
        return self._bytes("geometry_msgs/msg/PoseStamped", self._header(frame), self._pose(pose))

    def pose_with_covariance(self, frame: str, pose: F64, covariance: F64) -> bytes:
        """Return a geometry_msgs/PoseWithCovarianceStamped; `covariance` (3, 3) is of x, y, heading."""
        known = self._make("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), spread_out(covariance))
        return self._bytes("geometry_msgs/msg/PoseWithCovarianceStamped", self._header(frame), known)

    def odometry(self, frame: str, child: str, pose: F64) -> bytes:
        """Return a nav_msgs/Odometry of a pose (3,); covariances and speeds are unknown, and zero."""
        zero, nothing = np.zeros(36), self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        where = self._make("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), zero)
        still = self._make("geometry_msgs/msg/Twist", nothing, nothing)
        twist = self._make("geometry_msgs/msg/TwistWithCovariance", still, zero)
        return self._bytes("nav_msgs/msg/Odometry", self._header(frame), child, where, twist)

    def transforms(self, *links: tuple[str, str, F64]) -> bytes:
        """Return a tf2_msgs/TFMessage of links (parent frame, child frame, pose of the child (3,))."""
        transforms = []
        for parent, child, pose in links:
            offset = self._make("geometry_msgs/msg/Vector3", float(pose[0]), float(pose[1]), 0.0)
            transform = self._make("geometry_msgs/msg/Transform", offset, self._turn(float(pose[2])))
            header = self._header(parent)
            transforms.append(self._make("geometry_msgs/msg/TransformStamped", header, child, transform))
        return self._bytes("tf2_msgs/msg/TFMessage", transforms)

    def encoded_picture(self, frame: str, kind: str, data: bytes) -> bytes:
        """Return a sensor_msgs/CompressedImage of an encoded picture, `jpeg` or `png`."""
        values = np.frombuffer(data, np.uint8)
        return self._bytes("sensor_msgs/msg/CompressedImage", self._header(frame), kind, values)

    def scan(self, frame: str, scan: LaserScan) -> bytes:
        """Return a sensor_msgs/LaserScan; its ranges are exact, its angles of single precision."""
        last_rad = scan.start_rad + scan.step_rad * (scan.size - 1)
        angles, times = (scan.start_rad, last_rad, scan.step_rad), (0.0, 0.0)
        values = (*angles, *times, scan.min_m, scan.max_m, scan.ranges_m, np.zeros(0, np.float32))
        return self._bytes("sensor_msgs/msg/LaserScan", self._header(frame), *values)

    def text(self, text: str) -> bytes:
        """Return a std_msgs/String."""
        return self._bytes("std_msgs/msg/String", text)

    def pose_array(self, frame: str, poses: F64) -> bytes:
        """Return a geometry_msgs/PoseArray of poses (N, 3)."""
        empty = self._bytes("geometry_msgs/msg/PoseArray", self._header(frame), [])
        return with_items(empty, pose_rows(poses))

    def particle_cloud(self, frame: str, poses: F64, weights: F64) -> bytes:
        """Return a nav2_msgs/ParticleCloud of poses (N, 3) and weights (N,)."""
        empty = self._bytes("nav2_msgs/msg/ParticleCloud", self._header(frame), [])
        return with_items(empty, np.column_stack([pose_rows(poses), weights]))

    def header(self, info: SessionInfo, folder: Path) -> bytes:
        """Return a std_msgs/String with the first line of the session's log, as a log in `folder` has it."""
        return self.text(json.dumps(header_to_json(info, "session", folder), ensure_ascii=False))

    def readings(self, values: Mapping[str, float]) -> bytes:
        """Return a std_msgs/String with numbers by name as JSON, exactly: ROS has no message for them."""
        return self.text(json.dumps(dict(values), ensure_ascii=False))

    def motion(self, frame: str, motion: F64) -> bytes:
        """Return a geometry_msgs/Vector3Stamped: forward, left and turn of a motion (3,), exactly."""
        vector = self._make("geometry_msgs/msg/Vector3", *(float(v) for v in motion))
        return self._bytes("geometry_msgs/msg/Vector3Stamped", self._header(frame), vector)

    def path(self, frame: str, poses: F64) -> bytes:
        """Return a nav_msgs/Path of poses (N, 3), all stamped alike."""
        kind, header = "geometry_msgs/msg/PoseStamped", self._header(frame)
        stamped = [self._make(kind, header, self._pose(pose)) for pose in poses]
        return self._bytes("nav_msgs/msg/Path", header, stamped)

    def occupancy_grid(self, frame: str, corner: F64, cell_m: float, cells: NDArray[np.int8]) -> bytes:
        """Return a nav_msgs/OccupancyGrid of cells (H, W): percent, -1 where nobody has mapped."""
        origin = self._pose(np.array([*corner, 0.0]))
        header, (rows, columns) = self._header(frame), cells.shape
        about = self._make("nav_msgs/msg/MapMetaData", header.stamp, cell_m, columns, rows, origin)
        return self._bytes("nav_msgs/msg/OccupancyGrid", header, about, cells.ravel())

    def camera_mount(self, robot: str, frame: str, camera: Camera | None) -> bytes:
        """Return a TFMessage of the camera's pose (REP 103); an unknown one looks forward."""
        half = 0.0 if camera is None else camera.yaw_rad / 2
        cos, sin = math.cos(half) / 2, math.sin(half) / 2
        turn = (-cos - sin, cos - sin, sin - cos, cos + sin)
        height_m = 0.0 if camera is None or camera.height_m is None else camera.height_m
        transform = self._make(
            "geometry_msgs/msg/Transform",
            self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, height_m),
            self._make("geometry_msgs/msg/Quaternion", *turn),
        )
        kind = "geometry_msgs/msg/TransformStamped"
        return self._bytes(
            "tf2_msgs/msg/TFMessage", [self._make(kind, self._header(robot), frame, transform)]
        )

    def camera_info(self, frame: str, shape: tuple[int, ...], fov_rad: float) -> bytes:
        """Return a sensor_msgs/CameraInfo of pictures (H, W, 3): square pixels, no distortion."""
        height, width = shape[:2]
        focal, none = width / 2 / math.tan(fov_rad / 2), np.zeros((3, 1))
        matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
        region = self._make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        return self._bytes(
            "sensor_msgs/msg/CameraInfo",
            self._header(frame),
            *(height, width, PLUMB_BOB, np.zeros(5)),
            *(matrix.ravel(), np.eye(3).ravel(), np.hstack([matrix, none]).ravel()),
            *(0, 0, region),
        )

    def _header(self, frame: str) -> Any:
        seconds, nanoseconds = divmod(self._ns, 10**9)
        return self._make(
            "std_msgs/msg/Header", self._make("builtin_interfaces/msg/Time", seconds, nanoseconds), frame
        )

    def _pose(self, pose: F64) -> Any:
        place = self._make("geometry_msgs/msg/Point", float(pose[0]), float(pose[1]), 0.0)
        return self._make("geometry_msgs/msg/Pose", place, self._turn(float(pose[2])))

    def _turn(self, heading_rad: float) -> Any:
        half = heading_rad / 2
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))

    def _make(self, kind: str, *values: Any) -> Any:
        return self._store.types[kind](*values)

    def _bytes(self, kind: str, *values: Any) -> bytes:
        return bytes(self._store.serialize_cdr(self._make(kind, *values), kind))


def spread_out(covariance: F64) -> F64:
    """Return a covariance (3, 3) of x, y, heading as ROS's (36,) of x, y, z, roll, pitch, yaw, by rows."""
    full = np.zeros((6, 6))
    at = np.array([0, 1, 5])
    full[np.ix_(at, at)] = covariance
    return full.ravel()


def pose_rows(poses: F64) -> F64:
    """Return position and quaternion of poses (N, 3) as a geometry_msgs/Pose has them: (N, 7), w last."""
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = np.sin(poses[:, 2] / 2), np.cos(poses[:, 2] / 2)
    return rows


def with_items(message: bytes, items: F64) -> bytes:
    """Fill the empty sequence at a message's end with items (N, K), float64; objects would be slow."""
    head = message[:-4] + struct.pack("<I", len(items))
    pad = -(len(head) - ENCAPSULATION) % 8 if len(items) else 0
    return head + bytes(pad) + np.ascontiguousarray(items, "<f8").tobytes()


# A map as an occupancy grid.

CELL_M = 0.025
MOST_CELLS = 1_000_000  # a larger map has coarser cells
OCCUPIED = 100  # percent
SHIFT = 8  # fractional bits of the coordinates for OpenCV


def percents(occupancy: OccupancyMap) -> tuple[F64, float, NDArray[np.int8]]:
    """Return a map's corner (2,), a cell's side in meters, and the cells (H, W) as ROS has them."""
    values = np.array([0, OCCUPIED, -1], np.int8)  # of FREE, OCCUPIED, UNKNOWN
    return occupancy.corner, occupancy.cell_m, values[occupancy.cells]


def drawn(arena: Arena) -> tuple[F64, float, NDArray[np.int8]]:
    """Return the same of drawn walls and obstacles, smallest y first: all else is free."""
    width_m, depth_m = arena.size_m
    cell_m = max(CELL_M, math.sqrt(width_m * depth_m / MOST_CELLS))
    rows, columns = (max(1, math.ceil(side_m / cell_m - 1e-6)) for side_m in (depth_m, width_m))
    cells = np.zeros((rows, columns), np.uint8)
    for region in arena.obstacles:
        corners = _pixels(region.polygon, arena, cell_m)
        cv2.fillPoly(cells, [corners], OCCUPIED, lineType=cv2.LINE_8, shift=SHIFT)
    for wall in arena.walls:
        start, end = _pixels(wall.reshape(2, 2), arena, cell_m).tolist()
        cv2.line(cells, start, end, OCCUPIED, lineType=cv2.LINE_8, shift=SHIFT)
    return np.array(arena.bounds[:2]), cell_m, cells.astype(np.int8)


def _pixels(points: NDArray[np.float64], arena: Arena, cell_m: float) -> NDArray[np.int32]:
    """Return points (K, 2) in OpenCV's pixels, whose origin is the first cell's center."""
    counted = (points - arena.bounds[:2]) / cell_m - 0.5
    return np.asarray(np.round(counted * 2**SHIFT), np.int32)
