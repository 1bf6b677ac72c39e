"""Calibration trials: from a CSV table, a session log with truth, or a folder of odometry and truth."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maurice_mcl.filter.motion import MauriceParameters
from maurice_mcl.fitting.motion import MotionSegment, Straights, Trials, Turns, trials_of
from maurice_mcl.values import F64, KIDNAPPED, U8, Arena, Bool, SessionInfo, first_word, rotated

from .errors import InputError, PictureError, ReadingNotes
from .files.pictures import decode_picture, picture_file
from .files.text import METERS, PICTURES, number_in, read_csv, read_number_rows, show
from .reading.recording import LeftOut, Note, OdometryPose, Record, TruthPose
from .reading.session import RecordedSession, drive_segments
from .session_log.reader import LogRecording

# A CSV table of calibration trials, one row a turn or a straight, read strictly and written.

NEEDED = ("kind", "measured", "actual")
COLUMNS = (*NEEDED, "heading_error_deg", "floor")
KINDS = ("turn", "straight")
WAY_NUMBERS = 3  # of a straight, which has a drift
LENGTHS = ("m", "cm", "mm", "in")  # units of straights


Moved = tuple[float, ...]  # of a turn, measured and actual (rad); of a straight (m), with its drift (rad) too


def read_trials(file: Path, unit: str = "m") -> Trials:
    """Read turns (degrees) and straights (in `unit`: m, cm, mm, in). InputError names row and column."""
    if unit not in LENGTHS:
        raise ValueError(f"found unit {unit!r}, expected one of {', '.join(LENGTHS)}")
    rows = read_csv(file, "a table of trials", "trial", lambda table: _rows(file, table, METERS[unit]))
    ways = [row for row in rows if len(row[0]) == WAY_NUMBERS]
    turns = [moved for moved, _ in rows if len(moved) != WAY_NUMBERS]
    return _trials(turns, [moved for moved, _ in ways], tuple(floor for _, floor in ways))


def _trials(turns: list[Moved], ways: list[Moved], floors: tuple[str, ...], left_out: int = 0) -> Trials:
    measured, actual = np.array(turns, np.float64).reshape(-1, 2).T
    way_m, went_m, drift_rad = np.array(ways, np.float64).reshape(-1, WAY_NUMBERS).T
    return Trials(Turns(measured, actual), Straights(way_m, went_m, drift_rad, floors), left_out)


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
        given = (row.get("heading_error_deg") or "").strip()
        drift = math.radians(number_in(file, line, given, "heading_error_deg")) if given else math.nan
        yield (measured, actual, *([drift] if straight else [])), (row.get("floor") or "").strip()


def _check_columns(file: Path, columns: Sequence[str]) -> None:
    unknown = [name for name in columns if name not in COLUMNS]
    missing = [name for name in NEEDED if name not in columns]
    if unknown or missing or len(set(columns)) < len(columns):
        names = ", ".join(columns) or "none"
        wanted = f"{', '.join(NEEDED)}, and perhaps {', '.join(COLUMNS[len(NEEDED) :])}"
        raise InputError(file, f"found columns {names}; expected {wanted}, each once", 1)


# Calibration trials from a session log with truth: what each movement did, by the poses around it.

MISHAPS = ("slip", "bump")  # events of movements that no constant explains
SAMPLES = 9  # points of a path at which the floor is looked up


def trials_from_session(path: Path) -> Trials:
    """Read a session's movements and truth. Raises InputError for what is no session, or has no truth."""
    log = LogRecording(path)
    legs = [(plain(segment), segment) for segment in drive_segments(RecordedSession(log))]
    trials = trials_of([leg for leg, _ in legs if leg], lambda a, b: floor_between(log.info.arena, a, b))
    arcs = sum(len(segment.motions) for leg, segment in legs if leg is None)
    trials = replace(trials, left_out=trials.left_out + arcs)
    records = log.records(ReadingNotes(keep_going=False))
    truths = sum(1 for _ in islice((r for r in records if isinstance(r, TruthPose)), 2))
    if truths < 2:
        count = "no truth" if not truths else "one truth"
        raise InputError(path, f"found {count}, expected truth records before and after the movements")
    return trials


def mishaps(path: Path) -> dict[str, int]:
    """Count what a session log tells of slips and bumps: events that begin with these words."""
    counts = dict.fromkeys(MISHAPS, 0)
    for record in LogRecording(path).records(ReadingNotes(keep_going=False)):
        if isinstance(record, Note) and (word := first_word(record.text)) in counts:
            counts[word] += 1
    return counts


def plain(leg: MotionSegment) -> MotionSegment | None:
    """Return a leg of turns or straights, never both; None for arcs, which cannot be separated.

    A movement by itself counts as what it nearly is.
    """
    least = MauriceParameters()
    way_m, turn = float(np.hypot(*leg.motions[0][:2])), float(leg.motions[0][2])
    both = [
        np.hypot(*m[:2]) >= least.straight_from_m and abs(m[2]) >= least.turn_from_rad for m in leg.motions
    ]
    if not any(both):
        return leg
    if len(both) > 1 or (way_m >= LEAST_M) == (abs(turn) >= LEAST_RAD):
        return None
    if way_m >= LEAST_M:
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
    return next((floor.name for floor in reversed(arena.floors) if floor.depth_m(point[None])[0] >= 0), "")


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
        wanted = "expected some taken with the lens cap on"
        raise InputError(log, f'found no picture with "covered": true, {wanted}')


def _of_folder(folder: Path) -> Iterator[U8]:
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in PICTURES and file.is_file())
    if not files:
        wanted = "expected pictures taken with the lens cap on"
        raise InputError(folder, f"found neither pictures nor a log, {wanted}")
    for file in files:
        try:
            yield decode_picture(picture_file(file))
        except PictureError as problem:
            raise InputError(file, str(problem)) from None


# A folder of odometry beside motion-capture truth, one row per sample: the true x y theta, the x y of the
# robot's own odometry, and the z w of its heading, in a frame of its own. The robot never stops to be
# measured, so the drive is cut where it changes between turning and going.

FILES = {"gt.txt": 3, "odom_pose.txt": 2, "odom_quaternion.txt": 2}


# How a drive is cut into movements; all ours.
TURNING_M = 0.05  # turning: heading change times this (half a track) exceeds the distance
STILL_M = 0.0005  # a row in which neither goes further than this is standing
LEAST_RAD = float(np.radians(10))  # a smaller turn is left out, a straight that bends more as well
LEAST_M = 0.05  # shorter straights are left out
JUMP = 3.0  # truth that goes this many times as far as the wheels, in a row or altogether ...
NOISE_RAD = 0.1  # ... is not believed; but truth may be noisy by this in a row


@dataclass(frozen=True, slots=True, eq=False)
class AlignedDrive:
    """Odometry and truth, row by row; headings are not wrapped."""

    odometry: F64  # (n, 3) x_m, y_m, heading_rad, in the odometry's own frame
    truth: F64  # (n, 3)


def is_odometry_folder(folder: Path) -> bool:
    """Return whether a folder holds the three files."""
    return all((folder / name).is_file() for name in FILES)


def read_aligned(folder: Path) -> AlignedDrive:
    """Read the three files. Raises InputError naming the file and the line, or files of different lengths."""
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing:
        raise InputError(folder, f"found no {', '.join(missing)} in it, expected {', '.join(FILES)}")
    truth, places, turns = (_table(folder / name, columns) for name, columns in FILES.items())
    if not len(truth) == len(places) == len(turns):
        counts = ", ".join(f"{len(t)} in {n}" for n, t in zip(FILES, (truth, places, turns), strict=True))
        raise InputError(folder, f"found rows of different number ({counts}), expected them aligned")
    if len(truth) < 2:
        raise InputError(folder, f"found {len(truth)} rows, expected a drive")
    heading = np.unwrap(2 * np.arctan2(turns[:, 0], turns[:, 1]))
    return AlignedDrive(
        np.column_stack([places, heading]), np.column_stack([truth[:, :2], np.unwrap(truth[:, 2])])
    )


def _table(file: Path, columns: int) -> F64:
    rows = read_number_rows(file, "a table of numbers", "a table", columns, f"{columns} finite numbers")
    return np.array(rows, np.float64).reshape(-1, columns)


@dataclass(frozen=True, slots=True, eq=False)
class OdometryFolder:
    """The folder as a recording with one row each second; where the truth jumps, the robot was carried."""

    path: Path

    @property
    def info(self) -> SessionInfo:
        """The folder's name."""
        return SessionInfo(self.path.name)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the truth and the odometry of each row. InputError as `read_aligned`."""
        drive = read_aligned(self.path)
        jumped = [False, *jumps(drive)]
        for row, (truth, odometry) in enumerate(zip(drive.truth, drive.odometry, strict=True)):
            t_s = float(row)
            if jumped[row]:
                yield Note(t_s, KIDNAPPED)
            yield OdometryPose(t_s, odometry)  # which tells where the drive is cut
            yield TruthPose(t_s, truth)


def trials_from_folder(folder: Path) -> Trials:
    """Read a drive and cut it into turns and straights."""
    return cut(read_aligned(folder))


STANDING, TURNING, FORWARD, BACKWARD = range(4)


def cut(drive: AlignedDrive) -> Trials:
    """Cut a drive where it changes between turning and going, forward and backward.

    A drift is what the heading changed less what odometry saw; backward, lengths are negative. Movements
    that are too small, arcs, and those in which the truth jumps are left out and counted.
    """
    kinds, jumped = _kinds(drive.odometry), jumps(drive)
    edges = np.flatnonzero(np.diff(kinds)) + 1
    turns, ways, left_out = list[Moved](), list[Moved](), 0
    for first, last in zip([0, *edges], [*edges, len(kinds)], strict=True):  # steps first to last - 1
        moved, went = (rows[last] - rows[first] for rows in (drive.odometry, drive.truth))
        kind = kinds[first]
        if kind == STANDING:
            continue
        if jumped[first:last].any() or not _believed(moved, went, kind == TURNING):
            left_out += 1
        elif kind == TURNING:
            turns.append((moved[2], went[2]))
        else:
            sign = -1 if kind == BACKWARD else 1
            ways.append((sign * np.hypot(*moved[:2]), sign * np.hypot(*went[:2]), went[2] - moved[2]))
    return _trials(turns, ways, ("",) * len(ways), left_out)


def _believed(moved: F64, went: F64, turning: bool) -> bool:
    if turning:
        return bool(abs(moved[2]) >= LEAST_RAD and abs(went[2]) < JUMP * abs(moved[2]))
    way, really = (float(np.hypot(*step[:2])) for step in (moved, went))
    return bool(abs(moved[2]) <= LEAST_RAD and way >= LEAST_M and really < JUMP * way)


def _kinds(odometry: F64) -> NDArray[np.int64]:
    steps = np.diff(odometry, axis=0)
    way, arc = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2]) * TURNING_M
    ahead = rotated(steps[:, 0], steps[:, 1], -odometry[:-1, 2])[0]
    going = np.where(arc > way, TURNING, np.where(ahead >= 0, FORWARD, BACKWARD))
    return np.where(np.maximum(way, arc) < STILL_M, STANDING, going).astype(np.int64)


def jumps(drive: AlignedDrive) -> Bool:
    """Return the steps (n - 1,) in which the truth goes or turns further than the wheels ever could."""
    wheels, truth = (np.abs(np.diff(rows, axis=0)) for rows in (drive.odometry, drive.truth))
    most_m = JUMP * float(np.hypot(wheels[:, 0], wheels[:, 1]).max())
    most_rad = max(JUMP * float(wheels[:, 2].max()), NOISE_RAD)
    return np.asarray((np.hypot(truth[:, 0], truth[:, 1]) > most_m) | (truth[:, 2] > most_rad))
