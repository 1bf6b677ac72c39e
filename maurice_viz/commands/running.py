"""Replaying runs into a recording and saved runs, with progress, and printing what came of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from maurice_loaders.run_store_write import RunWriter, check_run_target
from maurice_loaders.session_log import SessionLog
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ..console import note, progress, results
from ..errors import SinkError, Terminated
from ..look import units_named
from ..replaying import ResultCollector, run_together
from ..summary import to_json, to_table
from .failing import INTERRUPTED, TERMINATED, one_line_errors
from .opening import Wanted, make_runs, open_library_for, open_session
from .options import OutputOptions, RunOptions
from .saving import Inputs, saving
from .showing import Drawn, Scene, recording

if TYPE_CHECKING:
    from ..observe import Observer


@dataclass(frozen=True, slots=True)
class Playing:
    """Runs that are about to go side by side, wherever their updates come from."""

    updates: Iterable[tuple[Moment, Mapping[str, StepRecord]]]
    total: int  # updates to come, for the progress bar
    drawn: Sequence[Drawn]
    scene: Scene
    remarks: Callable[[ResultCollector], None]  # says at the end what the figures do not


def replay_runs(
    path: Path,
    library: Path | None,
    wanted: Sequence[Wanted],
    options: RunOptions,
    output: OutputOptions,
    *,
    keep_going: bool,
) -> None:
    """Replay a session once for each run wanted; what is wrong with a file ends in one line and status 1."""
    with one_line_errors():
        if output.run is not None:
            check_run_target(output.run, force=output.force)
        session = open_session(path, keep_going=keep_going)
        references = open_library_for(session, library, keep_going=keep_going)
        runs = make_runs(session, references, wanted, options)
        pictures, has_truth = session.overview()
        inputs = Inputs(session, library or session.info.survey or path, pictures, has_truth, keep_going)
        playing = Playing(
            run_together(runs, session),
            pictures,
            [Drawn.live(run.label, run.localizer.sensor.distances) for run in runs],
            Scene(session.info, references, has_truth),
            lambda collector: remark(collector, session),
        )
        play(playing, output, saving(runs, inputs, output))


def play(
    playing: Playing,
    output: OutputOptions,
    savers: AbstractContextManager[Mapping[str, RunWriter]] | None = None,
) -> None:
    """Go through all updates, draw, save, and print the table or JSON.

    After Ctrl-C or SIGTERM what was done so far is kept and printed; when the recording cannot be written
    or shown the figures are printed all the same, and SinkError goes on.
    """
    arena = playing.scene.library.arena
    collector = ResultCollector([run.label for run in playing.drawn], arena.size_m)
    stopped: KeyboardInterrupt | None = None
    try:
        with recording(playing.drawn, playing.scene, output) as observers:
            try:
                with savers or nullcontext({}) as writers:
                    _step_through(playing, observers, writers, collector)
            except KeyboardInterrupt as stop:
                stopped = stop
    except SinkError:
        if collector.updates:
            report(collector, playing, output)
        raise
    report(collector, playing, output)
    if stopped is not None:
        note("stopped; the recording and the figures go as far as it got")
        raise typer.Exit(TERMINATED if isinstance(stopped, Terminated) else INTERRUPTED)


def _step_through(
    playing: Playing,
    observers: Mapping[str, Observer],
    writers: Mapping[str, RunWriter],
    collector: ResultCollector,
) -> None:
    with progress("replay") as advance:
        for moment, records in playing.updates:
            collector.add(moment, records)
            for label, writer in writers.items():
                writer.add(moment, records[label])
            for label, observer in observers.items():
                observer.see(moment, records[label])
            advance(moment.frame.step, playing.total)


def report(collector: ResultCollector, playing: Playing, output: OutputOptions) -> None:
    """Print the results; remarks go to standard error."""
    playing.remarks(collector)
    done, info = collector.results(), playing.scene.info
    if output.json:
        results.print_json(json.dumps(to_json(done)))
    else:
        results.print(to_table(done, units_named(info.display_units), info.name))


def remark(collector: ResultCollector, session: SessionLog) -> None:
    """Say what was skipped of a session and what went wrong in its runs."""
    for warning in session.warnings:
        note(warning)
    if session.problem_count:
        note(
            f"{session.path}: skipped {session.problem_count} broken lines, the first: {session.problems[0]}"
        )
    remark_zeros(collector)
    if not collector.updates:
        note(f"{session.path}: holds no picture, so nothing was localized")


def remark_zeros(collector: ResultCollector) -> None:
    """Say how often a run's particles were all somewhere where a robot cannot be."""
    for label, times in collector.all_zero.items():
        if times:
            why = "no particle was in free space"
            note(f"{label}: at {times} of {collector.updates} updates all weights were zero: {why}")
