"""Saved runs, opened to replay them without filtering, with what is still there of their sources."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import expect_regular
from maurice_loaders.formats.registry import chosen, nothing_beside, open_session
from maurice_loaders.libraries.completed import completed, with_channels
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import NAMED
from maurice_loaders.runs.manifest import (
    Source,
    library_hash,
    source_hash,
    versions_now,
)
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_mcl.config.build import build_localizer
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.filter.recovery import DRAWS_NEVER, DRAWS_WHERE_LIKELY
from maurice_mcl.sensor.outside import NOT_THERE, load_sensor
from maurice_mcl.values import Library, Moment, Session, SessionInfo, StepRecord

from ..errors import SILENT, Listener, progress_of
from ..playback import ResultCollector, shared
from ..scene import RunView, Scene
from .recorded import RecordedFrames, open_recorded, scene_of_recorded
from .run import Playback, remark_zeros
from .saved_steps import Pictures, Restored, restored_together

FROM_PICTURES = "(odometry from pictures)"  # ends the name of a session that an older version read so


def unchanged(
    source: Source, folder: Path, what: str, beside: Callable[[Path], Sequence[Path]] = nothing_beside
) -> Path:
    """Find what a run was made from. InputError when it is gone, or it or a file `beside` it was changed."""
    path = source.find(folder)
    if path is None:
        raise InputError(Path(source.path), f"the {what} that the run was made from is gone; put it back")
    expect_regular(path, f"the {what} that the run was made from")
    if source_hash(path, beside(path)) != source.sha256:
        raise InputError(
            path, f"the {what} was changed after the run was made; restore it, or replay it anew"
        )
    return path


def session_of(run: SavedRun) -> RecordedSession:
    """Open the session of a run as it was read then. InputError when it is gone or was changed."""
    if run.manifest.recorded:
        what = "is another localizer's run, as recorded: its filter is not here, so it cannot be run again"
        raise InputError(run.folder, f"{what}; replay the recording with a filter of ours")
    if run.manifest.name.endswith(FROM_PICTURES):
        raise InputError(run.folder, "its odometry was made from pictures, which is done no longer")
    reading, path = run.manifest.reading, recording_path(run)
    table = run.manifest.table
    table_path = None if table is None else unchanged(table, run.folder, "table")
    return open_session(path, replace(reading, table=table_path, keep_going=run.manifest.keep_going))


def recording_path(run: SavedRun) -> Path:
    """Return the recording that a run was made from. InputError when it is gone or was changed."""
    reading = run.manifest.reading
    return unchanged(
        run.manifest.session, run.folder, "session", lambda path: chosen(path, reading).beside(path)
    )


def frames_of(run: SavedRun) -> RecordedFrames:
    """Open what a bag holds beside a recorded localizer's run. InputError when it is gone or was changed."""
    reading = replace(run.manifest.reading, keep_going=run.manifest.keep_going)
    has_map = run.manifest.library.path != run.manifest.session.path  # else the bag's own, if any
    place = unchanged(run.manifest.library, run.folder, "map") if has_map else None
    return RecordedFrames(open_recorded(recording_path(run), reading, place))


def library_of(run: SavedRun, listener: Listener = SILENT) -> Library:
    """Open the library of a run. InputError when it is gone, was changed, or is measured differently."""
    path = unchanged(run.manifest.library, run.folder, "library")
    advance = progress_of(listener, "library")
    library = open_library(path, keep_going=run.manifest.keep_going, progress=advance)
    library = with_channels([run.configuration], library, listener.progress)
    missing = [name for name in run.manifest.channels if name not in library.index]
    if missing or library_hash(library, run.manifest.channels) != run.manifest.library_content:
        what = f"has no channel {missing[0]}" if missing else "holds other measurements or poses"
        raise InputError(path, f"the library {what} than when the run was made; restore its pictures")
    return library


def localizer_of(run: SavedRun, session: RecordedSession, library: Library) -> Localizer:
    """Build the filter of a run again. InputError when its parameters are refused today."""
    parameters = run.configuration.parameters
    for spelled, package in run.manifest.sensors.items():
        _check_sensor(run, spelled, package)
    (library,) = completed([run.configuration], library, session.info)
    try:
        return build_localizer(library, session, parameters, seed=run.manifest.seed, radii=run.manifest.radii)
    except (ValueError, KeyError) as problem:
        raise InputError(run.folder, f"its filter cannot be built here: {problem.args[0]}") from None


def _check_sensor(run: SavedRun, spelled: str, package: str) -> None:
    """Raise InputError, with what to install, where a sensor of another package cannot be loaded."""
    try:
        load_sensor(spelled)
    except InputError as problem:
        what = problem.message
        is_missing = versions_now([spelled]).get(package, NOT_THERE) == NOT_THERE
        if is_missing and (package != spelled or ":" not in spelled):
            requirement = f"{package}=={run.manifest.versions.get(package)}"
            what = f"its sensor {spelled} is not installed here: pip install {requirement}"
        raise InputError(run.folder, what) from None


def _localizers_of(runs: Sequence[SavedRun], session: RecordedSession, library: Library) -> list[Localizer]:
    return [localizer_of(run, session, library) for run in runs]


Part = TypeVar("Part")


@dataclass(frozen=True, slots=True)
class Opened:
    """A saved run, or those of a comparison, with what is still there of what they were made from."""

    runs: list[SavedRun]
    restored: list[Restored]
    session: Session | None
    scene: Scene  # its library has no entries where pictures or comparisons cannot be restored
    folder: Path  # of the run, or of the comparison
    listener: Listener = SILENT

    def updates(self) -> Iterator[tuple[Moment, Mapping[str, StepRecord]]]:
        """Go through the updates from the first, every time it is called; records by the run's label."""
        return restored_together(self.restored, Pictures(self.session, self.listener.warning))


def open_saved(folder: Path, listener: Listener = SILENT) -> Opened:
    """Open a saved run's folder, or a comparison's. Warnings name what is gone; InputError."""
    runs = open_runs(folder)
    run, manifest = runs[0], runs[0].manifest
    for text in changed_sensors(run):
        listener.warning(f"{run.folder}: {text}: comparisons may differ from those of the run")
    for other in runs[1:]:
        if other.manifest.session.sha256 != manifest.session.sha256:
            raise InputError(other.folder, f"is a run of another session than {run.folder}; replay it alone")
    if manifest.recorded:
        return _open_recorded(folder, runs, listener)
    problems: list[str] = []
    session = _tried(lambda: session_of(run), problems)
    library = _tried(lambda: library_of(run, listener), problems)
    localizers: list[Localizer] | None = None
    if session is not None and library is not None:
        localizers = _tried(partial(_localizers_of, runs, session, library), problems)
    if problems:
        empty = "pictures and comparisons" if session is None else "comparisons"
        listener.warning(f"{'; '.join(problems)}: the panels of {empty} stay empty")
    if localizers is None or library is None:
        library = Library(manifest.name, np.zeros((0, 3)), (), {}, run.arena(), manifest.display_units)
    localizers_known: Sequence[Localizer | None] = localizers or [None] * len(runs)
    restored = [Restored(*pair) for pair in zip(runs, localizers_known, strict=True)]
    notes = (NAMED,) if manifest.reading.odometry_from_truth else ()
    info = session.info if session else SessionInfo(manifest.name, manifest.display_units, notes=notes)
    scene = Scene(info, library, manifest.has_truth, manifest.pictures)
    return Opened(runs, restored, session, scene, folder, listener)


def _open_recorded(folder: Path, runs: list[SavedRun], listener: Listener) -> Opened:
    """Open the runs of recorded localizers, of which nothing is compared again."""
    problems: list[str] = []
    frames, manifest = _tried(lambda: frames_of(runs[0]), problems), runs[0].manifest
    if frames is not None:
        scene = scene_of_recorded(frames.recorded)
    else:
        listener.warning(f"{problems[0]}: its pictures and scans are not shown")
        info = SessionInfo(manifest.name, manifest.display_units)
        library = Library(manifest.name, np.zeros((0, 3)), (), {}, runs[0].arena(), manifest.display_units)
        scene = Scene(info, library, manifest.has_truth, manifest.pictures, has_pictures=False)
    restored = [Restored(run, None) for run in runs]
    return Opened(runs, restored, frames, scene, folder, listener)


def playback_of(opened: Opened, listener: Listener = SILENT) -> Playback:
    """Prepare saved runs for `play`, from their first update."""
    return Playback(
        shared(opened.updates()),
        opened.runs[0].manifest.pictures,
        [view_of(run) for run in opened.restored],
        replace(opened.scene, opens=str(opened.folder)),
        lambda collector: remark_saved(collector, opened.runs, listener),
    )


def _tried(opening: Callable[[], Part], problems: list[str]) -> Part | None:
    try:
        return opening()
    except InputError as problem:
        problems.append(str(problem).split(";")[0])
        return None


def view_of(run: Restored) -> RunView:
    """Return how one saved run is shown."""
    manifest = run.saved.manifest
    parameters = run.saved.configuration.parameters
    special = {"none": DRAWS_NEVER, "mixture": DRAWS_WHERE_LIKELY, "expansion": None}
    draws_new = special.get(parameters.recovery.strategy, parameters.recovery.draw)
    return RunView(
        manifest.label,
        manifest.channels,
        run.sensor,
        parameters.particles,
        radii=manifest.radii,
        draws_new=draws_new if manifest.channels else None,
        localizer=run.localizer,
        start=run.start,
    )


def remark_saved(collector: ResultCollector, runs: Sequence[SavedRun], listener: Listener) -> None:
    """Report which runs ended before their session, and what went wrong in them."""
    remark_zeros(collector, listener)
    for run in runs:
        manifest = run.manifest
        if manifest.state == "writing" or (manifest.steps or 0) < manifest.pictures:
            how = {"writing": "was cut off", "complete": "skipped pictures"}
            got = f"it holds {collector.updates} of {manifest.pictures} steps"
            listener.warning(f"{run.folder}: the run {how.get(manifest.state, manifest.state)}; {got}")


def changed_sensors(run: SavedRun) -> tuple[str, ...]:
    """Name the packages of its sensors that are here in another version than the run was made with."""
    packages = set(run.manifest.sensors.values())
    return tuple(
        f"{name} was {before}, is {now}"
        for name, before, now in _changes(run)
        if name in packages and now != NOT_THERE
    )


def changed_versions(run: SavedRun) -> tuple[str, ...]:
    """Name the packages whose version differs from the one that the run was made with."""
    return tuple(f"{name} was {before}, is {now}" for name, before, now in _changes(run))


def _changes(run: SavedRun) -> Iterator[tuple[str, str, str]]:
    """Yield packages with the version that the run was made with, and that of today, where they differ."""
    made_with, today = run.manifest.versions, versions_now(run.manifest.sensors)
    for name in {**made_with, **today}:
        before, now = made_with.get(name, "unknown"), today.get(name, "not there")
        if before != now:
            yield name, before, now
