"""A saved run as tables and trajectories: CSV, Parquet, TUM.

TUM has a line `t x y z qx qy qz qw` a pose. Numbers are written so that reading them gives the same float64.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TextIO

import numpy as np
import polars as pl

from maurice_mcl.scoring.metrics import FIRST_SCORED
from maurice_mcl.values import F64, U8, LaserScan, compose

from ..files.text import plain_cell
from ..files.writing import filling
from ..runs.store import SavedRun
from ..runs.writer import StepRows, steps_schema

PATHS = ("estimate", "truth", "odometry")  # in the order in which files and tables have them


@dataclass(frozen=True, slots=True, eq=False)
class ExportStep:
    """One update: three poses (3,) x_m, y_m, heading_rad, and the saved rows they came from."""

    rows: StepRows
    time_s: float  # since the session's first record, and what was asked to be added
    estimate: F64  # the scored one, in the map's frame
    truth: F64 | None  # in the map's frame; None where it is not known
    odometry: F64  # as measured, uncorrected, in a frame of its own that begins at 0, 0, 0
    readings: Mapping[str, float] = field(default_factory=dict)  # of other sensors, if known
    scan: LaserScan | None = None  # that was used, if known

    @property
    def scored(self) -> bool:
        """Return whether this project's tables count it: all but the first three are."""
        return int(self.rows.step["step"]) >= FIRST_SCORED

    def pose(self, path: str) -> F64 | None:
        """Return the pose of one of `PATHS`."""
        return {"estimate": self.estimate, "truth": self.truth, "odometry": self.odometry}[path]


class Sink(Protocol):
    """A file that is being written."""

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Take in the next update, and its picture (H, W, 3) RGB if there is one."""


def export_steps(run: SavedRun, *, begin_s: float = 0.0) -> Iterator[ExportStep]:
    """Go through a saved run from its first update, holding one at a time. InputError if it is damaged."""
    odometry = np.zeros(3)
    for rows in run.steps():
        for motion in rows.step["motions"]:
            odometry = compose(odometry, np.array(motion, np.float64))
        truth = None if rows.step["truth_x_m"] is None else _pose(rows, "truth")
        time_s = rows.step["time_s"] + begin_s
        yield ExportStep(rows, time_s, _pose(rows, "estimate"), truth, odometry)


def _pose(rows: StepRows, kind: str) -> F64:
    return np.array([rows.step[f"{kind}_{name}"] for name in ("x_m", "y_m", "heading_rad")])


# A saved run as one table, one row per update: CSV for spreadsheets, Parquet for programs.

LEFT_OUT = ("picture_sha256", "motions", "best_entries", "best_quality", "events", "session_events")
TEXTS = ("events", "session_events")  # lists in a saved run; one text here


def table_columns(channels: Sequence[str]) -> dict[str, type]:
    """Return names and Python types of the columns, for a run with these channels."""
    kinds = {pl.Int32: int, pl.Float64: float, pl.String: str}
    columns = {name: kinds[kind] for name, kind in steps_schema(channels).items() if name not in LEFT_OUT}
    odometry = {f"odometry_{name}": float for name in ("x_m", "y_m", "heading_rad")}
    return columns | odometry | dict.fromkeys(TEXTS, str)


def table_row(step: ExportStep) -> dict[str, Any]:
    """Return one row, by the names of `table_columns`; None where a value is not known."""
    row = dict(step.rows.step) | {"time_s": step.time_s}
    odometry = zip(("x_m", "y_m", "heading_rad"), step.odometry.tolist(), strict=True)
    row |= {f"odometry_{name}": value for name, value in odometry}
    return row | {name: "; ".join(row[name]) for name in TEXTS}


class TableSink:
    """Collects one row per update, never the clouds."""

    def __init__(self, channels: Sequence[str]) -> None:
        self.columns = table_columns(channels)
        self.rows: list[dict[str, Any]] = []

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Take in one update."""
        row = table_row(step)
        self.rows.append({name: row.get(name) for name in self.columns})


@contextmanager
def table_sink(file: Path, channels: Sequence[str], *, force: bool = False) -> Iterator[TableSink]:
    """Open a CSV file (RFC 4180, UTF-8, a header line), or Parquet by its ending. InputError as `filling`."""
    with filling(file, force=force) as part:
        part.touch()  # one that cannot be written fails now, not at the end
        sink = TableSink(channels)
        yield sink
        if file.suffix == ".parquet":
            kinds = {int: pl.Int32, float: pl.Float64, str: pl.String}
            table = pl.DataFrame(sink.rows, {name: kinds[kind] for name, kind in sink.columns.items()})
            with part.open("wb") as content:  # not by name: a name with a star in it is taken for a pattern
                table.write_parquet(content, compression="zstd")
            return
        with part.open("w", encoding="utf-8", newline="") as out:
            writer = csv.DictWriter(out, list(sink.columns), lineterminator="\n")
            writer.writeheader()
            writer.writerows({name: plain_cell(value) for name, value in row.items()} for row in sink.rows)


# Paths as text that evo, rpg_trajectory_evaluation and others read: TUM.


def tum_line(time_s: float, pose: F64) -> str:
    """Write one pose (3,) as TUM has it: seconds, meters, and a quaternion with w last."""
    x, y, heading = (float(v) for v in pose)
    values = (time_s, x, y, 0.0, 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2))
    return " ".join(repr(float(value)) for value in values) + "\n"


def path_files(file: Path, paths: Sequence[str]) -> dict[str, Path]:
    """Name each path's file: the estimate, or a single path, as asked; `-truth` is the truth's."""
    if len(paths) == 1:
        return {paths[0]: file}
    beside = {name: file.with_name(f"{file.stem}-{name}{file.suffix}") for name in paths}
    return {name: file if name == PATHS[0] else path for name, path in beside.items()}


class PathSink:
    """Writes one line per update into the file of each path; a file is made by its first line."""

    def __init__(self, files: Mapping[str, Path], stack: ExitStack) -> None:
        self._files, self._stack = files, stack
        self._open: dict[str, TextIO] = {}

    def add(self, step: ExportStep, image: U8 | None) -> None:
        """Write one update: a line for each pose that is known."""
        for name in self._files:
            pose = step.pose(name)
            if pose is not None:
                self._file(name).write(tum_line(step.time_s, pose))

    def _file(self, name: str) -> TextIO:
        if name not in self._open:
            file = self._files[name].open("w", encoding="ascii", newline="\n")
            self._open[name] = self._stack.enter_context(file)
        return self._open[name]


@contextmanager
def path_sink(files: Mapping[str, Path], *, force: bool = False) -> Iterator[PathSink]:
    """Open the files of some paths; all appear when all went well. Raises InputError as for `filling`."""
    with ExitStack() as whole:
        parts = {name: whole.enter_context(filling(file, force=force)) for name, file in files.items()}
        with ExitStack() as opened:
            yield PathSink(parts, opened)


def error_statistics(errors_m: F64) -> dict[str, float]:
    """Return the seven statistics that `evo_ape` prints of some errors (N,), N > 0, by its names."""
    squared = np.square(errors_m)
    statistics = {"rmse": np.sqrt(squared.mean()), "mean": errors_m.mean(), "median": np.median(errors_m)}
    statistics |= {"std": errors_m.std(), "min": errors_m.min(), "max": errors_m.max(), "sse": squared.sum()}
    return {name: float(value) for name, value in statistics.items()}
