"""Replaying one session: a recorded one, a saved run, or a live source (a socket, a pipe, a growing file)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from maurice_loaders.errors import InputError
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.manifest import check_run_target
from maurice_mcl.values import NO_PICTURE, Library, Moment, Session, SessionInfo, expect_frame

from ..errors import SILENT, Listener, OptionError
from ..layouts import RECORDED_LAYOUT_NAMES
from ..playback import FilterRun, run_together, shared
from ..running import open as opening
from ..running.filters import AnyFilter, AnySource, Filter, filter_of, read_as_amcl, words_of
from ..running.live import follow_source
from ..running.output import Output, output_of, show_recording, window_ahead
from ..running.run import Playback, Report, RunScores, play, remark, remark_zeros
from ..running.saving import Inputs, filters_to_save, saving
from ..running.source import LiveOptions, Request, SourceKind, kind_of_source
from ..scene import RunView, Scene


def replay(
    session: AnySource,
    library: str | Path | Library | None = None,
    filter: AnyFilter = None,  # noqa: A002
    *,
    reading: Reading | None = None,
    live: LiveOptions | None = None,
    as_recorded: bool = False,
    to: str | Path | None = None,
    save_run: str | Path | None = None,
    force: bool = False,
    output: Output | None = None,
    report: Report = lambda scores: None,
    listener: Listener = SILENT,
) -> RunScores:
    """Replay a session once and return its scores.

    `session` is the path of a session log, of a recording of any format or of a saved run, a live source
    (`live` says how it is listened to), a session that `open_session` opened, or one of your own. `library`
    is a library, its folder or a survey log; None: the one that the session's header names. `filter` is a
    `Filter`, or the name of a preset or feature. `reading` says how a recording is read. With `as_recorded`
    the particles of a localizer in a bag are shown and scored, and no filter runs. `to` is the Rerun
    recording (.rrd) to write, `save_run` the folder to save every step to; what exists is an error unless
    `force`. `output` says these at once, and layout, detail, and whether a viewer opens. Without a library a
    recording shows the drive alone, and the scores hold no run. `report` gets the scores as well, also those
    of a replay that is stopped.

    InputError for bad files and arguments. Nothing is printed: remarks and progress go to the listener.

        >>> import maurice_viz as mv
        >>> scores = mv.replay("session.log", filter=mv.Filter("color", particles=50), to="out.rrd")
        >>> round(scores.runs[0].score.error_mean_m, 2)
        0.02
    """
    output = output_of(session, output, to, save_run, force=force)
    request = Request(
        session,
        library,
        [filter_of(filter)],
        output,
        reading or Reading(),
        live or LiveOptions(),
        listener,
        report,
        alone=True,
    )
    if isinstance(session, (str, Path)) and Path(session).suffix == ".rrd":
        if not request.is_plain:
            raise OptionError(f"{session} is a recording of the viewer: no option applies to it")
        show_recording(Path(session), listener, output)
        return RunScores(())
    return _replay_as_recorded(request) if as_recorded else replay_source(request)


def replay_source(request: Request) -> RunScores:
    """Replay what was asked for, in the way of its source. InputError, OptionError."""
    return WAYS[kind_of_source(request.source, request.live)](request)


def _replay_as_recorded(request: Request) -> RunScores:
    """Show and score the localizers in a bag; no filter runs. InputError, OptionError."""
    output, library = request.output, request.library
    if list(request.specs) != [Filter()] or isinstance(library, Library):
        only = "only options of reading and of the output apply, and the path of a map"
        raise OptionError(f"--as-recorded runs no filter: {only}")
    if (
        not isinstance(request.source, (str, Path))
        or kind_of_source(request.source, request.live) is SourceKind.LIVE
    ):
        raise OptionError("--as-recorded reads a bag that is finished, not a live source")
    if output.layout not in (None, *RECORDED_LAYOUT_NAMES):
        names = " and ".join(RECORDED_LAYOUT_NAMES)
        raise OptionError(f"--as-recorded has the layouts {names}, found {output.layout!r}")
    if output.folder is not None:
        check_run_target(output.folder, force=output.force)
    from ..running.recorded import open_recorded, playback_of_recorded, recorded_to_save

    place = None if library is None else Path(library)
    recorded = open_recorded(Path(request.source), request.reading, place)
    savers = None if output.folder is None else saving(recorded_to_save(recorded, request.reading), output)
    playback = playback_of_recorded(recorded, request.listener)
    return play(playback, output.named(["as recorded"]), request.listener, savers, request.report)


def _replay_saved(request: Request) -> RunScores:
    """Show a saved run, or those of a comparison, as they were. InputError, OptionError."""
    if not request.is_plain:
        raise OptionError("a saved run is replayed as it was: only options of the output apply to it")
    from ..running.saved import open_saved, playback_of  # loads polars, which a plain replay does without

    playback = playback_of(open_saved(Path(str(request.source)), request.listener), request.listener)
    return play(playback, request.output, request.listener, report=request.report)


def _replay_session(request: Request) -> RunScores:
    """Replay a recording of any format, once for each filter, side by side. InputError, OptionError."""
    library, output, listener = request.library, request.output, request.listener
    assert isinstance(request.source, (str, Path, RecordedSession)), "see `kind_of_source`"
    if output.folder is not None:
        check_run_target(output.folder, force=output.force)
        if isinstance(library, Library):
            raise OptionError("a saved run stores its library's path: give a path, not an opened library")
    reading, specs = read_as_amcl(request.source, request.reading, request.specs, listener)
    opened = opening.open_session(request.source, reading, listener)
    plain = list(specs) == [Filter()] and output.folder is None and output.layout is None
    place = opening.library_of(opened, Path(library) if isinstance(library, str) else library)
    if place is None and request.alone and plain and output.alone and output.draws:
        from ..running.drive import show_alone  # imports Rerun

        written = show_alone(opened, output.named(["drive"]), listener)
        info = opened.info
        return RunScores((), info.name, info.display_units, tuple(info.notes), written)
    overview = opening.overview_of(opened, listener)
    if not overview[0]:
        shown = "a replay into a recording, without options of the filter, shows the drive"
        hint = shown if place is None else "`inspect` lists what it holds"
        raise InputError(opened.path, f"found neither pictures nor scans, which the filter needs; {hint}")
    with window_ahead(output) as output:  # comes up while the filter is made and Rerun imported
        references = opening.open_library_for(opened, place, keep_going=reading.keep_going, listener=listener)
        runs = opening.make_runs(opened, references, specs, listener)
        playback = playback_of_session(opened, references, runs, overview, listener)
        survey = place if isinstance(place, Path) else opened.path
        inputs = Inputs(opened, survey, playback.total, playback.scene.has_truth, opened.options)
        savers = saving(filters_to_save(runs, inputs), output)
        return play(playback, output.named(words_of(specs)), listener, savers, request.report)


@dataclass(frozen=True)
class _OwnSession:
    """A session of the caller's own, by a path for messages."""

    own: Session
    path: Path

    @property
    def info(self) -> SessionInfo:
        """The header."""
        return self.own.info

    def moments(self) -> Iterator[Moment]:
        """Yield the moments, each of which is one that a filter can use. InputError."""
        before = None
        for moment in self.own.moments():
            expect_frame(moment, before)
            before = moment.frame
            yield moment


def _replay_own(request: Request) -> RunScores:
    """Replay a session of the caller's own, which is on no disk. InputError, OptionError."""
    session, library, listener = request.source, request.library, request.listener
    if isinstance(session, (str, Path)) or not hasattr(session, "info") or not hasattr(session, "moments"):
        expected = "expected a path, or a session with `info` and `moments()`"
        raise InputError(None, f"session: found {type(session).__name__}, {expected}")
    place = session.info.survey if library is None else library
    if place is None:
        raise InputError(None, "found no library that goes with the session; name one with --library")
    if request.output.folder is not None:
        how = "write it with maurice_loaders.SessionWriter, and replay the log"
        raise OptionError(f"--save-run: a saved run names its session's file, and this one has none; {how}")
    own = _OwnSession(session, Path(session.info.name))
    references = place if isinstance(place, Library) else opening.library_at(Path(place), listener)
    first = next(own.moments(), None)
    if first is None:
        raise InputError(own.path, "holds no moment, so there is nothing to localize by")
    runs = opening.make_runs(own, references, request.specs, listener)
    has_pictures = first.frame.image is not NO_PICTURE
    playback = Playback(
        shared(run_together(runs, own.moments())),
        0,
        [RunView.of(run.label, run.localizer, run.start) for run in runs],
        Scene(own.info, references, first.truth is not None, has_pictures=has_pictures),
        lambda collector: remark_zeros(collector, listener),
    )
    return play(playback, request.output.named(words_of(request.specs)), listener, report=request.report)


WAYS: Mapping[SourceKind, Callable[[Request], RunScores]] = {
    SourceKind.SESSION: _replay_session,
    SourceKind.SAVED: _replay_saved,
    SourceKind.LIVE: follow_source,
    SourceKind.OWN: _replay_own,
}


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
