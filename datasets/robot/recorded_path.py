"""A path that a real robot drove, with its real odometry: read, and moved into an arena's free space."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.reading.recording import Motion, Note, Picture, TruthPose
from maurice_loaders.reading.time_alignment import Aligner
from maurice_loaders.session_log.header import session_in
from maurice_loaders.session_log.reader import LogRecording
from maurice_mcl.values import F64, KIDNAPPED, is_kidnapping

from .planner import Placement
from .segments import Segment


@dataclass(frozen=True, slots=True, eq=False)
class RecordedPath:
    """A recorded drive in its own frame, cut into updates."""

    name: str
    start: F64  # (3,)
    segments: tuple[Segment, ...]
    track: F64  # (K, 2) places along the path, dense where the recording is
    motion: dict[str, Any] | None  # motion parameters of its robot, as a header has them

    @property
    def carried(self) -> int:
        """Return how often the robot was carried to where it went on."""
        return sum(isinstance(e, Note) for segment in self.segments for e in segment.entries)

    def placed(self, at: Placement) -> Iterator[Segment]:
        """Return the segments at another place; a scale applies to the odometry's lengths as well."""
        lengths = np.array([at.scale, at.scale, 1.0])
        for segment in self.segments:
            each = segment.entries
            moved = (Motion(e.t_s, e.motion * lengths) if isinstance(e, Motion) else e for e in each)
            yield Segment(tuple(moved), segment.t_s, at.pose(segment.pose))


def read_recording(path: Path, updates: int) -> RecordedPath:
    """Read at most so many updates of a session log with truth; its pictures only mark when it looked.

    InputError where there are none.
    """
    path = session_in(path)
    log, notes = LogRecording(path), ReadingNotes(keep_going=False)
    truths = (aligned.truth_at() for aligned in Aligner()(log.records(notes)))
    info = log.info
    start, begin_s = info.start, 0.0
    segments: list[Segment] = []
    moved: list[Motion | Note] = []
    for record in log.records(notes):
        if isinstance(record, TruthPose) and start is None and not moved:
            start, begin_s = record.pose, record.t_s
        if isinstance(record, Note) and is_kidnapping(record.text):
            moved.append(Note(record.t_s - begin_s, KIDNAPPED))
        if isinstance(record, Motion):
            moved.append(Motion(record.t_s - begin_s, record.motion, record.encoders_m))
        if isinstance(record, Picture) and len(segments) < updates:
            truth = next(truths)
            if start is None or truth is None:
                why = "found a picture without truth, expected truth throughout"
                raise InputError(path, why, record.line)
            segments.append(Segment(tuple(moved), record.t_s - begin_s, truth))
            moved = []
    if start is None:
        raise InputError(path, "found neither a start pose nor truth, expected where the robot really was", 1)
    if not segments:
        raise InputError(path, "found no movement with truth before and after it; choose a longer recording")
    corners = np.array([start[:2], *(segment.pose[:2] for segment in segments)])
    shares = np.linspace(0, 1, 16, endpoint=False)[:, None, None]
    track = corners[:-1] + shares * (corners[1:] - corners[:-1])
    return RecordedPath(info.name, start, tuple(segments), track.reshape(-1, 2), info.motion)
