"""What an MCAP file of ours says once: header, map, the camera's place, and whole paths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from maurice_mcl.arena import Arena
from maurice_mcl.session import Camera, SessionInfo
from maurice_mcl.typing import F64, U8

from .export_mcap import CAMERA, CAMERA_INFO, GRID, IMAGE, MAP, MOUNT, ROBOT, McapFile
from .export_session import PictureKind, encode_picture
from .session_topics import HEADER

MOST_POSES = 5000  # of a path; a longer one is thinned


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is known before the first record."""

    info: SessionInfo | None  # None where the session is gone
    arena: Arena | None
    camera: Camera | None  # whose pictures are written; None where nothing is known of it

    def write(self, mcap: McapFile, begin_s: float) -> None:
        """Write header, map and the camera's place."""
        make = mcap.at(begin_s)
        if self.info is not None:
            mcap.write(HEADER, begin_s, make.header(self.info, mcap.folder))
        if self.arena is not None:
            mcap.write(GRID, begin_s, make.occupancy_grid(MAP, self.arena))
        mcap.write(MOUNT, begin_s, make.camera_mount(ROBOT, CAMERA, self.camera))

    def write_picture(self, mcap: McapFile, t_s: float, image: U8, kind: PictureKind) -> None:
        """Write a picture (H, W, 3), and the camera's geometry where its angle of view is known."""
        make = mcap.at(t_s)
        mcap.write(IMAGE, t_s, make.encoded_picture(CAMERA, kind, encode_picture(image, kind)))
        view_rad = None if self.camera is None else self.camera.horizontal_fov_rad
        if view_rad is not None:
            mcap.write(CAMERA_INFO, t_s, make.camera_info(CAMERA, image.shape, view_rad))


def scene_of(info: SessionInfo, camera: str | None = None) -> Scene:
    """Give the scene of a session, of which one camera's pictures are written: the first unless named."""
    named = [one for one in info.cameras if camera in (None, one.name)]
    return Scene(info, info.arena, named[0] if named else None)


@dataclass(slots=True)
class Thinned:
    """A path of at most `MOST_POSES`: every so many-th pose, twice as many apart each time it is full."""

    _poses: list[F64] = field(default_factory=list)
    _last: F64 | None = None
    _stride: int = 1
    _seen: int = 0

    def add(self, pose: F64) -> None:
        """Take in the next pose (3,)."""
        if self._seen % self._stride == 0:
            self._poses.append(pose)
        self._seen += 1
        self._last = pose
        if len(self._poses) >= MOST_POSES:
            self._poses = self._poses[::2]
            self._stride *= 2

    def poses(self) -> F64:
        """Give what is kept and the last pose, (N, 3)."""
        kept = self._poses
        if self._last is not None and kept[-1] is not self._last:
            kept = [*kept, self._last]
        return np.array(kept, np.float64).reshape(-1, 3)


def write_paths(mcap: McapFile, begin_s: float, paths: Mapping[str, Thinned]) -> None:
    """Write whole paths by topic, at the time of the first record: who looks there sees all of them."""
    for topic, path in paths.items():
        poses = path.poses()
        if len(poses):
            mcap.write(topic, begin_s, mcap.at(begin_s).path(MAP, poses))
