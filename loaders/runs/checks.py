"""Whether what is read of a saved run can be what was written: a damaged file is refused where it is read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import polars as pl

from ..errors import InputError
from ..files.text import MOST, show, up_to
from .writer import PARTS, TABLES, StepRows

SLACK = 1e-3  # tolerance of sums of weights: processors round differently
TRUTH = ("truth_x_m", "truth_y_m", "truth_heading_rad")
TOGETHER = (TRUTH, *(tuple(columns) for _, columns in PARTS.values()))  # known, or all of them not
# beginnings of columns whose values may be infinite, or NaN: what a picture says, headings of any direction
UNBOUNDED = (
    *("evidence_", "log_evidence", "calibrated_evidence", "library_evidence_", "recovery_"),
    *("estimate_heading_sd_rad", "mean_heading_sd_rad", "log_weight", "carried_log_weight"),
)


def expect_files(folder: Path) -> None:
    """Raise InputError for a device, a pipe or a folder in place of a part of a table."""
    for table in TABLES:
        for part in sorted((folder / table).glob("*.parquet")):
            if not part.is_file():
                raise InputError(part, "found no regular file, expected a Parquet file; is the run damaged?")


def check_table(file: Path, table: pl.DataFrame) -> None:
    """Raise InputError for the first value of a table that is missing, or no number that we would write."""
    optional = {name for names in TOGETHER for name in names}
    for name in table.columns:
        column = table[name]
        missing = column.is_null()
        if name not in optional and missing.any():
            _refuse_row(file, table, name, int(missing.arg_max() or 0), "a value")
        if column.dtype.is_float() and not name.startswith(UNBOUNDED):
            wrong = ~(column.abs() <= MOST)
            if wrong.any():
                expected = f"a finite number, {up_to()}"
                _refuse_row(file, table, name, int(wrong.fill_null(False).arg_max() or 0), expected)


def check_step(file: Path, row: Mapping[str, Any]) -> None:
    """Raise InputError where the values of a step do not go together."""
    for together in TOGETHER:
        missing = [name for name in together if row[name] is None]
        if 0 < len(missing) < len(together):
            _refuse(file, missing[0], None, row["step"], f"{', '.join(together)}, or none of them")
    if any(motion is None or len(motion) != 3 for motion in row["motions"]):
        _refuse(file, "motions", row["motions"], row["step"], "lists of three finite numbers")
    if len(row["best_entries"]) != len(row["best_quality"]):
        _refuse(file, "best_quality", row["best_quality"], row["step"], "one for each of best_entries")


def check_cloud(file: Path, cloud: pl.DataFrame, steps: pl.Series) -> None:
    """Raise InputError for the first row of a table of clouds that is of no step."""
    strays = ~cloud["step"].is_in(steps.implode())
    if strays.any():
        _refuse_row(file, cloud, "step", int(strays.arg_max() or 0), "a step of this part")


def check_update(folder: Path, part: str, rows: StepRows) -> None:
    """Raise InputError if the clouds of an update do not fit its row, or each other."""
    step, size = rows.step["step"], rows.particles.height
    weighted, renewed = folder / "particles" / part, folder / "renewed" / part
    if size != rows.step["particles"]:
        fault = f"found {size} particles at step {step}, expected {rows.step['particles']}"
        raise InputError(weighted, f"{fault}; is it damaged?")
    for file, cloud in ((weighted, rows.particles), (renewed, rows.renewed)):
        if not cloud.height:
            continue
        counted = cloud["index"].to_numpy() == np.arange(cloud.height)
        if not counted.all():
            row = int(counted.argmin())
            _refuse(file, "index", cloud["index"][row], step, f"particle {row} in row {row} of the step")
        total = float(np.exp(cloud["log_weight"].to_numpy()).sum())
        if not abs(total - 1) <= SLACK:  # NaN is not, either
            _refuse(file, "weights that sum to", total, step, "a sum of 1")
    parents = rows.renewed["parent"]
    wrong = ~parents.is_between(-1, size - 1)
    if wrong.any():
        row = int(wrong.arg_max() or 0)
        text = f"found parent {parents[row]} of particle {row} at step {step}, a parent that is no particle"
        raise InputError(renewed, f"{text}; expected -1 to {size - 1}; is it damaged?")


def _refuse_row(file: Path, cloud: pl.DataFrame, name: str, row: int, expected: str) -> NoReturn:
    found, step = f"{name} {show(cloud[name][row])}", show(cloud["step"][row])
    raise InputError(
        file, f"found {found} in row {row + 1} (step {step}), expected {expected}; is it damaged?"
    )


def _refuse(file: Path, name: str, found: Any, step: int, expected: str) -> NoReturn:
    raise InputError(file, f"found {name} {show(found)} at step {step}, expected {expected}; is it damaged?")
