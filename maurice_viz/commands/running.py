"""Replaying runs into a recording, with progress, and printing what came of them."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from maurice_loaders.session_log import SessionLog
from maurice_mcl.library import Library

from ..console import note, progress, results
from ..errors import SinkError, Terminated
from ..look import scale_for, units_named
from ..replaying import ResultCollector, Run, run_together
from ..summary import to_json, to_table
from .failing import INTERRUPTED, TERMINATED, one_line_errors
from .opening import make_runs, open_library_for, open_session
from .options import OutputOptions, RunOptions

if TYPE_CHECKING:
    import rerun as rr

    from ..observe import Observer

KEYS = (
    "Keys in the viewer: Ctrl or Cmd + arrow goes to the next data; "
    "choose the timeline `phase` to walk through one update."
)


def replay_features(
    path: Path,
    library: Path | None,
    features: Sequence[str],
    options: RunOptions,
    output: OutputOptions,
    *,
    keep_going: bool,
) -> None:
    """Replay a session once for each feature; what is wrong with a file ends in one line and status 1."""
    with one_line_errors():
        session = open_session(path, keep_going=keep_going)
        references = open_library_for(session, library, keep_going=keep_going)
        replay_and_report(make_runs(session, references, features, options), session, references, output)


def replay_and_report(
    runs: Sequence[Run], session: SessionLog, library: Library, output: OutputOptions
) -> None:
    """Replay, draw, and print the table or JSON.

    After Ctrl-C or SIGTERM what was done so far is kept and printed; when the recording cannot be written
    or shown the figures are printed all the same, and SinkError goes on.
    """
    collector = ResultCollector([run.label for run in runs])
    stopped: KeyboardInterrupt | None = None
    pictures, has_truth = session.overview()
    try:
        with recording(runs, session, library, output, has_truth) as observers:
            try:
                _step_through(runs, session, observers, collector, pictures)
            except KeyboardInterrupt as stop:
                stopped = stop
    except SinkError:
        if collector.updates:
            report(collector, session, output)
        raise
    report(collector, session, output)
    if stopped is not None:
        note("stopped; the recording and the figures go as far as it got")
        raise typer.Exit(TERMINATED if isinstance(stopped, Terminated) else INTERRUPTED)


def _step_through(
    runs: Sequence[Run],
    session: SessionLog,
    observers: Mapping[str, Observer],
    collector: ResultCollector,
    pictures: int,
) -> None:
    with progress("replay") as advance:
        for moment, records in run_together(runs, session):
            collector.add(moment, records)
            for label, observer in observers.items():
                observer.see(moment, records[label])
            advance(moment.frame.step, pictures)


def report(collector: ResultCollector, session: SessionLog, output: OutputOptions) -> None:
    """Print the results; warnings and what was skipped go to standard error."""
    done = collector.results()
    for warning in session.warnings:
        note(warning)
    if session.problem_count:
        note(
            f"{session.path}: skipped {session.problem_count} broken lines, the first: {session.problems[0]}"
        )
    for label, times in collector.all_zero.items():
        if times:
            why = "no particle was in free space"
            note(f"{label}: at {times} of {collector.updates} updates all weights were zero: {why}")
    if not collector.updates:
        note(f"{session.path}: holds no picture, so nothing was localized")
    if output.json:
        results.print_json(json.dumps(to_json(done)))
    else:
        results.print(to_table(done, units_named(session.info.display_units), session.info.name))


@contextmanager
def recording(
    runs: Sequence[Run], session: SessionLog, library: Library, output: OutputOptions, has_truth: bool
) -> Iterator[dict[str, Observer]]:
    """Open where the drawing goes, and one observer a run; none when no recording is wanted."""
    if output.no_recording:
        yield {}
        return
    from ..observe import RerunObserver

    with _sink(runs, session, library, output, has_truth) as rec:
        observers: dict[str, Observer] = {}
        for run in runs:
            channels = tuple(run.localizer.sensor.parameters.weights)
            shared = not observers
            observers[run.label] = RerunObserver(rec, run.label, channels, scene=shared, has_truth=has_truth)
        for observer in observers.values():
            observer.begin(session.info, library)
        try:
            yield observers
        finally:
            for observer in observers.values():
                observer.end()


@contextmanager
def _sink(
    runs: Sequence[Run], session: SessionLog, library: Library, output: OutputOptions, has_truth: bool
) -> Iterator[rr.RecordingStream]:
    from .. import blueprint, sinks

    units = session.info.display_units
    shown = blueprint.Shown(library.arena, scale_for(units, library.arena), has_truth)
    layout = blueprint.for_runs(
        [blueprint.Run(run.label, tuple(run.localizer.sensor.parameters.weights)) for run in runs], shown
    )
    if output.save is None and not output.headless and sinks.has_display():
        try:
            port = sinks.bring_up_viewer()
        except SinkError as problem:
            note(f"{problem}; writing a file instead")
        else:
            with sinks.to_viewer(port, session.info.name, layout) as rec:
                yield rec
            note(KEYS)
            return
    path = output.save or Path(f"{output.stem}.rrd")
    with sinks.to_file(path, session.info.name, layout, force=output.force) as rec:
        yield rec
    note(f"{path} written; open it with: {_viewer_command()} {shlex.quote(str(path))}")
    note(KEYS)


def _viewer_command() -> str:
    """Name the viewer as this shell can find it: by its word, or beside our own Python."""
    if shutil.which("rerun"):
        return "rerun"
    beside = Path(sys.executable).parent / "rerun"
    return str(beside.relative_to(Path.cwd())) if beside.is_relative_to(Path.cwd()) else str(beside)
