"""Saved runs: reading them back, a part at a time (docs/saved-runs.md)."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from maurice_mcl.arena import Arena
from maurice_mcl.configuration import Configuration, configure

from .arena_json import arena_from_json
from .config_file import read_config
from .errors import LogError
from .fields import FieldError, items, read_json
from .library_files import MANIFEST, hash_file
from .run_store_manifest import (
    COMPARISON,
    CONFIGURATION,
    FORMAT,
    MAP,
    RunManifest,
    read_manifest,
    read_object,
)
from .run_store_rows import PARTICLES, RENEWED, StepRows, steps_schema


@dataclass(frozen=True, slots=True)
class SavedRun:
    """A saved run's folder; only its manifest and its configuration are read yet."""

    folder: Path
    manifest: RunManifest
    configuration: Configuration

    def arena(self) -> Arena:
        """Read the map. LogError when it is damaged."""
        file = self.folder / MAP
        try:
            return arena_from_json(read_json(file.read_bytes()))
        except (OSError, ValueError) as problem:
            raise LogError(file, f"is no map ({problem}); is the run damaged?") from None

    def steps(self) -> Iterator[StepRows]:
        """Read update after update from the first, a part at a time.

        LogError where a part is missing or damaged.
        """
        number = 0
        for file in sorted((self.folder / "steps").glob("*.parquet")):
            for rows in _part(self.folder, file.name, self.manifest):
                number += 1
                if rows.step["step"] != number:
                    found = f"found step {rows.step['step']}, expected step {number}"
                    raise LogError(file, f"{found}; is a part missing?")
                yield rows
        if self.manifest.steps is not None and number != self.manifest.steps:
            found = f"found {number} steps, expected the {self.manifest.steps} of its manifest"
            raise LogError(self.folder, f"{found}; is a part missing?")


def is_saved(path: Path) -> bool:
    """Tell whether a path looks like a saved run, a broken one as well."""
    return (path / MANIFEST).is_file()


def open_runs(path: Path) -> list[SavedRun]:
    """Open a saved run, or all runs of a comparison, in order. LogError, one line, for what is neither."""
    found = read_object(path, FORMAT, COMPARISON)
    if found["format"] == FORMAT:
        return [_open_run(path)]
    try:
        labels = [str(label) for label in items(found.get("runs"), "runs")]
    except FieldError as problem:
        raise LogError(path / MANIFEST, f"{problem}; is it damaged?") from None
    if not labels or any(not label or "/" in label or label == ".." for label in labels):
        raise LogError(path / MANIFEST, "found no list of runs, expected their folders; is it damaged?")
    return [_open_run(path / label) for label in labels]


def _open_run(folder: Path) -> SavedRun:
    manifest = read_manifest(folder)
    file = folder / CONFIGURATION
    if not file.is_file() or hash_file(file) != manifest.configuration_sha256:
        found = "was changed after it was written" if file.is_file() else "is missing"
        raise LogError(file, f"{found}; replay the session again with --run")
    try:
        return SavedRun(folder, manifest, configure([read_config(file)]))
    except ValueError as problem:  # a channel that is not installed here, a key of another version
        raise LogError(file, f"{problem}; was it made by another version?") from None


def _part(folder: Path, name: str, manifest: RunManifest) -> Iterator[StepRows]:
    """Read one part of all three tables, and give its updates."""
    schema = steps_schema(manifest.channels)
    optional = {column for column in schema if column.startswith("truth_")}
    steps = _table(folder / "steps" / name, schema, optional)
    particles = _by_step(_table(folder / "particles" / name, PARTICLES))
    renewed = _by_step(_table(folder / "renewed" / name, RENEWED))
    for row in steps.iter_rows(named=True):
        rows = StepRows(
            row,
            particles.get(row["step"], pl.DataFrame(schema=PARTICLES)),
            renewed.get(row["step"], pl.DataFrame(schema=RENEWED)),
        )
        _check_clouds(folder / "particles" / name, rows)
        yield rows


def _check_clouds(file: Path, rows: StepRows) -> None:
    expected, found = rows.step["particles"], rows.particles.height
    if found != expected or not found:
        step = rows.step["step"]
        raise LogError(file, f"found {found} particles at step {step}, expected {expected}; is it damaged?")
    if rows.renewed.height and int(rows.renewed["parent"].max()) >= found:  # type: ignore[arg-type]  # a number
        raise LogError(file.parent.parent / "renewed" / file.name, "found a parent that is no particle")


def _by_step(cloud: pl.DataFrame) -> dict[int, pl.DataFrame]:
    parts = cloud.partition_by("step", maintain_order=True, as_dict=True)
    return {int(step): part for (step,), part in parts.items()}


def _table(file: Path, schema: Mapping[str, Any], optional: set[str] | None = None) -> pl.DataFrame:
    """Read one Parquet file with all these columns. LogError when it is cut, or not what it should be."""
    try:
        held = io.BytesIO(file.read_bytes())
        found = pl.read_parquet_schema(held)
        wrong = [name for name, kind in schema.items() if found.get(name) != kind]
        if wrong:
            raise LogError(file, f"found no column {wrong[0]} as expected; was it made by another version?")
        held.seek(0)
        table = pl.read_parquet(held, columns=list(schema))
    except FileNotFoundError:
        raise LogError(file, "is missing; is the run whole?") from None
    except (OSError, pl.exceptions.PolarsError) as problem:
        first = str(problem).strip().splitlines()[:1]
        raise LogError(file, f"is a damaged Parquet file ({''.join(first)}); restore it") from None
    empty = [name for name in schema if name not in (optional or ()) and table[name].null_count()]
    if empty:
        raise LogError(file, f"found no value of {empty[0]} in some rows; is it damaged?")
    return table
