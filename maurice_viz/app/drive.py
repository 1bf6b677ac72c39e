"""A drive that no library goes with: shown by itself, with a remark on what is missing."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_recording
from maurice_loaders.io.notes import ReadingNotes
from maurice_loaders.recorded_session import Glance, RecordedSession
from maurice_loaders.session_log.reader import SessionLog
from maurice_loaders.transforms.gating import FewerPictures
from maurice_loaders.transforms.placeholders import Placeholders
from maurice_mcl.session import Frame, Moment

from ..layouts.drive import drive_blueprint
from ..panels.drive import DrivePaths, DriveView, draw_drive, drive_paths
from .listener import Listener
from .output import NEXT_KEYS, OutputOptions, opened
from .run import remark_skipped

MOST_DRAWN = 3000  # moments; of longer drives every second, third, ... is drawn
MISSING = "Nothing was localized: there is no library"


def advice_for(path: Path, drive: DriveView) -> str:
    """Return how to localize on a drive that has no library."""
    if not drive.pictures:
        return "The drive has no pictures either, and the filter needs them."
    named = shlex.quote(str(path)) if len(drive.paths.true) else "DRIVE"
    return (
        f"One is made from a drive with true poses: maurice-replay library build {named} -o LIBRARY --every "
        "0.4m,45deg. Then replay another drive with --library LIBRARY."
    )


def show_alone(whole: RecordedSession, output: OutputOptions, listener: Listener) -> Path | None:
    """Draw a drive by itself; return the recording, None for a viewer. InputError without anything to draw.

    KeyboardInterrupt goes on when the recording, as far as it got, is written.
    """
    session, ways = _looked_over(whole)
    drive = DriveView(session.info, ways, not isinstance(session.recording, Placeholders))
    advice = advice_for(session.path, drive)
    drive = replace(drive, advice=f"**{MISSING}.** {advice}")
    drawn = _drawn_of(session, ways.moments, listener)
    total = ways.moments if drawn is session else MOST_DRAWN
    written: list[Path] = []
    stopped: KeyboardInterrupt | None = None
    with opened(
        output, session.info.name, drive_blueprint(drive), listener, keys=f"{NEXT_KEYS}.", written=written
    ) as rec:
        try:
            draw_drive(rec, drive, _counted(drawn, total, listener))
        except KeyboardInterrupt as stop:
            stopped = stop
    remark_skipped(drawn, listener)
    listener.remark(f"{MISSING}, so only the drive itself is shown. {advice}")
    if stopped is not None:
        raise type(stopped)("the recording goes as far as it got")
    return written[0] if written else None


def _looked_over(session: RecordedSession) -> tuple[RecordedSession, DrivePaths]:
    """Go through a drive once without its pictures; one without any gets gray ones."""
    ways = _ways(session)
    if not ways.moments:
        session = RecordedSession(Placeholders(session.recording), session.options)
        ways = _ways(session)
    if not ways.moments:
        nothing = "found neither pictures nor odometry nor true poses, so there is nothing to show"
        raise InputError(session.path, nothing)
    return session, ways


def _ways(session: RecordedSession) -> DrivePaths:
    notes = ReadingNotes(session.options.keep_going)
    return drive_paths(session.glances(notes), session.info)


def _drawn_of(session: RecordedSession, moments: int, listener: Listener) -> RecordedSession:
    """Leave out pictures of a long drive, unless it is given which ones make a moment."""
    options, stride = session.options, -(-moments // MOST_DRAWN)
    if stride <= 1 or options.min_distance_m or options.min_angle_rad:
        return session
    listener.remark(
        f"drawing one of every {stride} of {moments} moments; --reading min_distance_m=... chooses others"
    )
    return RecordedSession(FewerPictures(session.recording, stride), options)


def _counted(session: RecordedSession, count: int, listener: Listener) -> Iterator[Moment]:
    for number, moment in enumerate(session.moments()):
        listener.progress(number, count, "draw")
        yield moment


def moments_of(log: SessionLog) -> Iterator[Moment]:
    """Yield a session's moments; of a survey its pictures that are not covered, their poses as truth."""
    if log.kind == "session":
        yield from log.moments()
        return
    taken = (picture for picture in log.survey_pictures() if not picture.covered)
    for step, picture in enumerate(taken, start=1):
        name = "" if picture.path is None else str(picture.path)
        yield Moment(Frame(step, float(step), np.zeros((0, 3)), picture.image, name), picture.pose)


def glances_of(log: SessionLog) -> Iterator[Glance]:
    """Yield what is known of the same moments without their pictures."""
    if log.kind == "session":
        yield from RecordedSession(open_recording(log.path)).glances(ReadingNotes(keep_going=True))
        return
    for moment in moments_of(log):
        yield Glance(moment.frame.motions, moment.truth, ())
