"""Reading a session log or a survey log (docs/session-log.md)."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.values.arrays import F64, U8
from maurice_mcl.values.session import Frame, Moment, SessionInfo

from ..errors import HasReadingNotes, InputError, PictureError, ReadingNotes
from ..files.pictures import decode_picture, picture_in
from .header import Kind, session_in
from .records import (
    EventRecord,
    OdometryRecord,
    PictureRecord,
    ReadingRecord,
    TruthRecord,
    read_header,
    read_records,
    with_truth,
)


@dataclass(frozen=True, slots=True, eq=False)
class SurveyPicture:
    """One picture of a survey."""

    path: Path | None  # None when it is inline
    image: U8  # (H, W, 3) RGB
    pose: F64 | None  # (3,) x_m, y_m, heading_rad as surveyed; None when covered
    covered: bool  # taken with the lens cap on


class SessionLog(HasReadingNotes):
    """A log on disk, or in a folder as `session.log`; a `maurice_mcl.values.session.Session`.

    The header is read at once, records as asked. InputError for what is not a log, and for a broken line
    unless `keep_going`. `camera` chooses whose pictures are read: by default the header's first, or the
    first one seen.
    """

    def __init__(
        self, path: Path, *, keep_going: bool = False, camera: str | None = None, outside: bool = False
    ) -> None:
        self.path = session_in(Path(path))
        self._outside = outside  # whether pictures may be in other folders
        self._keep_going = keep_going
        self._info, self.kind = read_header(self.path)
        self._camera = self._choose(camera)
        self._notes = ReadingNotes(keep_going)

    @property
    def info(self) -> SessionInfo:
        """What the header says."""
        return self._info

    def moments(self) -> Iterator[Moment]:
        """Read the drive from its beginning, a picture at a time; InputError for a survey or broken lines."""
        self._expect("session", "build a library from it, and replay a session")
        return self._moments()

    def survey_pictures(self) -> Iterator[SurveyPicture]:
        """Read the pictures of a survey from its beginning. Raises InputError as for `moments`."""
        self._expect("survey", "only a survey's pictures have poses")
        return self._survey_pictures()

    def count_pictures(self) -> int:
        """Count the picture records without opening any picture."""
        return sum(1 for _ in self._pictures(ReadingNotes(self._keep_going)))

    def overview(self) -> tuple[int, bool]:
        """Count the pictures that make a moment, and tell whether any truth is there; opens no picture."""
        notes = ReadingNotes(self._keep_going)
        taken = CameraChoice(self._camera, notes)
        pictures, truth = 0, False
        for record in read_records(self.path, self.kind, notes):
            pictures += isinstance(record, PictureRecord) and taken(record) and not record.covered
            truth = truth or isinstance(record, TruthRecord)
        return pictures, truth

    def _moments(self) -> Iterator[Moment]:
        notes = self._notes = ReadingNotes(self._keep_going)
        motions: list[F64] = []
        events: list[str] = []
        readings: dict[str, float] = {}
        step, begin_s = 0, None
        taken = CameraChoice(self._camera, notes)
        for record, truth in with_truth(read_records(self.path, self.kind, notes)):
            begin_s = record.t_s if begin_s is None else begin_s
            if isinstance(record, OdometryRecord):
                motions.append(record.motion)
            elif isinstance(record, EventRecord):
                events.append(record.text)
            elif isinstance(record, ReadingRecord):
                readings |= record.values
            elif isinstance(record, PictureRecord) and taken(record) and not record.covered:
                image = self._image(record, notes)
                if image is None:
                    continue
                step += 1
                moved = np.array(motions, np.float64).reshape(-1, 3)
                name = record.path or f"{self.path.name}, picture {step}"
                frame = Frame(step, record.t_s - begin_s, moved, image, name, readings)
                yield Moment(frame, truth, tuple(events))
                motions, events, readings = [], [], {}

    def _survey_pictures(self) -> Iterator[SurveyPicture]:
        notes = self._notes = ReadingNotes(self._keep_going)
        for record in self._pictures(notes):
            image = self._image(record, notes)
            if image is not None:
                path = None if record.path is None else self.path.parent / record.path
                yield SurveyPicture(path, image, record.pose, record.covered)

    def _pictures(self, notes: ReadingNotes) -> Iterator[PictureRecord]:
        taken = CameraChoice(self._camera, notes)
        for record in read_records(self.path, self.kind, notes):
            if isinstance(record, PictureRecord) and taken(record):
                yield record

    def _image(self, record: PictureRecord, notes: ReadingNotes) -> U8 | None:
        try:
            return decode_picture(picture_bytes(record, self.path, self._outside))
        except PictureError as problem:
            notes.problem(InputError(self.path, f"{record.path or 'inline picture'}: {problem}", record.line))
            return None

    def _choose(self, camera: str | None) -> str | None:
        known = [c.name for c in self._info.cameras]
        if camera is not None and known and camera not in known:
            text = f"found cameras {', '.join(known)}, expected {camera!r} among them"
            raise InputError(self.path, text, 1)
        return camera or (known[0] if known else None)

    def _expect(self, kind: Kind, advice: str) -> None:
        if self.kind != kind:
            raise InputError(self.path, f"found a {self.kind} log, expected a {kind} log; {advice}", 1)


class CameraChoice:
    """Decides whose pictures are read: the named camera's, or that of the first one seen."""

    def __init__(self, name: str | None, notes: ReadingNotes) -> None:
        self._name = name
        self._notes = notes

    def __call__(self, record: PictureRecord) -> bool:
        """Take a picture, or leave it out with a warning; a picture that names no camera is taken."""
        if record.camera is None:
            return True
        self._name = self._name or record.camera
        if record.camera != self._name:
            left_out = f"pictures of camera {record.camera!r} are left out, {self._name!r} is used"
            self._notes.warning(left_out)
        return record.camera == self._name


def picture_bytes(record: PictureRecord, log: Path, outside: bool = False) -> bytes:
    """Return a picture's encoded bytes, from its file or its line. PictureError when they are not there.

    `outside` allows files that are not in the log's folder.
    """
    if record.base64 is not None:
        try:
            return base64.b64decode(record.base64, validate=True)
        except (binascii.Error, ValueError):
            raise PictureError("found broken base64, expected a picture") from None
    return picture_in(log.parent, str(record.path), outside=outside)
