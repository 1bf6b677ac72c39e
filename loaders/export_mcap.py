"""MCAP files of ROS 2 messages, for Foxglove, RViz and Rerun; through rosbags (`maurice-replay[ros]`)."""

from __future__ import annotations

import math
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maurice_mcl.typing import F64, U8

from .errors import LogError
from .export_steps import ExportStep
from .recording import motion_between, moved
from .ros_extra import INSTALL
from .run_store_rows import weighted_of
from .whole_files import expect_absent

if TYPE_CHECKING:
    from .export_ros_messages import Messages

MAP, ODOM, ROBOT, CAMERA = "map", "odom", "base_link", "camera"  # frames
IMAGE, TRUTH, ODOMETRY, EVENTS, TF = "/camera/image/compressed", "/truth", "/odom", "/events", "/tf"
ESTIMATE, WITH_COVARIANCE = "/estimate", "/amcl_pose"  # the second named as AMCL does
POSES, CLOUD = "/particlecloud", "/particle_cloud"  # named as AMCL in ROS 1, and as Nav2 does
TYPES = {
    IMAGE: "sensor_msgs/msg/CompressedImage",
    TRUTH: "geometry_msgs/msg/PoseStamped",
    ODOMETRY: "nav_msgs/msg/Odometry",
    EVENTS: "std_msgs/msg/String",
    TF: "tf2_msgs/msg/TFMessage",
    ESTIMATE: "geometry_msgs/msg/PoseStamped",
    WITH_COVARIANCE: "geometry_msgs/msg/PoseWithCovarianceStamped",
    POSES: "geometry_msgs/msg/PoseArray",
    CLOUD: "nav2_msgs/msg/ParticleCloud",
}
LATEST_S = 2.0**31 - 1  # seconds of a ROS time stamp are an int32


class McapFile:
    """An MCAP file that is being written, a message at a time; topics are added by their first message."""

    def __init__(self, file: Path, writer: Any) -> None:
        from .export_ros_messages import message_types

        self._file, self._writer = file, writer
        self._store = message_types()
        self._connections: dict[str, Any] = {}

    def at(self, time_s: float) -> Messages:
        """Give what makes messages of one time. LogError when no ROS message can hold that time."""
        from .export_ros_messages import Messages

        return Messages(self._store, self._nanoseconds(time_s))

    def write(self, topic: str, time_s: float, message: bytes) -> None:
        """Write a message of one of `TYPES`."""
        if topic not in self._connections:
            kind = TYPES[topic]
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(self._connections[topic], self._nanoseconds(time_s), message)

    def _nanoseconds(self, time_s: float) -> int:
        if not 0 <= time_s <= LATEST_S:
            found = f"found t {time_s:.15g}, expected 0 to {LATEST_S:.0f} s in a ROS message"
            raise LogError(self._file, f"{found}; move it with --t-offset")
        return round(time_s * 1e9)


@contextmanager
def mcap_file(file: Path, *, force: bool = False) -> Iterator[McapFile]:
    """Open an MCAP file that appears when all went well.

    LogError when it exists and `force` is not given, when it cannot be written, or without rosbags.
    """
    if find_spec("rosbags") is None:
        raise LogError(file, f"writing MCAP needs an extra; {INSTALL}")
    if file.suffix != ".mcap":
        raise LogError(file, f"found a name without .mcap, expected one; use {file.name}.mcap")
    expect_absent(file, force=force)
    from rosbags.rosbag2 import StoragePlugin, Writer

    filling = file.with_name(f".{file.name}-{uuid.uuid4().hex}.part")
    bag = filling / file.stem  # rosbags names the file after its folder, and keeps that name in it
    try:
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            yield McapFile(file, writer)
        (bag / file.name).replace(file)
    except OSError as problem:
        reason = problem.strerror or problem
        raise LogError(file, f"cannot be written: {reason}; choose another place") from None
    finally:
        shutil.rmtree(filling, ignore_errors=True)


class RunSink:
    """Writes all that a saved run knows of an update."""

    def __init__(self, mcap: McapFile, origin: F64) -> None:
        self._mcap, self._origin = mcap, origin

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Write the messages of one update, all with its time."""
        make = self._mcap.at(step.time_s)
        self._put(step, ODOMETRY, make.odometry(ODOM, ROBOT, step.odometry))
        correction = moved(step.estimate, motion_between(step.odometry, np.zeros(3)))
        self._put(step, TF, make.transforms((MAP, ODOM, correction), (ODOM, ROBOT, step.odometry)))
        if image is not None:
            self._put(step, IMAGE, make.picture(CAMERA, image))
        if step.truth is not None:
            self._put(step, TRUTH, make.pose(MAP, step.truth))
        self._add_clouds(step, make)
        self._put(step, ESTIMATE, make.pose(MAP, step.estimate))
        covered = make.pose_with_covariance(MAP, step.estimate, covariance_of(step))
        self._put(step, WITH_COVARIANCE, covered)
        for text in (*step.rows.step["session_events"], *step.rows.step["events"]):
            self._put(step, EVENTS, make.text(text))

    def _add_clouds(self, step: ExportStep, make: Messages) -> None:
        """Write the weighted cloud with its weights, and the one that the next update starts from without."""
        weighted = weighted_of(step.rows, self._origin)
        poses, renewed = weighted.world_poses, step.rows.renewed
        self._put(step, CLOUD, make.particle_cloud(MAP, poses, weighted.weights))
        if renewed.height:
            poses = renewed.select("x_m", "y_m", "heading_rad").to_numpy().astype(np.float64)
            poses[:, :2] += self._origin
        self._put(step, POSES, make.pose_array(MAP, poses))

    def _put(self, step: ExportStep, topic: str, message: bytes) -> None:
        self._mcap.write(topic, step.time_s, message)


def covariance_of(step: ExportStep) -> F64:
    """Give the covariance (3, 3) of the estimate's x, y and heading: the spread of its particles.

    Only the variances are known. A heading of which nothing is known has a deviation of pi.
    """
    spread = [step.rows.step[f"estimate_{name}"] for name in ("sd_x_m", "sd_y_m", "heading_sd_rad")]
    spread[2] = min(spread[2], math.pi)
    return np.diag(np.square(np.array(spread, np.float64)))


@contextmanager
def mcap_sink(file: Path, origin: F64, *, force: bool = False) -> Iterator[RunSink]:
    """Open an MCAP file for a run whose clouds are relative to `origin` (2,). LogError as for `mcap_file`."""
    with mcap_file(file, force=force) as mcap:
        yield RunSink(mcap, origin)
