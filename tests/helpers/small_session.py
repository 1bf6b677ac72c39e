"""A small session and survey on disk, quick to make, whose pictures are a formula of the pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.session import SessionInfo

COLUMNS, ROWS, HEADINGS, SPACING_M = 5, 4, 8, 0.5
UPDATES = 14


def small_arena() -> Arena:
    width, depth = COLUMNS * SPACING_M, ROWS * SPACING_M
    corners = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]
    walls = np.array([[*a, *b] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])
    floor = Region("wood", np.array(corners))
    return Arena((0.0, 0.0, width, depth), walls, floors=(floor,))


def picture_at(pose: F64, height: int = 30, width: int = 40) -> U8:
    columns = pose[2] + np.linspace(0.5, -0.5, width)
    red = 120 + 90 * np.sin(columns + pose[0])
    green = 60 + 40 * pose[1] + 30 * np.cos(columns)
    blue = 110 + 60 * np.sin(2 * columns + pose[1])
    image = np.repeat(np.stack([red, green, blue], axis=1)[None], height, axis=0)
    image[:, :: 3 + int(2 * abs(pose[0]))] *= 0.6
    return np.clip(image, 0, 255).astype(np.uint8)


def write_small_survey(folder: Path) -> Path:
    path = folder / "survey.log"
    with SessionWriter(path, SessionInfo("kleiner Raum", "m", arena=small_arena()), "survey") as log:
        log.image(0.0, np.full((30, 40, 3), 18, np.uint8), covered=True)
        poses = [
            np.array([(i + 0.5) * SPACING_M, (j + 0.5) * SPACING_M, k * 2 * np.pi / HEADINGS])
            for j in range(ROWS)
            for i in range(COLUMNS)
            for k in range(HEADINGS)
        ]
        for t, pose in enumerate(poses, start=1):
            log.image(float(t), picture_at(pose), pose=pose)
    return path


def write_small_session(
    folder: Path, *, truth: bool = True, updates: int = UPDATES, carried_at: int | None = None
) -> Path:
    """A drive on a circle; its odometry is exact, so that the generic motion model serves well.

    Before the update `carried_at`, counted from 0, the robot is carried away.
    """
    path = folder / "session.log"
    pose = np.array([1.6, 0.6, 0.3])
    info = SessionInfo("kleine Fahrt", "m", start=pose, survey=folder / "survey.log", arena=small_arena())
    with SessionWriter(path, info) as log:
        for step in range(updates):
            motion = np.array([0.12, 0.0, 0.21])
            pose = compose(pose, motion)
            log.odometry(2.0 * step + 1, motion)
            if step == carried_at:
                pose = np.array([0.5, 1.5, -2.0])
                log.event(2.0 * step + 1, "kidnapped")
            log.image(2.0 * step + 2, picture_at(pose))
            if truth:
                log.truth(2.0 * step + 2, pose)
    return path
