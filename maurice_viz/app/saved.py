"""Opening saved runs with what they were made from, and replaying them without filtering again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import chosen, nothing_beside, open_session
from maurice_loaders.libraries.store import open_library
from maurice_loaders.runs.manifest import library_hash
from maurice_loaders.runs.sources import Source, source_hash
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_loaders.transforms.made_odometry import NAMED
from maurice_mcl.config.build import build_localizer
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.session import Moment, SessionInfo

from ..playback import ResultCollector, shared
from ..scene import RunView
from .events import find_notes
from .listener import SILENT, Listener, progress_of
from .open import AnySession
from .output import DriveScene
from .restoring import Pictures, Restored, restored_together
from .run import Playback, remark_zeros


def unchanged(
    source: Source, folder: Path, what: str, beside: Callable[[Path], Sequence[Path]] = nothing_beside
) -> Path:
    """Find what a run was made from. InputError when it is gone, or it or a file `beside` it was changed."""
    path = source.find(folder)
    if path is None:
        raise InputError(Path(source.path), f"the {what} that the run was made from is gone; put it back")
    if source_hash(path, beside(path)) != source.sha256:
        raise InputError(
            path, f"the {what} was changed after the run was made; restore it, or replay it anew"
        )
    return path


def session_of(run: SavedRun) -> AnySession:
    """Open the session of a run as it was read then. InputError when it is gone or was changed."""
    reading = run.manifest.reading
    path = unchanged(
        run.manifest.session, run.folder, "session", lambda path: chosen(path, reading).beside(path)
    )
    table = run.manifest.table
    found = None if table is None else unchanged(table, run.folder, "table")
    return open_session(path, replace(reading, table=found, keep_going=run.manifest.keep_going))


def library_of(run: SavedRun, listener: Listener = SILENT) -> Library:
    """Open the library of a run. InputError when it is gone, was changed, or is measured differently."""
    path = unchanged(run.manifest.library, run.folder, "library")
    advance = progress_of(listener, "library")
    library = open_library(path, keep_going=run.manifest.keep_going, progress=advance)
    missing = [name for name in run.manifest.channels if name not in library.index]
    if missing or library_hash(library, run.manifest.channels) != run.manifest.library_content:
        what = f"has no channel {missing[0]}" if missing else "holds other measurements or poses"
        raise InputError(path, f"the library {what} than when the run was made; restore its pictures")
    return library


def localizer_of(run: SavedRun, session: AnySession, library: Library) -> Localizer:
    """Build the filter of a run again. InputError when its parameters are refused today."""
    parameters = run.configuration.parameters
    try:
        return build_localizer(library, session, parameters, seed=run.manifest.seed)
    except (ValueError, KeyError) as problem:
        raise InputError(run.folder, f"its filter cannot be built here: {problem}") from None


Part = TypeVar("Part")


@dataclass(frozen=True, slots=True)
class Opened:
    """A saved run, or those of a comparison, with what is still there of what they were made from."""

    runs: list[SavedRun]
    restored: list[Restored]
    session: AnySession | None
    scene: DriveScene  # its library has no entries where pictures or comparisons cannot be restored
    listener: Listener = SILENT

    def updates(self) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
        """Go through the updates from the first, every time it is called; records by the run's label."""
        return restored_together(self.restored, Pictures(self.session, self.listener.warning))


def open_saved(folder: Path, listener: Listener = SILENT) -> Opened:
    """Open a saved run's folder, or a comparison's. Warnings name what is gone; InputError."""
    runs = open_runs(folder)
    _check_one_session(runs)
    found = _find(runs[0], listener)
    first = runs[0].manifest
    whole = found.session is not None and found.library is not None
    library = found.library if whole and found.library is not None else _map_alone(runs[0])
    notes_then = (NAMED,) if first.reading.odometry_from_truth else ()
    gone = SessionInfo(first.name, first.display_units, notes=notes_then)
    info = found.session.info if found.session else gone
    notes = find_notes(folder, runs)
    for problem in notes.problems:
        listener.warning(problem)
    restored = [Restored(run, _sensor(run, found), notes.by_label[run.manifest.label]) for run in runs]
    scene = DriveScene(info, library, first.has_truth, first.pictures)
    return Opened(runs, restored, found.session, scene, listener)


def playback_of(opened: Opened, listener: Listener = SILENT) -> Playback:
    """Prepare saved runs for `play`, from their first update."""
    return Playback(
        shared(opened.updates()),
        opened.runs[0].manifest.pictures,
        [view_of(one) for one in opened.restored],
        opened.scene,
        lambda collector: remark_saved(collector, opened.runs, listener),
    )


@dataclass(frozen=True, slots=True)
class _Found:
    """What is still there of what a run was made from."""

    session: AnySession | None
    library: Library | None


def _check_one_session(runs: list[SavedRun]) -> None:
    for run in runs[1:]:
        if run.manifest.session.sha256 != runs[0].manifest.session.sha256:
            raise InputError(
                run.folder, f"is a run of another session than {runs[0].folder}; replay it alone"
            )


def _find(run: SavedRun, listener: Listener) -> _Found:
    """Open what is still there, and warn in a line of what is not."""
    problems: list[str] = []
    found = _Found(
        _tried(lambda: session_of(run), problems), _tried(lambda: library_of(run, listener), problems)
    )
    if problems:
        empty = "pictures and comparisons" if found.session is None else "comparisons"
        listener.warning(f"{'; '.join(problems)}: the panels of {empty} stay empty")
    return found


def _tried(opening: Callable[[], Part], problems: list[str]) -> Part | None:
    try:
        return opening()
    except InputError as problem:
        problems.append(str(problem).split(";")[0])
        return None


def _sensor(run: SavedRun, found: _Found) -> SensorModel | None:
    if found.session is None or found.library is None:
        return None
    return localizer_of(run, found.session, found.library).sensor


def view_of(one: Restored) -> RunView:
    """Return how one saved run is shown."""
    manifest = one.saved.manifest
    particles = one.saved.configuration.parameters.particles
    return RunView(manifest.label, manifest.channels, one.sensor, particles, one.bookmarks)


def _map_alone(run: SavedRun) -> Library:
    """Make a library without entries, of which only the map can be drawn."""
    manifest = run.manifest
    return Library(manifest.name, np.zeros((0, 3)), (), {}, run.arena(), manifest.display_units)


def remark_saved(collector: ResultCollector, runs: Sequence[SavedRun], listener: Listener) -> None:
    """Report which runs ended before their session, and what went wrong in them."""
    remark_zeros(collector, listener)
    for run in runs:
        manifest = run.manifest
        if manifest.state == "writing" or (manifest.steps or 0) < manifest.pictures:
            how = {"writing": "was cut off", "complete": "skipped pictures"}
            got = f"it holds {collector.updates} of {manifest.pictures} steps"
            listener.warning(f"{run.folder}: the run {how.get(manifest.state, manifest.state)}; {got}")
