"""A folder of odometry beside motion-capture truth, as text files with one row per sample.

`gt.txt` holds the true x y theta (m, m, rad), `odom_pose.txt` the x y of the robot's own odometry and
`odom_quaternion.txt` the z w of its heading, in a frame of its own; rows belong together. The robot never
stops to be measured, so the drive is cut into movements where it changes between turning and going.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maurice_mcl.arrays import F64, Bool
from maurice_mcl.calibration.motion import Straights, Trials, Turns

from ..errors import InputError
from ..io.fields import MOST, show, up_to
from ..io.files import expect_regular

FILES = {"gt.txt": 3, "odom_pose.txt": 2, "odom_quaternion.txt": 2}


@dataclass(frozen=True, slots=True)
class Cutting:
    """How a drive is cut into movements; all ours."""

    turning_m: float = 0.05  # turning: heading change times this (half a track) exceeds the distance
    still_m: float = 0.0005  # a row in which neither goes further than this is standing
    least_rad: float = float(np.radians(10))  # a smaller turn is left out, a straight that bends more as well
    least_m: float = 0.05  # shorter straights are left out
    jump: float = 3.0  # truth that goes this many times as far as the wheels, in a row or altogether ...
    noise_rad: float = 0.1  # ... is not believed; but truth may be noisy by this in a row


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


def trials_from_folder(folder: Path, cutting: Cutting | None = None) -> Trials:
    """Read a drive and cut it into turns and straights."""
    return cut(read_aligned(folder), cutting or Cutting())


STANDING, TURNING, FORWARD, BACKWARD = range(4)


def cut(drive: AlignedDrive, cutting: Cutting) -> Trials:
    """Cut a drive where it changes between turning and going straight, and between forward and backward.

    A straight's length is that between its ends, and its drift is what the heading really changed less what
    the odometry saw of it. Movements in which the truth jumps (capture lost, or the robot carried) are left
    out, and counted with those that are too small, and with arcs.
    """
    kinds, jumped = _kinds(drive.odometry, cutting), jumps(drive, cutting)
    edges = np.flatnonzero(np.diff(kinds)) + 1
    turns, ways, left_out = [], [], 0
    for first, last in zip([0, *edges], [*edges, len(kinds)], strict=True):  # steps first to last - 1
        moved, went = (rows[last] - rows[first] for rows in (drive.odometry, drive.truth))
        kind = kinds[first]
        if kind == STANDING:
            continue
        if jumped[first:last].any() or not _believed(moved, went, kind == TURNING, cutting):
            left_out += 1
        elif kind == TURNING:
            turns.append((moved[2], went[2]))
        else:
            ways.append((np.hypot(*moved[:2]), np.hypot(*went[:2]), went[2] - moved[2]))
    measured, actual = np.array(turns, np.float64).reshape(-1, 2).T
    way_m, went_m, drift_rad = np.array(ways, np.float64).reshape(-1, 3).T
    straights = Straights(way_m, went_m, drift_rad, ("",) * len(ways))
    return Trials(Turns(measured, actual), straights, left_out)


def _believed(moved: F64, went: F64, turning: bool, cutting: Cutting) -> bool:
    """Return whether a movement, by odometry and by truth (3,), is large enough, and the truth no jump."""
    if turning:
        return bool(cutting.least_rad <= abs(moved[2]) and abs(went[2]) < cutting.jump * abs(moved[2]))
    way, really = (float(np.hypot(*step[:2])) for step in (moved, went))
    return bool(abs(moved[2]) <= cutting.least_rad and cutting.least_m <= way and really < cutting.jump * way)


def _kinds(odometry: F64, cutting: Cutting) -> NDArray[np.int64]:
    """Return for every step (n - 1,) what the robot does: STANDING, TURNING, FORWARD or BACKWARD."""
    steps = np.diff(odometry, axis=0)
    way, arc = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2]) * cutting.turning_m
    ahead = steps[:, 0] * np.cos(odometry[:-1, 2]) + steps[:, 1] * np.sin(odometry[:-1, 2])
    going = np.where(arc > way, TURNING, np.where(ahead >= 0, FORWARD, BACKWARD))
    return np.where(np.maximum(way, arc) < cutting.still_m, STANDING, going).astype(np.int64)


def jumps(drive: AlignedDrive, cutting: Cutting) -> Bool:
    """Return the steps (n - 1,) in which the truth goes or turns further than the wheels ever could."""
    wheels, truth = (np.abs(np.diff(rows, axis=0)) for rows in (drive.odometry, drive.truth))
    most_m = cutting.jump * float(np.hypot(wheels[:, 0], wheels[:, 1]).max())
    most_rad = max(cutting.jump * float(wheels[:, 2].max()), cutting.noise_rad)
    return np.asarray((np.hypot(truth[:, 0], truth[:, 1]) > most_m) | (truth[:, 2] > most_rad))


def _table(file: Path, columns: int) -> F64:
    expect_regular(file, "a table of numbers")
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(file, f"cannot be read as a table: {problem}") from None
    used = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    return np.array([_values(file, n, line, columns) for n, line in used], np.float64).reshape(-1, columns)


def _values(file: Path, number: int, line: str, columns: int) -> list[float]:
    try:
        values = [float(word) for word in line.split()]
    except ValueError:
        values = []
    if len(values) != columns or not np.isfinite(values).all():
        raise InputError(file, f"found {show(line.strip())}, expected {columns} finite numbers", number)
    if max(map(abs, values)) > MOST:
        raise InputError(file, f"found {show(line.strip())}, expected each {up_to()}", number)
    return values
