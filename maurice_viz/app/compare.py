"""Comparisons: in what runs differ, and comparing saved runs and several sessions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import typer

from maurice_loaders.errors import InputError
from maurice_loaders.libraries.files import hash_file
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.runs.manifest import library_hash
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.library import Library
from maurice_mcl.map import Arena

from ..cli.console import note
from ..cli.errors import one_line_errors
from ..cli.options import OutputOptions, RunOptions
from ..cli.replay.compare import COLOR_AND_BLENDED
from ..entities import RESERVED
from ..playback import ResultCollector, aligned, run_together, shared
from ..scene import RunView
from .open import AnySession, RunSpec, make_runs, open_library_for, open_session, unique_labels
from .output import Scene
from .run import Playback, play, remark_skipped, remark_zeros
from .saved import Opened, drawn_of, open_saved, remark_saved, replay_saved

# In what runs differ: exactly one kind of option is given several times, and names the runs.

Given = Mapping[str, Sequence[Any]]  # by the names of RunSpec's fields, what was typed of each option

KINDS = "--feature, --preset, --resampler, --seed and --config"


def wanted_runs(given: Given) -> list[RunSpec]:
    """Give a run for each value of the one option that is given several times; the others hold for all.

    Without any such option and without a feature, color and blended are compared. A usage error for others.
    """
    several = [kind for kind, values in given.items() if len(values) > 1]
    if len(several) > 1:
        words = " and ".join(f"--{kind}" for kind in several)
        raise typer.BadParameter(f"{words} are given several times; give exactly one option several times")
    if not several and given["feature"]:
        raise typer.BadParameter(f"found 1 run to compare; give one of {KINDS} several times")
    kind = several[0] if several else "feature"
    values = given[kind] if several else COLOR_AND_BLENDED
    common = {name: typed[0] for name, typed in given.items() if typed and name != kind}
    named = zip(values, _names(kind, values), strict=True)
    return [RunSpec(**common, **{kind: value}, name=name) for value, name in named]


def one_filter(given: Given) -> RunSpec:
    """Give the filter that several sessions are replayed with. A usage error where there would be several."""
    for kind, values in given.items():
        if len(values) > 1:
            raise typer.BadParameter(f"sessions are compared with one filter; give --{kind} once")
    return RunSpec(**{kind: values[0] for kind, values in given.items() if values})


def _names(kind: str, values: Sequence[Any]) -> list[str]:
    if kind == "config":
        return names_of([value.with_suffix("") for value in values])
    return [f"seed {value}" if kind == "seed" else str(value) for value in values]


def names_of(paths: Sequence[Path]) -> list[str]:
    """Name paths by the last part in which they differ, and as many before it as tell them apart.

    `a/session` and `b/session` are "a" and "b". What cannot be told apart (the same path twice) keeps one
    name; `unique_labels` numbers those.
    """
    whole = [path.absolute().parts[1:] for path in paths]
    different = len(set(whole))
    typed = [tuple(part for part in path.parts if part not in (path.anchor, "..")) for path in paths]
    parts = typed if all(typed) and len(set(typed)) == different else whole
    while different > 1 and min(map(len, parts)) > 1 and len({one[-1] for one in parts}) == 1:
        parts = [one[:-1] for one in parts]
    depths = range(1, max(map(len, parts)) + 1)
    named = ([" ".join(one[-depth:]) for one in parts] for depth in depths)
    return next(names for names in named if len(set(names)) == different)


# Comparing what was made apart: saved runs, and sessions that are replayed with one filter.


def compare_saved(folders: Sequence[Path], output: OutputOptions) -> None:
    """Show saved runs side by side as they were; a single folder is a comparison's."""
    with one_line_errors():
        if len(folders) == 1:
            _check_comparison(open_saved(folders[0]), folders[0])
            replay_saved(folders[0], output)
            return
        _check_alike([_single(folder) for folder in folders])
        opened = [_labelled(*one) for one in zip(folders, unique_labels(names_of(folders)), strict=True)]
        own = [_drive(one) != _drive(opened[0]) for one in opened]
        drawn = [
            replace(drawn_of(one.restored[0]), own_drive=other)
            for one, other in zip(opened, own, strict=True)
        ]
        playback = Playback(
            aligned([shared(one.updates()) for one in opened]),
            min(one.runs[0].manifest.pictures for one in opened),
            drawn,
            _scene(opened),
            lambda collector: _remark_saved(collector, opened),
        )
        play(playback, output)


def compare_sessions(
    paths: Sequence[Path],
    library: Path | None,
    wanted: RunSpec,
    options: RunOptions,
    output: OutputOptions,
    *,
    keep_going: bool,
    opening: ReadingOptions | None = None,
) -> None:
    """Replay sessions of one library with one filter, side by side by the number of the update."""
    with one_line_errors():
        sessions = [open_session(path, keep_going=keep_going, opening=opening) for path in paths]
        references = _one_library(sessions, library, keep_going=keep_going)
        named = [replace(wanted, name=label) for label in _labels(paths)]
        runs = [
            make_runs(session, references, [one], options)[0]
            for session, one in zip(sessions, named, strict=True)
        ]
        overviews = [session.overview() for session in sessions]
        drives = [_content(path) for path in paths]
        info = replace(sessions[0].info, name=" | ".join(dict.fromkeys(s.info.name for s in sessions)))
        shortest = min(pictures for pictures, _ in overviews)
        playback = Playback(
            aligned([shared(run_together([run], s)) for run, s in zip(runs, sessions, strict=True)]),
            shortest,
            [
                replace(RunView.live(run.label, run.localizer), own_drive=drive != drives[0])
                for run, drive in zip(runs, drives, strict=True)
            ],
            Scene(info, references, any(truth for _, truth in overviews), shortest),
            lambda collector: _remark_sessions(collector, sessions, [count for count, _ in overviews]),
        )
        play(playback, output)


def _content(path: Path) -> str:
    """Tell drives apart: by content, or a folder by its place."""
    return str(path.resolve()) if path.is_dir() else hash_file(path)


def _labels(paths: Sequence[Path]) -> list[str]:
    """Name sessions after their files, which may well be called `session`, a word that is taken."""
    names = names_of([path.with_suffix("") for path in paths])
    free = [f"{name}.log" if name in RESERVED else name for name in names]
    return unique_labels(free)


def _check_comparison(opened: Opened, folder: Path) -> None:
    if len(opened.runs) < 2:
        raise InputError(folder, "is a single saved run; name the one to compare it with as well")


def _single(folder: Path) -> SavedRun:
    """Open a saved run, nothing that it was made from. InputError for a comparison's folder."""
    runs = open_runs(folder)
    if len(runs) > 1:
        below = ", ".join(str(run.folder) for run in runs)
        raise InputError(folder, f"holds {len(runs)} runs; name the ones to compare: {below}")
    return runs[0]


def _labelled(folder: Path, label: str) -> Opened:
    """Open one saved run under another label."""
    opened = open_saved(folder)
    (run,), (restored,) = opened.runs, opened.restored
    run = replace(run, manifest=replace(run.manifest, label=label))
    return replace(opened, runs=[run], restored=[replace(restored, saved=run)])


def _drive(opened: Opened) -> str:
    manifest = opened.runs[0].manifest
    table = None if manifest.table is None else manifest.table.sha256
    return f"{manifest.session.sha256} {manifest.reading} {table}"


def _scene(opened: Sequence[Opened]) -> Scene:
    """Draw with the library of a run whose library is still there."""
    scenes = [one.scene for one in opened]
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


def _same_map(one: Arena, other: Arena) -> bool:
    shapes = [
        [one.bounds, one.walls, *(region.polygon for region in one.obstacles)],
        [other.bounds, other.walls, *(region.polygon for region in other.obstacles)],
    ]
    return len(shapes[0]) == len(shapes[1]) and all(map(np.array_equal, *shapes))


def _one_library(sessions: Sequence[AnySession], asked: Path | None, *, keep_going: bool) -> Library:
    """Open the library that all sessions belong to. InputError where there are several."""
    found: dict[Path, Library] = {}
    for session in sessions:
        path = (asked or session.info.survey or session.path).resolve()
        if path not in found:
            found[path] = open_library_for(session, asked, keep_going=keep_going)
        first, this = next(iter(found.values())), found[path]
        if first is not this and library_hash(first, list(first.index)) != library_hash(
            this, list(this.index)
        ):
            advice = "compare sessions of one library, or name one with --library"
            raise InputError(session.path, f"belongs to another library than {sessions[0].path}; {advice}")
    return next(iter(found.values()))


def _remark_sessions(
    collector: ResultCollector, sessions: Sequence[AnySession], counts: Sequence[int]
) -> None:
    for session in sessions:
        remark_skipped(session)
    remark_zeros(collector)
    _remark_lengths(collector, [str(session.path) for session in sessions], counts)


def _remark_saved(collector: ResultCollector, opened: Sequence[Opened]) -> None:
    runs = [one.runs[0] for one in opened]
    remark_saved(collector, runs)
    counts = [run.manifest.pictures if run.manifest.steps is None else run.manifest.steps for run in runs]
    _remark_lengths(collector, [str(run.folder) for run in runs], counts)


def _remark_lengths(collector: ResultCollector, names: Sequence[str], counts: Sequence[int]) -> None:
    shortest = min(counts)
    if max(counts) > shortest == collector.updates:
        name = names[counts.index(shortest)]
        note(f"compared over the first {shortest} updates: {name} has no more")
