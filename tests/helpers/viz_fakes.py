"""A small world whose pictures are a formula of the pose: quick to make, and the real filter works in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from maurice_mcl.config.build import build_localizer
from maurice_mcl.config.parameters import of_feature
from maurice_mcl.filter.localizer import run
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.geometry import INCH_M, compose
from maurice_mcl.values.library import ChannelIndex, Library
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Frame, Moment, SessionInfo

SPACING_M = 18 * INCH_M


def box(name: str, x: float, y: float, width: float, depth: float) -> Region:
    corners = np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]])
    return Region(name, corners * INCH_M)


def arena(columns: int, rows: int) -> Arena:
    width, depth = 18.0 * columns, 18.0 * rows
    corners = [(0, 0), (width, 0), (width, depth), (0, depth)]
    walls = np.array([[*a, *b] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])
    return Arena(
        bounds=(0.0, 0.0, width * INCH_M, depth * INCH_M),
        walls=walls * INCH_M,
        obstacles=(box("table", 0.1 * width, 0.75 * depth, 0.2 * width, 0.2 * depth),),
        floors=(box("wood", 0, 0, width, depth), box("carpet", width / 2, 0, width / 2, depth)),
        rooms=(box("west room", 0, 0, width / 2, depth), box("east room", width / 2, 0, width / 2, depth)),
    )


def picture_at(pose: F64, height: int = 36, width: int = 44) -> U8:
    """Colors follow position and heading, stripes follow x: both channels have something to go by."""
    columns = pose[2] + np.linspace(0.5, -0.5, width)
    red = 120 + 90 * np.sin(columns + pose[0])
    green = 60 + 35 * pose[1] + 30 * np.cos(columns)
    blue = 110 + 60 * np.sin(2 * columns + pose[1])
    image = np.repeat(np.stack([red, green, blue], axis=1)[None], height, axis=0)
    image[:, :: 3 + int(2 * abs(pose[0]))] *= 0.6
    return np.clip(image, 0, 255).astype(np.uint8)


def reference_poses(columns: int, rows: int, headings: int = 8) -> F64:
    xs, ys = (np.arange(n) * SPACING_M + SPACING_M / 2 for n in (columns, rows))
    turns = -np.arange(headings) * 2 * np.pi / headings
    return np.array([(x, y, (t + np.pi) % (2 * np.pi) - np.pi) for y in ys for x in xs for t in turns])


def index_of(images: list[U8], channel: str) -> ChannelIndex:
    references = np.stack([CHANNELS[channel].describe(image) for image in images])
    return ChannelIndex(references, np.zeros(references.shape[1], np.float32), references.max(axis=0))


def make_library(
    folder: Path | None = None, columns: int = 5, rows: int = 4, headings: int = 8, units: str = "in"
) -> Library:
    poses = reference_poses(columns, rows, headings)
    images = [picture_at(pose) for pose in poses]
    paths: list[Path | None] = [None] * len(poses)
    if folder is not None:
        paths = [folder / f"{number:04}.jpg" for number in range(len(poses))]
        for path, image in zip(paths, images, strict=True):
            cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    index = {name: index_of(images, name) for name in ("color", "edges")}
    return Library("fake", poses, tuple(paths), index, arena(columns, rows), units)


@dataclass(frozen=True, slots=True, eq=False)
class FakeSession:
    """A drive round the middle, off the grid and off its headings."""

    info: SessionInfo
    library: Library
    steps: int
    has_truth: bool = True

    def moments(self) -> Iterator[Moment]:
        x_min, y_min, x_max, y_max = self.library.arena.bounds
        pose = np.array([(x_min + x_max) * 0.4, (y_min + y_max) * 0.3, 0.2])
        for step in range(1, self.steps + 1):
            motions = np.array([[0.0, 0.0, 0.35], [0.12, 0.0, 0.0]])
            for motion in motions:
                pose = compose(pose, motion)
            frame = Frame(step, step * 2.5, motions, picture_at(pose), f"{step}.jpg")
            events = ("kidnapped",) if step == 3 else ()
            yield Moment(frame, pose if self.has_truth else None, events)


def make_session(library: Library, steps: int = 6, has_truth: bool = True, name: str = "fake") -> FakeSession:
    info = SessionInfo(name, library.display_units, arena=library.arena)
    return FakeSession(info, library, steps, has_truth)


def play(
    session: FakeSession, feature: str = "blended", particles: int = 200, seed: int = 0
) -> list[tuple[Moment, StepRecord]]:
    localizer = build_localizer(session.library, session, of_feature(feature, particles), seed=seed)
    return list(run(localizer, session, None))


def changed(record: Any, **changes: Any) -> Any:
    """Give a frozen value with some fields changed."""
    return replace(record, **changes)
