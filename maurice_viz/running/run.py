"""Going through runs once: score, save and draw each update; return the scores.

Ctrl-C and SIGTERM wait for the end of an update, so that scores, recording and saved run end at the same one.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from html import escape
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from maurice_loaders.errors import InputError
from maurice_loaders.reading.session import RecordedSession
from maurice_mcl.reasons.verdict import decisive_step
from maurice_mcl.scoring.comparison import Step

from ..errors import Listener, SinkError, Terminated, once
from ..playback import ResultCollector, RunResult
from ..scene import RunView, Scene, numbered
from ..style import Scale, units_named
from ..text.explanation_table import say_other_shape
from .open import remark_skipped
from .output import Output, drawing
from .watch import Watch, write_rate

if TYPE_CHECKING:
    import polars as pl

    from maurice_loaders.runs.writer import RunWriter

    from .observer import SceneObserver

COMPLETE_SO_FAR = "the recording and the scores are complete up to that point"


@dataclass(slots=True, eq=False)
class Playback:
    """Runs that are about to go side by side, wherever their updates come from."""

    updates: Iterable[Mapping[str, Step]]  # by the labels of `views`
    total: int  # updates to come, for the progress bar
    views: Sequence[RunView]  # numbered in this order
    scene: Scene
    remarks: Callable[[ResultCollector], None]  # reports at the end what the scores do not say
    drawn: range | None = None  # steps that are drawn; None: all of them
    watch: Watch | None = None  # says what changes, of a live run

    def __post_init__(self) -> None:
        self.views = numbered(self.views)

    @property
    def labels(self) -> list[str]:
        """The runs' labels, in order."""
        return [run.label for run in self.views]

    def draws(self, steps: Mapping[str, Step]) -> bool:
        """Return whether an update is drawn."""
        return self.drawn is None or all(moment.frame.step in self.drawn for moment, _ in steps.values())

    @property
    def other_drives(self) -> set[str]:
        """Labels of the runs that replay another drive than the first one."""
        return {run.label for run in self.views if run.own_drive}


@dataclass(frozen=True, slots=True, repr=False)
class RunScores:
    """The result of a replay or a comparison; lengths in meters, angles in radians, times in seconds.

    >>> import maurice_viz as mv
    >>> scores = mv.replay("session.log", save_run="saved")
    >>> scores.name, scores.runs[0].score.updates, scores.saved_run.name
    ('kleine Fahrt', 14, 'saved')
    """

    runs: tuple[RunResult, ...]  # one a run, in order; all after the first are compared with it
    name: str = ""  # the session's
    display_units: str = "m"
    notes: tuple[str, ...] = ()  # of the session: what its reader should know, such as synthetic odometry
    rrd: Path | None = None  # the Rerun recording that was written
    saved_run: Path | None = None  # the folder of the saved run, or runs

    @property
    def steps(self) -> pl.DataFrame:
        """All runs as one polars frame: a row per run and update, with the columns of docs/python.md."""
        import polars as pl  # a replay without it does without

        tables = [(run.label, run.table) for run in self.runs if run.table is not None]
        frames = [table.frame().insert_column(0, pl.lit(label).alias("label")) for label, table in tables]
        return pl.concat(frames) if frames else pl.DataFrame()

    @property
    def text(self) -> str:
        """What happened, in a sentence, and a line per run."""
        from ..text.verdict import headline

        scale = Scale(units_named(self.display_units))
        summary = headline({run.label: run.verdict for run in self.runs}, scale) if self.runs else "no run"
        lines = [
            f"{run.label}: {run.score.updates} updates, {scale.say(run.score.error_mean_m)} off"
            if run.score.error_mean_m is not None
            else f"{run.label}: {run.score.updates} updates, no truth"
            for run in self.runs
        ]
        return "\n".join([f"{self.name}: {summary}", *lines])

    def __repr__(self) -> str:
        """Return what happened, as short as a screen has room for."""
        return f"RunScores of {self.text}"

    def _repr_html_(self) -> str:
        """Return what happened for a notebook."""
        return "<br>".join(map(escape, self.text.splitlines()))

    @property
    def ended_lost(self) -> tuple[str, ...]:
        """The labels of the runs that were lost at their last step, or probably so."""
        standings = {run.label: run.verdict.now for run in self.runs}
        return tuple(label for label, now in standings.items() if now is not None and now.is_lost)

    def to_json(self) -> dict[str, Any]:
        """Return the scores as `--json` prints them."""
        from ..text.summary import to_json

        notes = {"notes": list(self.notes)} if self.notes else {}
        return to_json(self.runs, Scale(units_named(self.display_units))) | notes


Report = Callable[[RunScores], None]


def play(
    playback: Playback,
    output: Output,
    listener: Listener,
    savers: AbstractContextManager[Mapping[str, RunWriter]] | None = None,
    report: Report = lambda scores: None,
) -> RunScores:
    """Go through all updates, draw, save, and return the scores, which `report` gets as well.

    After Ctrl-C or SIGTERM what was done so far is kept and reported, and KeyboardInterrupt goes on. When the
    recording cannot be written or shown, or writing it out is interrupted, the scores are reported all the
    same, and the error goes on.
    """
    collector = collector_of(playback)
    stopped: KeyboardInterrupt | None = None
    try:
        with drawing(playback.views, playback.scene, output, listener) as drawn:
            if playback.watch is not None and drawn.observer is not None:
                playback.watch.rate = write_rate(playback.views, output, listener)
            try:
                with savers or nullcontext({}) as writers:
                    step_through(playback, drawn.observer, writers, collector, listener)
            except KeyboardInterrupt as stop:
                stopped = stop
            if collector.updates and drawn.observer is not None:
                drawn.step = decisive_step(collector.verdicts())
    except (SinkError, KeyboardInterrupt):
        if collector.updates:
            playback.remarks(collector)
            report(_scores(collector, playback, None, output.folder))
        raise
    if stopped is not None and not collector.updates:  # nothing is known of the recording yet
        raise stopped
    playback.remarks(collector)
    scores = _scores(collector, playback, drawn.file, output.folder)
    report(scores)
    if stopped is not None:
        raise type(stopped)(COMPLETE_SO_FAR)
    return scores


def _scores(
    collector: ResultCollector, playback: Playback, rrd: Path | None, saved_run: Path | None
) -> RunScores:
    info = playback.scene.info
    runs = tuple(collector.results())
    return RunScores(runs, info.name, info.display_units, tuple(info.notes), rrd, saved_run)


def collector_of(playback: Playback) -> ResultCollector:
    """Return what scores the runs, and compares those after the first with it."""
    scene = playback.scene
    localizers = {run.label: run.localizer for run in playback.views}
    starts = {run.label: run.start for run in playback.views}
    return ResultCollector(
        playback.labels, scene.arena, scene.scale.say, playback.other_drives, localizers, starts
    )


def step_through(
    playback: Playback,
    observer: SceneObserver | None,
    writers: Mapping[str, RunWriter],
    collector: ResultCollector,
    listener: Listener,
) -> None:
    """Go through all updates once: score, save, draw, each update whole; then draw what the end tells."""
    try:
        with stops_between() as stops:
            for steps in _warned(playback, listener):
                with stops.wait():
                    collector.add_steps(steps)
                    for label, writer in writers.items():
                        writer.add(*steps[label])
                    if observer is not None and playback.draws(steps):
                        observer.see(steps, collector)
                listener.progress(collector.updates, playback.total, "replay")
                if playback.watch is not None:
                    playback.watch.see(steps, collector)
    finally:
        results = collector.results() if collector.updates else []
        for result in results:
            if result.label in writers:
                writers[result.label].failures = result.verdict.failures
        if observer is not None:
            observer.end(results)


def _warned(playback: Playback, listener: Listener) -> Iterator[Mapping[str, Step]]:
    """Yield all updates; warn at the first of what no sensor of a run can read."""
    warn = once(listener.warning)
    for number, steps in enumerate(playback.updates):
        for run in playback.views if number == 0 else ():
            frame = steps[run.label][0].frame
            text = None if run.sensor is None else say_other_shape(frame, run.sensor.sensors.values())
            if text is not None:
                warn(text)
        yield steps


def remark(collector: ResultCollector, session: RecordedSession, listener: Listener) -> None:
    """Report what was skipped of a session and what went wrong in its runs; InputError without a step."""
    remark_skipped(session, listener)
    remark_zeros(collector, listener)
    if not collector.updates:
        raise InputError(session.path, "found no picture that can be read, so nothing was localized")


def remark_zeros(collector: ResultCollector, listener: Listener) -> None:
    """Report how often all of a run's particles were where a robot cannot be."""
    for label, times in collector.all_zero.items():
        if times:
            why = "no particle was in free space"
            if collector.no_number[label]:
                why = f"likelihoods were no numbers (NaN) at {collector.no_number[label]} of them"
            listener.warning(f"{label}: at {times} of {collector.updates} steps all weights were zero: {why}")


STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stops:
    """Remembers a request to stop while an update is processed; a second one takes effect at once."""

    def __init__(self) -> None:
        self._inside = False
        self._requested: int | None = None  # the signal that came inside

    @contextmanager
    def wait(self) -> Iterator[None]:
        """Hold back a request that comes inside until the block has ended without an error."""
        self._inside = True
        try:
            yield
        finally:
            self._inside = False
        if self._requested is not None:
            raise Terminated if self._requested == signal.SIGTERM else KeyboardInterrupt

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal, as `signal.signal` takes it."""
        first, self._requested = self._requested is None, number
        if not (self._inside and first):
            raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def stops_between() -> Iterator[Stops]:
    """Handle both signals in the main thread, the only one in which Python can; what is ignored stays so.

    SIGTERM is left alone where nobody has set a handler: it then ends the process at once, as usual.
    """
    stops, before = Stops(), dict[int, Any]()
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
        before = {number: handler for number, handler in before.items() if callable(handler)}
    try:
        for number in before:
            signal.signal(number, stops.handle)
        yield stops
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
