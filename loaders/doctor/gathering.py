"""A recording as plain arrays, without its pictures' content: what the checks of an examination look at."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from maurice_mcl.filter.motion import MauriceParameters, from_header
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import SessionInfo, is_kidnapping

from ..errors import InputError, ReadingNotes
from ..formats.registry import open_recording
from ..reading.options import Reading
from ..reading.recording import Motion, Note, OdometryPose, Picture, Record, Scan, TruthPose
from .findings import MOST_SCANS, RecordedDrive, RecordedOdometry, RecordedScans, RecordedTruth, thinned

MOST_RECORDS = 50_000  # records of one kind that are looked at: an hour and a half of odometry at 10 Hz
Row = tuple[float, F64, int]  # time, values (3,), and how often the robot was carried away before


class Gathering:
    """Takes the records of a recording one by one, and keeps what the checks need."""

    def __init__(self) -> None:
        self.falls = 0  # times that fall, which the reader refuses
        self.cut = False  # whether there are more records of a kind than are kept
        self._last_s = -math.inf
        self._part = 0
        self._kept: dict[type, list[Row]] = {Motion: [], OdometryPose: [], TruthPose: [], Picture: []}
        self._scans = list[tuple[float, LaserScan]]()

    def add(self, record: Record) -> None:
        """Take the next record; none once a kind of them is cut."""
        if self.cut:
            return
        self.falls += record.t_s < self._last_s
        self._last_s = record.t_s
        if isinstance(record, Scan) and len(self._scans) < MOST_SCANS:
            self._scans.append((record.t_s, thinned(record.scan)))
        self._part += isinstance(record, Note) and is_kidnapping(record.text)
        rows = self._kept.get(type(record))
        if rows is not None:
            values = record.motion if isinstance(record, Motion) else getattr(record, "pose", None)
            rows.append((record.t_s, np.zeros(3) if values is None else values, self._part))
            self.cut = len(rows) >= MOST_RECORDS

    def drive(self, size_m: float = math.inf, turn_gain: float = 1.0) -> RecordedDrive:
        """Return the records so far, but the scans."""
        odometry, truth = self._kept[Motion] or self._kept[OdometryPose], self._kept[TruthPose]
        return RecordedDrive(
            RecordedOdometry(_times(odometry), _values(odometry), odometry is self._kept[OdometryPose]),
            RecordedTruth(_times(truth), _values(truth), np.array([part for _, _, part in truth], np.int32)),
            _times(self._kept[Picture]),
            size_m,
            turn_gain,
        )

    @property
    def scans(self) -> RecordedScans:
        """The scans so far."""
        times = np.array([t_s for t_s, _ in self._scans], np.float64)
        return RecordedScans(times, tuple(scan for _, scan in self._scans))


def _times(rows: list[Row]) -> F64:
    return np.array([t_s for t_s, _, _ in rows], np.float64)


def _values(rows: list[Row]) -> F64:
    return np.array([values for _, values, _ in rows], np.float64).reshape(-1, 3)


@dataclass(slots=True, eq=False)
class Gathered:
    """A recording without its pictures' content."""

    info: SessionInfo
    drive: RecordedDrive
    falls: int  # times that fall, which the reader refuses
    skipped: int  # records that cannot be read at all
    first_problem: str
    cut: bool  # whether only the beginning was looked at
    warnings: tuple[str, ...] = ()
    tilts: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # rad, m, of sources off the plane
    scans: RecordedScans = field(default_factory=lambda: RecordedScans(np.zeros(0), ()))


def gather(path: Path, options: Reading) -> Gathered:
    """Read all but the pictures. Raises InputError if there is nothing to examine."""
    recording = open_recording(path, options, unchecked=True)
    info, notes, gathering = recording.info, ReadingNotes(keep_going=True), Gathering()
    for record in recording.records(notes):
        gathering.add(record)
        if gathering.cut:
            break
    drive = gathering.drive(max(info.arena.size_m) if info.arena else math.inf, _gain(path, info))
    first = str(notes.problems[0]) if notes.problems else ""
    remarks = tuple(dict.fromkeys((*info.notes, *notes.warnings)))
    remainder = (gathering.falls, notes.count, first, gathering.cut, remarks, notes.tilts)
    return Gathered(info, drive, *remainder, gathering.scans)


def _gain(path: Path, info: SessionInfo) -> float:
    if not info.motion or info.motion.get("model", "maurice") != "maurice":
        return 1.0
    try:
        return from_header(MauriceParameters, info.motion).turn_gain
    except ValueError as problem:
        raise InputError(path, str(problem), 1) from None
