"""Comparing two to four runs side by side: of one session or live source, of several sessions, or saved."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.manifest import library_hash
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.values import Arena, Library

from ..entities import RESERVED
from ..errors import SILENT, Listener, OptionError
from ..playback import ResultCollector, aligned, run_together, shared
from ..running import open as opening
from ..running.filters import AnyFilter, AnySource, Filter, filter_of, names_of, read_as_amcl, told_apart
from ..running.output import Output, output_of
from ..running.run import Playback, Report, RunScores, play, remark_zeros
from ..running.saved import Opened, open_saved, playback_of, remark_saved, view_of
from ..running.source import LiveOptions, Request, SourceKind, kind_of_source
from ..scene import RunView, Scene
from .convert import only_run
from .replay import replay_source

COLOR_AND_BLENDED = ("color", "blended")
MOST_RUNS = 4
SEVERAL = "comparison"  # stem of the recording where no single session gives it a name
KINDS = "--feature, --preset, --particles, --seed, --start, --config and --set"


def compare(
    session: AnySource | Sequence[AnySource],
    library: str | Path | Library | None = None,
    filters: AnyFilter | Sequence[AnyFilter] = (),
    *,
    reading: Reading | None = None,
    live: LiveOptions | None = None,
    to: str | Path | None = None,
    save_run: str | Path | None = None,
    force: bool = False,
    output: Output | None = None,
    report: Report = lambda scores: None,
    listener: Listener = SILENT,
) -> RunScores:
    """Replay two to four runs side by side and return their scores; all after the first are compared with it.

    One session or live source is run with each of the `filters` (`Filter`, or names of presets or features;
    without any, color and blended). Several sessions (paths, or opened ones) of one library are replayed with
    one filter; saved runs (paths) are compared as they were. The other arguments are those of `replay`.

    InputError for bad files and arguments. Nothing is printed: remarks and progress go to the listener.

        >>> import maurice_viz as mv
        >>> scores = mv.compare("session.log", filters=["color", mv.Filter("blended", particles=50)])
        >>> [run.label for run in scores.runs]
        ['color', 'blended']
    """
    several = isinstance(session, (list, tuple))
    sources: list[AnySource] = list(session) if several else [session]  # type: ignore[list-item,arg-type]  # told apart
    filter_list = [filters] if isinstance(filters, (Filter, str)) else list(filters or ())
    specs = [filter_of(each) for each in filter_list]
    named = sources[0] if len(sources) == 1 else SEVERAL
    output = output_of(named, output, to, save_run, force=force)
    live = live or LiveOptions()
    kinds = {kind_of_source(source, live) for source in sources}
    request = Request(sources[0], library, specs, output, reading or Reading(), live, listener, report)
    if len(sources) > 1 or SourceKind.SAVED in kinds:
        playback = _separate(sources, kinds, request)
        labels = [run.label for run in playback.views] if output.stem == SEVERAL else []
        return play(playback, output.named(labels), listener, report=report)
    if len(specs) == 1:
        raise OptionError(f"found 1 run to compare, {specs[0].label}; give another filter as well")
    specs = told_apart(specs or [Filter(feature=name) for name in COLOR_AND_BLENDED])
    _check_count(len(specs))
    return replay_source(replace(request, specs=specs))


def _separate(sources: Sequence[AnySource], kinds: Set[SourceKind], request: Request) -> Playback:
    """Prepare saved runs, or sessions that are replayed with one filter. InputError, OptionError."""
    specs, has_folder = request.specs, request.output.folder is not None
    if SourceKind.SAVED in kinds:
        if len(kinds) > 1:
            raise OptionError("sessions and saved runs do not mix; save the other runs first with --save-run")
        if specs or request.library is not None or has_folder or request.reading != Reading():
            only = "only options of the output apply to them"
            raise OptionError(f"saved runs are compared as they were: {only}")
        _check_count(len(sources), fewest=1)
        return _saved_playback([Path(str(source)) for source in sources], request.listener)
    _check_count(len(sources))
    if SourceKind.LIVE in kinds:
        raise OptionError("a live source is compared alone, with several filters; several were named")
    if has_folder:
        advice = "replay each with --save-run, then compare"
        raise OptionError(f"--save-run saves runs of one session; {advice}")
    if len(specs) > 1:
        raise OptionError(f"sessions are compared with one filter, found {len(specs)}; give one")
    return _sessions_playback(sources, request, specs[0] if specs else Filter())


def _check_count(found: int, fewest: int = 2) -> None:
    if not fewest <= found <= MOST_RUNS:
        raise OptionError(f"2 to {MOST_RUNS} runs can be compared, found {found}")


# Comparing what was made separately: saved runs, and sessions that are replayed with one filter.


def _saved_playback(folders: Sequence[Path], listener: Listener) -> Playback:
    """Prepare saved runs side by side as they were; a single folder is a comparison's."""
    if len(folders) == 1:
        comparison = open_saved(folders[0], listener)
        if len(comparison.runs) < 2:
            raise InputError(folders[0], "is a single saved run; name the one to compare it with as well")
        return playback_of(comparison, listener)
    _check_alike([only_run(folder) for folder in folders])
    opened = [
        _labelled(folder, label, listener)
        for folder, label in zip(folders, opening.unique_labels(names_of(folders)), strict=True)
    ]
    own = [_drive(run) != _drive(opened[0]) for run in opened]

    def remarks(collector: ResultCollector) -> None:
        runs = [run.runs[0] for run in opened]
        remark_saved(collector, runs, listener)
        counts = [run.manifest.pictures if run.manifest.steps is None else run.manifest.steps for run in runs]
        _remark_lengths(collector, [run.folder for run in runs], counts, listener)

    return Playback(
        aligned([shared(run.updates()) for run in opened]),
        min(run.runs[0].manifest.pictures for run in opened),
        [replace(view_of(run.restored[0]), own_drive=other) for run, other in zip(opened, own, strict=True)],
        _scene(opened),
        remarks,
    )


def _sessions_playback(sources: Sequence[AnySource], request: Request, spec: Filter) -> Playback:
    """Prepare sessions of one library with one filter, side by side by the number of the update."""
    recorded = [source for source in sources if isinstance(source, (str, Path, RecordedSession))]
    if len(recorded) < len(sources):
        raise OptionError("a session of your own is compared with several filters, not beside others")
    listener = request.listener
    reading, (spec,) = read_as_amcl(recorded[0], request.reading, [spec], listener)
    sessions = [opening.open_session(source, reading, listener) for source in recorded]
    paths = [session.path for session in sessions]
    place = Path(request.library) if isinstance(request.library, str) else request.library
    references = _one_library(sessions, place, reading.keep_going, listener)
    names = names_of([path.with_suffix("") for path in paths])
    free = [f"{name}.log" if name in RESERVED else name for name in names]  # as `session` is
    named = [replace(spec, name=label) for label in opening.unique_labels(free)]
    runs = [
        opening.make_runs(session, references, [labelled], listener)[0]
        for session, labelled in zip(sessions, named, strict=True)
    ]
    overviews = [opening.overview_of(session, listener) for session in sessions]
    drives = [str(path.resolve()) if path.is_dir() else hash_file(path) for path in paths]
    info = replace(sessions[0].info, name=" | ".join(dict.fromkeys(s.info.name for s in sessions)))
    shortest = min(pictures for pictures, _ in overviews)

    def remarks(collector: ResultCollector) -> None:
        for session in sessions:
            opening.remark_skipped(session, listener)
        remark_zeros(collector, listener)
        _remark_lengths(collector, paths, [pictures for pictures, _ in overviews], listener)

    return Playback(
        aligned([shared(run_together([run], s.moments())) for run, s in zip(runs, sessions, strict=True)]),
        shortest,
        [
            replace(RunView.of(run.label, run.localizer, run.start), own_drive=drive != drives[0])
            for run, drive in zip(runs, drives, strict=True)
        ],
        Scene(info, references, any(truth for _, truth in overviews), shortest),
        remarks,
    )


def _labelled(folder: Path, label: str, listener: Listener) -> Opened:
    opened = open_saved(folder, listener)
    (run,), (restored,) = opened.runs, opened.restored
    run = replace(run, manifest=replace(run.manifest, label=label))
    return replace(opened, runs=[run], restored=[replace(restored, saved=run)])


def _drive(opened: Opened) -> str:
    manifest = opened.runs[0].manifest
    table = None if manifest.table is None else manifest.table.sha256
    return f"{manifest.session.sha256} {manifest.reading} {table}"


def _scene(opened: Sequence[Opened]) -> Scene:
    """Draw with the library of a run whose library is still there."""
    scenes = [run.scene for run in opened]
    whole = next((scene for scene in scenes if scene.library.size), scenes[0])
    return replace(whole, has_truth=any(scene.has_truth for scene in scenes))


def _check_alike(runs: Sequence[SavedRun]) -> None:
    """Refuse runs with other maps or libraries than the first: the map is drawn once for all."""
    first, *others = runs
    for run in others:
        if not _same_map(first.arena(), run.arena()):
            raise InputError(
                run.folder, f"is a run on another map than {first.folder}; compare runs on one map"
            )
        if run.manifest.library.sha256 != first.manifest.library.sha256:
            raise InputError(
                run.folder, f"was made with another library than {first.folder}; compare runs of one"
            )


def _same_map(arena: Arena, other: Arena) -> bool:
    shapes = [
        [arena.bounds, arena.walls, *(region.polygon for region in arena.obstacles)],
        [other.bounds, other.walls, *(region.polygon for region in other.obstacles)],
    ]
    return len(shapes[0]) == len(shapes[1]) and all(map(np.array_equal, *shapes))


def _one_library(
    sessions: Sequence[RecordedSession], asked: Path | Library | None, keep_going: bool, listener: Listener
) -> Library:
    """Open the library that all sessions belong to. InputError if there are several."""
    if isinstance(asked, Library):
        return asked
    libraries: dict[Path, Library] = {}
    for session in sessions:
        path = (asked or session.info.survey or session.path).resolve()
        if path not in libraries:
            libraries[path] = opening.open_library_for(
                session, asked, keep_going=keep_going, listener=listener
            )
        first, this = next(iter(libraries.values())), libraries[path]
        if first is not this and library_hash(first, list(first.index)) != library_hash(
            this, list(this.index)
        ):
            advice = "compare sessions of one library, or name one with --library"
            raise InputError(session.path, f"belongs to another library than {sessions[0].path}; {advice}")
    return next(iter(libraries.values()))


def _remark_lengths(
    collector: ResultCollector, names: Sequence[Path], counts: Sequence[int], listener: Listener
) -> None:
    shortest = min(counts)
    if max(counts) > shortest == collector.updates:
        name = names[counts.index(shortest)]
        listener.remark(f"compared over the first {shortest} steps: {name} has no more")
