"""Runs written while they go: those of filters, and another localizer's, as a bag holds it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from maurice_loaders.files.writing import discard
from maurice_loaders.formats.registry import chosen
from maurice_loaders.reading.options import Reading
from maurice_loaders.runs.manifest import RunManifest, library_hash, source_of, versions_now
from maurice_mcl.sensor.outside import package_of
from maurice_mcl.values import Arena

from ..errors import SinkError
from ..playback import FilterRun
from .open import SourcedSession
from .output import Output

if TYPE_CHECKING:
    from maurice_loaders.runs.writer import RunWriter


@dataclass(frozen=True, slots=True, eq=False)
class ToSave:
    """What is written of a run before its first step."""

    label: str
    manifest: Callable[[Path], RunManifest]  # for the folder that it is written to
    configuration: str  # as TOML
    arena: Arena
    live: bool = False  # what it is made from is complete only at the end, and named again then


@contextmanager
def saving(runs: Sequence[ToSave], output: Output) -> Iterator[Mapping[str, RunWriter]]:
    """Open a writer a run, and at the end have each record how it ended; no writers without a folder.

    Raises InputError when the folder is taken, SinkError when it can be written to no longer.
    """
    if output.folder is None:
        yield {}
        return
    writers = _writers(runs, output.folder, output.force)
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
        for run, writer in zip(runs, writers.values(), strict=True):
            try:
                writer.close(state, run.manifest(writer.folder) if run.live else None)
            except OSError as error:
                problem = error
        if problem is not None:
            raise _full(output.folder, problem, min(writer.written for writer in writers.values()))


def _writers(runs: Sequence[ToSave], target: Path, force: bool) -> dict[str, RunWriter]:
    """Return a writer a run: one run is the folder itself, several are folders below it."""
    from maurice_loaders.runs.writer import RunWriter, begin_comparison  # loads polars

    folders = {runs[0].label: target}
    if len(runs) > 1:
        begin_comparison(target, [run.label for run in runs], force=force)
        folders = {run.label: target / run.label for run in runs}
    return {
        run.label: RunWriter(
            folders[run.label],
            run.manifest(folders[run.label]),
            run.configuration,
            run.arena,
            force=force,
        )
        for run in runs
    }


def filters_to_save(runs: Sequence[FilterRun], inputs: Inputs, *, live: bool = False) -> list[ToSave]:
    """Return what is to be written of runs of filters; of `live` ones the inputs grow with the runs."""
    return [
        ToSave(
            run.label,
            partial(manifest_of, run, inputs),
            run.configuration,
            run.localizer.library.arena,
            live,
        )
        for run in runs
    ]


@dataclass(slots=True)
class Inputs:
    """What all runs of a replay are made from."""

    session: SourcedSession
    library: Path  # a library folder or a survey log
    pictures: int
    has_truth: bool
    reading: Reading  # how the session was read


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
    advice = f"the run stopped there; it holds {steps} steps; free some space, and replace it with --force"
    if not steps:
        discard(target)
        advice = "free some space"
    return SinkError(target, f"cannot be written to the end ({problem.strerror or problem}); {advice}")
