"""A library and a drive small enough to be made in memory in an instant: for examples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .sensor.descriptors.registry import CHANNELS
from .values import F64, U8, Arena, ChannelIndex, Frame, Library, Moment, SessionInfo, compose

ARENA = Arena((0.0, 0.0, 2.0, 1.5), np.array([[1.0, 0.0, 1.0, 0.5]]))
CHANNELS_USED = ("color", "edges", "chromaticity", "blurred", "tiny", "smoothed")


def tiny_library() -> Library:
    """Return a library of 96 references (L = 96): 12 places at half a meter, 8 headings at each.

    >>> import maurice_mcl as mcl
    >>> mcl.tiny_library().poses.shape
    (96, 3)
    """
    steps = np.meshgrid(np.arange(0.25, 2.0, 0.5), np.arange(0.25, 1.5, 0.5), np.arange(8) * np.pi / 4)
    poses = np.column_stack([axis.ravel() for axis in steps])
    pictures = [picture_at(pose) for pose in poses]
    index = {}
    for name in CHANNELS_USED:
        references = np.stack([CHANNELS[name].describe(picture) for picture in pictures])
        nothing = np.zeros(references.shape[1], np.float32)
        index[name] = ChannelIndex(references, nothing, references.max(axis=0))
    return Library("tiny", poses, (None,) * len(poses), index, ARENA)


@dataclass(frozen=True, slots=True, eq=False)
class _TinySession:
    info: SessionInfo
    all_moments: tuple[Moment, ...]

    def moments(self) -> Iterator[Moment]:
        """Yield from the first picture, on every call."""
        return iter(self.all_moments)


def tiny_session() -> _TinySession:
    """Return a drive of six pictures through `tiny_library`'s arena, with its true poses.

    Motions are in meters and radians; the pictures are drawn from the pose, so that examples need no file.

        >>> import maurice_mcl as mcl
        >>> len(list(mcl.tiny_session().moments()))
        6
    """
    start = np.array([0.4, 0.9, 0.2])
    pose, moments = start, []
    for step in range(1, 7):
        motion = np.array([0.15, 0.0, 0.1])
        pose = compose(pose, motion)
        moments.append(Moment(Frame(step, 2.0 * step, motion[None], picture_at(pose), ""), pose))
    return _TinySession(SessionInfo("tiny drive", start=start, arena=ARENA), tuple(moments))


def picture_at(pose: F64) -> U8:
    """Return a picture (24, 32, 3) RGB that is a smooth function of a pose (3,)."""
    columns = pose[2] + np.linspace(0.5, -0.5, 32)
    red = 120 + 90 * np.sin(columns + pose[0])
    green = 60 + 40 * pose[1] + 30 * np.cos(columns)
    blue = 110 + 60 * np.sin(2 * columns + pose[1])
    image = np.repeat(np.stack([red, green, blue], axis=1)[None], 24, axis=0)
    return np.asarray(np.clip(image, 0, 255), np.uint8)
