"""A CSV table of calibration trials, one row a turn or a straight, read strictly and written."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.calibrate import Straights, Trials, Turns
from maurice_mcl.geometry import INCH_M

from .cells import number_in
from .errors import LogError
from .fields import show
from .regular import expect_regular
from .whole_files import write_whole

NEEDED = ("kind", "measured", "actual")
COLUMNS = (*NEEDED, "heading_error_deg", "floor")
KINDS = ("turn", "straight")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH_M}


@dataclass(frozen=True, slots=True)
class _Row:
    straight: bool
    measured: float  # m or rad
    actual: float
    drift_rad: float  # nan: not given
    floor: str


def read_trials(file: Path, unit: str = "m") -> Trials:
    """Read turns (degrees) and straights (lengths in "m", "cm", "mm" or "in").

    LogError names an unknown or missing column, or the row and the column at fault.
    """
    if unit not in METRES:
        raise ValueError(f"found unit {unit!r}, expected one of {', '.join(METRES)}")
    expect_regular(file, "a table of trials")
    try:
        with file.open(newline="", encoding="utf-8-sig") as data:
            rows = list(_rows(file, csv.DictReader(data), METRES[unit]))
    except FileNotFoundError:
        raise LogError(file, "found no such file, expected a table of trials; check the path") from None
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise LogError(file, f"cannot be read as a CSV table: {problem}") from None
    if not rows:
        raise LogError(file, "found no rows, expected one a trial")
    return _trials(rows)


def write_trials(file: Path, trials: Trials, *, force: bool = False) -> None:
    """Write trials as a table that `read_trials` reads, lengths in metres; whole or not at all.

    LogError when the file exists and `force` is not given.
    """
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for measured, actual in np.degrees(np.column_stack([trials.turns.measured_rad, trials.turns.actual_rad])):
        table.writerow(["turn", f"{measured:.4f}", f"{actual:.4f}", "", ""])
    s = trials.straights
    for measured, actual, drift, floor in zip(s.measured_m, s.actual_m, s.drift_rad, s.floors, strict=True):
        turned = f"{np.degrees(drift):.4f}" if math.isfinite(drift) else ""
        table.writerow(["straight", f"{measured:.6f}", f"{actual:.6f}", turned, floor or ""])
    write_whole(file, text.getvalue().encode(), force=force)


def _rows(file: Path, table: csv.DictReader[str], metres: float) -> Iterator[_Row]:
    _check_columns(file, table.fieldnames or [])
    for row in table:
        line = table.line_num
        if None in row:
            raise LogError(file, f"found more values than the {len(table.fieldnames or [])} columns", line)
        kind = (row["kind"] or "").strip()
        if kind not in KINDS:
            raise LogError(file, f"found kind {show(row['kind'])}, expected turn or straight", line)
        straight = kind == "straight"
        unit = metres if straight else math.pi / 180
        measured, actual = (number_in(file, line, name, row[name]) * unit for name in ("measured", "actual"))
        if measured == 0:
            raise LogError(file, "found measured 0, expected a movement", line)
        given = (row.get("heading_error_deg") or "").strip()
        drift = math.radians(number_in(file, line, "heading_error_deg", given)) if given else math.nan
        yield _Row(straight, measured, actual, drift, (row.get("floor") or "").strip())


def _check_columns(file: Path, found: Sequence[str]) -> None:
    unknown = [name for name in found if name not in COLUMNS]
    missing = [name for name in NEEDED if name not in found]
    if unknown or missing or len(set(found)) < len(found):
        names = ", ".join(found) or "none"
        wanted = f"{', '.join(NEEDED)}, and perhaps {', '.join(COLUMNS[len(NEEDED) :])}"
        raise LogError(file, f"found columns {names}; expected {wanted}, each once", 1)


def _trials(rows: list[_Row]) -> Trials:
    turns, ways = ([r for r in rows if r.straight is kind] for kind in (False, True))

    def column(of: list[_Row], name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.array([getattr(row, name) for row in of], np.float64)

    return Trials(
        Turns(column(turns, "measured"), column(turns, "actual")),
        Straights(
            column(ways, "measured"),
            column(ways, "actual"),
            column(ways, "drift_rad"),
            tuple(row.floor for row in ways),
        ),
    )
