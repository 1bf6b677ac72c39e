"""ROS 2 messages of what stands still or is told once: map, camera, paths, and the session's header."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from maurice_mcl.arena import Arena
from maurice_mcl.session import Camera, SessionInfo
from maurice_mcl.typing import F64

from .export_map import occupancy
from .export_ros_messages import Messages
from .header import header_to_json

NO_TIME = QosTime(0, 0)
LATCHED = Qos(  # who comes late is given the last message
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


class SceneMessages(Messages):
    """Makes the messages that `Messages` does, and those of the scene."""

    def header(self, info: SessionInfo, folder: Path) -> bytes:
        """Give a std_msgs/String with the first line of the session's log, as a log in `folder` has it."""
        return self.text(json.dumps(header_to_json(info, "session", folder), ensure_ascii=False))

    def motion(self, frame: str, motion: F64) -> bytes:
        """Give a geometry_msgs/Vector3Stamped: forward, left and turn of one motion (3,), to the last bit."""
        vector = self._make("geometry_msgs/msg/Vector3", *(float(v) for v in motion))
        return self._bytes("geometry_msgs/msg/Vector3Stamped", self._header(frame), vector)

    def path(self, frame: str, poses: F64) -> bytes:
        """Give a nav_msgs/Path of poses (N, 3), all stamped alike."""
        kind, header = "geometry_msgs/msg/PoseStamped", self._header(frame)
        stamped = [self._make(kind, header, self._pose(pose)) for pose in poses]
        return self._bytes("nav_msgs/msg/Path", header, stamped)

    def occupancy_grid(self, frame: str, arena: Arena) -> bytes:
        """Give a nav_msgs/OccupancyGrid: walls and obstacles are occupied, all else is free."""
        cell_m, cells = occupancy(arena)
        origin = self._pose(np.array([*arena.bounds[:2], 0.0]))
        header, (rows, columns) = self._header(frame), cells.shape
        about = self._make("nav_msgs/msg/MapMetaData", header.stamp, cell_m, columns, rows, origin)
        return self._bytes("nav_msgs/msg/OccupancyGrid", header, about, cells.ravel())

    def camera_mount(self, robot: str, frame: str, camera: Camera | None) -> bytes:
        """Give a tf2_msgs/TFMessage of where the camera is: z along the view, y down (REP 103).

        A camera of which nothing is known looks forward, at the floor's height.
        """
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
        """Give a sensor_msgs/CameraInfo of pictures (H, W, 3): square pixels, no distortion."""
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
