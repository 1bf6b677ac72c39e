"""How many pictures and poses are used: pictures after enough movement, gray ones without a camera, paths."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from maurice_mcl.arrays import F64, U8
from maurice_mcl.geometry import compose_motions, motion_between

from ..errors import ReadingNotes
from ..recording import Motion, Note, OdometryPose, Picture, Record, RecordingWrapper, TruthPose

# Which pictures make an update: those after enough movement (AMCL's update_min_d and update_min_a).


@dataclass(frozen=True, slots=True)
class Gate:
    """How far a robot goes before a picture is used. Nothing asked for: every picture is."""

    min_distance_m: float = 0.0  # as the crow flies since the last picture that was used
    min_angle_rad: float = 0.0  # turned since the last picture that was used

    def open_after(self, motion: F64) -> bool:
        """Return whether a motion (3,) since the last update makes one: far enough, or turned enough.

        All motions in between have been composed into one.
        """
        asked = (self.min_distance_m > 0, self.min_angle_rad > 0)
        far = asked[0] and math.hypot(motion[0], motion[1]) >= self.min_distance_m
        return not any(asked) or bool(far or (asked[1] and abs(motion[2]) >= self.min_angle_rad))


# Every second, third, ... picture of a recording; what moved between them is kept.


@dataclass(frozen=True, slots=True, eq=False)
class FewerPictures(RecordingWrapper):
    """A recording of which one picture of every `stride` is there, the first among them."""

    stride: int

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records but the pictures between."""
        pictures = 0
        for record in self.measured.records(notes):
            if isinstance(record, Picture):
                pictures += 1
                if (pictures - 1) % self.stride:
                    continue
            yield record


# Gray pictures in the place of a camera's, so that a drive without a camera has moments too.

PLACEHOLDER = "no picture"
GATE = Gate(0.25, math.radians(15))  # a moment after so much movement


@dataclass(frozen=True, slots=True, eq=False)
class Placeholders(RecordingWrapper):
    """A recording without pictures that has a gray one at its beginning and whenever the robot has moved."""

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, and gray pictures by whichever shows movement first."""
        moved = _Moved()
        for record in self.measured.records(notes):
            yield record
            if moved.enough(record):
                yield Picture(record.t_s, _gray, PLACEHOLDER)


class _Moved:
    """Detects when the robot has moved enough, by one kind of record: odometry or truth."""

    def __init__(self) -> None:
        self._kind: type[Record] | None = None
        self._pose: F64 | None = None  # of the last record that had one
        self._way: F64 = np.zeros(3)  # since the last moment

    def enough(self, record: Record) -> bool:
        """Take in a record, and tell whether a moment is due."""
        if isinstance(record, Note | Picture) or (self._kind or type(record)) is not type(record):
            return False
        first, self._kind = self._kind is None, type(record)
        if isinstance(record, Motion):
            self._way = compose_motions(self._way, record.motion)
        elif isinstance(record, OdometryPose | TruthPose):
            if self._pose is not None:
                self._way = compose_motions(self._way, motion_between(self._pose, record.pose))
            self._pose = record.pose
        if not first and not GATE.open_after(self._way):
            return False
        self._way = np.zeros(3)
        return True


def _gray() -> U8:
    return np.full((90, 120, 3), 48, np.uint8)


# A path of any length, held with few poses.


@dataclass(slots=True)
class SimplifiedPath:
    """A path of at most `most` poses and the last one: of a longer one every second, fourth, ... pose."""

    most: int
    _kept: list[F64] = field(default_factory=list)
    _last: F64 | None = None
    _stride: int = 1
    _seen: int = 0

    def add(self, pose: F64) -> None:
        """Take in the next pose (3,)."""
        if self._seen % self._stride == 0:
            self._kept.append(pose)
            if len(self._kept) > self.most:
                self._kept, self._stride = self._kept[::2], 2 * self._stride
        self._seen += 1
        self._last = pose

    def poses(self) -> F64:
        """Return what is kept, and the last pose: (N, 3)."""
        kept = self._kept
        if self._last is not None and kept[-1] is not self._last:
            kept = [*kept, self._last]
        return np.array(kept, np.float64).reshape(-1, 3)
