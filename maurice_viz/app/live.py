"""Localizing on a drive that is going on: from a socket, a pipe, or a file that grows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from maurice_loaders.errors import SourceError
from maurice_loaders.libraries.store import open_library
from maurice_loaders.live.listening import Patience
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import live_source
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.transforms.gating import Gate
from maurice_mcl.library import Library
from maurice_mcl.session import Moment, SessionInfo

from ..errors import OptionError
from ..playback import ResultCollector, run_together, shared
from ..scene import RunView
from .listener import Listener, progress_of
from .open import RunSpec, make_runs
from .output import DriveScene, OutputOptions
from .run import Playback, Report, RunScores, play, remark_zeros

STEM = "live"  # of the recording, where no --rrd names it
LATE_S = 10.0  # of session time: by then a robot may have moved
CALENDAR_S = 1e8  # times from here on count from 1970, and do not show when the drive began
QUIET = "warn,re_log_encoding=error"  # a live recording has no footer on purpose, of which Rerun warns


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a live source is listened to; None: the source's default."""

    follow: bool = False  # the source is a file that is still being written
    capture: Path | None = None  # a folder: write all that comes to its session.log
    keep_up: bool | None = None  # leave out the oldest of more than four waiting pictures
    patience_s: float | None = None  # end when the source was away, or silent, for this long


def patience_of(seconds: float | None) -> Patience:
    """Return how long to wait for a source that is away or silent."""
    return Patience() if seconds is None else Patience(seconds, seconds)


@dataclass(frozen=True, slots=True, eq=False)
class StartedSession:
    """A live session whose first moment has come already."""

    info: SessionInfo
    first: Moment
    rest: Iterator[Moment]

    def moments(self) -> Iterator[Moment]:
        """Yield all moments, once."""
        return chain([self.first], self.rest)


def follow_source(
    source: Path,
    library: Path | None,
    spec: RunSpec,
    output: OutputOptions,
    live: LiveOptions,
    opening: ReadingOptions,
    listener: Listener,
    report: Report,
) -> RunScores:
    """Localize on a live source until it ends or is stopped. InputError, OptionError."""
    if output.save_run is not None:
        advice = "capture the drive with --capture DIR, then replay DIR/session.log with --save-run"
        raise OptionError(f"--save-run is for recorded sessions; {advice}")
    if opening.corrections or opening.odometry_from_truth:
        what = opening.corrections[0] if opening.corrections else "--odometry-from-truth"
        advice = "capture the drive with --capture DIR, then replay DIR/session.log so"
        raise OptionError(f"{what} needs a recording; {advice}")
    os.environ.setdefault("RUST_LOG", QUIET)  # read when rerun is imported, which is later
    recorder = None if live.capture is None else LiveRecorder(live.capture, force=output.force)
    gate = Gate(opening.min_distance_m, opening.min_angle_rad)
    listen = ListenOptions(live.keep_up, patience_of(live.patience_s), opening.camera, gate, library=library)
    with LiveSession(live_source(source, opening), listen, recorder, listener.remark) as session:
        try:
            return _localize(session, spec, replace(output, stem=STEM), listener, report)
        finally:
            if recorder is not None:
                _remark_captured(session, listener)


def _localize(
    session: LiveSession, spec: RunSpec, output: OutputOptions, listener: Listener, report: Report
) -> RunScores:
    """Run the filter on what comes; the drawing begins with the first picture."""
    for text in session.info.notes:
        listener.remark(text)
    references = _library(session, listener)
    runs = make_runs(session, references, [spec], listener)  # what is wrong with it is raised before we wait
    moments = session.moments()
    first = next(moments, None)
    if first is None:
        _remark_left_out(session, listener)
        raise SourceError(session.source.name, "ended before a picture came, so nothing was localized")
    if _joined_late(session, spec, listener):
        runs = make_runs(session, references, [replace(spec, start="global")], listener)
    playback = Playback(
        shared(run_together(runs, StartedSession(session.info, first, moments))),
        0,
        [RunView.live(run.label, run.localizer) for run in runs],
        DriveScene(session.info, references, first.truth is not None, live=True),
        lambda collector: remark_live(collector, session, listener),
    )
    return play(playback, output, listener, report=report)


def _library(session: LiveSession, listener: Listener) -> Library:
    path = session.info.survey
    if path is None or not path.exists():
        where = "no library" if path is None else f"no library or survey at {path}"
        raise SourceError(session.source.name, f"found {where}; name one with --library")
    advance = progress_of(listener, "library")
    return open_library(path, keep_going=False, progress=advance, warn=listener.warning)


def _joined_late(session: LiveSession, spec: RunSpec, listener: Listener) -> bool:
    """Return whether the robot has moved on from its header's start pose; remark what that means."""
    if spec.start is not None or session.info.start is None or not session.source.peer:
        return False
    since_s = session.begun_s
    if LATE_S < since_s < CALENDAR_S:
        joined = f"joined {since_s:.0f} s into the drive"
        listener.remark(f"{joined}, so the particles start anywhere; --start tracking for the header's pose")
        return True
    if since_s >= CALENDAR_S:
        listener.remark(
            "starting where the header says that the drive began; --start global where it has gone on since"
        )
    return False


def remark_live(collector: ResultCollector, session: LiveSession, listener: Listener) -> None:
    """Report how it ended, what was left out, and what went wrong."""
    counts = session.counts
    if session.ended:
        listener.remark(f"{session.ended}; ended")
    for warning in session.warnings:
        listener.warning(warning)
    _remark_left_out(session, listener)
    policy = "the oldest of more than four waiting" if session.keep_up else "none is left out"
    kept = "; what moved before them was kept" if session.skipped else ""
    listener.remark(f"{counts.pictures} pictures came, {session.skipped} were skipped ({policy}){kept}")
    remark_zeros(collector, listener)


def _remark_left_out(session: LiveSession, listener: Listener) -> None:
    if session.problem_count:
        found = f"{session.problem_count} lines or pictures made no sense and were left out"
        listener.remark(f"{session.source.name}: {found}, the first: {session.problems[0]}")


def _remark_captured(session: LiveSession, listener: Listener) -> None:
    session.close()  # so that the file is whole when this is remarked
    listener.remark(
        f"{session.path}: {session.counts.records} records, {session.counts.pictures} of them pictures"
    )
