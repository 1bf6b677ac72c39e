"""Drives alone, without a library: no filter runs on them."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from maurice_loaders.doctor.gathering import Gathering
from maurice_loaders.errors import InputError, ReadingNotes
from maurice_loaders.reading.observations import SCANS, Gate
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import FewerPictures, Placeholders
from maurice_loaders.session_log.reader import SurveyLog
from maurice_mcl.values import Frame, Moment

from ..errors import Listener
from ..layouts.drive import drive_blueprint
from ..panels.drive import DrivePaths, DriveView, draw_drive, drive_paths
from .open import remark_skipped, warn_implausible
from .output import NEXT_KEYS_HINT, Drawn, Output, sink_of

MOST_DRAWN = 3000  # moments; of longer drives every second, third, ... is drawn
LASER_ADVICE = "The drive has scans of a laser, for which a map is enough: add --map map.yaml."
NOT_LOCALIZED = "Nothing was localized: there is no library"


def advice_for(path: Path, drive: DriveView) -> str:
    """Return how to localize on a drive that has no library."""
    if not drive.pictures:
        return "The drive has no pictures either, and the filter needs them."
    source = shlex.quote(str(path)) if len(drive.paths.true) else "DRIVE"
    return (
        f"One is made from a drive with true poses: maurice-replay library build {source} -o LIBRARY --every "
        "0.4m,45deg. Then replay another drive with --library LIBRARY."
    )


def show_alone(whole: RecordedSession, output: Output, listener: Listener) -> Path | None:
    """Draw a drive by itself; return the recording, None for a viewer. InputError without anything to draw.

    KeyboardInterrupt goes on when the recording up to that point is written.
    """
    session, paths = _with_paths(whole, listener)
    pictures = session.observed.pictures and not isinstance(session.recording, Placeholders)
    drive = DriveView(session.info, paths, pictures)
    advice = LASER_ADVICE if session.observed.name == SCANS else advice_for(session.path, drive)
    drive = replace(drive, advice=f"**{NOT_LOCALIZED}.** {advice}")
    shown_session = _thinned(session, paths.moments, listener)
    total = paths.moments if shown_session is session else MOST_DRAWN
    target = Drawn()

    def counted() -> Iterator[Moment]:
        for number, moment in enumerate(shown_session.moments()):
            listener.progress(number, total, "draw")
            yield moment

    stopped: KeyboardInterrupt | None = None
    layout, keys = drive_blueprint(drive), f"{NEXT_KEYS_HINT}."
    with sink_of(target, output, session.info.name, layout, listener, keys=keys) as rec:
        try:
            draw_drive(rec, drive, counted())
        except KeyboardInterrupt as stop:
            stopped = stop
    remark_skipped(shown_session, listener)
    listener.remark(f"{NOT_LOCALIZED}, so only the drive itself is shown. {advice}")
    if stopped is not None:
        raise type(stopped)("the recording is complete up to that point")
    return target.file


def _with_paths(session: RecordedSession, listener: Listener) -> tuple[RecordedSession, DrivePaths]:
    """Go through a drive once without its pictures; one without any gets gray ones. Warnings."""
    gathering = Gathering()
    paths = _paths_of(session, gathering)
    warn_implausible(session.path, gathering, listener)
    if not paths.moments:
        session = RecordedSession(Placeholders(session.recording), session.options)
        paths = _paths_of(session, Gathering())
    if not paths.moments:
        nothing = "found neither pictures nor odometry nor true poses, so there is nothing to show"
        raise InputError(session.path, nothing)
    return session, paths


def _paths_of(session: RecordedSession, gathering: Gathering) -> DrivePaths:
    notes = ReadingNotes(session.options.keep_going)
    return drive_paths(session.glances(notes, gathering.add), session.info)


def _thinned(session: RecordedSession, moments: int, listener: Listener) -> RecordedSession:
    """Leave out pictures of a long drive, unless it is given which ones make a moment."""
    options, stride = session.options, -(-moments // MOST_DRAWN)
    if stride <= 1 or session.gate != Gate():
        return session
    listener.remark(
        f"drawing one of every {stride} of {moments} moments; --reading min_distance_m=... chooses others"
    )
    return RecordedSession(FewerPictures(session.recording, stride), options)


def moments_of(log: RecordedSession | SurveyLog) -> Iterator[Moment]:
    """Yield a session's moments; of a survey its pictures that are not covered, their poses as truth."""
    if isinstance(log, RecordedSession):
        yield from log.moments()
        return
    pictures = (picture for picture in log.survey_pictures() if not picture.covered)
    for step, picture in enumerate(pictures, start=1):
        name = "" if picture.path is None else str(picture.path)
        yield Moment(Frame(step, float(step), np.zeros((0, 3)), picture.image, name), picture.pose)
