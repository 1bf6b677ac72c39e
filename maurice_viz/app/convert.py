"""Converting a session of any readable format to a native session log, or to MCAP with ROS 2 messages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.export.drive import convert_to_mcap
from maurice_loaders.export.session import Converted, PictureKind, convert_to_log, records_to_log
from maurice_loaders.io.notes import ReadingNotes
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.recording import Picture, Recording

from ..errors import OptionError
from .listener import SILENT, Listener
from .open import AnySession, as_recorded_session, open_session

LOG, MCAP = ".log", ".mcap"
PICTURES = ("png", "jpeg")


def convert(
    source: str | Path,
    target: str | Path,
    *,
    pictures: PictureKind = "png",
    t_offset_s: float = 0.0,
    options: ReadingOptions | None = None,
    force: bool = False,
    listener: Listener = SILENT,
) -> tuple[Path, Converted]:
    """Convert a recording and return the file written and how many records of each kind it holds.

    `target` is a file that ends in .log or .mcap, or a folder, which gets a `session.log`. The file holds
    what a replay of `source` sees, so that replaying either gives the same run to the last bit; a recording
    without pictures is written whole: odometry, truth and events. "png" pictures are lossless, "jpeg" ones
    are of quality 95. `t_offset_s` (seconds) is added to every time of the clock of `source`.

    Raises InputError for a source that cannot be read or a target that exists (unless `force`), and
    OptionError for another ending, picture format or a time offset that is not finite.

        >>> file, count = mv.convert("drive.bag", "drive")
        >>> file.name
        'session.log'
    """
    source, target, options = Path(source), Path(target), options or ReadingOptions()
    if target.suffix not in (LOG, MCAP, ""):
        raise OptionError(f"OUT is a folder, or ends in {LOG} or {MCAP}; found {target.name!r}")
    if pictures not in PICTURES:
        raise OptionError(f"pictures are {' or '.join(PICTURES)}, found {pictures!r}")
    if not np.isfinite(t_offset_s):
        raise OptionError(f"a time offset is a number of seconds, found {t_offset_s}")
    target = target if target.suffix else target / "session.log"
    session = open_session(source, keep_going=options.keep_going, opening=options, listener=listener)
    notes = ReadingNotes(options.keep_going)
    recorded = as_recorded_session(session, options)
    if target.suffix == MCAP:
        steps = convert_to_mcap(
            recorded, target, camera=options.camera, kind=pictures, t_offset_s=t_offset_s, force=force
        )
        done = _count(steps, target, listener)
        _report(session.path, recorded, listener)
        return target, done
    begin_s, has_pictures = _begin(recorded.recording)
    if has_pictures:
        steps = convert_to_log(session, target, kind=pictures, t_offset_s=begin_s + t_offset_s, force=force)
    else:
        steps = records_to_log(recorded.recording, target, notes, t_offset_s=t_offset_s, force=force)
    done = _count(steps, target, listener)
    _report(session.path, session if done.pictures else notes, listener)
    return target, done


def _begin(recording: Recording) -> tuple[float, bool]:
    """Return the time of the first record, which a session counts from, and whether there is any picture."""
    first_s: float | None = None
    for record in recording.records(ReadingNotes(keep_going=True)):
        first_s = record.t_s if first_s is None else first_s
        if isinstance(record, Picture):
            return first_s, True
    return first_s or 0.0, False


def _count(steps: Iterator[Converted], target: Path, listener: Listener) -> Converted:
    done = Converted()
    try:
        for done in steps:
            listener.progress(done.pictures, done.pictures, "convert")
    except ValueError as problem:  # a time that no log may hold, moved too far by the offset
        raise InputError(target, str(problem)) from None
    return done


def _report(path: Path, read: ReadingNotes | AnySession, listener: Listener) -> None:
    """Pass on what was found wrong while reading."""
    for warning in read.warnings:
        listener.warning(warning)
    count = read.count if isinstance(read, ReadingNotes) else read.problem_count
    if count:
        listener.warning(f"{path}: skipped {count} broken records, the first: {read.problems[0]}")
