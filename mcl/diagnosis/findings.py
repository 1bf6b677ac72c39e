"""What people get wrong in a recording: what was recorded as plain arrays, and what a diagnosis says of it.

Nothing here reads files. `diagnosis_truth` compares odometry with truth, `diagnosis_plausible` asks whether
numbers can be what they are called, and `diagnosis_pictures` asks a library.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import F64, I32

DEGREE = float(np.pi / 180)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong, why it is believed, and what mends it."""

    code: str  # a word for machines, see docs/doctor.md
    what: str  # one sentence
    evidence: str  # the numbers that speak for it
    mend: str  # in words, for what wrote the log, or what else can be done
    numbers: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, float | str] = field(default_factory=dict)  # of reading, by field, that mend it


@dataclass(frozen=True, slots=True, eq=False)
class RecordedOdometry:
    """Odometry as it was recorded, K records in order."""

    t_s: F64  # (K,)
    values: F64  # (K, 3): motions (forward, left, turn), or poses in a frame of the odometry's own
    poses: bool  # whether the values are poses

    @property
    def size(self) -> int:
        """The number of records K."""
        return len(self.t_s)

    def slowed(self, factor: float) -> RecordedOdometry:
        """Return the same with all times multiplied."""
        return RecordedOdometry(self.t_s * factor, self.values, self.poses)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTruth:
    """Truth as it was recorded, T poses in order."""

    t_s: F64  # (T,)
    poses: F64  # (T, 3)
    part: I32  # (T,) counts up at every kidnapping: truth is not joined across it

    @property
    def size(self) -> int:
        """The number of poses T."""
        return len(self.t_s)

    def slowed(self, factor: float) -> RecordedTruth:
        """Return the same with all times multiplied."""
        return RecordedTruth(self.t_s * factor, self.poses, self.part)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDrive:
    """All of a recording but its pictures' content."""

    odometry: RecordedOdometry
    truth: RecordedTruth
    picture_t_s: F64  # (P,)
    size_m: float = float("inf")  # the longer side of the map; infinite without one
    turn_gain: float = 1.0  # actual over measured, as the header has it

    def slowed(self, factor: float) -> RecordedDrive:
        """Return the same with all times multiplied."""
        return RecordedDrive(
            self.odometry.slowed(factor),
            self.truth.slowed(factor),
            self.picture_t_s * factor,
            self.size_m,
            self.turn_gain,
        )


def in_radians(drive: RecordedDrive) -> RecordedDrive:
    """Return a drive whose odometry turns in degrees as one that turns in radians."""
    odometry = drive.odometry
    return replace(drive, odometry=replace(odometry, values=odometry.values * [1, 1, DEGREE]))


def motions_of(odometry: RecordedOdometry, turn: float = 1.0) -> F64:
    """Return motions (K, 3), the first of poses being none; `turn` is what every angle is multiplied by."""
    values = odometry.values * [1, 1, turn]
    return motions_between(values) if odometry.poses else values


def motions_between(poses: F64) -> F64:
    """Return the motion (K, 3) that leads to each of K poses from the one before it; nothing to the first."""
    step = np.diff(poses, axis=0, prepend=poses[:1])
    before = np.concatenate([poses[:1, 2], poses[:-1, 2]])
    ahead, aside = rotated(step[:, 0], step[:, 1], -before)
    return np.column_stack([ahead, aside, short_way(step[:, 2])])


def joined(motions: F64) -> F64:
    """Return the poses (K, 3) that K motions lead to, from zero on; headings are counted on."""
    heading = np.cumsum(motions[:, 2])
    x, y = rotated(motions[:, 0], motions[:, 1], heading - motions[:, 2])
    return np.column_stack([np.cumsum(x), np.cumsum(y), heading])


def rotated(x: F64, y: F64, angle_rad: F64 | float) -> tuple[F64, F64]:
    """Turn vectors counter-clockwise."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return x * cos - y * sin, x * sin + y * cos


def short_way(angle_rad: F64) -> F64:
    """Bring angles into [-pi, pi)."""
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi)
