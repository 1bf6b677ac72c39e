"""Replaying: a session of any format, a saved run, a live source, or a bag's own localizer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from maurice_loaders.live.source import is_live
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.runs.store import is_saved
from maurice_loaders.runs.writer import check_run_target
from maurice_mcl.arrays import F64
from maurice_mcl.library import Library

from ..errors import OptionError
from ..layouts.names import DETAILS, RECORDED_LAYOUT_NAMES
from ..playback import run_together, shared
from ..scene import RunView
from .drive import show_alone
from .listener import SILENT, Listener
from .live import LiveOptions, follow_source
from .open import (
    AnySession,
    RunSpec,
    as_recorded_session,
    make_runs,
    open_library_for,
    open_session,
)
from .output import DriveScene, OutputOptions
from .recorded import open_as_recorded, playback_as_recorded
from .run import Playback, Report, RunScores, no_report, play, remark
from .saved import open_saved, playback_of
from .saving import Inputs, saving

AS_IT_WAS = "a saved run is replayed as it was: only options of the output apply to it"


def replay(
    session: str | Path | AnySession,
    library: str | Path | Library | None = None,
    *,
    feature: str | None = None,
    preset: str | None = None,
    particles: int | None = None,
    seed: int = 0,
    start: str | F64 | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    reading: ReadingOptions | None = None,
    to: str | Path | None = None,
    run: str | Path | None = None,
    layout: str | None = None,
    detail: str = DETAILS[0],
    force: bool = False,
    listener: Listener | None = None,
) -> RunScores:
    """Replay a session once and return its scores.

    `session` is the path of a session log, of a recording of any format or of a saved run, or a session that
    `maurice_loaders.open_session` opened. `library` is a library, its folder or a survey log; None: the one
    that the session's header names. `feature`, `preset`, `config` (a TOML file) and `settings` (values by key
    of the configuration, such as `{"sensor.sharpness": 2}`) choose the filter, the later over the earlier.
    `start` is "tracking", "truth", "global", "X,Y,HEADING" in display units and degrees, or a pose (3,) in
    meters and radians. `reading` says how a recording is read. `to` is the Rerun recording (.rrd) to write,
    `run` the folder to save every step to; what exists is an error unless `force`.

    InputError for bad files and arguments. Nothing is printed: remarks and progress go to the listener.

    >>> import maurice_viz as mv
    >>> scores = mv.replay("session.log", feature="color", particles=500)
    >>> print(scores.runs[0].score.position_error_mean_m)
    """
    spec = spec_of(feature, preset, particles, seed, start, config, settings)
    output = output_of(session, to, run, layout, detail, force)
    return replay_any(session, library, spec, output, reading=reading, listener=listener or SILENT)


def spec_of(
    feature: str | None,
    preset: str | None,
    particles: int | None,
    seed: int,
    start: str | F64 | None,
    config: str | Path | None,
    settings: Mapping[str, Any] | None,
) -> RunSpec:
    """Return one run as it is asked for in Python."""
    path = None if config is None else Path(config)
    return RunSpec(preset, feature, particles, seed, start, path, dict(settings or {}))


def output_of(
    session: object,
    to: str | Path | None,
    run: str | Path | None,
    layout: str | None,
    detail: str,
    force: bool,
) -> OutputOptions:
    """Return the output that is asked for in Python: no viewer, and a recording only where it is named."""
    stem = Path(session).stem if isinstance(session, (str, Path)) else "replay"
    rrd, folder = None if to is None else Path(to), None if run is None else Path(run)
    return OutputOptions(stem, rrd, True, rrd is None, force, folder, layout, detail)


def replay_any(
    session: str | Path | AnySession,
    library: str | Path | Library | None,
    spec: RunSpec,
    output: OutputOptions,
    *,
    reading: ReadingOptions | None = None,
    live: LiveOptions | None = None,
    as_recorded: bool = False,
    alone: bool = True,
    listener: Listener = SILENT,
    report: Report = no_report,
) -> RunScores:
    """Replay whatever `session` names, with one run; the command and the function `replay` both call this.

    With `alone` a drive without a library is shown by itself where a recording is wanted and nothing else was
    asked for; its scores hold no run. InputError, OptionError.
    """
    plain = spec == RunSpec() and library is None and output.save_run is None
    how, live = reading or ReadingOptions(), live or LiveOptions()
    if not isinstance(session, (str, Path)):
        return replay_session(session, library, [spec], output, how, listener, report, alone)
    path = Path(session)
    listened = live.follow or is_live(path)
    if as_recorded:
        if not plain:
            raise OptionError("--as-recorded runs no filter: only options of reading and of the output apply")
        if listened:
            raise OptionError("--as-recorded reads a bag that is finished, not a live source")
        if output.layout not in (None, *RECORDED_LAYOUT_NAMES):
            names = " and ".join(RECORDED_LAYOUT_NAMES)
            raise OptionError(f"--as-recorded has the layouts {names}, found {output.layout!r}")
        recorded = playback_as_recorded(open_as_recorded(path, how), listener)
        return play(recorded, output, listener, report=report)
    if listened:
        if isinstance(library, Library):
            raise OptionError("a live source needs the path of its library, found an opened one")
        survey = None if library is None else Path(library)
        return follow_source(path, survey, spec, output, live, how, listener, report)
    if live != LiveOptions():
        given = "--capture, --keep-up, --every-picture and --patience need a live source"
        raise OptionError(f"{given}: -, tcp://, ws://, or a file with --follow")
    if is_saved(path):
        if not plain or how != ReadingOptions():
            raise OptionError(AS_IT_WAS)
        return play(playback_of(open_saved(path, listener), listener), output, listener, report=report)
    return replay_session(path, library, [spec], output, how, listener, report, alone)


def replay_session(
    session: str | Path | AnySession,
    library: str | Path | Library | None,
    specs: Sequence[RunSpec],
    output: OutputOptions,
    reading: ReadingOptions,
    listener: Listener,
    report: Report = no_report,
    alone: bool = False,
) -> RunScores:
    """Replay a recorded session once for each spec, side by side. InputError, OptionError."""
    if output.save_run is not None:
        check_run_target(output.save_run, force=output.force)
        if isinstance(library, Library):
            raise OptionError("a saved run names its library: give the path, found an opened library")
    opened = opened_session(session, reading, listener)
    asked = Path(library) if isinstance(library, (str, Path)) else library
    plain = list(specs) == [RunSpec()] and output.save_run is None and output.layout is None
    alone = alone and plain and not output.no_recording
    if alone and asked is None and opened.info.survey is None:
        written = show_alone(as_recorded_session(opened, reading), output, listener)
        return RunScores((), opened.info.name, opened.info.display_units, tuple(opened.info.notes), written)
    references = open_library_for(opened, asked, keep_going=reading.keep_going, listener=listener)
    runs = make_runs(opened, references, specs, listener)
    pictures, has_truth = opened.overview()
    survey = asked if isinstance(asked, Path) else opened.info.survey or opened.path
    inputs = Inputs(opened, survey, pictures, has_truth, reading.keep_going, reading)
    playback = Playback(
        shared(run_together(runs, opened)),
        pictures,
        [RunView.live(run.label, run.localizer) for run in runs],
        DriveScene(opened.info, references, has_truth, pictures),
        lambda collector: remark(collector, opened, listener),
    )
    return play(playback, output, listener, saving(runs, inputs, output), report)


def opened_session(
    session: str | Path | AnySession, reading: ReadingOptions, listener: Listener
) -> AnySession:
    """Return the session itself, or open what the path names. InputError for what is no session."""
    if not isinstance(session, (str, Path)):
        return session
    path = Path(session)
    return open_session(path, keep_going=reading.keep_going, opening=reading, listener=listener)
