"""The native session log as one of the formats: the same records as `SessionLog`, one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.session import SessionInfo

from ..errors import FieldError, InputError, ReadingNotes
from ..files.pictures import decode_picture
from ..reading.options import ReadingOptions
from ..reading.recording import Motion, Note, Picture, Readings, Record, TruthPose
from ..reading.time_alignment import PER_SECOND
from ..session_log.header import FORMAT, session_in
from ..session_log.reader import CameraChoice, SessionLog, picture_bytes
from ..session_log.records import (
    OdometryRecord,
    PictureRecord,
    ReadingRecord,
    TruthRecord,
    parse_object,
    read_header,
    read_lines,
    read_records,
    readings_of,
)
from .registry import NATIVE, Format

MOST_RAW = 1e25  # of any number of a raw log; nanoseconds since 1970 are 2e18, and squares can be added up
LOOKED_AT = 4096  # bytes of the header in which the format's name is looked for


class NativeRecording:
    """A session log; covered pictures are no part of a drive and are left out."""

    def __init__(
        self, path: Path, camera: str | None = None, time_unit: str = "s", *, outside: bool = False
    ) -> None:
        self._per_s = PER_SECOND[time_unit]
        self._outside = outside
        log = SessionLog(path, camera=camera)  # checks the header and the camera's name
        self.path = log.path
        if log.kind != "session":
            raise InputError(log.path, f"found a {log.kind} log, expected a session log", 1)
        self._camera = camera or next((one.name for one in log.info.cameras), None)
        self._info = log.info

    @property
    def info(self) -> SessionInfo:
        """What the header says."""
        return self._info

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the log's records in order."""
        taken, number = CameraChoice(self._camera, notes), 0
        for record in read_records(self.path, "session", notes, self._per_s):
            if isinstance(record, OdometryRecord):
                yield Motion(record.t_s, record.motion)
            elif isinstance(record, TruthRecord):
                yield TruthPose(record.t_s, record.pose)
            elif isinstance(record, ReadingRecord):
                yield Readings(record.t_s, record.values)
            elif not isinstance(record, PictureRecord):
                yield Note(record.t_s, record.text)
            elif taken(record) and not record.covered:
                number += 1
                name = record.path or f"{self.path.name}, picture {number}"
                yield Picture(record.t_s, partial(_read, record, self.path, self._outside), name)


class RawLog:
    """A native log whose numbers may break the rules."""

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        self.path = path = session_in(path)
        self.info, kind = read_header(path)
        if kind != "session":
            advice = "expected a session log; `library check` is for those"
            raise InputError(path, f"found a {kind} log, {advice}", 1)
        self._camera = options.camera or next((one.name for one in self.info.cameras), None)
        self._per_s = PER_SECOND[options.time_unit or "s"]
        self._outside = options.pictures_outside

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield what can be read at all, in the order of the lines."""
        taken = CameraChoice(self._camera, notes)
        for line in read_lines(self.path):
            if line.number == 1 or not line.data.strip():
                continue
            try:
                record = _raw(parse_object(line), line.number, self.path, taken, self._outside)
            except (FieldError, TypeError, ValueError, OverflowError) as problem:
                if line.ended:
                    notes.problem(InputError(self.path, str(problem), line.number))
                continue
            if record is not None:
                yield replace(record, t_s=record.t_s / self._per_s)


def _raw(
    found: dict[str, object], number: int, path: Path, taken: CameraChoice, outside: bool
) -> Record | None:
    t_s = _finite(found.get("t"))
    if "odometry" in found:
        return Motion(t_s, _three(found["odometry"]))
    if "truth" in found:
        return TruthPose(t_s, _three(found["truth"]))
    if "event" in found:
        return Note(t_s, str(found["event"]))
    if "reading" in found:
        return Readings(t_s, readings_of(found["reading"]))
    if "image" not in found or found.get("covered"):
        return None
    image = found["image"]
    inline = str(image.get("base64")) if isinstance(image, dict) else None
    camera = found.get("camera")
    named = None if camera is None else str(camera)
    record = PictureRecord(number, t_s, None if inline else str(image), inline, named, False, None)
    name = record.path or f"{path.name}:{number}"
    return Picture(t_s, partial(_read, record, path, outside), name) if taken(record) else None


def _finite(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < MOST_RAW:
        raise FieldError(f"found {value!r:.60}, expected a finite number")
    return float(value)


def _three(value: object) -> F64:
    if not isinstance(value, list) or len(value) != 3:
        raise FieldError(f"found {value!r:.60}, expected a list of 3 numbers")
    return np.array([_finite(v) for v in value])


def looks_native(path: Path) -> bool:
    """Recognize a session or survey log by its first line, and a file ending in .log that is JSON at all.

    A folder that holds a `session.log` stands for that log.
    """
    path = session_in(path)
    try:
        with path.open("rb") as file:
            begin = file.read(LOOKED_AT)
    except OSError:
        return False
    named = FORMAT.encode() in begin and b"\0" not in begin  # an MCAP file of ours carries a header as well
    return named or (path.suffix == ".log" and begin.lstrip()[:1] == b"{")


def _open(path: Path, options: ReadingOptions) -> NativeRecording:
    return NativeRecording(path, options.camera, options.time_unit or "s", outside=options.pictures_outside)


def _read(record: PictureRecord, log: Path, outside: bool) -> U8:
    return decode_picture(picture_bytes(record, log, outside))


FORMATS = (
    Format(NATIVE, "the session log of maurice-replay (JSON Lines)", looks_native, _open, readings=True),
)
