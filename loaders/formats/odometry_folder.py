"""Folders with aligned rows of truth, odometry and floor sensors, as the Thymio localization data has them.

`odom_pose.txt` holds x y (meters), `odom_quaternion.txt` z w, `gt.txt` x y heading (meters, radians), and
each file `sensor_NAME.txt` one reading a row. `map.png`, there or in the folder above, is the print of the
floor: one centimeter a pixel, its first axis x and its second y.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.geometry import wrap
from maurice_mcl.session import SessionInfo

from ..errors import InputError, ReadingNotes
from ..files import expect_regular, read_number_rows
from ..reading import ReadingOptions
from ..recording import Note, OdometryPose, Readings, Record, TruthPose
from .registry import Format

TRUTH, PLACES, TURNS = "gt.txt", "odom_pose.txt", "odom_quaternion.txt"
COLUMNS = {TRUTH: 3, PLACES: 2, TURNS: 2}
SENSORS, PRINT = "sensor_*.txt", "map.png"
# Rows are millimeters apart, and the errors of a movement are those of all its rows: more noise in each.
MOTION = {"model": "odometry", "turn_from_turn": 0.08, "turn_from_way": 1.0, "way_from_way": 0.16}
PERIOD_S = 1 / 3  # of the rows, which have no time
PIXEL_M = 0.01
JUMP_M, JUMP_RAD = 0.05, 0.5  # in a row, beyond what the wheels went: somebody carried the robot
AFTER = 10  # rows: one carrying is told once


@dataclass(frozen=True, eq=False)
class OdometryFolder:
    """The rows as records; times are made up, a third of a second a row."""

    path: Path
    info: SessionInfo
    odometry: F64  # (N, 3) x_m, y_m, heading_rad
    truth: F64 | None  # (N, 3)
    readings: dict[str, F64]  # (N,) by name

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield odometry, truth and readings row by row, and where the robot was carried."""
        notes.warning(f"no file holds times: {1 / PERIOD_S:g} rows a second are assumed")
        carried = set() if self.truth is None else carried_rows(self.odometry, self.truth)
        for row, odometry in enumerate(self.odometry):
            t_s = round(row * PERIOD_S, 6)
            if row in carried:
                yield Note(t_s, "kidnapped")
            yield OdometryPose(t_s, odometry)
            if self.truth is not None:
                yield TruthPose(t_s, self.truth[row])
            found = {name: float(values[row]) for name, values in self.readings.items()}
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
    """Return whether a folder holds the two files of the odometry."""
    try:
        return all((folder / name).is_file() for name in (PLACES, TURNS))
    except OSError:
        return False


def number_table(file: Path, columns: int) -> F64:
    """Read rows of numbers (N, columns). Raises InputError naming the line."""
    rows = read_number_rows(file, "a table of numbers", "a table", columns, f"{columns} finite numbers")
    return np.array(rows, np.float64).reshape(-1, columns)


def open_odometry_folder(path: Path, options: ReadingOptions | None = None) -> OdometryFolder:
    """Read the rows of a folder. InputError for a file that is missing or broken, or of another length."""
    missing = [name for name in (PLACES, TURNS) if not (path / name).is_file()]
    if missing:
        raise InputError(path, f"found no {', '.join(missing)} in it, expected {PLACES} and {TURNS}")
    tables = {name: number_table(path / name, COLUMNS[name]) for name in COLUMNS if (path / name).is_file()}
    sensors = sensor_files(path)
    tables |= {file.name: number_table(file, 1) for file in sensors.values()}
    counts = {name: len(table) for name, table in tables.items()}
    if len(set(counts.values())) != 1:
        listed = ", ".join(f"{count} in {name}" for name, count in counts.items())
        raise InputError(path, f"found rows of different number ({listed}), expected them aligned")
    if not len(tables[PLACES]):
        raise InputError(path / PLACES, "found no rows, expected a drive")
    heading = 2 * np.arctan2(tables[TURNS][:, 0], tables[TURNS][:, 1])
    odometry = np.column_stack([tables[PLACES], wrap(heading)])
    survey = path.resolve() if sensors and floor_print(path) is not None else None
    readings = {name: tables[file.name][:, 0] for name, file in sensors.items()}
    info = SessionInfo(path.resolve().name, motion=dict(MOTION), survey=survey)
    return OdometryFolder(path, info, odometry, tables.get(TRUTH), readings)


def sensor_files(folder: Path) -> dict[str, Path]:
    """Return the files of readings by the names of their sensors."""
    return {file.stem.removeprefix("sensor_"): file for file in sorted(folder.glob(SENSORS))}


def floor_print(folder: Path) -> Path | None:
    """Return the picture of the floor, in the folder or the one above it."""
    folder = folder.resolve()
    return next((one / PRINT for one in (folder, folder.parent) if (one / PRINT).is_file()), None)


def read_print(file: Path) -> F64:
    """Read the print as (rows along y, columns along x), 0 black to 1 white. Raises InputError."""
    expect_regular(file, "a picture")
    try:
        image = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_GRAYSCALE)
    except (OSError, cv2.error) as problem:
        raise InputError(file, f"cannot be read as a picture: {problem}") from None
    if image is None:
        raise InputError(file, "cannot be read as a picture, expected the print of a floor")
    return np.asarray(image.T, np.float64) / 255


WHAT = "a folder of aligned odometry, truth and floor sensors (odom_pose.txt, gt.txt, sensor_left.txt)"
FORMATS = (Format("odometry-folder", WHAT, looks_like_odometry_folder, open_odometry_folder, readings=True),)
