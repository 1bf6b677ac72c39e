"""Writing a saved run while it goes: parts of so many steps, each of them whole.

A Parquet file can be read only once its footer is there, so a single growing file would be lost with a
killed process. Each table is a folder of parts instead; a part appears under its name when it is complete,
the clouds before the steps they belong to, so that every step that can be read has its particles.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import polars as pl

from maurice_mcl.map import Arena
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from ..errors import InputError
from ..io.files import begin_folder, check_target
from ..libraries.files import MANIFEST
from ..session_log.header import arena_to_json
from .manifest import (
    COMPARISON,
    CONFIGURATION,
    FORMAT,
    MAP,
    VERSION,
    RunManifest,
    ended,
    put,
    read_object,
    to_bytes,
    write_manifest,
)
from .rows import StepRows, rows_of, steps_schema

TABLES = ("particles", "renewed", "steps")  # in the order in which parts are written
PART_STEPS = 25
PART_PARTICLES = 200_000  # a part is also full with so many rows of a cloud


class RunWriter:
    """Writes one run into a new folder; memory holds at most one part.

    InputError when the folder exists, unless `force` is given and a saved run is in it.
    """

    def __init__(
        self, folder: Path, manifest: RunManifest, configuration: str, arena: Arena, *, force: bool = False
    ) -> None:
        check_run_target(folder, force=force)
        begin_folder(folder, force=force)
        self._folder, self._manifest = folder, manifest
        self._schema = steps_schema(manifest.channels)
        self._waiting: list[StepRows] = []
        self._written = 0
        for table in TABLES:
            (folder / table).mkdir()
        put(folder / CONFIGURATION, configuration.encode())
        put(folder / MAP, to_bytes(arena_to_json(arena)))
        write_manifest(folder, manifest)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Take in the next update."""
        self._waiting.append(rows_of(moment, record))
        particles = sum(rows.particles.height for rows in self._waiting)
        if len(self._waiting) >= PART_STEPS or particles >= PART_PARTICLES:
            self._flush()

    def close(self, state: str) -> None:
        """Write what is left, and in the manifest how it ended: "complete", "stopped" or "failed"."""
        self._flush()
        write_manifest(self._folder, ended(self._manifest, state, self._written))

    def _flush(self) -> None:
        if not self._waiting:
            return
        rows, self._waiting = self._waiting, []
        frames = {
            "particles": pl.concat([row.particles for row in rows]),
            "renewed": pl.concat([row.renewed for row in rows]),
            "steps": pl.DataFrame([row.step for row in rows], schema=self._schema, orient="row"),
        }
        for table in TABLES:
            put(self._folder / table / part_name(self._written + 1), _parquet(frames[table]))
        self._written += len(rows)


def part_name(first_step: int) -> str:
    """Name a part by its first step, so that sorting by name sorts by step."""
    return f"{first_step:08d}.parquet"


def _parquet(frame: pl.DataFrame) -> bytes:
    held = io.BytesIO()  # not by name: a name with a star in it would be taken for a pattern
    frame.write_parquet(held, compression="zstd")
    return held.getvalue()


def begin_comparison(folder: Path, labels: Sequence[str], *, force: bool = False) -> None:
    """Begin a folder with a folder for each run below it. InputError as for `RunWriter`."""
    check_run_target(folder, force=force)
    begin_folder(folder, force=force)
    put(folder / MANIFEST, to_bytes({"format": COMPARISON, "version": VERSION, "runs": list(labels)}))


def check_run_target(folder: Path, *, force: bool) -> None:
    """Refuse a folder that no run may be written to; with `force` only a saved run is replaced."""
    check_target(folder, force)
    if (folder / MANIFEST).is_file():
        try:
            read_object(folder, FORMAT, COMPARISON)
        except InputError as problem:
            raise InputError(folder, f"holds no saved run ({problem}); remove it yourself") from None
