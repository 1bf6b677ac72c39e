"""Gray pictures in the place of a camera's, so that a drive without a camera has moments too."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from maurice_mcl.arrays import F64, U8
from maurice_mcl.geometry import compose_motions, motion_between

from ..io.notes import ReadingNotes
from ..recording import Motion, Note, OdometryPose, Picture, Record, RecordingWrapper, TruthPose
from .gating import Gate

PLACEHOLDER = "no picture"
GATE = Gate(0.25, math.radians(15))  # a moment after so much movement


@dataclass(frozen=True, slots=True, eq=False)
class Placeholders(RecordingWrapper):
    """A recording without pictures that has a gray one at its beginning and whenever the robot has moved."""

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, and gray pictures by whichever tells of movement first."""
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
