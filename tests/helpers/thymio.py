"""Recorded wheel odometry beside motion capture, where the machine has it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from maurice_mcl.values.arrays import F64

THYMIO = Path(os.environ.get("MAURICE_DATA", Path(__file__).parents[3] / "shared" / "data")) / "thymio"


class AlignedDrive(NamedTuple):
    """Odometry and truth (n, 3), row by row; headings are not wrapped."""

    odometry: F64
    truth: F64


def read_aligned(folder: Path) -> AlignedDrive:
    """Read the tables of one drive: true x y heading, odometry's x y, and z w of its heading."""
    names = ("gt.txt", "odom_pose.txt", "odom_quaternion.txt")
    truth, places, turns = (np.loadtxt(folder / name) for name in names)
    heading = np.unwrap(2 * np.arctan2(turns[:, 0], turns[:, 1]))
    truth[:, 2] = np.unwrap(truth[:, 2])
    return AlignedDrive(np.column_stack([places, heading]), truth)
