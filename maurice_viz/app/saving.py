"""Saving runs while they go, one folder each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from maurice_loaders.formats.registry import chosen
from maurice_loaders.reading import ReadingOptions
from maurice_loaders.runs.manifest import RunManifest, library_hash, versions_now
from maurice_loaders.runs.sources import source_of
from maurice_loaders.runs.writer import RunWriter, begin_comparison

from ..errors import SinkError
from ..playback import FilterRun
from .open import AnySession
from .output import OutputOptions


@dataclass(frozen=True, slots=True)
class Inputs:
    """What all runs of a replay are made from."""

    session: AnySession
    library: Path  # a library folder or a survey log
    pictures: int
    has_truth: bool
    keep_going: bool
    opening: ReadingOptions  # how the session was read


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
    state = "failed"
    try:
        yield writers
        state = "complete"
    except KeyboardInterrupt:
        state = "stopped"
        raise
    except OSError as problem:
        raise _full(output.save_run, problem) from None
    finally:
        _close(writers, state, output.save_run)


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
    localizer, info, opening = run.localizer, inputs.session.info, inputs.opening
    channels, path = tuple(localizer.sensor.distances), inputs.session.path
    form = chosen(path, opening)
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
        keep_going=inputs.keep_going,
        session=source_of(path, folder, form.beside(path)),
        library=source_of(inputs.library, folder),
        library_content=library_hash(localizer.library, channels),
        configuration_sha256=sha256(run.configuration.encode()).hexdigest(),
        versions=versions_now(),
        reading=replace(opening, format=form.name),
        table=None if opening.table is None else source_of(opening.table, folder),
    )


def _close(writers: Mapping[str, RunWriter], state: str, target: Path) -> None:
    for writer in writers.values():
        try:
            writer.close(state)
        except OSError as problem:
            raise _full(target, problem) from None


def _full(target: Path, problem: OSError) -> SinkError:
    return SinkError(target, f"cannot be written to the end ({problem.strerror or problem}); free some space")
