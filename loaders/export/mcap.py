"""MCAP files of ROS 2 messages, for Foxglove, RViz and Rerun; through rosbags (`maurice-replay[ros]`)."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..bags.readers import HEADER, MOTIONS
from ..bags.source import INSTALL
from ..errors import InputError
from ..io.files import expect_absent

if TYPE_CHECKING:
    from .ros_messages import SceneMessages

MAP, ODOM, ROBOT, CAMERA = "map", "odom", "base_link", "camera"  # frames
IMAGE, CAMERA_INFO = "/camera/image/compressed", "/camera/camera_info"
TRUTH, ODOMETRY, EVENTS = "/truth", "/odom", "/events"
GRID, TF, MOUNT = "/map", "/tf", "/tf_static"
TRUE_PATH, ESTIMATED_PATH = "/truth_path", "/estimate_path"
ESTIMATE, WITH_COVARIANCE = "/estimate", "/amcl_pose"  # the second named as AMCL does
POSES, CLOUD = "/particlecloud", "/particle_cloud"  # named as AMCL in ROS 1, and as Nav2 does
TYPES = {
    IMAGE: "sensor_msgs/msg/CompressedImage",
    TRUTH: "geometry_msgs/msg/PoseStamped",
    ODOMETRY: "nav_msgs/msg/Odometry",
    EVENTS: "std_msgs/msg/String",
    TF: "tf2_msgs/msg/TFMessage",
    MOUNT: "tf2_msgs/msg/TFMessage",
    GRID: "nav_msgs/msg/OccupancyGrid",
    CAMERA_INFO: "sensor_msgs/msg/CameraInfo",
    TRUE_PATH: "nav_msgs/msg/Path",
    ESTIMATED_PATH: "nav_msgs/msg/Path",
    HEADER: "std_msgs/msg/String",
    MOTIONS: "geometry_msgs/msg/Vector3Stamped",
    ESTIMATE: "geometry_msgs/msg/PoseStamped",
    WITH_COVARIANCE: "geometry_msgs/msg/PoseWithCovarianceStamped",
    POSES: "geometry_msgs/msg/PoseArray",
    CLOUD: "nav2_msgs/msg/ParticleCloud",
}
ONCE = (HEADER, GRID, MOUNT, TRUE_PATH, ESTIMATED_PATH)  # latched: late subscribers receive them too
LATEST_S = 2.0**31 - 1  # seconds of a ROS time stamp are an int32


class McapWriter:
    """An MCAP file being written, a message at a time; topics are added by their first message."""

    def __init__(self, file: Path, writer: Any) -> None:
        from .ros_messages import message_types

        self._file, self._writer = file, writer
        self.folder = file.parent  # where the file will be
        self._store = message_types()
        self._connections: dict[str, Any] = {}

    def at(self, time_s: float) -> SceneMessages:
        """Return the factory of messages of one time. InputError when no ROS message can hold that time."""
        from .ros_messages import SceneMessages

        return SceneMessages(self._store, self._nanoseconds(time_s))

    def write(self, topic: str, time_s: float, message: bytes) -> None:
        """Write a message of one of `TYPES`."""
        if topic not in self._connections:
            from .ros_messages import LATCHED

            offered = (LATCHED,) if topic in ONCE else ()
            self._connections[topic] = self._writer.add_connection(
                topic, TYPES[topic], typestore=self._store, offered_qos_profiles=offered
            )
        self._writer.write(self._connections[topic], self._nanoseconds(time_s), message)

    def _nanoseconds(self, time_s: float) -> int:
        if not 0 <= time_s <= LATEST_S:
            found = f"found t {time_s:.15g}, expected 0 to {LATEST_S:.0f} s in a ROS message"
            raise InputError(self._file, f"{found}; move it with --t-offset")
        whole = int(time_s)  # separately, or Unix time would lose its last digits
        return whole * 10**9 + round((time_s - whole) * 1e9)


@contextmanager
def mcap_file(file: Path, *, force: bool = False) -> Iterator[McapWriter]:
    """Open an MCAP file that appears when all went well.

    InputError when it exists and `force` is not given, when it cannot be written, or without rosbags.
    """
    if find_spec("rosbags") is None:
        raise InputError(file, f"writing MCAP needs an extra; {INSTALL}")
    if file.suffix != ".mcap":
        raise InputError(file, f"found a name without .mcap, expected one; use {file.name}.mcap")
    expect_absent(file, force=force)
    from rosbags.rosbag2 import StoragePlugin, Writer

    filling = file.with_name(f".{file.name}-{uuid.uuid4().hex}.part")
    bag = filling / file.stem  # rosbags names the file after its folder, and keeps that name in it
    try:
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            yield McapWriter(file, writer)
        (bag / file.name).replace(file)
    except OSError as problem:
        reason = problem.strerror or problem
        raise InputError(file, f"cannot be written: {reason}; choose another place") from None
    finally:
        shutil.rmtree(filling, ignore_errors=True)
