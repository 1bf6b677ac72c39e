"""What an examination looks at, a recording as plain arrays, and its findings as codes and numbers.

Nothing here reads files, and nothing is put into words: `maurice_viz.text.findings` does that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from maurice_mcl.values import F64, I32, LaserScan, motions_between

DEGREE = float(np.pi / 180)
Value = float | str


@dataclass(frozen=True, slots=True)
class Evidence:
    """One observation that supports a finding."""

    kind: str  # a key of maurice_viz.text.findings.EVIDENCE
    values: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong, why it is believed, and the reading options that fix it."""

    code: str  # see docs/doctor.md
    evidence: tuple[Evidence, ...]
    numbers: Mapping[str, float] = field(default_factory=dict)
    options: Mapping[str, Value] = field(default_factory=dict)  # of reading, by field, that fix it
    details: Mapping[str, Value] = field(default_factory=dict)  # what a description needs besides the numbers


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


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDrive:
    """A recording without the content of its pictures."""

    odometry: RecordedOdometry
    truth: RecordedTruth
    picture_t_s: F64  # (P,) of scans where nothing else was seen
    size_m: float = float("inf")  # the longer side of the map; infinite without one
    turn_gain: float = 1.0  # actual over measured, as the header has it
    sees: str = "pictures"  # or "scans"

    @property
    def begin_s(self) -> float:
        """The first time of all."""
        times = (self.odometry.t_s, self.truth.t_s, self.picture_t_s)
        return min((float(t_s[0]) for t_s in times if len(t_s)), default=0.0)

    def slowed(self, factor: float) -> RecordedDrive:
        """Return the same with all times multiplied."""
        odometry = replace(self.odometry, t_s=self.odometry.t_s * factor)
        truth = replace(self.truth, t_s=self.truth.t_s * factor)
        return replace(self, odometry=odometry, truth=truth, picture_t_s=self.picture_t_s * factor)


BEAMS, MOST_SCANS = 180, 20_000  # that are kept: of one scan, and of a recording


@dataclass(frozen=True, slots=True, eq=False)
class RecordedScans:
    """Scans as they were recorded, thinned to `BEAMS` beams, in order."""

    t_s: F64  # (S,)
    scans: tuple[LaserScan, ...]

    @property
    def size(self) -> int:
        """The number of scans S."""
        return len(self.scans)


def thinned(scan: LaserScan) -> LaserScan:
    """Keep every n-th beam."""
    stride = -(-scan.size // BEAMS)
    return replace(scan, ranges_m=scan.ranges_m[::stride].copy(), step_rad=scan.step_rad * stride)


def motions_of(odometry: RecordedOdometry, turn: float = 1.0) -> F64:
    """Return motions (K, 3), zero for a first pose; every angle is multiplied by `turn`."""
    values = odometry.values * [1, 1, turn]
    return motions_between(values) if odometry.poses else values


# Findings about odometry and camera that several checks share.

TURNS = {"": 1.0, "clockwise": -1.0, "degrees": DEGREE, "clockwise degrees": -DEGREE}  # reading to factor
UNITS = {0.001: "millimeters", 0.01: "centimeters", 0.0254: "inches", 0.3048: "feet", 1000.0: "kilometers"}
LEAST_FORWARD = np.radians(1)  # of steps along fixed axes
SAME_SCALE = 0.25  # natural log of a ratio: slip is not a wrong unit
SAME_AXIS_DEG = 20  # tolerance for swapped and backward axes


def turn_finding(turn: str, *evidence: Evidence, **numbers: float) -> Finding:
    """Report that turns are not counter-clockwise radians; `turn` is a key of TURNS."""
    return Finding(f"turn-{turn.replace(' ', '-')}", evidence, numbers, {"turn_scale": TURNS[turn]})


def frame_finding(frame: str, *evidence: Evidence, offset_rad: float = 0.0, **numbers: float) -> Finding:
    """Report absolute poses, or steps along the world's axes; forward is off by `offset_rad`."""
    options: dict[str, Value] = {"odometry_are": {"absolute": "poses", "world": "steps"}[frame]}
    if abs(offset_rad) > LEAST_FORWARD:
        options["odometry_forward_rad"] = float(np.radians(round(float(np.degrees(-offset_rad)))))
    return Finding(f"frame-{frame}", evidence, numbers, options)


def direction_finding(offset_rad: float, *evidence: Evidence, **numbers: float) -> Finding:
    """Report that odometry's forward direction is wrong."""
    degrees = round(float(np.degrees(offset_rad)))
    near = 90 * round(degrees / 90)
    forward = -near if near and abs(degrees - near) <= SAME_AXIS_DEG else -degrees
    forward = 180 if forward == -180 else forward
    code = "frame-turned"
    if abs(abs(degrees) - 90) <= SAME_AXIS_DEG:
        code = "frame-swapped"
    elif abs(degrees) >= 180 - SAME_AXIS_DEG:
        code = "frame-backward"
    options = {"odometry_forward_rad": float(np.radians(forward))}
    return Finding(code, evidence, {"offset_deg": degrees, **numbers}, options)


def scale_finding(scale: float, *evidence: Evidence, truth: bool = False, **numbers: float) -> Finding:
    """Report that lengths are not in meters, or far too long."""
    whose = "truth" if truth else "odometry"
    near = min(UNITS, key=lambda unit: abs(np.log(scale / unit)))
    numbers = {"scale": scale, **numbers}
    if abs(np.log(scale / near)) >= SAME_SCALE:
        return Finding("scale", evidence, numbers, {f"{whose}_scale": round(scale, 4)}, {"whose": whose})
    code = "truth-scale" if truth else "scale"
    details: dict[str, Value] = {"whose": whose, "unit": UNITS[near], "factor": near}
    return Finding(code, evidence, numbers, {f"{whose}_scale": near}, details)


def gain_finding(gain: float, expected: float, *evidence: Evidence) -> Finding:
    """Report that turns over-read or under-read by far."""
    options = {"turn_gain": round(gain / expected, 3)}
    return Finding("turn-gain", evidence, {"gain": gain, "expected": expected}, options)


def picture_delay_finding(late_s: float, *evidence: Evidence) -> Finding:
    """Report that the time stamps of pictures are wrong."""
    late = round(late_s, 6)
    return Finding("picture-delay", evidence, {"delay_s": late}, {"picture_offset_s": -late})
