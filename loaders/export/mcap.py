"""MCAP files of ROS 2 messages, for Foxglove, RViz and Rerun; through rosbags (`maurice-replay[ros]`)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from maurice_mcl.values import F64, U8, Arena, Camera, LaserScan, OccupancyMap, SessionInfo, compose, inverse

from ..bags.readers import HEADER, MOTIONS, READINGS
from ..bags.source import INSTALL
from ..errors import InputError
from ..files.pictures import PictureKind, encode_picture
from ..files.writing import expect_absent, scratch_folder, writing
from ..reading.recording import SimplifiedPath
from ..runs.writer import weighted_of
from .tables import ExportStep

if TYPE_CHECKING:
    from .ros_messages import Messages

MAP, ODOM, ROBOT, CAMERA, LASER = "map", "odom", "base_link", "camera", "laser"  # frames
SCAN, IMAGE, CAMERA_INFO = "/scan", "/camera/image/compressed", "/camera/camera_info"
TRUTH, ODOMETRY, EVENTS = "/truth", "/odom", "/events"
GRID, TF, MOUNT = "/map", "/tf", "/tf_static"
TRUE_PATH, ESTIMATED_PATH = "/truth_path", "/estimate_path"
ESTIMATE, WITH_COVARIANCE = "/estimate", "/amcl_pose"  # the second named as AMCL does
POSES, CLOUD = "/particlecloud", "/particle_cloud"  # named as AMCL in ROS 1, and as Nav2 does
TYPES = {
    SCAN: "sensor_msgs/msg/LaserScan",
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
    READINGS: "std_msgs/msg/String",
    ESTIMATE: "geometry_msgs/msg/PoseStamped",
    WITH_COVARIANCE: "geometry_msgs/msg/PoseWithCovarianceStamped",
    POSES: "geometry_msgs/msg/PoseArray",
    CLOUD: "nav2_msgs/msg/ParticleCloud",
}
ONCE = (HEADER, GRID, MOUNT, TRUE_PATH, ESTIMATED_PATH)  # latched: late subscribers receive them too
MOST_POSES = 5000  # of a path
LATEST_S = 2.0**31 - 1  # seconds of a ROS time stamp are an int32


class McapWriter:
    """An MCAP file being written, a message at a time; topics are added by their first message."""

    def __init__(self, file: Path, writer: Any) -> None:
        from .ros_messages import message_types

        self._file, self._writer = file, writer
        self.folder = file.parent  # where the file will be
        self._store = message_types()
        self._connections: dict[str, Any] = {}

    def at(self, time_s: float) -> Messages:
        """Return the factory of messages of one time. InputError if no ROS message can hold that time."""
        from .ros_messages import Messages

        return Messages(self._store, self._nanoseconds(time_s))

    def write(self, topic: str, time_s: float, message: bytes) -> None:
        """Write a message of one of `TYPES`."""
        if topic not in self._connections:
            from .ros_messages import LATCHED

            offered = (LATCHED,) if topic in ONCE else ()
            self._connections[topic] = self._writer.add_connection(
                topic, TYPES[topic], typestore=self._store, offered_qos_profiles=offered
            )
        self._writer.write(self._connections[topic], self._nanoseconds(time_s), message)

    def write_path(self, topic: str, begin_s: float, path: SimplifiedPath) -> None:
        """Write a complete path at the time of the first record, so that it is visible from there."""
        if len(poses := path.poses()):
            self.write(topic, begin_s, self.at(begin_s).path(MAP, poses))

    def _nanoseconds(self, time_s: float) -> int:
        if not 0 <= time_s <= LATEST_S:
            fault = f"found t {time_s:.15g}, expected 0 to {LATEST_S:.0f} s in a ROS message"
            raise InputError(
                self._file, f"{fault}; move it with --reading picture_offset_s=... and the other offsets"
            )
        whole = int(time_s)  # separately, or Unix time would lose its last digits
        return whole * 10**9 + round((time_s - whole) * 1e9)


@contextmanager
def mcap_file(file: Path, *, force: bool = False) -> Iterator[McapWriter]:
    """Open an MCAP file that appears when all went well. InputError if it exists, or without rosbags."""
    if find_spec("rosbags") is None:
        raise InputError(file, f"writing MCAP needs an extra; {INSTALL}")
    if file.suffix != ".mcap":
        raise InputError(file, f"found a name without .mcap, expected one; use {file.name}.mcap")
    expect_absent(file, force=force)
    from rosbags.rosbag2 import StoragePlugin, Writer

    with scratch_folder(file) as folder, writing(file):
        bag = folder / file.stem  # rosbags names the file after its folder, and keeps that name in it
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            yield McapWriter(file, writer)
        (bag / file.name).replace(file)


# The constant content of an exported MCAP file: header, map, camera pose.


@dataclass(frozen=True, slots=True, eq=False)
class McapScene:
    """The content that is known before the first record."""

    info: SessionInfo | None  # None where the session no longer exists
    arena: Arena | None
    camera: Camera | None  # whose pictures are written; None where it is unknown
    occupancy: OccupancyMap | None = None  # of a robot with a laser: the map itself

    def write(self, mcap: McapWriter, begin_s: float) -> None:
        """Write header, map and camera pose."""
        from .ros_messages import drawn, percents

        make = mcap.at(begin_s)
        if self.info is not None:
            mcap.write(HEADER, begin_s, make.header(self.info, mcap.folder))
        if self.occupancy is not None:
            mcap.write(GRID, begin_s, make.occupancy_grid(MAP, *percents(self.occupancy)))
        elif self.arena is not None:
            mcap.write(GRID, begin_s, make.occupancy_grid(MAP, *drawn(self.arena)))
        mcap.write(MOUNT, begin_s, make.camera_mount(ROBOT, CAMERA, self.camera))

    def write_picture(self, mcap: McapWriter, t_s: float, image: U8, kind: PictureKind) -> None:
        """Write a picture (H, W, 3), and the camera's geometry where its angle of view is known."""
        make = mcap.at(t_s)
        mcap.write(IMAGE, t_s, make.encoded_picture(CAMERA, kind, encode_picture(image, kind)))
        view_rad = None if self.camera is None else self.camera.horizontal_fov_rad
        if view_rad is not None and view_rad < math.pi:  # a wider lens is no pinhole
            mcap.write(CAMERA_INFO, t_s, make.camera_info(CAMERA, image.shape, view_rad))


def scene_of(info: SessionInfo, camera: str | None = None) -> McapScene:
    """Return the scene of a session with the camera whose pictures are written: the first unless named."""
    named = [camera_of for camera_of in info.cameras if camera in (None, camera_of.name)]
    return McapScene(info, info.arena, named[0] if named else None)


class ScanTopic:
    """Writes scans, and where the laser is on the robot whenever that changes."""

    def __init__(self, mcap: McapWriter) -> None:
        self._mcap = mcap
        self._laser: F64 | None = None  # its pose (3,) as it was written last

    def write(self, t_s: float, scan: LaserScan) -> None:
        """Write a scan and its mount."""
        make = self._mcap.at(t_s)
        if self._laser is None or not np.array_equal(self._laser, scan.mount):
            self._laser = scan.mount
            self._mcap.write(MOUNT, t_s, make.transforms((ROBOT, LASER, scan.mount)))
        self._mcap.write(SCAN, t_s, make.scan(LASER, scan))


# A saved run as an MCAP file of ROS 2 messages.


class RunSink:
    """Writes all content of a saved run's updates."""

    def __init__(self, mcap: McapWriter, origin: F64, scene: McapScene) -> None:
        self._mcap, self._origin, self._scene = mcap, origin, scene
        self._begin_s: float | None = None
        self._scans = ScanTopic(mcap)
        self._paths = {topic: SimplifiedPath(MOST_POSES) for topic in (TRUE_PATH, ESTIMATED_PATH)}

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Write the messages of one update, all with its time."""
        if self._begin_s is None:
            self._begin_s = step.time_s
            self._scene.write(self._mcap, step.time_s)
        make = self._mcap.at(step.time_s)
        for motion in step.rows.step["motions"]:
            self._put(step, MOTIONS, make.motion(ROBOT, np.array(motion, np.float64)))
        self._put(step, ODOMETRY, make.odometry(ODOM, ROBOT, step.odometry))
        correction = compose(step.estimate, inverse(step.odometry))
        self._put(step, TF, make.transforms((MAP, ODOM, correction), (ODOM, ROBOT, step.odometry)))
        if image is not None:
            self._scene.write_picture(self._mcap, step.time_s, image, "jpeg")
        if step.scan is not None:
            self._scans.write(step.time_s, step.scan)
        self._add_poses(step, make)
        self._add_clouds(step, make)
        if step.readings:
            self._put(step, READINGS, make.readings(step.readings))
        for text in (*step.rows.step["session_events"], *step.rows.step["events"]):
            self._put(step, EVENTS, make.text(text))

    def end(self) -> None:
        """Write what is known only at the end."""
        if self._begin_s is not None:
            for topic, path in self._paths.items():
                self._mcap.write_path(topic, self._begin_s, path)

    def _add_poses(self, step: ExportStep, make: Messages) -> None:
        if step.truth is not None:
            self._put(step, TRUTH, make.pose(MAP, step.truth))
            self._paths[TRUE_PATH].add(step.truth)
        self._put(step, ESTIMATE, make.pose(MAP, step.estimate))
        covered = make.pose_with_covariance(MAP, step.estimate, covariance_of(step))
        self._put(step, WITH_COVARIANCE, covered)
        self._paths[ESTIMATED_PATH].add(step.estimate)

    def _add_clouds(self, step: ExportStep, make: Messages) -> None:
        """Write the weighted cloud, and the resampled one that the next update starts from."""
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
    """Return the covariance (3, 3) of x, y, heading: its variances; an unknown heading has sd pi."""
    spread = [step.rows.step[f"estimate_{name}"] for name in ("sd_x_m", "sd_y_m", "heading_sd_rad")]
    spread[2] = min(spread[2], math.pi)
    return np.diag(np.square(np.array(spread, np.float64)))


@contextmanager
def mcap_sink(file: Path, origin: F64, scene: McapScene, *, force: bool = False) -> Iterator[RunSink]:
    """Open an MCAP file for a run whose clouds are relative to `origin` (2,). InputError as `mcap_file`."""
    with mcap_file(file, force=force) as mcap:
        sink = RunSink(mcap, origin, scene)
        yield sink
        sink.end()
