"""Replaying one session: a recorded one, a saved run, or a live source (a socket, a pipe, a growing file)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maurice_loaders.errors import InputError, SourceError
from maurice_loaders.live.source import Patience, is_live, live_source
from maurice_loaders.reading.observations import gate_of
from maurice_loaders.reading.options import MADE_ODOMETRY, ReadingOptions
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.manifest import check_run_target, is_saved
from maurice_mcl.values import F64, Library

from ..errors import SILENT, Listener, OptionError
from ..layouts import DETAILS, RECORDED_LAYOUT_NAMES
from ..playback import FilterRun, ResultCollector, run_together, shared
from ..running import open as opening
from ..running.output import OutputOptions, output_of, show_recording, window_ahead
from ..running.run import Playback, Report, RunScores, play, remark, remark_zeros
from ..running.run_spec import RunSpec, words_of
from ..running.saving import Inputs, filters_to_save, saving
from ..running.watch import LossCommand, Watch
from ..scene import RunView, Scene

if TYPE_CHECKING:
    from maurice_loaders.live.session import LiveSession


def replay(
    session: str | Path | RecordedSession,
    library: str | Path | Library | None = None,
    *,
    feature: str | None = None,
    preset: str | None = None,
    particles: int | None = None,
    seed: int = 0,
    start: str | F64 | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    sensors: Sequence[str] = (),
    reading: ReadingOptions | None = None,
    live: LiveOptions | None = None,
    as_recorded: bool = False,
    to: str | Path | None = None,
    save_run: str | Path | None = None,
    layout: str | None = None,
    detail: str = DETAILS[0],
    force: bool = False,
    output: OutputOptions | None = None,
    report: Report = lambda scores: None,
    listener: Listener = SILENT,
) -> RunScores:
    """Replay a session once and return its scores.

    `session` is the path of a session log, of a recording of any format or of a saved run, a live source
    (`live` says how it is listened to), or a session that `maurice_loaders.open_session` opened. `library` is
    a library, its folder or a survey log; None: the one that the session's header names. `feature`, `preset`,
    `config` (a TOML file) and `settings` (values by key of the configuration, such as
    `{"sensor.sharpness": 2}`; `motion` may name a file) choose the filter, the later over the earlier.
    `sensors` are pose sensors of other packages by name, such as "beacon" or "module:Class".
    `start` is "tracking", "truth", "global", "X,Y,HEADING" in display units and degrees, or a pose (3,) in
    meters and radians. `reading` says how a recording is read. With `as_recorded` the particles of a
    localizer in a bag are shown and scored, and no filter runs. `to` is the Rerun recording (.rrd) to write,
    `save_run` the folder to save every step to; what exists is an error unless `force`. `output` says these
    at once, and whether a viewer opens. Without a library a recording shows the drive alone, and the scores
    hold no run. `report` gets the scores as well, also those of a replay that is stopped.

    InputError for bad files and arguments. Nothing is printed: remarks and progress go to the listener.

        >>> import maurice_viz as mv
        >>> scores = mv.replay("session.log", feature="color", particles=50, to="out.rrd")
        >>> round(scores.runs[0].score.position_error_mean_m, 2)
        0.02
    """
    spec = RunSpec.of(preset, feature, particles, seed, start, config, settings, sensors)
    output = output_of(session, output, to, save_run, layout, detail, force=force)
    reading, live = reading or ReadingOptions(), live or LiveOptions()
    return _replayed(session, library, spec, output, reading, live, as_recorded, listener, report)


def _replayed(
    session: str | Path | RecordedSession,
    library: str | Path | Library | None,
    spec: RunSpec,
    output: OutputOptions,
    reading: ReadingOptions,
    live: LiveOptions,
    as_recorded: bool,
    listener: Listener,
    report: Report,
) -> RunScores:
    """Replay what `session` names, by the one way that fits it. InputError, OptionError."""
    unfiltered = spec == RunSpec() and library is None
    plain = unfiltered and output.save_run is None
    if not isinstance(session, (str, Path)):
        return replay_session(session, library, [spec], output, reading, listener, report, alone=True)
    path = Path(session)
    listened = live.follow or is_live(path)
    if path.suffix == ".rrd":
        if not plain:
            raise OptionError(f"{path} is a recording of the viewer: no option applies to it")
        show_recording(path, listener, output)
        return RunScores(())
    if as_recorded:
        if not unfiltered:
            raise OptionError("--as-recorded runs no filter: only options of reading and of the output apply")
        if listened:
            raise OptionError("--as-recorded reads a bag that is finished, not a live source")
        if output.layout not in (None, *RECORDED_LAYOUT_NAMES):
            names = " and ".join(RECORDED_LAYOUT_NAMES)
            raise OptionError(f"--as-recorded has the layouts {names}, found {output.layout!r}")
        if output.save_run is not None:
            check_run_target(output.save_run, force=output.force)
        from ..running.recorded import open_recorded, playback_of_recorded, recorded_to_save

        recorded = open_recorded(path, reading)
        savers = None if output.save_run is None else saving(recorded_to_save(recorded, reading), output)
        named = output.named(["as recorded"])
        return play(playback_of_recorded(recorded, listener), named, listener, savers, report)
    if listened:
        if isinstance(library, Library):
            raise OptionError("a live source needs the path of its library, found an opened one")
        survey = None if library is None else Path(library)
        return follow_source(path, survey, spec, output, live, reading, listener, report)
    if live != LiveOptions():
        given = "--capture, --keep-up, --every-picture, --patience and --on-lost need a live source"
        raise OptionError(f"{given}: -, tcp://, ws://, cmucam://, or a file with --follow")
    if is_saved(path):
        if not plain or reading != ReadingOptions():
            raise OptionError("a saved run is replayed as it was: only options of the output apply to it")
        from ..running.saved import open_saved, playback_of  # loads polars, which a plain replay does without

        return play(playback_of(open_saved(path, listener), listener), output, listener, report=report)
    return replay_session(path, library, [spec], output, reading, listener, report, alone=True)


def replay_session(
    session: str | Path | RecordedSession,
    library: str | Path | Library | None,
    specs: Sequence[RunSpec],
    output: OutputOptions,
    reading: ReadingOptions,
    listener: Listener,
    report: Report,
    *,
    alone: bool = False,
) -> RunScores:
    """Replay a recorded session once for each spec, side by side; `alone` where no run may be enough.

    InputError, OptionError.
    """
    if output.save_run is not None:
        check_run_target(output.save_run, force=output.force)
        if isinstance(library, Library):
            raise OptionError("a saved run stores its library's path: give a path, not an opened library")
    reading = opening.read_as_amcl(reading, specs, listener)
    opened = opening.open_session(session, reading, listener)
    asked = Path(library) if isinstance(library, (str, Path)) else library
    plain = list(specs) == [RunSpec()] and output.save_run is None and output.layout is None
    alone = alone and plain and output.alone and not output.no_recording
    place = opening.library_of(opened, asked)
    if place is None and alone:
        from ..running.drive import show_alone  # imports Rerun

        written = show_alone(opened, output.named(["drive"]), listener)
        info = opened.info
        return RunScores((), info.name, info.display_units, tuple(info.notes), written)
    overview = opened.overview()
    if not overview[0]:
        shown = "a replay into a recording, without options of the filter, shows the drive"
        hint = shown if place is None else "`inspect` lists what it holds"
        raise InputError(opened.path, f"found neither pictures nor scans, which the filter needs; {hint}")
    with window_ahead(output) as output:  # comes up while the filter is made and Rerun imported
        references = opening.open_library_for(opened, place, keep_going=reading.keep_going, listener=listener)
        runs = opening.make_runs(opened, references, specs, listener)
        playback = playback_of_session(opened, references, runs, overview, listener)
        survey = place if isinstance(place, Path) else opened.path
        inputs = Inputs(opened, survey, playback.total, playback.scene.has_truth, reading)
        savers = saving(filters_to_save(runs, inputs), output)
        return play(playback, output.named(words_of(specs)), listener, savers, report)


def playback_of_session(
    session: RecordedSession,
    library: Library,
    runs: Sequence[FilterRun],
    overview: tuple[int, bool],
    listener: Listener,
) -> Playback:
    """Prepare runs of one recorded session, whose `overview` is known, for `play`."""
    pictures, has_truth = overview
    return Playback(
        shared(run_together(runs, session.moments())),
        pictures,
        [RunView.of(run.label, run.localizer, run.start) for run in runs],
        Scene(session.info, library, has_truth, pictures),
        lambda collector: remark(collector, session, listener),
    )


STEM = "live"  # of the recording, where no -o names it


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a live source is listened to; None: the source's default.

    >>> import maurice_viz as mv
    >>> followed = mv.LiveOptions(follow=True, patience_s=0.1)
    >>> mv.replay("session.log", particles=50, live=followed, to="live.rrd").runs[0].score.updates
    14
    """

    follow: bool = False  # the source is a file that is still being written
    capture: Path | None = None  # a folder: write all that comes to its session.log
    keep_up: bool | None = None  # leave out the oldest of more than four waiting pictures
    patience_s: float | None = None  # end when the source was away, or silent, for this long
    on_lost: str | None = None  # a command to run at each loss, without a shell


def patience_of(seconds: float | None) -> Patience:
    """Return how long to wait for a source that is away or silent."""
    return Patience() if seconds is None else Patience(seconds, seconds)


def follow_source(
    source: Path,
    library: Path | None,
    spec: RunSpec,
    output: OutputOptions,
    live: LiveOptions,
    reading: ReadingOptions,
    listener: Listener,
    report: Report,
) -> RunScores:
    """Localize on a live source until it ends or is stopped. InputError, OptionError."""
    if output.save_run is not None:
        advice = "capture the drive with --capture DIR, then replay DIR/session.log with --save-run"
        raise OptionError(f"--save-run is for recorded sessions; {advice}")
    options = [option for option in MADE_ODOMETRY if getattr(reading, option)]
    if reading.corrections or options:
        what = reading.corrections[0] if reading.corrections else f"--reading {options[0]}=true"
        advice = "capture the drive with --capture DIR, then replay DIR/session.log so"
        raise OptionError(f"{what} needs a recording; {advice}")
    from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession

    command = None if live.on_lost is None else LossCommand(live.on_lost, listener)
    recorder = None if live.capture is None else LiveRecorder(live.capture, force=output.force)
    asked = (reading.min_distance_m, reading.min_angle_rad) != (None, None)
    gate = gate_of(reading, scans=False) if asked else None
    listen = ListenOptions(
        live.keep_up,
        patience_of(live.patience_s),
        reading.camera,
        gate,
        library=library,
        start_holds=spec.start == "tracking",
    )
    with LiveSession(live_source(source, reading), listen, recorder, listener.remark) as session:
        try:
            watch = Watch(listener, command)
            return _localize(session, spec, replace(output, stem=STEM), watch, listener, report)
        finally:
            if recorder is not None:
                session.close()  # so that the file is whole when this is remarked
                counts = session.counts
                listener.remark(f"{session.path}: {counts.records} records, {counts.observed}")


def _localize(
    session: LiveSession,
    spec: RunSpec,
    output: OutputOptions,
    watch: Watch,
    listener: Listener,
    report: Report,
) -> RunScores:
    """Run the filter on what comes; the drawing begins with the first picture."""
    for text in session.info.notes:
        listener.remark(text)
    references = _library(session, listener)
    # what is wrong with it is raised before we wait
    runs = opening.make_runs(session, references, [spec], listener)
    moments = session.moments()
    first = next(moments, None)
    if first is None:
        _remark_left_out(session, listener)
        raise SourceError(session.source.name, "ended before a picture came, so nothing was localized")
    if _joined_late(session, spec, listener):
        runs = opening.make_runs(session, references, [replace(spec, start="global")], listener)
    playback = Playback(
        shared(run_together(runs, chain([first], moments), live=True)),
        0,
        [RunView.of(run.label, run.localizer, run.start) for run in runs],
        Scene(session.info, references, first.truth is not None, live=True),
        lambda collector: remark_live(collector, session, listener),
        watch=watch,
    )
    return play(playback, output, listener, report=report)


def _library(session: LiveSession, listener: Listener) -> Library:
    path = session.info.survey
    if path is None or not path.exists():
        where = "no library" if path is None else f"no library or survey at {path}"
        raise SourceError(session.source.name, f"found {where}; name one with --library")
    return opening.library_at(path, listener)


def _joined_late(session: LiveSession, spec: RunSpec, listener: Listener) -> bool:
    """Return whether the robot has moved on from its header's start pose; remark what that means."""
    from maurice_loaders.live.session import CALENDAR_S

    if spec.start is not None or session.info.start is None or not session.source.peer:
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
    kept = "; what moved before them was kept" if session.skipped else ""
    listener.remark(f"{counts.observed} came, {session.skipped} were skipped ({policy}){kept}")
    remark_zeros(collector, listener)


def _remark_left_out(session: LiveSession, listener: Listener) -> None:
    if session.problem_count:
        problems = f"{session.problem_count} lines or pictures made no sense and were left out"
        listener.remark(f"{session.source.name}: {problems}, the first: {session.problems[0]}")
