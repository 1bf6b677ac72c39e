"""The native session log as one of the formats: the same records as `SessionLog`, one by one."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from maurice_mcl.arrays import U8
from maurice_mcl.session import SessionInfo

from ..errors import InputError, ReadingNotes
from ..io.pictures import decode_picture
from ..reading import ReadingOptions
from ..recording import Motion, Note, Picture, Record, TruthPose
from ..session_log.header import FORMAT
from ..session_log.reader import CameraChoice, SessionLog, picture_bytes
from ..session_log.records import OdometryRecord, PictureRecord, TruthRecord, read_records
from ..transforms.clocks import PER_SECOND
from .registry import NATIVE, Format

LOOKED_AT = 4096  # bytes of the header in which the format's name is looked for


class NativeRecording:
    """A session log; covered pictures are no part of a drive and are left out."""

    def __init__(self, path: Path, camera: str | None = None, time_unit: str = "s") -> None:
        self.path = path
        self._per_s = PER_SECOND[time_unit]
        log = SessionLog(path, camera=camera)  # checks the header and the camera's name
        if log.kind != "session":
            raise InputError(path, f"found a {log.kind} log, expected a session log", 1)
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
            elif not isinstance(record, PictureRecord):
                yield Note(record.t_s, record.text)
            elif taken(record) and not record.covered:
                number += 1
                name = record.path or f"{self.path.name}, picture {number}"
                yield Picture(record.t_s, partial(_read, record, self.path), name)


def looks_native(path: Path) -> bool:
    """Recognize a session or survey log by its first line, and a file ending in .log that is JSON at all."""
    try:
        with path.open("rb") as file:
            begin = file.read(LOOKED_AT)
    except OSError:
        return False
    named = FORMAT.encode() in begin and b"\0" not in begin  # an MCAP file of ours carries a header as well
    return named or (path.suffix == ".log" and begin.lstrip()[:1] == b"{")


def _open(path: Path, options: ReadingOptions) -> NativeRecording:
    return NativeRecording(path, options.camera, options.time_unit or "s")


def _read(record: PictureRecord, log: Path) -> U8:
    return decode_picture(picture_bytes(record, log))


FORMATS = (Format(NATIVE, "the session log of maurice-replay (JSON Lines)", looks_native, _open),)
