"""Comparing two to four runs side by side: of one session or live source, of several sessions, or saved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.config_files import motion_file
from maurice_loaders.errors import InputError
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.reading.options import ReadingOptions
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.manifest import is_saved, library_hash
from maurice_loaders.runs.store import SavedRun
from maurice_mcl.values import F64, Arena, Library

from ..entities import RESERVED
from ..errors import SILENT, Listener, OptionError
from ..layouts import DETAILS
from ..playback import ResultCollector, aligned, run_together, shared
from ..running import open as opening
from ..running.live import LiveOptions
from ..running.output import OutputOptions, output_of
from ..running.run import Playback, Report, RunScores, play, remark_zeros
from ..running.run_spec import AnySource, RunSpec, read_as_amcl, settings_with, start_of
from ..running.saved import Opened, open_saved, playback_of, remark_saved, view_of
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
    *,
    features: Sequence[str] = (),
    presets: Sequence[str] = (),
    particles: int | Sequence[int] = (),
    seeds: int | Sequence[int] = (),
    starts: str | Sequence[str | F64] = (),
    configs: Sequence[str | Path] = (),
    settings: Mapping[str, Any] | Sequence[Mapping[str, Any]] = (),
    sensors: Sequence[str] = (),
    reading: ReadingOptions | None = None,
    live: LiveOptions | None = None,
    to: str | Path | None = None,
    save_run: str | Path | None = None,
    layout: str | None = None,
    detail: str = DETAILS[0],
    force: bool = False,
    output: OutputOptions | None = None,
    report: Report = lambda scores: None,
    listener: Listener = SILENT,
) -> RunScores:
    """Replay two to four runs side by side and return their scores; all after the first are compared with it.

    Of one session or live source, exactly one of the plural arguments has several values, a run each, but
    files of AMCL's parameters go beside presets; without any, the features color and blended are compared.
    Several sessions (paths, or opened ones) of one library are replayed with one filter; saved runs (paths)
    are compared as they were. The other arguments are those of `replay`.

    InputError for bad files and arguments. Nothing is printed: remarks and progress go to the listener.

        >>> import maurice_viz as mv
        >>> scores = mv.compare("session.log", features=["color", "blended"], particles=50)
        >>> [run.label for run in scores.runs]
        ['color', 'blended']
    """
    given: dict[str, Sequence[Any]] = {
        "feature": _several(features),
        "preset": _several(presets),
        "particles": _several(particles),
        "seed": _several(seeds),
        "start": [start_of(start) for start in _several(starts)],
        "config": [Path(config) for config in _several(configs)],
        "settings": [settings_with(values, sensors) for values in _several(settings) or [{}] * bool(sensors)],
    }
    is_one = not isinstance(session, Sequence) or isinstance(session, str)
    sources: list[AnySource] = [session] if is_one else list(session)  # type: ignore[list-item,arg-type]  # told apart by is_one
    named = sources[0] if len(sources) == 1 else SEVERAL
    output = output_of(named, output, to, save_run, layout, detail, force=force)
    reading, live = reading or ReadingOptions(), live or LiveOptions()
    return _compared(sources, library, given, output, reading, live, listener, report)


def _several(values: Any) -> Sequence[Any]:
    return list(values) if isinstance(values, Sequence) and not isinstance(values, str) else [values]


def _compared(
    sources: Sequence[AnySource],
    library: str | Path | Library | None,
    given: Given,
    output: OutputOptions,
    reading: ReadingOptions,
    live: LiveOptions,
    listener: Listener,
    report: Report,
) -> RunScores:
    """Compare what is named, by the one way that fits it. InputError, OptionError."""
    saved = [isinstance(source, (str, Path)) and is_saved(Path(source)) for source in sources]
    if any(saved):
        if not all(saved):
            raise OptionError("sessions and saved runs do not mix; save the other runs first with --save-run")
        if any(given.values()) or library is not None or output.save_run or reading != ReadingOptions():
            raise OptionError(
                "saved runs are compared as they were: only options of the output apply to them"
            )
        _check_count(len(sources), fewest=1)
        folders = [Path(str(source)) for source in sources]
        return _play(_saved_playback(folders, listener), output, listener, report)
    if len(sources) > 1:
        _check_count(len(sources))
        paths = [source for source in sources if isinstance(source, (str, Path))]
        if live != LiveOptions() or any(map(live.listens, paths)):
            raise OptionError("a live source is compared alone, with several filters; several were named")
        if output.save_run is not None:
            advice = "replay each with --save-run, then compare"
            raise OptionError(f"--save-run saves runs of one session; {advice}")
        asked = Path(library) if isinstance(library, str) else library
        playback = _sessions_playback(sources, asked, one_filter(given), reading, listener)
        return _play(playback, output, listener, report)
    specs = specs_of(given)
    _check_count(len(specs))
    return replay_source(sources[0], library, specs, output, reading, live, listener, report)


def _play(playback: Playback, output: OutputOptions, listener: Listener, report: Report) -> RunScores:
    labels = [run.label for run in playback.views] if output.stem == SEVERAL else []
    return play(playback, output.named(labels), listener, report=report)


def _check_count(found: int, fewest: int = 2) -> None:
    if not fewest <= found <= MOST_RUNS:
        raise OptionError(f"2 to {MOST_RUNS} runs can be compared, found {found}")


# In what runs differ: exactly one kind of option is given several times, and names the runs.

Given = Mapping[str, Sequence[Any]]  # by the names of RunSpec's fields, what was given of each


def specs_of(given: Given) -> list[RunSpec]:
    """Return a run for each value of the one option that has several; the others hold for all.

    AMCL's parameters are a filter of their own, and compared with presets. Without any such option and
    without a feature, color and blended are compared. OptionError for others.
    """
    several = [kind for kind, values in given.items() if len(values) > 1]
    if len(several) > 1:
        words = " and ".join(f"--{_option(kind)}" for kind in several)
        raise OptionError(f"{words} are given several times; give exactly one option several times")
    amcl = given["config"] and RunSpec(config=given["config"][0]).amcl
    if amcl and given["preset"] and several in ([], ["config"], ["preset"]):
        return [*_runs("config", {**given, "preset": ()}), *_runs("preset", {**given, "config": ()})]
    if not several and given["feature"]:
        raise OptionError(f"found 1 run to compare; give one of {KINDS} several times")
    return _runs(several[0], given) if several else _runs("feature", {**given, "feature": COLOR_AND_BLENDED})


def _runs(kind: str, given: Given) -> list[RunSpec]:
    """Return a run for each value of one option; the first of every other holds for all."""
    common = {name: values[0] for name, values in given.items() if values and name != kind}
    named = zip(given[kind], _names(kind, given[kind]), strict=True)
    return [RunSpec(**common, **{kind: value}, name=name) for value, name in named]


def _option(kind: str) -> str:
    return "set" if kind == "settings" else kind


def one_filter(given: Given) -> RunSpec:
    """Return the filter that several sessions are replayed with. OptionError if there would be several."""
    for kind, values in given.items():
        if len(values) > 1:
            raise OptionError(f"sessions are compared with one filter; give --{_option(kind)} once")
    return RunSpec(**{kind: values[0] for kind, values in given.items() if values})


def _names(kind: str, values: Sequence[Any]) -> list[str]:
    if kind == "config":
        return names_of([value.with_suffix("") for value in values])
    if kind == "settings":
        return _setting_names(values)
    if kind in ("seed", "particles"):
        return [f"{kind} {value}" for value in values]
    return [value if isinstance(value, str) else f"start {number}" for number, value in enumerate(values, 1)]


def _setting_names(values: Sequence[Mapping[str, Any]]) -> list[str]:
    keys = list(dict.fromkeys(key for settings in values for key in settings))
    differing = [key for key in keys if len({str(settings.get(key)) for settings in values}) > 1]
    words = [
        {key: _setting_word(key, settings.get(key, "default")) for key in differing} for settings in values
    ]
    return [" ".join(run.values()) or "set" for run in words]


def _setting_word(key: str, value: Any) -> str:
    """Return a value as a run's name may hold it: of a file of motion parameters, its stem."""
    file = motion_file({key: value})
    return str(value) if file is None else file.stem


def names_of(paths: Sequence[Path]) -> list[str]:
    """Name paths by the last part in which they differ, and as many before it as distinguish them.

    `a/session` and `b/session` are "a" and "b". What cannot be distinguished (the same path twice) keeps one
    name; `unique_labels` numbers those.
    """
    whole = [path.absolute().parts[1:] for path in paths]
    different = len(set(whole))
    typed = [tuple(part for part in path.parts if part not in (path.anchor, "..")) for path in paths]
    parts = typed if all(typed) and len(set(typed)) == different else whole
    while different > 1 and min(map(len, parts)) > 1 and len({path[-1] for path in parts}) == 1:
        parts = [path[:-1] for path in parts]
    depths = range(1, max(map(len, parts)) + 1)
    named = ([" ".join(path[-depth:]) for path in parts] for depth in depths)
    return next(names for names in named if len(set(names)) == different)


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


def _sessions_playback(
    sources: Sequence[AnySource],
    library: Path | Library | None,
    spec: RunSpec,
    reading: ReadingOptions,
    listener: Listener,
) -> Playback:
    """Prepare sessions of one library with one filter, side by side by the number of the update."""
    reading, (spec,) = read_as_amcl(sources[0], reading, [spec], listener)
    sessions = [opening.open_session(source, reading, listener) for source in sources]
    paths = [session.path for session in sessions]
    references = _one_library(sessions, library, reading.keep_going, listener)
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
    found: dict[Path, Library] = {}
    for session in sessions:
        path = (asked or session.info.survey or session.path).resolve()
        if path not in found:
            found[path] = opening.open_library_for(session, asked, keep_going=keep_going, listener=listener)
        first, this = next(iter(found.values())), found[path]
        if first is not this and library_hash(first, list(first.index)) != library_hash(
            this, list(this.index)
        ):
            advice = "compare sessions of one library, or name one with --library"
            raise InputError(session.path, f"belongs to another library than {sessions[0].path}; {advice}")
    return next(iter(found.values()))


def _remark_lengths(
    collector: ResultCollector, names: Sequence[Path], counts: Sequence[int], listener: Listener
) -> None:
    shortest = min(counts)
    if max(counts) > shortest == collector.updates:
        name = names[counts.index(shortest)]
        listener.remark(f"compared over the first {shortest} steps: {name} has no more")
