"""Saved runs: written while they go, opened to replay them without filtering, verified to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import expect_regular
from maurice_loaders.files.writing import discard
from maurice_loaders.formats.registry import chosen, nothing_beside, open_session
from maurice_loaders.libraries.store import open_library
from maurice_loaders.reading.options import ReadingOptions
from maurice_loaders.reading.picture_odometry import FROM_PICTURES
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.reading.transforms import NAMED
from maurice_loaders.runs.manifest import (
    RunManifest,
    Source,
    library_hash,
    source_hash,
    source_of,
    versions_now,
)
from maurice_loaders.runs.store import SavedRun, open_runs
from maurice_loaders.runs.writer import RunWriter, begin_comparison
from maurice_mcl.config.build import build_localizer
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.sensor.outside import NOT_THERE, load_sensor, package_of
from maurice_mcl.values.library import Library
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment, SessionInfo

from ..errors import SinkError
from ..listener import SILENT, Listener, progress_of
from ..playback import FilterRun, ResultCollector, shared
from ..scene import DRAWS_NEVER, DRAWS_WHERE_LIKELY, RunView, Scene
from .open import landmarked
from .output import OutputOptions
from .run import Playback, remark_zeros
from .saved_steps import Pictures, Restored, restored_together


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
    reading = run.manifest.reading
    path = unchanged(
        run.manifest.session, run.folder, "session", lambda path: chosen(path, reading).beside(path)
    )
    table = run.manifest.table
    table_path = None if table is None else unchanged(table, run.folder, "table")
    return open_session(path, replace(reading, table=table_path, keep_going=run.manifest.keep_going))


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


def localizer_of(run: SavedRun, session: RecordedSession, library: Library) -> Localizer:
    """Build the filter of a run again. InputError when its parameters are refused today."""
    parameters = run.configuration.parameters
    for spelled, package in run.manifest.sensors.items():
        _check_sensor(run, spelled, package)
    library = landmarked([run.configuration], session.info, library)
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
        gone = versions_now([spelled]).get(package, NOT_THERE) == NOT_THERE
        if gone and (package != spelled or ":" not in spelled):
            wanted = f"{package}=={run.manifest.versions.get(package)}"
            what = f"its sensor {spelled} is not installed here: pip install {wanted}"
        raise InputError(run.folder, what) from None


def _localizers_of(runs: Sequence[SavedRun], session: RecordedSession, library: Library) -> list[Localizer]:
    return [localizer_of(run, session, library) for run in runs]


Part = TypeVar("Part")


@dataclass(frozen=True, slots=True)
class Opened:
    """A saved run, or those of a comparison, with what is still there of what they were made from."""

    runs: list[SavedRun]
    restored: list[Restored]
    session: RecordedSession | None
    scene: Scene  # its library has no entries where pictures or comparisons cannot be restored
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
    reading = manifest.reading
    odometry_from = (NAMED, reading.odometry_from_truth), (FROM_PICTURES, reading.odometry_from_pictures)
    notes = tuple(named for named, is_so in odometry_from if is_so)
    info = session.info if session else SessionInfo(manifest.name, manifest.display_units, notes=notes)
    scene = Scene(info, library, manifest.has_truth, manifest.pictures)
    return Opened(runs, restored, session, scene, listener)


def playback_of(opened: Opened, listener: Listener = SILENT) -> Playback:
    """Prepare saved runs for `play`, from their first update."""
    return Playback(
        shared(opened.updates()),
        opened.runs[0].manifest.pictures,
        [view_of(run) for run in opened.restored],
        opened.scene,
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


@dataclass(frozen=True, slots=True)
class Inputs:
    """What all runs of a replay are made from."""

    session: RecordedSession
    library: Path  # a library folder or a survey log
    pictures: int
    has_truth: bool
    reading: ReadingOptions  # how the session was read


@contextmanager
def saving(
    runs: Sequence[FilterRun], inputs: Inputs, output: OutputOptions
) -> Iterator[Mapping[str, RunWriter]]:
    """Open a writer a run, and at the end have each record how it ended; no writers without a folder.

    Raises InputError when the folder is taken, SinkError when it can be written to no longer.
    """
    if output.save_run is None:
        yield {}
        return
    writers = _writers(runs, inputs, output.save_run, output.force)
    state, problem = "failed", None
    try:
        yield writers
        state = "complete"
    except KeyboardInterrupt:
        state = "stopped"
        raise
    except OSError as error:
        problem = error
    finally:
        for writer in writers.values():
            try:
                writer.close(state)
            except OSError as error:
                problem = error
        if problem is not None:
            raise _full(output.save_run, problem, min(writer.written for writer in writers.values()))


def _writers(runs: Sequence[FilterRun], inputs: Inputs, target: Path, force: bool) -> dict[str, RunWriter]:
    """Return a writer a run: one run is the folder itself, several are folders below it."""
    folders = {runs[0].label: target}
    if len(runs) > 1:
        begin_comparison(target, [run.label for run in runs], force=force)
        folders = {run.label: target / run.label for run in runs}
    return {
        run.label: RunWriter(
            folders[run.label],
            manifest_of(run, inputs, folders[run.label]),
            run.configuration,
            run.localizer.library.arena,
            force=force,
        )
        for run in runs
    }


def manifest_of(run: FilterRun, inputs: Inputs, folder: Path) -> RunManifest:
    """Return the manifest of a run before its first step: what it is made from."""
    localizer, info, reading = run.localizer, inputs.session.info, inputs.reading
    channels, path = tuple(localizer.sensor.distances), inputs.session.path
    outside = localizer.sensor.parameters.outside
    form = chosen(path, reading)
    return RunManifest(
        label=run.label,
        seed=localizer.seed,
        start=None if run.start is None else tuple(run.start.tolist()),
        channels=channels,
        origin_m=tuple(localizer.library.origin.tolist()),
        name=info.name,
        display_units=info.display_units,
        pictures=inputs.pictures,
        has_truth=inputs.has_truth,
        keep_going=reading.keep_going,
        session=source_of(path, folder, form.beside(path)),
        library=source_of(inputs.library, folder),
        library_content=library_hash(localizer.library, channels),
        configuration_sha256=sha256(run.configuration.encode()).hexdigest(),
        versions=versions_now(outside),
        sensors={spelled: package_of(spelled)[0] for spelled in outside},
        radii=localizer.radii,
        reading=replace(reading, format=form.name),
        table=None if reading.table is None else source_of(reading.table, folder),
    )


def _full(target: Path, problem: OSError, steps: int) -> SinkError:
    """Return the error of a disk that ran full; a folder that holds no step is removed."""
    kept = f"it holds {steps} steps; free some space, and replace it with --force"
    if not steps:
        discard(target)
        kept = "free some space"
    return SinkError(target, f"cannot be written to the end ({problem.strerror or problem}); {kept}")


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
