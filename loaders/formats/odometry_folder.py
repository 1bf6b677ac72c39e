"""Folders with aligned rows of truth, odometry and floor sensors, as the Thymio localization data has them.

`odom_pose.txt` holds x y (meters), `odom_quaternion.txt` z w, `gt.txt` x y heading (meters, radians), and
each file `sensor_NAME.txt` one reading a row. `map.png`, there or in the folder above, is the print of the
floor: one centimeter a pixel, its first axis x and its second y.

A column of times before them, heights, whole quaternions, commas and a line of names are read as well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.geometry import wrap
from maurice_mcl.session import SessionInfo

from ..errors import InputError, ReadingNotes
from ..files import MOST, expect_regular, show, up_to
from ..reading import ReadingOptions
from ..recording import Note, OdometryPose, Readings, Record, TruthPose
from .registry import Format

TRUTH, PLACES, TURNS = "gt.txt", "odom_pose.txt", "odom_quaternion.txt"
# How many columns a file may have, and whether the first of so many is a time. What is wanted are the last,
# but for a height behind the place.
COLUMNS: Mapping[str, Mapping[int, bool]] = {
    TRUTH: {3: False, 4: True},
    PLACES: {2: False, 3: True, 4: True},
    TURNS: {2: False, 3: True, 4: False, 5: True},
}
OF_SENSOR = {1: False, 2: True}
WANTED = {TRUTH: 3, PLACES: 2, TURNS: 2}
SENSORS, PRINT = "sensor_*.txt", "map.png"
# Rows are millimeters apart, and the errors of a movement are those of all its rows: more noise in each.
MOTION = {"model": "odometry", "turn_from_turn": 0.08, "turn_from_way": 1.0, "way_from_way": 0.16}
PERIOD_S = 1 / 3  # of rows without a time
UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)  # of times: rows are under ten seconds apart
LEVEL_M = 0.01  # a last column that varies by less is a height
FEWER = 3  # rows that a file may have less than another: its writer was stopped earlier
PIXEL_M = 0.01
JUMP_M, JUMP_RAD = 0.05, 0.5  # in a row, beyond what the wheels went: somebody carried the robot
AFTER = 10  # rows: one carrying is told once
WINDOW, ALIKE = 30, 0.25  # rows over which movements are compared, and the logarithm of a factor
UNITS_M = {"millimeters": 1000.0, "centimeters": 100.0}


@dataclass(frozen=True, eq=False)
class OdometryFolder:
    """The rows as records; where no file has times, they are a third of a second apart."""

    path: Path
    info: SessionInfo
    odometry: F64  # (N, 3) x_m, y_m, heading_rad
    truth: F64 | None  # (N, 3); NaN: not known
    readings: dict[str, F64]  # (N,) by name; NaN: none
    times: F64 | None = None  # (N,) in seconds; None: not in any file
    doubts: tuple[str, ...] = ()  # what a reader should know

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield odometry, truth and readings row by row, and where the robot was carried."""
        for text in self.doubts:
            notes.warning(text)
        carried = set() if self.truth is None else carried_rows(self.odometry, self.truth)
        for row, odometry in enumerate(self.odometry):
            t_s = round(row * PERIOD_S if self.times is None else float(self.times[row]), 6)
            if row in carried:
                yield Note(t_s, "kidnapped")
            yield OdometryPose(t_s, odometry)
            if self.truth is not None and np.isfinite(self.truth[row]).all():
                yield TruthPose(t_s, self.truth[row])
            found = {name: float(values[row]) for name, values in self.readings.items()}
            found = {name: value for name, value in found.items() if math.isfinite(value)}
            if found:
                yield Readings(t_s, found)


def carried_rows(odometry: F64, truth: F64) -> set[int]:
    """Return the rows before which the truth went much further than the wheels; the first of several."""
    steps = [np.abs(np.diff(rows, axis=0)) for rows in (odometry, truth)]
    wheels_m, went_m = (np.hypot(step[:, 0], step[:, 1]) for step in steps)
    turned = np.abs(wrap(np.diff(truth[:, 2]) - np.diff(odometry[:, 2])))
    jumped = np.flatnonzero((went_m - wheels_m > JUMP_M) | (turned > JUMP_RAD)) + 1
    before = [-math.inf, *jumped][: len(jumped)]
    return {int(row) for row, last in zip(jumped, before, strict=True) if row - last > AFTER}


def looks_like_odometry_folder(folder: Path) -> bool:
    """Return whether a folder holds the files of the odometry, or one of them beside floor sensors."""
    try:
        there = [(folder / name).is_file() for name in (PLACES, TURNS)]
        return all(there) or (any(there) and bool(sensor_files(folder)))
    except OSError:
        return False


@dataclass(frozen=True, slots=True, eq=False)
class NumberTable:
    """The rows of one file."""

    values: F64  # (N, C)
    times: F64 | None  # (N,) as written


def number_table(file: Path, columns: Mapping[int, bool], wanted: int, *, gaps: bool = False) -> NumberTable:
    """Read rows of numbers, of which the last `wanted` count; `gaps` allows NaN. InputError naming the line.

    Numbers are separated by blanks, commas or semicolons. A first line of names, and lines that begin with #,
    are passed over.
    """
    expect_regular(file, "a table of numbers")
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(file, f"cannot be read as a table: {problem}") from None
    rows, expected = list[list[float]](), f"{wanted} {'' if gaps else 'finite '}numbers"
    for at, line in enumerate(map(str.strip, lines), 1):
        if not line or line.startswith("#") or (not rows and _is_names(line)):
            continue
        values = _numbers(line)
        count = len(values)
        unlike = count not in columns or (rows and count != len(rows[0]))
        if unlike or any(math.isinf(v) or (math.isnan(v) and not gaps) for v in values):
            raise InputError(file, f"found {show(line)}, expected {expected}", at)
        if max(map(abs, values[columns[count] :])) > MOST:
            raise InputError(file, f"found {show(line)}, expected each {up_to()}", at)
        rows.append(values)
    if not rows:
        raise InputError(file, "found no rows, expected a drive")
    table = np.array(rows, np.float64)
    count, timed = table.shape[1], columns[table.shape[1]]
    end = count
    if file.name == PLACES and count > wanted and np.ptp(table[:, -1]) < LEVEL_M:
        end, timed = count - 1, count > 3
    return NumberTable(table[:, end - wanted : end], table[:, 0] if timed else None)


def _is_names(line: str) -> bool:
    return re.search(r"[^\W\d]", line) is not None and not _numbers(line)


def _numbers(line: str) -> list[float]:
    """Return the numbers of a line, empty where it holds something else; 0,5;0,3 has decimal commas."""
    words = (
        line.replace(",", ".").split(";") if ";" in line and "." not in line else re.split(r"[\s,;]+", line)
    )
    try:
        return [float(word) for word in words]
    except ValueError:
        return []


def _seconds(tables: Iterable[NumberTable]) -> F64 | None:
    """Return the times (N,) of the first file whose times rise, from zero."""
    for table in tables:
        if table.times is not None and len(table.times) > 1:
            since = table.times - table.times[0]
            step = float(np.median(np.diff(since)))
            if (np.diff(since) >= 0).all() and step > 0:
                return np.asarray(since * next((unit for unit in UNITS_S if step * unit < 10), UNITS_S[-1]))
    return None


def open_odometry_folder(path: Path, options: ReadingOptions | None = None) -> OdometryFolder:
    """Read the rows of a folder. InputError for a file that is missing or broken, or of another length."""
    missing = [name for name in (PLACES, TURNS) if not (path / name).is_file()]
    if missing:
        raise InputError(path, f"found no {', '.join(missing)} in it, expected {PLACES} and {TURNS}")
    sensors = sensor_files(path)
    tables = {
        name: number_table(path / name, COLUMNS[name], WANTED[name], gaps=name == TRUTH)
        for name in COLUMNS
        if (path / name).is_file()
    }
    tables |= {file.name: number_table(file, OF_SENSOR, 1, gaps=True) for file in sensors.values()}
    rows, doubts = _aligned(path, {name: len(table.values) for name, table in tables.items()})
    values = {name: table.values[:rows] for name, table in tables.items()}
    heading = 2 * np.arctan2(values[TURNS][:, 0], values[TURNS][:, 1])
    odometry = np.column_stack([values[PLACES], wrap(heading)])
    times, truth = _seconds(tables.values()), values.get(TRUTH)
    if times is None:
        doubts.append(f"no file holds times: {1 / PERIOD_S:g} rows a second are assumed")
    odometry, truth, units = _in_meters(odometry, truth)
    doubts += units
    survey = path.resolve() if sensors else None
    readings = {name: values[file.name][:, 0] for name, file in sensors.items()}
    info = SessionInfo(path.resolve().name, motion=dict(MOTION), survey=survey)
    times = None if times is None else times[:rows]
    return OdometryFolder(path, info, odometry, truth, readings, times, tuple(doubts))


def _aligned(path: Path, counts: Mapping[str, int]) -> tuple[int, list[str]]:
    """Return how many rows all files have, and what to say where some have a few more. InputError."""
    rows, listed = min(counts.values()), ", ".join(f"{count} in {name}" for name, count in counts.items())
    if max(counts.values()) - rows > FEWER:
        raise InputError(path, f"found rows of different number ({listed}), expected them aligned")
    apart = max(counts.values()) > rows
    return rows, [f"found rows of different number ({listed}): the first {rows} are taken as aligned"] * apart


def _in_meters(odometry: F64, truth: F64 | None) -> tuple[F64, F64 | None, list[str]]:
    """Return both in meters and radians, and what was taken as other units, told by the other one."""
    if truth is None:
        return odometry, None, []
    found, degrees = list[str](), math.degrees(1)
    ways = [np.hypot(*(rows[WINDOW:] - rows[:-WINDOW])[:, :2].T) for rows in (odometry, truth)]
    times = _ratio(ways[1], ways[0])
    for name, factor in UNITS_M.items():
        if abs(math.log(times / factor)) < ALIKE:
            truth = truth / [factor, factor, 1]
            found.append(f"places in {TRUTH} go {times:.3g} times as far as in {PLACES}: taken as {name}")
        elif abs(math.log(times * factor)) < ALIKE:
            odometry = odometry / [factor, factor, 1]
            found.append(f"places in {PLACES} go {1 / times:.3g} times as far as in {TRUTH}: taken as {name}")
    headings = [np.unwrap(odometry[:, 2]), truth[:, 2]]
    turns = [np.abs(rows[WINDOW:] - rows[:-WINDOW]) for rows in headings]
    if abs(math.log(_ratio(turns[1], turns[0]) / degrees)) < ALIKE:
        truth = truth / [1, 1, degrees]
        found.append(f"headings in {TRUTH} turn {degrees:.3g} times as far as in {TURNS}: taken as degrees")
    return odometry, truth, found


def _ratio(ours: F64, theirs: F64) -> float:
    """Return how many times as large numbers (N,) are as others that are not small; 1: unknown."""
    large = np.isfinite(ours) & (theirs > 0.2 * theirs.max(initial=0.0)) & (ours > 0)
    return float(np.median(ours[large] / theirs[large])) if large.any() else 1.0


def sensor_files(folder: Path) -> dict[str, Path]:
    """Return the files of readings by the names of their sensors."""
    return {file.stem.removeprefix("sensor_"): file for file in sorted(folder.glob(SENSORS))}


def floor_print(folder: Path) -> Path | None:
    """Return the picture of the floor, in the folder or the one above it."""
    folder = folder.resolve()
    return next((one / PRINT for one in (folder, folder.parent) if (one / PRINT).is_file()), None)


def read_print(file: Path) -> F64:
    """Read the print as (rows along y, columns along x), 0 black to 1 its lightest. Raises InputError.

    Pictures of 8 or 16 bits or of floats are read; the lightest pixel is paper, whatever its value.
    """
    expect_regular(file, "a picture")
    try:
        how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
        image = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), how)
    except (OSError, cv2.error) as problem:
        raise InputError(file, f"cannot be read as a picture: {problem}") from None
    if image is None:
        raise InputError(file, "cannot be read as a picture, expected the print of a floor")
    values = np.asarray(image.T, np.float64)
    lightest = float(values.max())
    if not (np.isfinite(values).all() and values.min() >= 0 and lightest > 0):
        raise InputError(
            file, "found a picture that is all black, or not of numbers from 0 up, expected a print"
        )
    return np.asarray(values / lightest)


WHAT = "a folder of aligned odometry, truth and floor sensors (odom_pose.txt, gt.txt, sensor_left.txt)"
FORMATS = (Format("odometry-folder", WHAT, looks_like_odometry_folder, open_odometry_folder, readings=True),)
