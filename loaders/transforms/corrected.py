"""Corrections of a recording while it is read: units, signs, frames, clocks."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from maurice_mcl.arrays import F64
from maurice_mcl.geometry import compose, motion_between, wrap_angle
from maurice_mcl.session import SessionInfo

from ..errors import InputError, ReadingNotes
from ..reading import MOTIONS_ARE, ReadingOptions
from ..recording import Motion, Note, OdometryPose, Picture, Record, Recording, RecordingWrapper, TruthPose

# A recording with what is wrong in it put right while it is read: units, signs, frames, clocks.

NEAR_M = 1.0  # a first pose so near zero is the path since the drive began


@dataclass(frozen=True, slots=True, eq=False)
class Corrected(RecordingWrapper):
    """A recording as it should have been written; docs/formats.md explains each correction."""

    correction: ReadingOptions

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record; a note says what was corrected."""
        info, yaw_rad = self.measured.info, self.correction.camera_yaw_rad
        info = replace(
            info, notes=(*info.notes, f"corrected in reading: {' '.join(self.correction.corrections)}")
        )
        if not yaw_rad:
            return info
        cameras = tuple(replace(camera, yaw_rad=0.0) for camera in info.cameras)
        start = None if info.start is None else info.start + np.array([0.0, 0.0, yaw_rad])
        return replace(info, cameras=cameras, start=start)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the records put right, in time order.

        The recording is read once for every clock, so that no more is held than without offsets.
        """
        clocks = [
            self._on_clock(kinds, offset_s, ReadingNotes(keep_going=True) if number else notes)
            for number, (offset_s, kinds) in enumerate(_clocks(self.correction))
        ]
        wheels = _Wheels(self.correction, self.path)
        for record in heapq.merge(*clocks, key=lambda record: record.t_s):
            if isinstance(record, Motion):
                yield Motion(record.t_s, wheels.motion(record.motion))
            elif isinstance(record, OdometryPose):
                yield OdometryPose(record.t_s, wheels.pose(record.pose))
            elif isinstance(record, TruthPose):
                yield TruthPose(record.t_s, self._truth(record.pose))
            else:
                yield record

    def _on_clock(
        self, kinds: tuple[type[Record], ...], offset_s: float, notes: ReadingNotes
    ) -> Iterator[Record]:
        for record in self.measured.records(notes):
            if isinstance(record, kinds):
                yield record if self._one_clock else replace(record, t_s=round(record.t_s + offset_s, 6))

    @property
    def _one_clock(self) -> bool:
        """Whether no time is moved; else all are rounded, so that what comes at one time still does."""
        c = self.correction
        return not (c.picture_offset_s or c.odometry_offset_s or c.truth_offset_s)

    def _truth(self, pose: F64) -> F64:
        c = self.correction
        right: F64 = pose * [c.truth_scale, c.truth_scale, c.truth_turn_scale]
        if c.camera_yaw_rad:
            right[2] = wrap_angle(float(right[2]) + c.camera_yaw_rad)
        return right


def corrected(recording: Recording, correction: ReadingOptions) -> Recording:
    """Put a recording right; the recording itself where there is nothing to do."""
    if not correction.corrections:
        return recording
    if correction.odometry_are not in (None, *MOTIONS_ARE):
        expected = f"expected one of {', '.join(MOTIONS_ARE)}"
        raise InputError(
            recording.path, f"found --reading odometry_are={correction.odometry_are}, {expected}"
        )
    return Corrected(recording, correction)


def _clocks(correction: ReadingOptions) -> list[tuple[float, tuple[type[Record], ...]]]:
    """Return the kinds of records that are moved in time alike; what comes with pictures is last.

    So at the same time poses come before pictures, as in every format.
    """
    c = correction
    offsets: dict[type[Record], float] = {
        Motion: c.odometry_offset_s,
        OdometryPose: c.odometry_offset_s,
        TruthPose: c.truth_offset_s,
        Note: 0.0,
        Picture: c.picture_offset_s,
    }
    groups: dict[float, list[type[Record]]] = {}
    for kind, offset_s in offsets.items():
        groups.setdefault(offset_s, []).append(kind)
    ordered = sorted(groups.items(), key=lambda group: Picture in group[1])
    return [(offset_s, tuple(kinds)) for offset_s, kinds in ordered]


class _Wheels:
    """The odometry put right, from its first record on."""

    def __init__(self, correction: ReadingOptions, path: Path) -> None:
        scale = correction.odometry_scale
        self._are, self._gain, self._path = correction.odometry_are, correction.turn_gain, path
        self._units: F64 = np.array([scale, scale, correction.turn_scale])
        self._ahead_rad = correction.odometry_forward_rad + correction.camera_yaw_rad
        self._before: F64 | None = None  # the pose (3,) before, of those that are read
        self._at: F64 = np.zeros(3)  # the pose (3,) before, of those that are given
        self._counted_on = False  # whether any heading was beyond half a turn
        self._heading_rad = 0.0  # by the steps so far

    def motion(self, values: F64) -> F64:
        """Return the robot's motion (3,) of what was written in its place (3,)."""
        forward, left, turn = (float(v) for v in self._as_motion(values * self._units))
        forward, left = _turned(forward, left, -self._ahead_rad)
        return np.array([forward, left, turn * self._gain])

    def pose(self, values: F64) -> F64:
        """Return the odometry's pose (3,) of what was written (3,)."""
        if self._are == "steps":
            found = "found odometry that is poses, and --reading odometry_are=steps is for motions"
            raise InputError(self._path, f"{found}; leave it out")
        pose: F64 = values * self._units + [0.0, 0.0, self._ahead_rad]
        if self._gain == 1:
            return pose
        before, self._before = self._before, pose
        if before is None:
            self._at = pose
        else:
            self._at = compose(self._at, motion_between(before, pose) * [1.0, 1.0, self._gain])
        return self._at

    def _as_motion(self, values: F64) -> F64:
        if self._are == "poses":
            before, self._before = self._before, values
            if before is None:  # counted from where the drive began, unless counting began long before
                before = np.zeros(3) if math.hypot(values[0], values[1]) < NEAR_M else values
            return self._between(before, values)
        if self._are == "steps":
            heading_rad, turn = self._heading_rad, float(values[2])
            self._heading_rad += turn
            return np.array([*_turned(float(values[0]), float(values[1]), -heading_rad), turn])
        return values

    def _between(self, before: F64, after: F64) -> F64:
        """Return the motion (3,) between poses (3,); headings beyond half a turn give the turn as counted."""
        motion, turn = motion_between(before, after), float(after[2] - before[2])
        self._counted_on |= max(abs(float(before[2])), abs(float(after[2]))) > math.pi
        counted = self._counted_on and abs(turn) < 1.5 * math.pi  # not so where they begin anew at a turn
        return np.array([motion[0], motion[1], turn]) if counted else motion


def _turned(x: float, y: float, angle_rad: float) -> tuple[float, float]:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return x * cos - y * sin, x * sin + y * cos
