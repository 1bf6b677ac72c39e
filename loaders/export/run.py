"""A saved run as an MCAP file of ROS 2 messages."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.arrays import F64, U8
from maurice_mcl.geometry import compose, motion_between
from maurice_mcl.map import Arena
from maurice_mcl.session import Camera, SessionInfo

from ..bags.readers import HEADER, MOTIONS
from ..runs.rows import weighted_of
from ..transforms.simplified_path import SimplifiedPath
from .mcap import (
    CAMERA,
    CAMERA_INFO,
    CLOUD,
    ESTIMATE,
    ESTIMATED_PATH,
    EVENTS,
    GRID,
    IMAGE,
    MAP,
    MOUNT,
    ODOM,
    ODOMETRY,
    POSES,
    ROBOT,
    TF,
    TRUE_PATH,
    TRUTH,
    WITH_COVARIANCE,
    McapWriter,
    mcap_file,
)
from .session import PictureKind, encode_picture
from .tables import ExportStep

if TYPE_CHECKING:
    from .ros_messages import SceneMessages

# The constant content of an exported MCAP file: header, map, camera pose, and whole paths.

MOST_POSES = 5000  # of a path


@dataclass(frozen=True, slots=True, eq=False)
class McapScene:
    """The content that is known before the first record."""

    info: SessionInfo | None  # None where the session no longer exists
    arena: Arena | None
    camera: Camera | None  # whose pictures are written; None where it is unknown

    def write(self, mcap: McapWriter, begin_s: float) -> None:
        """Write header, map and camera pose."""
        make = mcap.at(begin_s)
        if self.info is not None:
            mcap.write(HEADER, begin_s, make.header(self.info, mcap.folder))
        if self.arena is not None:
            mcap.write(GRID, begin_s, make.occupancy_grid(MAP, self.arena))
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
    named = [one for one in info.cameras if camera in (None, one.name)]
    return McapScene(info, info.arena, named[0] if named else None)


def new_path() -> SimplifiedPath:
    """Return an empty path, to be written at the end."""
    return SimplifiedPath(MOST_POSES)


def write_paths(mcap: McapWriter, begin_s: float, paths: Mapping[str, SimplifiedPath]) -> None:
    """Write whole paths by topic at the time of the first record, so that they are visible from there."""
    for topic, way in paths.items():
        poses = way.poses()
        if len(poses):
            mcap.write(topic, begin_s, mcap.at(begin_s).path(MAP, poses))


# A saved run as an MCAP file of ROS 2 messages.


class RunSink:
    """Writes all content of a saved run's updates."""

    def __init__(self, mcap: McapWriter, origin: F64, scene: McapScene) -> None:
        self._mcap, self._origin, self._scene = mcap, origin, scene
        self._begin_s: float | None = None
        self._paths = {TRUE_PATH: new_path(), ESTIMATED_PATH: new_path()}

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Write the messages of one update, all with its time."""
        if self._begin_s is None:
            self._begin_s = step.time_s
            self._scene.write(self._mcap, step.time_s)
        make = self._mcap.at(step.time_s)
        for motion in step.rows.step["motions"]:
            self._put(step, MOTIONS, make.motion(ROBOT, np.array(motion, np.float64)))
        self._put(step, ODOMETRY, make.odometry(ODOM, ROBOT, step.odometry))
        correction = compose(step.estimate, motion_between(step.odometry, np.zeros(3)))
        self._put(step, TF, make.transforms((MAP, ODOM, correction), (ODOM, ROBOT, step.odometry)))
        if image is not None:
            self._scene.write_picture(self._mcap, step.time_s, image, "jpeg")
        self._add_poses(step, make)
        self._add_clouds(step, make)
        for text in (*step.rows.step["session_events"], *step.rows.step["events"]):
            self._put(step, EVENTS, make.text(text))

    def end(self) -> None:
        """Write what is known only at the end."""
        if self._begin_s is not None:
            write_paths(self._mcap, self._begin_s, self._paths)

    def _add_poses(self, step: ExportStep, make: SceneMessages) -> None:
        """Write truth and estimate, and add them to their paths."""
        if step.truth is not None:
            self._put(step, TRUTH, make.pose(MAP, step.truth))
            self._paths[TRUE_PATH].add(step.truth)
        self._put(step, ESTIMATE, make.pose(MAP, step.estimate))
        covered = make.pose_with_covariance(MAP, step.estimate, covariance_of(step))
        self._put(step, WITH_COVARIANCE, covered)
        self._paths[ESTIMATED_PATH].add(step.estimate)

    def _add_clouds(self, step: ExportStep, make: SceneMessages) -> None:
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
    """Return the covariance (3, 3) of the estimate's x, y and heading: the spread of its particles.

    Only the variances are known. An unknown heading has a deviation of pi.
    """
    spread = [step.rows.step[f"estimate_{name}"] for name in ("sd_x_m", "sd_y_m", "heading_sd_rad")]
    spread[2] = min(spread[2], math.pi)
    return np.diag(np.square(np.array(spread, np.float64)))


@contextmanager
def mcap_sink(file: Path, origin: F64, scene: McapScene, *, force: bool = False) -> Iterator[RunSink]:
    """Open an MCAP file for a run whose clouds are relative to `origin` (2,).

    InputError as for `mcap_file`.
    """
    with mcap_file(file, force=force) as mcap:
        sink = RunSink(mcap, origin, scene)
        yield sink
        sink.end()
