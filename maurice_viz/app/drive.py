"""A drive that no library goes with: shown by itself, and what is missing said."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from maurice_loaders.errors import InputError
from maurice_loaders.io.notes import ReadingNotes
from maurice_loaders.recorded_session import RecordedSession
from maurice_loaders.transforms.gating import FewerPictures
from maurice_loaders.transforms.placeholders import Placeholders
from maurice_mcl.session import Moment

from ..cli.console import Advance, note, progress
from ..cli.errors import INTERRUPTED, TERMINATED
from ..cli.options import OutputOptions
from ..errors import Terminated
from ..panels.drive import DrivePaths, drive_paths
from .output import NEXT_KEYS, opened
from .run import remark_skipped

if TYPE_CHECKING:
    from ..panels.drive import DriveView

MOST_DRAWN = 3000  # moments; of longer drives every second, third, ... is drawn
MISSING = "Nothing was localized: there is no library"


def advice_for(path: Path, drive: DriveView) -> str:
    """Say how to localize on a drive that has no library."""
    if not drive.pictures:
        return "The drive has no pictures either, and the filter needs them."
    named = shlex.quote(str(path)) if len(drive.paths.true) else "DRIVE"
    return (
        f"One is made from a drive with true poses: maurice-replay library build {named} -o LIBRARY --every "
        "0.4m,45deg. Then replay another drive with --library LIBRARY."
    )


def replay_alone(whole: RecordedSession, output: OutputOptions) -> None:
    """Draw a drive by itself. InputError where there is nothing to draw."""
    from ..layouts.drive import drive_blueprint
    from ..panels.drive import DriveView, draw_drive

    session, ways = _looked_over(whole)
    drive = DriveView(session.info, ways, not isinstance(session.recording, Placeholders))
    advice = advice_for(session.path, drive)
    drive = replace(drive, advice=f"**{MISSING}.** {advice}")
    drawn = _drawn_of(session, ways.moments)
    total = ways.moments if drawn is session else MOST_DRAWN
    layout = drive_blueprint(drive)
    stopped: KeyboardInterrupt | None = None
    with opened(output, session.info.name, layout, keys=f"{NEXT_KEYS}.") as rec, progress("draw") as advance:
        try:
            draw_drive(rec, drive, _counted(drawn, total, advance))
        except KeyboardInterrupt as stop:
            stopped = stop
    remark_skipped(drawn)
    note(f"{MISSING}, so only the drive itself is shown. {advice}")
    if stopped is not None:
        note("stopped; the recording goes as far as it got")
        raise typer.Exit(TERMINATED if isinstance(stopped, Terminated) else INTERRUPTED)


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


def _drawn_of(session: RecordedSession, moments: int) -> RecordedSession:
    """Leave out pictures of a long drive, unless it was said which ones make a moment."""
    options, stride = session.options, -(-moments // MOST_DRAWN)
    if stride <= 1 or options.min_distance_m or options.min_angle_rad:
        return session
    note(f"drawing one of every {stride} of {moments} moments; --min-distance and --min-angle choose others")
    return RecordedSession(FewerPictures(session.recording, stride), options)


def _counted(session: RecordedSession, count: int, advance: Advance) -> Iterator[Moment]:
    for number, moment in enumerate(session.moments()):
        advance(number, count)
        yield moment
