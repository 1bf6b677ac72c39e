"""Reading a session log as a recording, and the pictures of a survey log (docs/session-log.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from maurice_mcl.values import F64, U8, SessionInfo

from ..errors import HasReadingNotes, InputError, PictureError, ReadingNotes
from ..formats.registry import Format
from ..reading.options import Reading
from ..reading.recording import LeftOut, Picture, Record, camera_named
from ..reading.time_alignment import PER_SECOND
from .header import FORMAT, Kind, session_in
from .records import LineReader, read_header

LOOKED_AT = 4096  # bytes of the header in which the format's name is looked for
ADVICE: dict[Kind, str] = {
    "session": "build a library from it, and replay a session",
    "survey": "only a survey's pictures have poses",
}


class LogRecording:
    """A session log on disk, or in a folder as `session.log`; pictures that no step uses are `LeftOut`.

    The header is read at once. InputError for a file that is no log, a survey unless `any_kind`, and a
    camera that the header does not have. With `unchecked`, times may fall and
    numbers may be of nearly any size.
    """

    def __init__(
        self,
        path: Path,
        options: Reading | None = None,
        *,
        any_kind: bool = False,
        unchecked: bool = False,
    ) -> None:
        options = options or Reading()
        self.path = session_in(path)
        self.info, self.kind = _header(self.path, None if any_kind else "session")
        self.stated = self.info.notes
        self._camera = camera_of(self.path, self.info, options.camera)
        self._reader = LineReader(
            self.path,
            self.kind,
            PER_SECOND[options.time_unit or "s"],
            outside=options.pictures_outside,
            unchecked=unchecked,
        )

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read the log's records in order."""
        choice, number = CameraChoice(self._camera, notes), 0
        for record in self._reader.records(notes):
            if not isinstance(record, Picture):
                yield record
            elif not choice(record) or record.covered:
                yield LeftOut(record.t_s, record)
            else:
                number += 1
                yield record if record.path else replace(record, name=picture_name(self.path, number))


def picture_name(log: Path, number: int) -> str:
    """Name a picture that a log holds inside by its number, from 1, among those that are used."""
    return f"{log.name}, picture {number}"


@dataclass(frozen=True, slots=True, eq=False)
class SurveyPicture:
    """One picture of a survey."""

    path: Path | None  # None when it is inline
    image: U8  # (H, W, 3) RGB
    pose: F64 | None  # (3,) x_m, y_m, heading_rad as surveyed; None when covered
    covered: bool  # taken with the lens cap on


class SurveyLog(HasReadingNotes):
    """A survey log on disk. InputError for a file that is none, and for a broken line unless `keep_going`."""

    def __init__(self, path: Path, options: Reading | None = None) -> None:
        self._options = options or Reading()
        self.path = path
        self.info, _ = _header(path, "survey")
        self._camera = camera_of(path, self.info, self._options.camera)
        self._notes = ReadingNotes(self._options.keep_going)

    def survey_pictures(self) -> Iterator[SurveyPicture]:
        """Read the pictures from the beginning, covered ones too."""
        notes = self._notes = ReadingNotes(self._options.keep_going)
        for record in self.pictures(notes):
            try:
                image = record.read()
            except PictureError as problem:
                notes.problem(InputError(self.path, f"{record.name}: {problem}", record.line))
                continue
            path = None if record.path is None else self.path.parent / record.path
            yield SurveyPicture(path, image, record.pose, record.covered)

    def count_pictures(self) -> int:
        """Count the picture records without opening any picture."""
        return sum(1 for _ in self.pictures(ReadingNotes(self._options.keep_going)))

    def pictures(self, notes: ReadingNotes) -> Iterator[Picture]:
        """Read the records of the pictures, without opening any."""
        choice = CameraChoice(self._camera, notes)
        for record in LineReader(self.path, "survey", outside=self._options.pictures_outside).records(notes):
            if isinstance(record, Picture) and choice(record):
                yield record


class CameraChoice:
    """Decides which camera's pictures are read: the named one's, or the one's that comes first."""

    def __init__(self, name: str | None, notes: ReadingNotes) -> None:
        self._name = name
        self._notes = notes

    def __call__(self, record: Picture) -> bool:
        """Take a picture, or leave it out with a warning; a picture that names no camera is taken."""
        if record.camera is None:
            return True
        self._name = self._name or record.camera
        if record.camera != self._name:
            left_out = f"pictures of camera {record.camera!r} are left out, {self._name!r} is used"
            self._notes.warning(left_out)
        return record.camera == self._name


def camera_of(path: Path, info: SessionInfo, wanted: str | None) -> str | None:
    """Return the camera to read: the wanted one, else the header's first. InputError if it does not exist."""
    known = [camera.name for camera in info.cameras]
    return camera_named(path, known, wanted, 1) if known else wanted


def is_survey(path: Path) -> bool:
    """Return whether a path is a survey log. InputError for a log with a broken header."""
    return looks_like_log(path) and read_header(session_in(path))[1] == "survey"


def _header(path: Path, expected: Kind | None) -> tuple[SessionInfo, Kind]:
    info, kind = read_header(path)
    if expected is not None and kind != expected:
        raise InputError(path, f"found a {kind} log, expected a {expected} log; {ADVICE[expected]}", 1)
    return info, kind


def looks_like_log(path: Path) -> bool:
    """Recognize a session or survey log by its first line, and a file ending in .log that is JSON at all.

    A folder that holds a `session.log` stands for that log.
    """
    path = session_in(path)
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            begin = file.read(LOOKED_AT)
    except OSError:
        return False
    named = FORMAT.encode() in begin and b"\0" not in begin  # an MCAP file of ours carries a header as well
    return named or (path.suffix == ".log" and begin.lstrip()[:1] == b"{")


FORMATS = (
    Format(
        "session-log",
        "the session log of maurice-replay (JSON Lines)",
        looks_like_log,
        LogRecording,
        open_unchecked=partial(LogRecording, unchecked=True),
        ours=True,
        readings=True,
        takes_unit=True,
    ),
)
