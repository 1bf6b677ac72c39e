"""A live source as runs: listened to, localized on by one or several filters, drawn and saved as it comes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from maurice_loaders.errors import SourceError
from maurice_loaders.live.source import Patience, live_source
from maurice_loaders.reading.observations import gate_of
from maurice_loaders.reading.options import Reading
from maurice_loaders.runs.manifest import check_run_target
from maurice_mcl.values import Library, Moment

from ..errors import Listener, OptionError
from ..playback import ResultCollector, run_together, shared
from ..scene import RunView, Scene
from . import open as opening
from .filters import Filter, read_as_amcl, words_of
from .output import Output
from .run import Playback, Report, RunScores, play, remark_zeros
from .saving import Inputs, filters_to_save, saving
from .source import Request
from .watch import LossCommand, Watch

if TYPE_CHECKING:
    from maurice_loaders.live.session import LiveSession
    from maurice_loaders.runs.writer import RunWriter

STEM = "live"  # of the recording, where no -o names it


def patience_of(seconds: float | None) -> Patience:
    """Return how long to wait for a source that is away or silent."""
    return Patience() if seconds is None else Patience(seconds, seconds)


def follow_source(request: Request) -> RunScores:
    """Localize on a live source, once for each filter, until it ends. InputError, OptionError."""
    if isinstance(request.library, Library):
        raise OptionError("a live source needs the path of its library, found an opened one")
    source, output, live, reading = Path(str(request.source)), request.output, request.live, request.reading
    listener = request.listener
    if output.folder is not None:
        if live.capture is None:
            raise OptionError("--save-run of a live source needs what came as well: add --capture DIR")
        check_run_target(output.folder, force=output.force)
    changes = [*reading.corrections, *["--reading odometry_from_truth=true"] * reading.odometry_from_truth]
    if changes:
        advice = "capture the drive with --capture DIR, then replay DIR/session.log so"
        raise OptionError(f"{changes[0]} needs a recording; {advice}")
    from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession

    command = None if live.on_lost is None else LossCommand(live.on_lost, listener)
    reading, specs = read_as_amcl(source, reading, request.specs, listener)
    output = replace(output, stem=STEM).named(words_of(specs))
    recorder = None if live.capture is None else LiveRecorder(live.capture, force=output.force)
    has_gate = (reading.min_distance_m, reading.min_angle_rad) != (None, None)
    gate = gate_of(reading, scans=False) if has_gate else None
    listen = ListenOptions(
        live.keep_up,
        patience_of(live.patience_s),
        reading.camera,
        gate,
        library=None if request.library is None else Path(request.library),
        start_holds=any(spec.start == "tracking" for spec in specs),
    )
    with LiveSession(live_source(source, reading), listen, recorder, listener.remark) as session:
        try:
            watch = Watch(listener, command)
            return _localize(session, specs, output, reading, watch, listener, request.report)
        finally:
            if recorder is not None:
                session.close()  # so that the file is whole when this is remarked
                counts = session.counts
                listener.remark(f"{session.path}: {counts.records} records, {counts.observed}")


def _localize(
    session: LiveSession,
    specs: Sequence[Filter],
    output: Output,
    reading: Reading,
    watch: Watch,
    listener: Listener,
    report: Report,
) -> RunScores:
    """Run the filters on what comes; the drawing begins with the first picture."""
    for text in session.info.notes:
        listener.remark(text)
    references = _library(session, listener)
    # what is wrong with them is raised before we wait
    runs = opening.make_runs(session, references, specs, listener)
    moments = session.moments()
    first = next(moments, None)
    if first is None:
        _remark_left_out(session, listener)
        raise SourceError(session.source.name, "ended before a picture came, so nothing was localized")
    if _joined_late(session, specs, listener):
        runs = [
            replace(run, start=None) if spec.start is None else run
            for run, spec in zip(runs, specs, strict=True)
        ]
    captured = Reading(
        camera=reading.camera, min_distance_m=reading.min_distance_m, min_angle_rad=reading.min_angle_rad
    )
    inputs = Inputs(session, session.info.survey or session.path, 0, False, captured)
    playback = Playback(
        shared(run_together(runs, _counted(chain([first], moments), inputs), live=True)),
        0,
        [RunView.of(run.label, run.localizer, run.start) for run in runs],
        Scene(session.info, references, first.truth is not None, live=True),
        lambda collector: remark_live(collector, session, listener),
        watch=watch,
    )
    savers = saving(filters_to_save(runs, inputs, live=True), output)
    return play(playback, output, listener, _after_the_capture(session, savers), report)


def _counted(moments: Iterable[Moment], inputs: Inputs) -> Iterator[Moment]:
    """Yield moments, and note what a recording knows of them before it is read."""
    for moment in moments:
        inputs.pictures += 1
        inputs.has_truth = inputs.has_truth or moment.truth is not None
        yield moment


@contextmanager
def _after_the_capture(
    session: LiveSession, savers: AbstractContextManager[Mapping[str, RunWriter]]
) -> Iterator[Mapping[str, RunWriter]]:
    """Listen no longer when the runs have ended: then the capture is whole, which saved runs name."""
    with savers as writers:
        try:
            yield writers
        finally:
            session.close()


def _library(session: LiveSession, listener: Listener) -> Library:
    path = session.info.survey
    if path is None or not path.exists():
        where = "no library" if path is None else f"no library or survey at {path}"
        raise SourceError(session.source.name, f"found {where}; name one with --library")
    return opening.library_at(path, listener)


def _joined_late(session: LiveSession, specs: Sequence[Filter], listener: Listener) -> bool:
    """Return whether the robot has moved on from its header's start pose; remark what that means."""
    from maurice_loaders.live.session import CALENDAR_S

    starts = [spec.start for spec in specs]
    if None not in starts or session.info.start is None or not session.source.peer:
        return False
    if session.joined_late:
        joined = f"joined {session.begun_s:.0f} s into the drive"
        listener.remark(f"{joined}, so the particles start anywhere; --start tracking for the header's pose")
        return True
    if session.begun_s >= CALENDAR_S:
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
    remark = "; what moved before them was kept" if session.skipped else ""
    listener.remark(f"{counts.observed} came, {session.skipped} were skipped ({policy}){remark}")
    remark_zeros(collector, listener)


def _remark_left_out(session: LiveSession, listener: Listener) -> None:
    if session.problem_count:
        problems = f"{session.problem_count} lines or pictures made no sense and were left out"
        listener.remark(f"{session.source.name}: {problems}, the first: {session.problems[0]}")
