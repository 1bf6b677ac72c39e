"""Pictures taken with the lens covered, from a survey log, its folder, or a folder of pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from maurice_mcl.arrays import U8

from ..errors import InputError, PictureError
from ..io.files import PICTURES
from ..io.notes import ReadingNotes
from ..io.pictures import decode_picture
from ..session_log.reader import picture_bytes
from ..session_log.records import PictureRecord, read_header, read_records


def covered_pictures(path: Path) -> Iterator[U8]:
    """Read the covered pictures of a log, or all of a folder without one; one is held at a time.

    InputError where there are none, naming what was looked for, or for a picture that cannot be read.
    """
    log = _log_of(path) if path.is_dir() else path
    return _of_folder(path) if log is None else _of_log(log)


def _log_of(folder: Path) -> Path | None:
    """Return survey.log, or the only log of a folder; None when it holds no log."""
    logs = sorted(folder.glob("*.log"))
    named = folder / "survey.log"
    if named in logs:
        return named
    if len(logs) > 1:
        raise InputError(folder, f"found {len(logs)} logs, expected one or survey.log; name the log instead")
    return logs[0] if logs else None


def _of_log(log: Path) -> Iterator[U8]:
    _, kind = read_header(log)
    none = True
    for record in read_records(log, kind, ReadingNotes(keep_going=False)):
        if isinstance(record, PictureRecord) and record.covered:
            none = False
            try:
                yield decode_picture(picture_bytes(record, log))
            except PictureError as problem:
                raise InputError(log, f"{record.path or 'inline picture'}: {problem}", record.line) from None
    if none:
        raise InputError(
            log, 'found no picture with "covered": true, expected some taken with the lens cap on'
        )


def _of_folder(folder: Path) -> Iterator[U8]:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in PICTURES and file.is_file())
    if not files:
        raise InputError(
            folder, "found neither pictures nor a log, expected pictures taken with the lens cap on"
        )
    for file in files:
        try:
            yield decode_picture(file.read_bytes())
        except PictureError as problem:
            raise InputError(file, str(problem)) from None
