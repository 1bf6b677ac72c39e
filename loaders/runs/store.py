"""Saved runs: reading them back, comparing two updates to the last bit (docs/saved-runs.md)."""

from __future__ import annotations

import io
import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from maurice_mcl.config.parameters import Configuration, configure
from maurice_mcl.values import Arena

from ..config_files import read_config
from ..errors import FieldError, InputError
from ..files.text import expect_regular, items, read_json, show
from ..libraries.files import MANIFEST, hash_file
from ..session_log.header import arena_from_json
from .checks import check_cloud, check_step, check_update, expect_files, step_rules
from .manifest import COMPARISON, CONFIGURATION, FORMAT, MAP, RunManifest, read_manifest, read_object
from .writer import PARTICLES, RENEWED, TOOK, StepRows, steps_schema


@dataclass(frozen=True, slots=True, repr=False)
class SavedRun:
    """A saved run's folder; only its manifest and its configuration are read yet."""

    folder: Path
    manifest: RunManifest
    configuration: Configuration

    def __repr__(self) -> str:
        """Return what it is, in a line."""
        how = f"{self.manifest.state}, {self.manifest.steps} steps"
        return f"SavedRun({self.manifest.label!r} in {str(self.folder)!r}, {how})"

    def arena(self) -> Arena:
        """Read the map. Raises InputError if it is damaged."""
        file = self.folder / MAP
        expect_regular(file, "a map")
        try:
            return arena_from_json(read_json(file.read_bytes()))
        except (OSError, ValueError) as problem:
            raise InputError(file, f"is no map ({problem}); is the run damaged?") from None

    @property
    def cloud(self) -> pl.LazyFrame:
        """All particles, one row per step, phase and particle, in the map's frame; read when it is collected.

        Columns: step, phase ("weighted", or "resampled" where the run resampled), index, x_m, y_m,
        heading_rad, weight, parent (its index in the weighted cloud, -1: fresh; null of the weighted), fresh,
        truth_x_m, truth_y_m, truth_heading_rad (null where not known).
        """
        origin_x_m, origin_y_m = self.manifest.origin_m
        place = [pl.col("x_m").cast(pl.Float64) + origin_x_m, pl.col("y_m").cast(pl.Float64) + origin_y_m]
        pose = [pl.col("step"), pl.col("index"), *place, pl.col("heading_rad").cast(pl.Float64)]
        weight = pl.col("log_weight").exp().alias("weight")
        own = pl.col("parent"), pl.col("injected").alias("fresh")
        none = pl.lit(None, pl.Int32).alias("parent"), pl.lit(False).alias("fresh")
        weighted = self._parts("particles").select(*pose, weight, *none, pl.lit("weighted").alias("phase"))
        resampled = self._parts("renewed").select(*pose, weight, *own, pl.lit("resampled").alias("phase"))
        truth = self._parts("steps").select("step", "truth_x_m", "truth_y_m", "truth_heading_rad")
        clouds = pl.concat([weighted, resampled]).join(truth, on="step", how="left", maintain_order="left")
        columns = ["step", "phase", "index", "x_m", "y_m", "heading_rad", "weight", "parent", "fresh"]
        return clouds.select(*columns, "truth_x_m", "truth_y_m", "truth_heading_rad")

    def _parts(self, kind: str) -> pl.LazyFrame:
        return pl.scan_parquet(sorted((self.folder / kind).glob("*.parquet")))

    def steps(self) -> Iterator[StepRows]:
        """Read update after update from the first. InputError if a part is missing or damaged."""
        number, last_s = 0, -math.inf
        for file in sorted((self.folder / "steps").glob("*.parquet")):
            for rows in _part(self.folder, file.name, self.manifest, number + 1):
                number, time_s = number + 1, rows.step["time_s"]
                if time_s < last_s:
                    fault = f"found time_s {time_s:.15g} at step {number}, expected at least {last_s:.15g}"
                    raise InputError(file, f"{fault}, that of the step before; is it damaged?")
                last_s = time_s
                yield rows
        if self.manifest.steps is not None and number != self.manifest.steps:
            fault = f"found {number} steps, expected the {self.manifest.steps} of its manifest"
            raise InputError(self.folder, f"{fault}; is a part missing?")


def open_runs(path: Path) -> list[SavedRun]:
    """Open a saved run, or all runs of a comparison, in order. Raises InputError for what is neither."""
    manifest = read_object(path, FORMAT, COMPARISON)
    if manifest["format"] == FORMAT:
        return [open_run(path)]
    try:
        labels = [str(label) for label in items(manifest.get("runs"), "runs")]
    except FieldError as problem:
        raise InputError(path / MANIFEST, f"{problem}; is it damaged?") from None
    if not labels or any(not label or "/" in label or label == ".." for label in labels):
        raise InputError(path / MANIFEST, "found no list of runs, expected their folders; is it damaged?")
    return [open_run(path / label) for label in labels]


def runs_beside(folder: Path) -> list[SavedRun]:
    """Open all runs of the comparison that a saved run belongs to, with itself; none where it is alone."""
    try:
        runs = open_runs(folder.resolve().parent)
    except InputError:  # the folder above holds no comparison, or one that is damaged
        return []
    return runs if any(run.folder == folder.resolve() for run in runs) else []


def open_run(folder: str | Path) -> SavedRun:
    """Open the folder of a saved run; only its manifest, configuration and map are read yet.

    `steps()` then gives update after update, `arena()` the map. Raises InputError for anything but a whole
    run of one filter; `open_runs` opens the runs of a comparison.

        >>> from maurice_loaders import InputError, open_run
        >>> try:
        ...     open_run("session.log")
        ... except InputError as error:
        ...     print(error)
        session.log: found a recording (session-log), expected a saved run's folder; make one with: ...
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    expect_files(folder)
    file = folder / CONFIGURATION
    if not file.is_file() or hash_file(file) != manifest.configuration_sha256:
        fault = "was changed after it was written" if file.is_file() else "is missing"
        raise InputError(file, f"{fault}; replay the session again with --save-run")
    try:
        layer = read_config(file)
        configuration = configure([layer], sensors=None)
    except ValueError as problem:  # a channel that is not installed here, a key of another version
        raise InputError(file, f"{problem}; was it made by another version?") from None
    settings = [setting for setting in configuration.settings if setting.value not in (None, ())]
    missing = [setting.key for setting in settings if setting.key not in layer.values]
    if missing:  # what the filter ran with is not known
        fault = f"found no {missing[0]}, so it was saved by an earlier version"
        raise InputError(file, f"{fault}; replay the session again with --save-run")
    run = SavedRun(folder, manifest, configuration)
    run.arena()  # a damaged one is told of now, not where the library is gone
    return run


def _part(folder: Path, name: str, manifest: RunManifest, first: int) -> Iterator[StepRows]:
    """Read the updates of one part, each checked; the first of them should have the number `first`."""
    rules, file = step_rules(manifest.channels, recorded=manifest.recorded), folder / "steps" / name
    steps = _table(file, steps_schema(manifest.channels))
    for number, step in enumerate(steps["step"], first):
        if step != number:
            raise InputError(file, f"found step {show(step)}, expected step {number}; is a part missing?")
    particles = _cloud(folder / "particles" / name, PARTICLES, steps)
    renewed = _cloud(folder / "renewed" / name, RENEWED, steps)
    for number, row in enumerate(steps.iter_rows(named=True), first):
        check_step(file, row, rules)
        rows = StepRows(
            row,
            particles.get(number, pl.DataFrame(schema=PARTICLES)),
            renewed.get(number, pl.DataFrame(schema=RENEWED)),
        )
        check_update(folder, name, rows)
        yield rows


def _cloud(file: Path, schema: Mapping[str, Any], steps: pl.DataFrame) -> dict[int, pl.DataFrame]:
    """Read a table of clouds; the cloud of each step that has one."""
    cloud = _table(file, schema)
    check_cloud(file, cloud, steps["step"])
    parts = cloud.partition_by("step", maintain_order=True, as_dict=True)
    return {int(step): part for (step,), part in parts.items()}


def _table(file: Path, schema: Mapping[str, Any]) -> pl.DataFrame:
    try:
        content = io.BytesIO(file.read_bytes())
        stored = pl.read_parquet_schema(content)
        wrong = [name for name, kind in schema.items() if stored.get(name) != kind]
        if wrong:
            raise InputError(file, f"found no column {wrong[0]} as expected; was it made by another version?")
        content.seek(0)
        return pl.read_parquet(content, columns=list(schema))
    except FileNotFoundError:
        raise InputError(file, "is missing; is the run whole?") from None
    except (OSError, pl.exceptions.PolarsError) as problem:
        first = str(problem).strip().splitlines()[:1]
        raise InputError(file, f"is a damaged Parquet file ({''.join(first)}); restore it") from None


@dataclass(frozen=True, slots=True)
class RunDifference:
    """The first field in which an update is not the same."""

    step: int
    field: str  # "estimate_x_m", or "particles.x_m" with the particle's number
    stored: str
    now: str

    def __str__(self) -> str:
        return f"step {self.step}, {self.field}: stored {self.stored}, now {self.now}"


def first_difference(stored: StepRows, now: StepRows) -> RunDifference | None:
    """Return the first field that differs, clouds first; None if equal. What a step took does not count."""
    step = stored.step["step"]
    clouds = {"particles": (stored.particles, now.particles), "renewed": (stored.renewed, now.renewed)}
    if stored.step["picture_sha256"] != now.step["picture_sha256"]:
        return RunDifference(step, "picture", str(stored.step["picture"]), "another picture")
    difference = _of_cloud(step, "particles", *clouds["particles"]) or _of_row(step, stored, now)
    return difference or _of_cloud(step, "renewed", *clouds["renewed"])


def _of_row(step: int, stored: StepRows, now: StepRows) -> RunDifference | None:
    for name, value in stored.step.items():
        if name != TOOK and not same(value, now.step.get(name)):
            return RunDifference(step, name, repr(value), repr(now.step.get(name)))
    return None


def _of_cloud(step: int, table: str, stored: pl.DataFrame, now: pl.DataFrame) -> RunDifference | None:
    if stored.height != now.height:
        return RunDifference(step, table, f"{stored.height} rows", f"{now.height} rows")
    for name in stored.columns:
        a, b = stored[name].to_numpy(), now[name].to_numpy()
        if a.tobytes() == b.tobytes():
            continue
        width = a.dtype.itemsize
        bits = [np.frombuffer(v.tobytes(), np.uint8).reshape(-1, width) for v in (a, b)]
        row = int((bits[0] != bits[1]).any(axis=1).argmax())
        return RunDifference(
            step, f"{table}.{name} of particle {row}", repr(a[row].item()), repr(b[row].item())
        )
    return None


def same(a: Any, b: Any) -> bool:
    """Return whether two values are the same to the last bit: 0.0 and -0.0 are not."""
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return struct.pack("d", a) == struct.pack("d", b)
    return type(a) is type(b) and bool(a == b)
