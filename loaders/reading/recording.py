"""A recorded drive as a stream of records in time order: what every format is read into.

Meters, radians, seconds; x forward, y left, headings counter-clockwise (docs/session-log.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np

from maurice_mcl.values import F64, NO_PICTURE, U8, LaserScan, SessionInfo, wrap_angle

from ..errors import InputError, ReadingNotes
from ..files.text import MOST, MOST_T_S, show_time, up_to


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A picture, not decoded before somebody asks."""

    t_s: float
    read: Callable[[], U8]  # decodes to (H, W, 3) RGB, top row first; raises PictureError
    name: str  # where it can be found again
    line: int | None = None  # of the file that lists it
    path: str | None = None  # relative to that file, where it is named there
    camera: str | None = None  # that took it
    covered: bool = False  # taken with the lens covered
    pose: F64 | None = None  # (3,) x_m, y_m, heading_rad as surveyed
    encoded: Callable[[], bytes] | None = None  # returns its file, if it comes as one; raises PictureError


PLACEHOLDER = "no picture"


def gray_picture(t_s: float) -> Picture:
    """Return a gray picture that stands where there is none."""
    return Picture(t_s, lambda: NO_PICTURE, PLACEHOLDER)


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """A picture that is no part of the drive: taken with the lens covered, or by another camera."""

    t_s: float
    picture: Picture


@dataclass(frozen=True, slots=True, eq=False)
class OdometryPose:
    """The robot's pose by its odometry, in the frame of that odometry."""

    t_s: float
    pose: F64  # (3,) x_m, y_m, heading_rad


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A movement since the last odometry record, as the robot measured it."""

    t_s: float
    motion: F64  # (3,) forward_m, left_m, turn_rad, in the robot's frame at its start
    encoders_m: F64 | None = None  # (4,) of wheels: front left, front right, rear left, rear right


@dataclass(frozen=True, slots=True, eq=False)
class TruthPose:
    """Where the robot really was, in the map's frame."""

    t_s: float
    pose: F64  # (3,) x_m, y_m, heading_rad


@dataclass(frozen=True, slots=True)
class Note:
    """What happened, in free text; an event of the session log."""

    t_s: float
    text: str


@dataclass(frozen=True, slots=True)
class Readings:
    """What sensors other than cameras measured: numbers by name, in whatever unit they have."""

    t_s: float
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """A scan of a planar laser."""

    t_s: float
    scan: LaserScan


Record = Picture | LeftOut | OdometryPose | Motion | TruthPose | Note | Readings | Scan


class Recording(Protocol):
    """A recorded drive that can be read again from its beginning as often as one likes."""

    @property
    def path(self) -> Path:
        """The file or folder."""

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record."""

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Read lazily from the beginning, in time order; broken parts go to `notes`. InputError."""


def camera_named(path: Path, known: Sequence[str], wanted: str | None, line: int | None = None) -> str | None:
    """Return the camera to read: as wanted, else the first. InputError for one that is not there."""
    if wanted is not None and wanted not in known:
        names = ", ".join(known) or "none"
        raise InputError(path, f"found cameras {names}, expected {wanted!r} among them", line)
    return wanted or next(iter(known), None)


def checked(recording: Recording, notes: ReadingNotes) -> Iterator[Record]:
    """Yield a recording's records; times that fall and numbers that no log may hold go to `notes`."""
    last_t_s = -math.inf
    for record in recording.records(notes):
        fault = _fault(record, last_t_s)
        if fault:
            what = type(record).__name__
            notes.problem(InputError(recording.path, f"{what} at t {show_time(record.t_s)}: {fault}"))
            continue
        last_t_s = record.t_s
        yield record


def interpolated(before: OdometryPose | TruthPose, after: OdometryPose | TruthPose, t_s: float) -> F64:
    """Return the pose (3,) at a time between two poses, the heading through the smaller angle."""
    step = after.pose - before.pose
    step[2] = wrap_angle(float(step[2]))
    share = (t_s - before.t_s) / (after.t_s - before.t_s) if after.t_s > before.t_s else 0.0
    pose: F64 = before.pose + step * share
    pose[2] = wrap_angle(float(pose[2]))
    return pose


def _fault(record: Record, last_t_s: float) -> str:
    if not abs(record.t_s) <= MOST_T_S:
        return f"expected a finite time, {up_to(MOST_T_S)}"
    if record.t_s < last_t_s:
        return f"after t {show_time(last_t_s)}, expected time not to fall"
    if isinstance(record, Scan):
        return scan_fault(record.scan)
    if isinstance(record, Readings):
        wrong = [name for name, value in record.values.items() if not abs(value) <= MOST]
        return f"found {wrong[0]} {record.values[wrong[0]]}, expected {up_to()}" if wrong else ""
    values = getattr(record, "pose", None) if not isinstance(record, Motion) else record.motion
    if values is not None and not _are_three(values):
        return f"found {values}, expected three finite numbers, each {up_to()}"
    return ""


def _are_three(values: F64) -> bool:
    """Return whether values are three finite numbers of sensible size; most of a long log's time is here."""
    if np.shape(values) != (3,):
        return False
    x, y, heading = values.tolist()
    return bool(abs(x) <= MOST and abs(y) <= MOST and abs(heading) <= MOST)


MOST_BEAMS = 20_000  # of a scan; planar lasers have some thousand


def scan_fault(scan: LaserScan) -> str:
    """Return what no scan may be, in one line; "" for a scan that may."""
    if not 1 <= scan.size <= MOST_BEAMS:
        return f"found {scan.size} beams, expected 1 to {MOST_BEAMS}"
    if not (abs(scan.start_rad) <= 2 * math.pi and 0 < abs(scan.step_rad) <= 2 * math.pi):
        angles = f"beams from {scan.start_rad:g} rad in steps of {scan.step_rad:g} rad"
        return f"found {angles}, expected angles of at most a whole turn, and steps other than 0"
    if not 0 <= scan.min_m < scan.max_m <= MOST:
        return f"found ranges from {scan.min_m:g} to {scan.max_m:g} m, expected the least first, {up_to()}"
    if not _are_three(scan.mount):
        return f"found mount {scan.mount}, expected three finite numbers, each {up_to()}"
    return ""


@dataclass(frozen=True, slots=True, eq=False)
class RecordingWrapper:
    """A recording around another one, with its path and info; subclasses define `records`."""

    measured: Recording

    @property
    def path(self) -> Path:
        """The file or folder."""
        return self.measured.path

    @property
    def stated(self) -> tuple[str, ...]:
        """The notes that the file itself holds, which are no remarks about reading it."""
        return tuple(getattr(self.measured, "stated", ()))

    @property
    def pictureless(self) -> bool:
        """Whether it is known before reading that there are no pictures."""
        return bool(getattr(self.measured, "pictureless", False))

    @property
    def not_read(self) -> str:
        """What the recording holds that is not read, in one line; "" for all that is known."""
        return str(getattr(self.measured, "not_read", ""))

    @property
    def info(self) -> SessionInfo:
        """What is known before the first record."""
        return self.measured.info


@dataclass(slots=True)
class SimplifiedPath:
    """A path of at most `most` poses and the last one: of a longer one every second, fourth, ... pose."""

    most: int
    _kept: list[F64] = field(default_factory=list)
    _last: F64 | None = None
    _stride: int = 1
    _seen: int = 0

    def add(self, pose: F64) -> None:
        """Take in the next pose (3,)."""
        if self._seen % self._stride == 0:
            self._kept.append(pose)
            if len(self._kept) > self.most:
                self._kept, self._stride = self._kept[::2], 2 * self._stride
        self._seen += 1
        self._last = pose

    def poses(self) -> F64:
        """Return what is kept, and the last pose: (N, 3)."""
        poses = self._kept
        if self._last is not None and poses[-1] is not self._last:
            poses = [*poses, self._last]
        return np.array(poses, np.float64).reshape(-1, 3)
