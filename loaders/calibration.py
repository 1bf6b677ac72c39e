"""Calibration trials: from a CSV table, or from a session log with truth."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arrays import F64, U8
from maurice_mcl.calibration.motion import MotionSegment, Straights, Trials, Turns, trials_of
from maurice_mcl.filter.motion import MauriceParameters
from maurice_mcl.geometry import INCH_M
from maurice_mcl.map import Arena

from .errors import InputError, PictureError, ReadingNotes
from .formats.odometry_folder import Cutting
from .io.fields import number_in, show
from .io.files import PICTURES, expect_regular, write_whole
from .io.pictures import decode_picture
from .session_log.reader import picture_bytes
from .session_log.records import (
    EventRecord,
    OdometryRecord,
    PictureRecord,
    TruthRecord,
    is_kidnapping,
    read_header,
    read_records,
)

# A CSV table of calibration trials, one row a turn or a straight, read strictly and written.

NEEDED = ("kind", "measured", "actual")
COLUMNS = (*NEEDED, "heading_error_deg", "floor")
KINDS = ("turn", "straight")
METERS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH_M}


@dataclass(frozen=True, slots=True)
class _Row:
    straight: bool
    measured: float  # m or rad
    actual: float
    drift_rad: float  # nan: not given
    floor: str


def read_trials(file: Path, unit: str = "m") -> Trials:
    """Read turns (degrees) and straights (lengths in "m", "cm", "mm" or "in").

    Raises InputError naming an unknown or missing column, or the row and the column at fault.
    """
    if unit not in METERS:
        raise ValueError(f"found unit {unit!r}, expected one of {', '.join(METERS)}")
    expect_regular(file, "a table of trials")
    try:
        with file.open(newline="", encoding="utf-8-sig") as data:
            rows = list(_rows(file, csv.DictReader(data), METERS[unit]))
    except FileNotFoundError:
        raise InputError(file, "found no such file, expected a table of trials; check the path") from None
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise InputError(file, f"cannot be read as a CSV table: {problem}") from None
    if not rows:
        raise InputError(file, "found no rows, expected one a trial")
    return _trials(rows)


def write_trials(file: Path, trials: Trials, *, force: bool = False) -> None:
    """Write trials as a table that `read_trials` reads, lengths in meters; completely or not at all.

    Raises InputError if the file exists and `force` is not given.
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


def _rows(file: Path, table: csv.DictReader[str], meters: float) -> Iterator[_Row]:
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
        measured, actual = (number_in(file, line, name, row[name]) * unit for name in ("measured", "actual"))
        if measured == 0:
            raise InputError(file, "found measured 0, expected a movement", line)
        given = (row.get("heading_error_deg") or "").strip()
        drift = math.radians(number_in(file, line, "heading_error_deg", given)) if given else math.nan
        yield _Row(straight, measured, actual, drift, (row.get("floor") or "").strip())


def _check_columns(file: Path, found: Sequence[str]) -> None:
    unknown = [name for name in found if name not in COLUMNS]
    missing = [name for name in NEEDED if name not in found]
    if unknown or missing or len(set(found)) < len(found):
        names = ", ".join(found) or "none"
        wanted = f"{', '.join(NEEDED)}, and perhaps {', '.join(COLUMNS[len(NEEDED) :])}"
        raise InputError(file, f"found columns {names}; expected {wanted}, each once", 1)


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


# Calibration trials from a session log with truth: what each movement did, by the poses around it.

MISHAPS = ("slip", "bump")  # events of movements that no constant explains
SAMPLES = 9  # points of a path at which the floor is looked up


def trials_from_session(path: Path) -> Trials:
    """Read a session's movements and truth. Raises InputError for what is no session, or has no truth."""
    info, kind = read_header(path)
    if kind != "session":
        raise InputError(path, f"found a {kind} log, expected a session log with odometry and truth", 1)
    reader = _Legs(path)
    trials = trials_of(reader, lambda a, b: floor_between(info.arena, a, b))
    trials = replace(trials, left_out=trials.left_out + reader.bent)
    if reader.truths < 2:
        found = "no truth" if not reader.truths else "one truth"
        raise InputError(path, f"found {found}, expected truth records before and after the movements")
    return trials


class _Legs:
    """The legs of a log: the movements between truths, with the first truth after each movement.

    The first, because odometry covers the time since the odometry record before: later truths may already
    belong to the next movement. Nothing is joined across a kidnapping.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.truths = 0  # seen so far ...
        self.bent = 0  # ... and movements left out because they are arcs

    def __iter__(self) -> Iterator[MotionSegment]:
        self.truths = self.bent = 0
        before: F64 | None = None
        motions: list[F64] = []
        for record in read_records(self._path, "session", ReadingNotes(keep_going=False)):
            if isinstance(record, OdometryRecord):
                motions.append(record.motion)
            elif is_kidnapping(record):
                before, motions = None, []
            elif isinstance(record, TruthRecord):
                self.truths += 1
                if before is not None and motions:
                    leg = plain(MotionSegment(before, tuple(motions), record.pose))
                    self.bent += 0 if leg else len(motions)
                    yield from (leg,) if leg else ()
                if before is None or motions:
                    before, motions = record.pose, []


def mishaps(path: Path) -> dict[str, int]:
    """Count what a session log tells of slips and bumps: events that begin with these words."""
    found = dict.fromkeys(MISHAPS, 0)
    for record in read_records(path, "session", ReadingNotes(keep_going=False)):
        if isinstance(record, EventRecord) and (word := record.text.split(" ")[0]) in found:
            found[word] += 1
    return found


def plain(leg: MotionSegment) -> MotionSegment | None:
    """Return a leg whose movements are turns or straights and never both; None for arcs.

    A movement by itself that is nearly a turn counts as one, and one that is nearly a straight as a straight
    that drifted by what its odometry did not see. What an arc did cannot be separated.
    """
    least, limits = MauriceParameters(), Cutting()
    way_m, turn = float(np.hypot(*leg.motions[0][:2])), float(leg.motions[0][2])
    both = [
        np.hypot(*m[:2]) >= least.straight_from_m and abs(m[2]) >= least.turn_from_rad for m in leg.motions
    ]
    if not any(both):
        return leg
    if len(both) > 1 or (way_m >= limits.least_m) == (abs(turn) >= limits.least_rad):
        return None
    if way_m >= limits.least_m:
        return MotionSegment(leg.before, (leg.motions[0] * [1, 1, 0],), leg.after - [0, 0, turn])
    return MotionSegment(leg.before, (np.array([0, 0, turn]),), leg.after)


def floor_between(arena: Arena | None, start: F64, end: F64) -> str | None:
    """Name the floor of a straight path between two points (2,); "" without one, None across several."""
    if arena is None:
        return ""
    names = {floor_at(arena, point) for point in np.linspace(start, end, SAMPLES)}
    return names.pop() if len(names) == 1 else None


def floor_at(arena: Arena, point: F64) -> str:
    """Name the topmost floor at a point (2,); "" where there is none."""
    x, y = (float(v) for v in point)
    for floor in reversed(arena.floors):
        if cv2.pointPolygonTest(floor.polygon.astype(np.float32), (x, y), False) >= 0:
            return floor.name
    return ""


# Pictures taken with the lens covered, from a survey log, its folder, or a folder of pictures.


def covered_pictures(path: Path) -> Iterator[U8]:
    """Read the covered pictures of a log, or all of a folder without one; one is held at a time.

    Raises InputError if there are none, naming what was looked for, or for a picture that cannot be read.
    """
    log = _log_of(path) if path.is_dir() else path
    return _of_folder(path) if log is None else _of_log(log)


def _log_of(folder: Path) -> Path | None:
    """Return survey.log, or the only log of a folder; None when it holds no log."""
    logs = sorted(folder.glob("*.log"))
    named = folder / "survey.log"
    if named in logs:
        return named
    if len(logs) > 1:
        raise InputError(folder, f"found {len(logs)} logs, expected one or survey.log; name the log instead")
    return logs[0] if logs else None


def _of_log(log: Path) -> Iterator[U8]:
    _, kind = read_header(log)
    none = True
    for record in read_records(log, kind, ReadingNotes(keep_going=False)):
        if isinstance(record, PictureRecord) and record.covered:
            none = False
            try:
                yield decode_picture(picture_bytes(record, log))
            except PictureError as problem:
                raise InputError(log, f"{record.path or 'inline picture'}: {problem}", record.line) from None
    if none:
        raise InputError(
            log, 'found no picture with "covered": true, expected some taken with the lens cap on'
        )


def _of_folder(folder: Path) -> Iterator[U8]:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in PICTURES and file.is_file())
    if not files:
        raise InputError(
            folder, "found neither pictures nor a log, expected pictures taken with the lens cap on"
        )
    for file in files:
        try:
            yield decode_picture(file.read_bytes())
        except PictureError as problem:
            raise InputError(file, str(problem)) from None
