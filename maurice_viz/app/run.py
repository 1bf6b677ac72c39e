"""Replaying runs into a recording and saved runs, with progress, and printing what came of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from maurice_loaders.reading import ReadingOptions
from maurice_loaders.runs.writer import RunWriter, check_run_target
from maurice_mcl.analysis.run_comparison import Step

from ..cli.console import note, progress, results
from ..cli.errors import INTERRUPTED, TERMINATED, one_line_errors
from ..cli.options import OutputOptions, RunOptions
from ..errors import SinkError, Terminated
from ..playback import ResultCollector, run_together, shared
from ..scene import RunView
from ..style import scale_for, units_named
from ..text.summary import to_json, to_table
from .open import AnySession, RunSpec, as_recorded_session, make_runs, open_library_for, open_session
from .output import Scene, recording
from .saving import Inputs, saving
from .stop import stops_between

if TYPE_CHECKING:
    from ..panels.comparison import ComparisonDrawing
    from ..panels.observer import Observer


@dataclass(frozen=True, slots=True)
class Playback:
    """Runs that are about to go side by side, wherever their updates come from."""

    updates: Iterable[Mapping[str, Step]]  # by the labels of `drawn`
    total: int  # updates to come, for the progress bar
    drawn: Sequence[RunView]
    scene: Scene
    remarks: Callable[[ResultCollector], None]  # says at the end what the figures do not

    @property
    def labels(self) -> list[str]:
        """The runs' labels, in order."""
        return [run.label for run in self.drawn]

    @property
    def other_drives(self) -> set[str]:
        """Labels of the runs that replay another drive than the first one."""
        return {run.label for run in self.drawn if run.own_drive}


def replay_runs(
    path: Path,
    library: Path | None,
    wanted: Sequence[RunSpec],
    options: RunOptions,
    output: OutputOptions,
    *,
    keep_going: bool,
    opening: ReadingOptions | None = None,
    shown_alone: bool = False,
) -> None:
    """Replay a session once for each run wanted; what is wrong with a file ends in one line and status 1.

    A session without a library is an error, or where nothing of the filter was asked for is `shown_alone`.
    """
    with one_line_errors():
        if output.run is not None:
            check_run_target(output.run, force=output.force)
        session = open_session(path, keep_going=keep_going, opening=opening)
        if shown_alone and library is None and session.info.survey is None:
            from .drive import replay_alone

            reading = replace(opening or ReadingOptions(), keep_going=keep_going)
            replay_alone(as_recorded_session(session, reading), output)
            return
        references = open_library_for(session, library, keep_going=keep_going)
        runs = make_runs(session, references, wanted, options)
        pictures, has_truth = session.overview()
        survey, how = library or session.info.survey or path, opening or ReadingOptions()
        inputs = Inputs(session, survey, pictures, has_truth, keep_going, how)
        playback = Playback(
            shared(run_together(runs, session)),
            pictures,
            [RunView.live(run.label, run.localizer) for run in runs],
            Scene(session.info, references, has_truth, pictures),
            lambda collector: remark(collector, session),
        )
        play(playback, output, saving(runs, inputs, output))


def play(
    playback: Playback,
    output: OutputOptions,
    savers: AbstractContextManager[Mapping[str, RunWriter]] | None = None,
) -> None:
    """Go through all updates, draw, save, and print the table or JSON.

    After Ctrl-C or SIGTERM what was done so far is kept and printed. When the recording cannot be written
    or shown, or one is stopped while it is being written out, the figures are printed all the same, and the
    error goes on.
    """
    collector = collector_of(playback)
    stopped: KeyboardInterrupt | None = None
    try:
        with recording(playback.drawn, playback.scene, output) as observers:
            try:
                with savers or nullcontext({}) as writers:
                    step_through(playback, observers, writers, collector)
            except KeyboardInterrupt as stop:
                stopped = stop
    except (SinkError, KeyboardInterrupt):
        if collector.updates:
            report(collector, playback, output)
        raise
    report(collector, playback, output)
    if stopped is not None:
        note("stopped; the recording and the figures go as far as it got")
        raise typer.Exit(TERMINATED if isinstance(stopped, Terminated) else INTERRUPTED)


def collector_of(playback: Playback) -> ResultCollector:
    """Make what scores the runs, and compares those after the first with it."""
    scene = playback.scene
    arena = scene.library.arena
    say = scale_for(scene.info.display_units, arena).say
    return ResultCollector(playback.labels, arena.size_m, say, playback.other_drives)


def step_through(
    playback: Playback,
    observers: Mapping[str, Observer],
    writers: Mapping[str, RunWriter],
    collector: ResultCollector,
) -> None:
    """Go through all updates once: score, save, draw, each update whole."""
    comparison = _comparison(playback, observers)
    try:
        with progress("replay") as advance, stops_between() as stops:
            for steps in playback.updates:
                with stops.wait():
                    pairs = collector.add_steps(steps)
                    for label, writer in writers.items():
                        writer.add(*steps[label])
                    for label, observer in observers.items():
                        observer.see(*steps[label])
                    if comparison is not None:
                        comparison.see(steps, pairs)
                advance(collector.updates, playback.total)
    finally:
        if comparison is not None and collector.updates:
            comparison.end(collector.results())


def _comparison(playback: Playback, observers: Mapping[str, Observer]) -> ComparisonDrawing | None:
    """Draw into the observers' recording what several runs share; None where there is nothing to share."""
    if len(observers) < 2:
        return None
    from ..panels.comparison import ComparisonDrawing
    from ..panels.observer import RerunObserver

    first, scene = next(iter(observers.values())), playback.scene
    if not isinstance(first, RerunObserver):
        return None
    scale = scale_for(scene.info.display_units, scene.library.arena)
    drawing = ComparisonDrawing(first.rec, playback.labels, scale, playback.other_drives)
    drawing.begin(scene.library.arena, scene.has_truth)
    return drawing


def report(collector: ResultCollector, playback: Playback, output: OutputOptions) -> None:
    """Print the results; remarks go to standard error."""
    playback.remarks(collector)
    done, info = collector.results(), playback.scene.info
    if output.json:
        told = {"notes": list(info.notes)} if info.notes else {}
        results.print_json(json.dumps(to_json(done) | told))
    else:
        results.print(to_table(done, units_named(info.display_units), info.name))


def remark(collector: ResultCollector, session: AnySession) -> None:
    """Say what was skipped of a session and what went wrong in its runs."""
    remark_skipped(session)
    remark_zeros(collector)
    if not collector.updates:
        note(f"{session.path}: holds no picture, so nothing was localized")


def remark_skipped(session: AnySession) -> None:
    """Say what was skipped of a session."""
    for warning in session.warnings:
        note(warning)
    if session.problem_count:
        skipped = f"skipped {session.problem_count} broken records"
        note(f"{session.path}: {skipped}, the first: {session.problems[0]}")


def remark_zeros(collector: ResultCollector) -> None:
    """Say how often a run's particles were all somewhere where a robot cannot be."""
    for label, times in collector.all_zero.items():
        if times:
            why = "no particle was in free space"
            note(f"{label}: at {times} of {collector.updates} updates all weights were zero: {why}")
