"""Calibration trials from a session log with truth: what each movement did, by the poses around it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arena import Arena
from maurice_mcl.calibrate import Trials
from maurice_mcl.calibrate_legs import Leg, trials_of
from maurice_mcl.typing import F64

from .errors import LogError
from .findings import Findings
from .log_records import Odometry, Truth, read_header, read_records
from .truth import is_kidnapping

SAMPLES = 9  # points of a way at which the floor is looked up


def trials_from_session(path: Path) -> Trials:
    """Read a session's movements and truth. LogError for what is no session, or has no truth."""
    info, kind = read_header(path)
    if kind != "session":
        raise LogError(path, f"found a {kind} log, expected a session log with odometry and truth", 1)
    reader = _Legs(path)
    trials = trials_of(reader, lambda a, b: floor_between(info.arena, a, b))
    if reader.truths < 2:
        found = "no truth" if not reader.truths else "one truth"
        raise LogError(path, f"found {found}, expected truth records before and after the movements")
    return trials


class _Legs:
    """The legs of a log: the movements between truths, with the first truth after each movement.

    The first, because odometry covers the time since the odometry record before: later truths may already
    be on the next way. Nothing is joined across a kidnapping.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.truths = 0  # seen so far

    def __iter__(self) -> Iterator[Leg]:
        self.truths = 0
        before: F64 | None = None
        motions: list[F64] = []
        for record in read_records(self._path, "session", Findings(keep_going=False)):
            if isinstance(record, Odometry):
                motions.append(record.motion)
            elif is_kidnapping(record):
                before, motions = None, []
            elif isinstance(record, Truth):
                self.truths += 1
                if before is not None and motions:
                    yield Leg(before, tuple(motions), record.pose)
                if before is None or motions:
                    before, motions = record.pose, []


def floor_between(arena: Arena | None, start: F64, end: F64) -> str | None:
    """Name the floor of a straight way between two points (2,); "" without one, None across several."""
    if arena is None:
        return ""
    names = {floor_at(arena, point) for point in np.linspace(start, end, SAMPLES)}
    return names.pop() if len(names) == 1 else None


def floor_at(arena: Arena, point: F64) -> str:
    """Name the topmost floor at a point (2,); "" where there is none."""
    x, y = (float(v) for v in point)
    for floor in reversed(arena.floors):
        if cv2.pointPolygonTest(floor.polygon.astype(np.float32), (x, y), False) >= 0:
            return floor.name
    return ""
