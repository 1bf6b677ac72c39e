"""A table of pictures with their poses, and a map as wall segments."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.map import Arena, open_arena

from ..errors import InputError
from ..io.fields import MOST, number_in, show, up_to
from ..io.files import expect_regular
from ..libraries.files import check_span

# A CSV table of pictures and their poses, read strictly: every complaint names the row and the column.

UNITS = ("deg", "rad")
OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs"}  # as some programs write what they call CSV


@dataclass(frozen=True, slots=True)
class Columns:
    """Which columns of the table hold what."""

    image: str = "image"  # a path, relative to the folder of pictures or to the table
    x: str = "x_m"  # meters
    y: str = "y_m"  # meters
    heading: str = "heading_deg"  # counter-clockwise from +x; its unit by the name's ending ...
    heading_unit: str | None = None  # ... unless given here: "deg" or "rad"


@dataclass(frozen=True, slots=True, eq=False)
class PoseRow:
    """One row of the table."""

    number: int  # of the row among the data rows, from 0; a picture taken at that second
    line: int  # in the file, for messages
    image: str
    pose: F64  # (3,) x_m, y_m, heading_rad


def read_pose_table(file: Path, columns: Columns) -> list[PoseRow]:
    """Read all rows. Raises InputError naming the columns that were found, or the row and column at fault."""
    expect_regular(file, "a table of poses")
    try:
        with file.open(newline="", encoding="utf-8-sig") as data:
            rows = list(_rows(file, csv.DictReader(data), columns))
    except FileNotFoundError:
        raise InputError(file, "found no such file, expected a table of poses; check the path") from None
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise InputError(file, f"cannot be read as a CSV table: {problem}") from None
    if not rows:
        raise InputError(file, "found no rows, expected one a picture")
    return rows


def pose_runs(rows: list[PoseRow]) -> list[list[PoseRow]]:
    """Group consecutive rows of equal pose."""
    runs: list[list[PoseRow]] = []
    for row in rows:
        if runs and np.array_equal(runs[-1][0].pose, row.pose):
            runs[-1].append(row)
        else:
            runs.append([row])
    return runs


def heading_unit(file: Path, columns: Columns) -> str:
    """Return the heading's unit from the option or the column's name."""
    unit = columns.heading_unit or columns.heading.rsplit("_", 1)[-1]
    if unit not in UNITS:
        advice = "say whether it is in deg or rad"
        raise InputError(
            file, f"found heading column {columns.heading!r} without a unit in its name; {advice}"
        )
    return unit


def _rows(file: Path, table: csv.DictReader[str], columns: Columns) -> Iterator[PoseRow]:
    found = table.fieldnames or []
    wanted = (columns.image, columns.x, columns.y, columns.heading)
    missing = [name for name in wanted if name not in found]
    if missing:
        _expect_commas(file, found)
        names = ", ".join(found) or "none"
        raise InputError(
            file, f"found columns {names}, expected also {', '.join(missing)}; choose the columns", 1
        )
    to_rad = math.pi / 180 if heading_unit(file, columns) == "deg" else 1.0
    for number, row in enumerate(table):
        line = table.line_num
        image = row[columns.image]
        if not image:
            raise InputError(
                file, f"found no file name in column {columns.image!r}, expected a picture", line
            )
        x, y, heading = (number_in(file, line, name, row[name]) for name in wanted[1:])
        yield PoseRow(number, line, image, np.array([x, y, heading * to_rad]))


def _expect_commas(file: Path, found: Sequence[str]) -> None:
    """Report when all names are one column, which another separator explains."""
    for separator, name in OTHER_SEPARATORS.items():
        if len(found) == 1 and separator in found[0]:
            advice = "save the table with commas between columns"
            raise InputError(file, f"found columns separated by {name}, expected commas; {advice}", 1)


# A map given as a text file of wall segments.

METERS = {"m": 1.0, "mm": 0.001}


def arena_from_lines(file: Path, unit: str, poses: F64, margin_m: float = 1.0) -> Arena:
    """Read `x1 y1 x2 y2` a line, in "m" or "mm"; empty lines and lines that begin with # are skipped.

    The bounds reach a margin beyond the poses (L, 2 or 3), for a plan of a whole building says nothing about
    rooms that were never surveyed; walls entirely outside are left out. Raises InputError naming a bad line,
    or says that the map is larger than any robot's.
    """
    if unit not in METERS:
        raise ValueError(f"found map unit {unit!r}, expected one of {', '.join(METERS)}")
    expect_regular(file, "a map")
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(file, f"cannot be read as a map: {problem}") from None
    used = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.strip().startswith("#")]
    segments = np.array([_wall(file, n, line) for n, line in used], np.float64).reshape(-1, 4)
    bounds = open_arena(poses, margin_m).bounds
    arena = Arena(bounds, _near(segments * METERS[unit], bounds))
    check_span(file, poses, arena)
    return arena


def _near(walls: F64, bounds: tuple[float, float, float, float]) -> F64:
    """Keep the walls (W, 4) whose own box meets the bounds."""
    x_min, y_min, x_max, y_max = bounds
    x, y = walls[:, [0, 2]], walls[:, [1, 3]]
    meets_x = (x.max(axis=1) >= x_min) & (x.min(axis=1) <= x_max)
    meets_y = (y.max(axis=1) >= y_min) & (y.min(axis=1) <= y_max)
    near: F64 = walls[meets_x & meets_y]
    return near


def _wall(file: Path, number: int, line: str) -> list[float]:
    try:
        values = [float(word) for word in line.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != 4 or not np.isfinite(values).all():
        raise InputError(file, f"found {show(line.strip())}, expected four numbers x1 y1 x2 y2", number)
    if max(map(abs, values)) > MOST:
        raise InputError(file, f"found {show(line.strip())}, expected each {up_to()}", number)
    return values
