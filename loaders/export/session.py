"""A recording of any format as a native session log.

What is written is what a replay sees: pictures that were used, the motions between them, truth and events at
their times. So the log written from a session replays as the session does, to the last bit.
"""

from __future__ import annotations

import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2

from maurice_mcl.arrays import F64, U8
from maurice_mcl.geometry import motion_between
from maurice_mcl.session import Moment, Session, SessionInfo

from ..errors import InputError
from ..io.files import discard, expect_absent
from ..io.notes import ReadingNotes
from ..io.pictures import encode_jpeg
from ..recording import Motion, Note, OdometryPose, Record, Recording, TruthPose, checked
from ..session_log.header import header_to_json
from ..session_log.writer import SessionWriter
from .tables import filling

# A session of any format as a native session log.

PictureKind = Literal["png", "jpeg"]
OURS = re.compile(r"\d{5,}\.(png|jpg)")  # names of pictures that were written here


@dataclass(slots=True)
class Converted:
    """How much was written so far."""

    pictures: int = 0
    motions: int = 0
    truths: int = 0
    events: int = 0

    def count(self, moment: Moment) -> None:
        """Count one more update."""
        self.pictures += 1
        self.motions += len(moment.frame.motions)
        self.truths += moment.truth is not None
        self.events += len(moment.events)


def encode_picture(image: U8, kind: PictureKind) -> bytes:
    """Encode an RGB picture (H, W, 3): PNG without any loss, or JPEG of quality 95, 4:4:4."""
    if kind == "jpeg":
        return encode_jpeg(image)
    done, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not done:
        raise ValueError(f"a picture of {image.shape} cannot be written as PNG")
    return data.tobytes()


def convert_to_log(
    session: Session, file: Path, *, kind: PictureKind = "png", t_offset_s: float = 0.0, force: bool = False
) -> Iterator[Converted]:
    """Write a native log, pictures in `<stem>-pictures` beside it; return the counts after every picture.

    Both appear when all went well. InputError when they exist and `force` is not given, or as the session's
    reading and `SessionWriter` raise it.
    """
    pictures = file.with_name(f"{file.stem}-pictures")
    _check_targets(file, pictures, force)
    with _filling(file) as folder:
        (folder / pictures.name).mkdir()
        info, done = beside(session.info, file), Converted()
        with SessionWriter(folder / file.name, info) as log:
            for moment in session.moments():
                name = f"{pictures.name}/{moment.frame.step:05d}.{'jpg' if kind == 'jpeg' else 'png'}"
                (folder / name).write_bytes(encode_picture(moment.frame.image, kind))
                _write_moment(log, moment, name, t_offset_s, first=not done.pictures)
                done.count(moment)
                yield done
        _expect_pictures(done, file)
        if pictures.is_dir():
            discard(pictures)
        (folder / pictures.name).replace(pictures)
        (folder / file.name).replace(file)


def _write_moment(log: SessionWriter, moment: Moment, picture: str, offset_s: float, *, first: bool) -> None:
    """Write what came before a picture at its time; the drive's very first record keeps the time 0."""
    t_s = moment.frame.time_s + offset_s
    opening_s = offset_s if first else t_s
    for text in moment.events:
        log.event(opening_s, text)
    for number, motion in enumerate(moment.frame.motions):
        log.odometry(opening_s if number == 0 else t_s, motion)
    if moment.truth is not None:
        if first and not moment.events and not len(moment.frame.motions):
            log.truth(opening_s, moment.truth)
        log.truth(t_s, moment.truth)
    log.image_path(t_s, picture)


def _expect_pictures(done: Converted, file: Path) -> None:
    if not done.pictures:
        raise InputError(file, "found no picture to write, expected some; is it the right camera or topic?")


def beside(info: SessionInfo, file: Path) -> SessionInfo:
    """Return a header's facts with the survey's path as seen from the log that will be at `file`."""
    survey = header_to_json(info, "session", file.parent).get("survey")
    return info if survey is None else replace(info, survey=Path(survey))


def _check_targets(file: Path, pictures: Path, force: bool) -> None:
    """Refuse what exists; with `force` only pictures that were written here are replaced."""
    expect_absent(file, force=force)
    if not pictures.exists():
        return
    if not force:
        raise InputError(pictures, "exists already; write elsewhere, or replace it with --force")
    if not pictures.is_dir() or not all(OURS.fullmatch(found.name) for found in pictures.iterdir()):
        raise InputError(pictures, "holds more than the pictures of a converted log; remove it yourself")


@contextmanager
def _filling(file: Path) -> Iterator[Path]:
    """Return a new folder beside the file, gone afterwards. InputError when there is no room for it.

    Where nothing came of it the file's own folder is gone as well, if it was made here.
    """
    made = not file.parent.exists()
    folder = file.with_name(f".{file.name}-{uuid.uuid4().hex}.part")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
        yield folder
    except OSError as problem:
        reason = problem.strerror or problem
        raise InputError(file, f"cannot be written: {reason}; choose another place") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if made:
            with suppress(OSError):  # it holds the log
                file.parent.rmdir()


# A recording without pictures as a native log, record by record at their own times.


def records_to_log(
    recording: Recording, file: Path, notes: ReadingNotes, *, t_offset_s: float = 0.0, force: bool = False
) -> Iterator[Converted]:
    """Write odometry, truth and events of a recording as a native log; return the counts after every record.

    Odometry poses become the motions between them. Pictures are left out. InputError as for `filling`, and
    when there was nothing to write.
    """
    done = Converted()
    last: F64 | None = None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(file, f"cannot be written: {problem.strerror}; choose another place") from None
    with filling(file, force=force) as part:
        with SessionWriter(part, beside(recording.info, file), force=True) as log:
            for record in checked(recording, notes):
                last = _write_line(log, record, record.t_s + t_offset_s, last, done)
                yield done
        _expect_records(done, recording.path)


def _write_line(
    log: SessionWriter, record: Record, t_s: float, last: F64 | None, done: Converted
) -> F64 | None:
    """Write one record; return the last odometry pose."""
    if isinstance(record, OdometryPose):
        if last is not None:
            log.odometry(t_s, motion_between(last, record.pose))
            done.motions += 1
        return record.pose
    if isinstance(record, Motion):
        log.odometry(t_s, record.motion)
        done.motions += 1
    elif isinstance(record, TruthPose):
        log.truth(t_s, record.pose)
        done.truths += 1
    elif isinstance(record, Note):
        log.event(t_s, record.text)
        done.events += 1
    return last


def _expect_records(done: Converted, path: Path) -> None:
    if not (done.motions or done.truths or done.events):
        raise InputError(path, "found nothing to write, expected pictures, odometry or truth")
