"""Localizing on a drive that is going on: from a socket, a pipe, or a file that grows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import typer

from maurice_loaders.errors import SourceError
from maurice_loaders.libraries.store import open_library
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import live_source
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.transforms.gating import Gate
from maurice_mcl.library import Library
from maurice_mcl.session import Moment, SessionInfo

from ..cli.console import note, progress
from ..cli.errors import one_line_errors
from ..cli.live_options import LiveOptions, patience_of
from ..cli.options import OutputOptions, RunOptions
from ..playback import ResultCollector, run_together, shared
from ..scene import RunView
from .open import RunSpec, make_runs
from .output import Scene
from .run import Playback, play, remark_zeros

STEM = "live"  # of the recording, where no --save names it
LATE_S = 10.0  # of session time: by then a robot may have moved
CALENDAR_S = 1e8  # times from here on count from 1970, and do not tell when the drive began
QUIET = "warn,re_log_encoding=error"  # a live recording has no footer on purpose, of which Rerun warns


@dataclass(frozen=True, slots=True, eq=False)
class Begun:
    """A live session whose first moment has come already."""

    info: SessionInfo
    first: Moment
    rest: Iterator[Moment]

    def moments(self) -> Iterator[Moment]:
        """Give all moments, once."""
        return chain([self.first], self.rest)


def follow_source(
    source: Path,
    library: Path | None,
    wanted: RunSpec,
    options: RunOptions,
    output: OutputOptions,
    live: LiveOptions,
    opening: ReadingOptions,
) -> None:
    """Localize on a live source until it ends or one is stopped; errors end in one line and status 1."""
    if output.run is not None:
        advice = "record the drive with --record DIR, then replay DIR/session.log with --run"
        raise typer.BadParameter(f"--run is for recorded sessions; {advice}")
    if opening.corrections:
        advice = "record the drive with --record DIR, then replay DIR/session.log so"
        raise typer.BadParameter(f"{opening.corrections[0]} needs a recording; {advice}")
    os.environ.setdefault("RUST_LOG", QUIET)  # read when rerun is imported, which is later
    with one_line_errors():
        recorder = None if live.record is None else LiveRecorder(live.record, force=output.force)
        gate = Gate(opening.min_distance_m, opening.min_angle_rad)
        patience = patience_of(live.patience)
        listen = ListenOptions(live.keep_up, patience, opening.camera, gate, library=library)
        with LiveSession(live_source(source, opening), listen, recorder, note) as session:
            try:
                _localize(session, wanted, options, replace(output, stem=STEM))
            finally:
                if recorder is not None:
                    _say_recorded(session)


def _localize(session: LiveSession, wanted: RunSpec, options: RunOptions, output: OutputOptions) -> None:
    """Run the filter on what comes; the drawing begins with the first picture."""
    for text in session.info.notes:
        note(text)
    references = _library(session)
    runs = make_runs(session, references, [wanted], options)  # what is wrong with it is said before we wait
    moments = session.moments()
    first = next(moments, None)
    if first is None:
        _say_left_out(session)
        raise SourceError(session.source.name, "ended before a picture came, so nothing was localized")
    if _joined_late(session, options):
        runs = make_runs(session, references, [wanted], replace(options, start="global"))
    playback = Playback(
        shared(run_together(runs, Begun(session.info, first, moments))),
        0,
        [RunView.live(run.label, run.localizer) for run in runs],
        Scene(session.info, references, first.truth is not None, live=True),
        lambda collector: remark_live(collector, session),
    )
    play(playback, output)


def _library(session: LiveSession) -> Library:
    path = session.info.survey
    if path is None or not path.exists():
        where = "no library" if path is None else f"no library or survey at {path}"
        raise SourceError(session.source.name, f"found {where}; say which with --library")
    with progress("library") as advance:
        return open_library(path, keep_going=False, progress=advance, warn=note)


def _joined_late(session: LiveSession, options: RunOptions) -> bool:
    """Tell whether the robot has gone on since it was where its header says; says what that means."""
    if options.start is not None or session.info.start is None or not session.source.peer:
        return False
    since_s = session.begun_s
    if LATE_S < since_s < CALENDAR_S:
        joined = f"joined {since_s:.0f} s into the drive"
        note(f"{joined}, so the particles start anywhere; --start tracking for the header's pose")
        return True
    if since_s >= CALENDAR_S:
        note("starting where the header says that the drive began; --start global where it has gone on since")
    return False


def remark_live(collector: ResultCollector, session: LiveSession) -> None:
    """Say how it ended, what was left out, and what went wrong."""
    counts = session.counts
    if session.ended:
        note(f"{session.ended}; ended")
    for warning in session.warnings:
        note(warning)
    _say_left_out(session)
    policy = "the oldest of more than four waiting" if session.keep_up else "none is left out"
    kept = "; what moved before them was kept" if session.skipped else ""
    note(f"{counts.pictures} pictures came, {session.skipped} were skipped ({policy}){kept}")
    remark_zeros(collector)


def _say_left_out(session: LiveSession) -> None:
    if session.problem_count:
        found = f"{session.problem_count} lines or pictures made no sense and were left out"
        note(f"{session.source.name}: {found}, the first: {session.problems[0]}")


def _say_recorded(session: LiveSession) -> None:
    session.close()  # so that the file is whole when we say so
    note(f"{session.path}: {session.counts.records} records, {session.counts.pictures} of them pictures")
