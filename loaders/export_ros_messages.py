"""ROS 2 messages, serialized, from poses, clouds and pictures.

Headings become quaternions about z; everything lies in the plane z = 0. Needs rosbags
(`maurice-replay[ros]`), so it is imported only where messages are written.
"""

from __future__ import annotations

import math
import struct
from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from maurice_mcl.typing import F64, U8

from .pictures import encode_jpeg

PARTICLE = "geometry_msgs/Pose pose\nfloat64 weight\n"
PARTICLE_CLOUD = "std_msgs/Header header\nnav2_msgs/Particle[] particles\n"
ENCAPSULATION = 4  # bytes in front of a CDR body; alignment is counted behind them
LATEST_S = 2**31 - 1  # seconds of a stamp are an int32
Stamp = tuple[int, int]  # seconds, nanoseconds


@cache
def message_types() -> Typestore:
    """Give the types that are written: those of ROS 2 Humble, and Nav2's weighted cloud."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(PARTICLE, "nav2_msgs/msg/Particle"))
    store.register(get_types_from_msg(PARTICLE_CLOUD, "nav2_msgs/msg/ParticleCloud"))
    return store


class Messages:
    """Makes the messages of one time; every method gives serialized bytes (CDR, little endian)."""

    def __init__(self, store: Typestore, nanoseconds: int) -> None:
        self._store = store
        self._ns = nanoseconds

    def pose(self, frame: str, pose: F64) -> bytes:
        """Give a geometry_msgs/PoseStamped of a pose (3,)."""
        return self._bytes("geometry_msgs/msg/PoseStamped", self._header(frame), self._pose(pose))

    def pose_with_covariance(self, frame: str, pose: F64, covariance: F64) -> bytes:
        """Give a geometry_msgs/PoseWithCovarianceStamped; `covariance` (3, 3) is of x, y, heading."""
        known = self._make("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), spread_out(covariance))
        return self._bytes("geometry_msgs/msg/PoseWithCovarianceStamped", self._header(frame), known)

    def odometry(self, frame: str, child: str, pose: F64) -> bytes:
        """Give a nav_msgs/Odometry of a pose (3,); covariances and speeds are not known, and zero."""
        zero, nothing = np.zeros(36), self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        where = self._make("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), zero)
        still = self._make("geometry_msgs/msg/Twist", nothing, nothing)
        twist = self._make("geometry_msgs/msg/TwistWithCovariance", still, zero)
        return self._bytes("nav_msgs/msg/Odometry", self._header(frame), child, where, twist)

    def transforms(self, *links: tuple[str, str, F64]) -> bytes:
        """Give a tf2_msgs/TFMessage of links (parent frame, child frame, pose of the child (3,))."""
        made = []
        for parent, child, pose in links:
            offset = self._make("geometry_msgs/msg/Vector3", float(pose[0]), float(pose[1]), 0.0)
            transform = self._make("geometry_msgs/msg/Transform", offset, self._turn(float(pose[2])))
            header = self._header(parent)
            made.append(self._make("geometry_msgs/msg/TransformStamped", header, child, transform))
        return self._bytes("tf2_msgs/msg/TFMessage", made)

    def picture(self, frame: str, image: U8) -> bytes:
        """Give a sensor_msgs/CompressedImage of an RGB picture (H, W, 3): JPEG, quality 95, 4:4:4."""
        return self.encoded_picture(frame, "jpeg", encode_jpeg(image))

    def encoded_picture(self, frame: str, kind: str, data: bytes) -> bytes:
        """Give a sensor_msgs/CompressedImage of what is encoded already, as `jpeg` or `png`."""
        held = np.frombuffer(data, np.uint8)
        return self._bytes("sensor_msgs/msg/CompressedImage", self._header(frame), kind, held)

    def text(self, text: str) -> bytes:
        """Give a std_msgs/String."""
        return self._bytes("std_msgs/msg/String", text)

    def pose_array(self, frame: str, poses: F64) -> bytes:
        """Give a geometry_msgs/PoseArray of poses (N, 3)."""
        empty = self._bytes("geometry_msgs/msg/PoseArray", self._header(frame), [])
        return with_items(empty, pose_rows(poses))

    def particle_cloud(self, frame: str, poses: F64, weights: F64) -> bytes:
        """Give a nav2_msgs/ParticleCloud of poses (N, 3) and weights (N,)."""
        empty = self._bytes("nav2_msgs/msg/ParticleCloud", self._header(frame), [])
        return with_items(empty, np.column_stack([pose_rows(poses), weights]))

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
    """Put a covariance (3, 3) of x, y, heading into ROS's (36,) of x, y, z, roll, pitch, yaw, row by row."""
    full = np.zeros((6, 6))
    at = np.array([0, 1, 5])
    full[np.ix_(at, at)] = covariance
    return full.ravel()


def pose_rows(poses: F64) -> F64:
    """Give position and quaternion of poses (N, 3) as a geometry_msgs/Pose has them: (N, 7), w last."""
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = np.sin(poses[:, 2] / 2), np.cos(poses[:, 2] / 2)
    return rows


def with_items(message: bytes, items: F64) -> bytes:
    """Fill the empty sequence that a serialized message ends with; items (N, K) are K float64 each.

    Thousands of particles as objects, one by one, would take longer than the filter.
    """
    head = message[:-4] + struct.pack("<I", len(items))
    pad = -(len(head) - ENCAPSULATION) % 8 if len(items) else 0
    return head + bytes(pad) + np.ascontiguousarray(items, "<f8").tobytes()
