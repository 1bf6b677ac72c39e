"""Calibration trials: from a CSV table; and pictures taken with the lens covered."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from maurice_mcl.fitting.motion import Straights, Trials, Turns
from maurice_mcl.values import U8, expected_one_of

from .errors import InputError, PictureError, ReadingNotes
from .files.pictures import decode_picture, picture_file
from .files.text import METERS, PICTURES, number_in, read_csv, show
from .reading.recording import LeftOut
from .session_log.reader import LogRecording

# A CSV table of calibration trials, one row a turn or a straight, read strictly.

NEEDED = ("kind", "measured", "actual")
COLUMNS = (*NEEDED, "heading_error_deg", "floor")
KINDS = ("turn", "straight")
WAY_NUMBERS = 3  # of a straight, which has a drift
LENGTHS = ("m", "cm", "mm", "in")  # units of straights


Moved = tuple[float, ...]  # of a turn, measured and actual (rad); of a straight (m), with its drift (rad) too


def read_trials(file: Path, unit: str = "m") -> Trials:
    """Read turns (degrees) and straights (in `unit`: m, cm, mm, in). InputError names row and column."""
    if unit not in LENGTHS:
        raise ValueError(f"found unit {unit!r}, {expected_one_of(unit, LENGTHS)}")
    rows = read_csv(file, "a table of trials", "trial", lambda table: _rows(file, table, METERS[unit]))
    ways = [row for row in rows if len(row[0]) == WAY_NUMBERS]
    turns = [moved for moved, _ in rows if len(moved) != WAY_NUMBERS]
    measured, actual = np.array(turns, np.float64).reshape(-1, 2).T
    way_m, went_m, drift_rad = np.array([moved for moved, _ in ways], np.float64).reshape(-1, WAY_NUMBERS).T
    floors = tuple(floor for _, floor in ways)
    return Trials(Turns(measured, actual), Straights(way_m, went_m, drift_rad, floors))


def _rows(file: Path, table: csv.DictReader[str], meters: float) -> Iterator[tuple[Moved, str]]:
    _check_columns(file, table.fieldnames or [])
    for row in table:
        line = table.line_num
        if None in row:
            raise InputError(file, f"found more values than the {len(table.fieldnames or [])} columns", line)
        kind = (row["kind"] or "").strip()
        if kind not in KINDS:
            raise InputError(file, f"found kind {show(row['kind'])}, expected turn or straight", line)
        straight = kind == "straight"
        unit = meters if straight else math.pi / 180
        measured, actual = (number_in(file, line, row[name], name) * unit for name in ("measured", "actual"))
        if measured == 0:
            raise InputError(file, "found measured 0, expected a movement", line)
        error = (row.get("heading_error_deg") or "").strip()
        drift = math.radians(number_in(file, line, error, "heading_error_deg")) if error else math.nan
        yield (measured, actual, *([drift] if straight else [])), (row.get("floor") or "").strip()


def _check_columns(file: Path, columns: Sequence[str]) -> None:
    unknown = [name for name in columns if name not in COLUMNS]
    missing = [name for name in NEEDED if name not in columns]
    if unknown or missing or len(set(columns)) < len(columns):
        names = ", ".join(columns) or "none"
        columns_in_words = f"{', '.join(NEEDED)}, and perhaps {', '.join(COLUMNS[len(NEEDED) :])}"
        raise InputError(file, f"found columns {names}; expected {columns_in_words}, each once", 1)


# Pictures taken with the lens covered, from a survey log, its folder, or a folder of pictures.


def covered_pictures(path: Path) -> Iterator[U8]:
    """Yield the covered pictures of a log, or all pictures of a folder. InputError if there are none."""
    log = _log_of(path) if path.is_dir() else path
    return _of_folder(path) if log is None else _of_log(log)


def _log_of(folder: Path) -> Path | None:
    logs = sorted(folder.glob("*.log"))
    named = folder / "survey.log"
    if named in logs:
        return named
    if len(logs) > 1:
        raise InputError(folder, f"found {len(logs)} logs, expected one or survey.log; name the log instead")
    return logs[0] if logs else None


def _of_log(log: Path) -> Iterator[U8]:
    none = True
    for record in LogRecording(log, any_kind=True).records(ReadingNotes(keep_going=False)):
        if isinstance(record, LeftOut) and record.picture.covered:
            none = False
            try:
                yield record.picture.read()
            except PictureError as problem:
                raise InputError(log, f"{record.picture.name}: {problem}", record.picture.line) from None
    if none:
        advice = "expected some taken with the lens cap on"
        raise InputError(log, f'found no picture with "covered": true, {advice}')


def _of_folder(folder: Path) -> Iterator[U8]:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in PICTURES and file.is_file())
    if not files:
        advice = "expected pictures taken with the lens cap on"
        raise InputError(folder, f"found neither pictures nor a log, {advice}")
    for file in files:
        try:
            yield decode_picture(picture_file(file))
        except PictureError as problem:
            raise InputError(file, str(problem)) from None
