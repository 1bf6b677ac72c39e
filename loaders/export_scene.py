"""What an MCAP file of ours says once: header, map, the camera's place, and whole paths."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from maurice_mcl.arena import Arena
from maurice_mcl.session import Camera, SessionInfo
from maurice_mcl.typing import U8

from .export_mcap import CAMERA, CAMERA_INFO, GRID, IMAGE, MAP, MOUNT, ROBOT, McapFile
from .export_session import PictureKind, encode_picture
from .session_topics import HEADER
from .thinned_path import ThinnedPath

MOST_POSES = 5000  # of a path


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
        if view_rad is not None and view_rad < math.pi:  # a wider lens is no pinhole
            mcap.write(CAMERA_INFO, t_s, make.camera_info(CAMERA, image.shape, view_rad))


def scene_of(info: SessionInfo, camera: str | None = None) -> Scene:
    """Give the scene of a session, of which one camera's pictures are written: the first unless named."""
    named = [one for one in info.cameras if camera in (None, one.name)]
    return Scene(info, info.arena, named[0] if named else None)


def new_path() -> ThinnedPath:
    """Begin a path that is written whole at the end."""
    return ThinnedPath(MOST_POSES)


def write_paths(mcap: McapFile, begin_s: float, paths: Mapping[str, ThinnedPath]) -> None:
    """Write whole paths by topic, at the time of the first record: who looks there sees all of them."""
    for topic, way in paths.items():
        poses = way.poses()
        if len(poses):
            mcap.write(topic, begin_s, mcap.at(begin_s).path(MAP, poses))
