"""Recordings around recordings: corrected, with odometry from the truth, with fewer or gray pictures."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose, compose_motions, motion_between, rotated, wrap_angle
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.randomness import Domain, stream
from maurice_mcl.values.session import SessionInfo, is_kidnapping

from ..errors import InputError, ReadingNotes
from .jumps import jumps_of
from .observations import Gate
from .options import JUMPING, MOTIONS_ARE, Reading
from .recording import (
    LeftOut,
    Motion,
    Note,
    OdometryPose,
    Picture,
    Readings,
    Record,
    Recording,
    RecordingWrapper,
    Scan,
    TruthPose,
    checked,
    gray_picture,
)


@dataclass(frozen=True, slots=True, eq=False)
class FewerPictures(RecordingWrapper):
    """A recording of which one picture of every `stride` is there, the first among them."""

    stride: int

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records but the pictures between."""
        pictures = 0
        for record in self.measured.records(notes):
            if isinstance(record, Picture):
                pictures += 1
                if (pictures - 1) % self.stride:
                    continue
            yield record


GATE = Gate(0.25, math.radians(15))  # a moment after so much movement


@dataclass(frozen=True, slots=True, eq=False)
class Placeholders(RecordingWrapper):
    """A recording without pictures that has a gray one at its beginning and whenever the robot has moved."""

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, and gray pictures by whichever shows movement first."""
        moved = _Moved()
        for record in self.measured.records(notes):
            yield record
            if moved.enough(record):
                yield gray_picture(record.t_s)


class _Moved:
    def __init__(self) -> None:
        self._kind: type[Record] | None = None
        self._pose: F64 | None = None  # of the last record that had one
        self._way: F64 = np.zeros(3)  # since the last moment

    def enough(self, record: Record) -> bool:
        if not isinstance(record, Motion | OdometryPose | TruthPose):
            return False
        if (self._kind or type(record)) is not type(record):
            return False
        first, self._kind = self._kind is None, type(record)
        if isinstance(record, Motion):
            self._way = compose_motions(self._way, record.motion)
        else:
            if self._pose is not None:
                self._way = compose_motions(self._way, motion_between(self._pose, record.pose))
            self._pose = record.pose
        if not first and not GATE.open_after(self._way):
            return False
        self._way = np.zeros(3)
        return True


@dataclass(frozen=True, slots=True, eq=False)
class FramesOfReadings(RecordingWrapper):
    """A recording of readings without pictures: a gray one goes with every row of readings.

    Where names come in turn, not together, a row ends with the one that came first.
    """

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records, a gray picture after all of a time at which a row came."""
        names: set[str] = set()  # of the first row
        due_s = math.inf
        for record in self.measured.records(notes):
            if record.t_s > due_s:
                yield gray_picture(due_s)
                due_s = math.inf
            if isinstance(record, Readings) and record.values:
                names = names or set(record.values)
                due_s = record.t_s if names & set(record.values) else due_s
            yield record
        if due_s < math.inf:
            yield gray_picture(due_s)


def with_frames(recording: Recording) -> Recording:
    """Give a recording of readings, without pictures and scans, a gray one a row; others stay as they are."""
    readings = False
    try:
        for record in recording.records(ReadingNotes(keep_going=True)):
            if isinstance(record, Picture | Scan):
                return recording
            readings = readings or isinstance(record, Readings)
    except InputError:
        return recording  # told where the drive is read
    return FramesOfReadings(recording) if readings else recording


NEAR_ZERO_M = 1.0  # a first pose so near zero is the path since the drive began


@dataclass(frozen=True, slots=True, eq=False)
class Corrected(RecordingWrapper):
    """A recording as it should have been written; docs/formats.md explains each correction."""

    correction: Reading

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record; a note says what was corrected."""
        info, yaw_rad = self.measured.info, self.correction.camera_yaw_rad
        info = replace(
            info, notes=(*info.notes, f"corrected in reading: {' '.join(self.correction.corrections)}")
        )
        start = None if info.start is None else self._at_wheels(info.start) + np.array([0.0, 0.0, yaw_rad])
        cameras = tuple(replace(camera, yaw_rad=0.0) for camera in info.cameras) if yaw_rad else info.cameras
        return replace(info, cameras=cameras, start=start)

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the records put right, in time order; the recording is read once for every clock."""
        clocks = [
            self._on_clock(kinds, offset_s, ReadingNotes(keep_going=True) if number else notes)
            for number, (offset_s, kinds) in enumerate(_clocks(self.correction))
        ]
        wheels = _Wheels(self.correction, self.path)
        jumps = jumps_of(self.measured, self.correction)
        number = 0  # of records of odometry so far
        for record in heapq.merge(*clocks, key=lambda record: record.t_s):
            if isinstance(record, Motion):
                motion = np.zeros(3) if number in jumps else record.motion
                number += 1
                yield replace(record, motion=wheels.motion(motion))
            elif isinstance(record, OdometryPose):
                yield OdometryPose(record.t_s, wheels.pose(record.pose, is_jump=number in jumps))
                number += 1
            elif isinstance(record, TruthPose):
                yield TruthPose(record.t_s, self._truth(record.pose))
            elif isinstance(record, Scan):
                yield replace(record, scan=self._scan(record.scan))
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

    def _scan(self, scan: LaserScan) -> LaserScan:
        """Return a scan of the laser as it is mounted, seen with the camera's forward."""
        mount = scan.mount + np.array([0.0, 0.0, self.correction.scan_yaw_rad])
        return turned(replace(scan, mount=mount), -self.correction.camera_yaw_rad)

    def _truth(self, pose: F64) -> F64:
        c = self.correction
        right = self._at_wheels(pose * [c.truth_scale, c.truth_scale, c.truth_turn_scale])
        if c.camera_yaw_rad:
            right[2] = wrap_angle(float(right[2]) + c.camera_yaw_rad)
        return right

    def _at_wheels(self, pose: F64) -> F64:
        """Return the pose (3,) of the wheels' center from that of the place on the robot that truth is of."""
        moved = rotated(self.correction.truth_ahead_m, self.correction.truth_left_m, float(pose[2]))
        return np.asarray(pose - np.array([*moved, 0.0]))


def corrected(recording: Recording, correction: Reading) -> Recording:
    """Put a recording right; the recording itself where there is nothing to do."""
    if not correction.corrections:
        return recording
    if correction.odometry_are not in (None, *MOTIONS_ARE):
        expected = f"expected one of {', '.join(MOTIONS_ARE)}"
        text = f"found --reading odometry_are={correction.odometry_are}, {expected}"
        raise InputError(recording.path, text)
    return Corrected(recording, correction)


def turned(scan: LaserScan, angle_rad: float) -> LaserScan:
    """Return a scan as a robot sees it whose forward is turned by the opposite angle."""
    return replace(scan, mount=compose(np.array([0.0, 0.0, angle_rad]), scan.mount))


def _clocks(correction: Reading) -> list[tuple[float, tuple[type[Record], ...]]]:
    """Return each time offset and the kinds of records that it applies to; pictures last, after the poses."""
    c = correction
    offsets: dict[type[Record], float] = {
        Motion: c.odometry_offset_s,
        OdometryPose: c.odometry_offset_s,
        TruthPose: c.truth_offset_s,
        Note: 0.0,
        Readings: c.picture_offset_s,
        Scan: c.picture_offset_s,
        LeftOut: c.picture_offset_s,
        Picture: c.picture_offset_s,
    }
    groups: dict[float, list[type[Record]]] = {}
    for kind, offset_s in offsets.items():
        groups.setdefault(offset_s, []).append(kind)
    ordered = sorted(groups.items(), key=lambda group: Picture in group[1])
    return [(offset_s, tuple(kinds)) for offset_s, kinds in ordered]


class _Wheels:
    def __init__(self, correction: Reading, path: Path) -> None:
        scale = correction.odometry_scale
        self._are, self._gain, self._path = correction.odometry_are, correction.turn_gain, path
        self._units: F64 = np.array([scale, scale, correction.turn_scale])
        self._ahead_rad = correction.odometry_forward_rad + correction.camera_yaw_rad
        self._before: F64 | None = None  # the pose (3,) before, of those that are read
        self._at: F64 = np.zeros(3)  # the pose (3,) before, of those that are given
        self._counted_on = False  # whether any heading was beyond half a turn
        self._heading_rad = 0.0  # by the steps so far

    def motion(self, values: F64) -> F64:
        forward, left, turn = (float(v) for v in self._as_motion(values * self._units))
        forward, left = rotated(forward, left, -self._ahead_rad)
        return np.array([forward, left, turn * self._gain])

    def pose(self, values: F64, *, is_jump: bool = False) -> F64:
        if self._are == "steps":
            fault = "found odometry that is poses, and --reading odometry_are=steps is for motions"
            raise InputError(self._path, f"{fault}; leave it out")
        pose: F64 = values * self._units + [0.0, 0.0, self._ahead_rad]
        if self._gain == 1 and self._are != JUMPING:
            return pose
        before, self._before = self._before, pose
        if before is None:
            self._at = pose
        elif not is_jump:
            self._at = compose(self._at, motion_between(before, pose) * [1.0, 1.0, self._gain])
        return self._at

    def _as_motion(self, values: F64) -> F64:
        if self._are == "poses":
            before, self._before = self._before, values
            if before is None:  # counted from where the drive began, unless counting began long before
                before = np.zeros(3) if math.hypot(values[0], values[1]) < NEAR_ZERO_M else values
            return self._between(before, values)
        if self._are == "steps":
            heading_rad, turn = self._heading_rad, float(values[2])
            self._heading_rad += turn
            return np.array([*rotated(float(values[0]), float(values[1]), -heading_rad), turn])
        return values

    def _between(self, before: F64, after: F64) -> F64:
        """Return the motion (3,) between poses (3,); headings beyond half a turn give the turn as counted."""
        motion, turn = motion_between(before, after), float(after[2] - before[2])
        self._counted_on |= max(abs(float(before[2])), abs(float(after[2]))) > math.pi
        counted = self._counted_on and abs(turn) < 1.5 * math.pi  # not so where they begin anew at a turn
        return np.array([motion[0], motion[1], turn]) if counted else motion


# Odometry for drives that come without: made from the steps between known poses, plus stated noise.


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """How the odometry is spoiled, so that it is not the truth itself; a plain wheeled robot's numbers."""

    way_share: float = 0.05  # sd of a straight's length, as a share of it
    turn_share: float = 0.05  # sd of a turn, as a share of it
    drift_rad_per_m: float = 0.05  # sd of the heading gained on a straight, radians a meter

    def __str__(self) -> str:
        way, turn = f"{self.way_share:g} of a way", f"{self.turn_share:g} of a turn"
        return f"with noise of {way}, {turn} and {self.drift_rad_per_m:g} rad a metre of way"


NAMED = "odometry made from the truth"  # in the session's name: every table and picture says it
MOVEMENT_M, MOVEMENT_RAD = 0.5, math.pi / 4  # errors stay the same over so much, as over a movement


@dataclass(frozen=True, slots=True, eq=False)
class MadeOdometry(RecordingWrapper):
    """A recording with an odometry pose beside every true pose, in a frame of the odometry's own."""

    seed: int
    noise: OdometryNoise = field(default_factory=OdometryNoise)

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record; name and notes say where the odometry is from.

        The robot's own motion constants, such as a gain of its turns, are not those of this odometry.
        """
        info = self.measured.info
        return replace(info, name=f"{info.name} ({NAMED})", notes=(*info.notes, self.statement), motion=None)

    @property
    def statement(self) -> str:
        """What everybody has to know who sees a result."""
        return (
            f"ODOMETRY IS NOT MEASURED but made from the truth, {self.noise} "
            f"(standard deviations, drawn once a movement of {MOVEMENT_M:g} m or "
            f"{math.degrees(MOVEMENT_RAD):g} degrees), seed {self.seed}"
        )

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Yield the recording's records; odometry comes before the true pose of the same time."""
        notes.warning(self.statement)
        wheels = _NoisyWheels(self.noise, self.seed)
        for record in checked(self.measured, notes):
            if isinstance(record, TruthPose):
                yield OdometryPose(record.t_s, wheels.go_to(record.pose))
            elif isinstance(record, Note) and is_kidnapping(record.text):
                wheels.carried()
            yield record


def odometry_from_truth(recording: Recording, seed: int) -> MadeOdometry:
    """Add odometry to a recording. Raises InputError if it has odometry of its own, or no truth."""
    notes, truths = ReadingNotes(keep_going=True), 0
    for record in checked(recording, notes):
        if isinstance(record, OdometryPose | Motion):
            fault = "found odometry that was measured, so none is made from the truth"
            raise InputError(recording.path, f"{fault}; leave odometry_from_truth out")
        truths += isinstance(record, TruthPose)
    if not truths:
        remarks = [text for text in notes.warnings if "truth" in text]
        why = f" ({remarks[0]})" if remarks else ""
        raise InputError(recording.path, f"found no truth{why}, and odometry_from_truth needs true poses")
    return MadeOdometry(recording, seed)


class _NoisyWheels:
    def __init__(self, noise: OdometryNoise, seed: int) -> None:
        self._noise, self._seed = noise, seed
        self._at: F64 | None = None  # the true pose
        self._pose: F64 = np.zeros(3)  # by the wheels
        self._movement, self._gone_m, self._turned_rad = 0, 0.0, 0.0
        self._errors = self._drawn()

    def go_to(self, truth: F64) -> F64:
        if self._at is not None:
            self._pose = compose(self._pose, self._measured(motion_between(self._at, truth)))
        self._at = truth
        return self._pose

    def carried(self) -> None:
        """Forget where the robot was: wheels do not see how it comes to the next true pose."""
        self._at = None

    def _measured(self, motion: F64) -> F64:
        forward, left, turn = (float(v) for v in motion)
        length_m = math.hypot(forward, left)
        length, drift, share = (float(v) for v in self._errors)
        along = 1 + self._noise.way_share * length
        turned = turn * (1 + self._noise.turn_share * share) + self._noise.drift_rad_per_m * length_m * drift
        self._gone_m, self._turned_rad = self._gone_m + length_m, self._turned_rad + abs(turn)
        if self._gone_m >= MOVEMENT_M or self._turned_rad >= MOVEMENT_RAD:
            self._movement, self._gone_m, self._turned_rad = self._movement + 1, 0.0, 0.0
            self._errors = self._drawn()
        return np.array([forward * along, left * along, turned])

    def _drawn(self) -> F64:
        return stream(Domain.IMPORT, self._seed, self._movement).standard_normal(3)
