"""Odometry against truth: which reading of the odometry explains best what the robot really did.

A reading says what the numbers might be in place of what they should be: degrees, clockwise, absolute poses,
steps along the axes of a fixed frame. For each the drive is cut into segments by the truth, the odometry of
a segment is combined, and the share of the true movement that it does not explain is what counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F64, I32
from ..geometry import wrap_angle
from .findings import (
    TURNS,
    RecordedDrive,
    RecordedOdometry,
    RecordedTruth,
    motions_between,
    motions_of,
    rotated,
)

SEGMENT_M, SEGMENT_RAD = 0.15, 0.2  # a segment is as long as it takes to go or turn so far
MOST_SEGMENTS = 400  # spread over the drive
FEWEST_SEGMENTS = 8
WORST = 0.15  # share of the segments that slips and jumps of the truth may spoil
GAINS: F64 = np.geomspace(0.3, 3.3, 200)  # actual over measured turns; skidding wheels over-read by a third


@dataclass(frozen=True, slots=True)
class Reading:
    """What the numbers might be."""

    turn: str = ""  # a key of TURNS
    frame: str = ""  # "": the robot's; "world": steps along fixed axes; "absolute": poses


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well odometry, read in one way, agrees with the truth."""

    reading: Reading
    shift_s: float  # taken from the odometry's times
    gain: float  # true turn over measured turn
    scale: float  # true way over measured way
    offset_rad: float  # true direction of travel minus measured, in the robot's frame
    turn_unexplained: float  # share of the turning's squares, 0 to about 1
    way_unexplained: float  # share of the ways' squares
    legs: int

    @property
    def unexplained(self) -> float:
        """The mean of both shares."""
        return (self.turn_unexplained + self.way_unexplained) / 2


@dataclass(frozen=True, slots=True, eq=False)
class TruthSegments:
    """The truth cut into L legs."""

    begin_s: F64  # (L,)
    end_s: F64  # (L,)
    moved: F64  # (L, 3) the true motion, in the robot's frame at the leg's begin


def segments_of(track: RecordedTruth, turn: float = 1.0) -> TruthSegments:
    """Cut the truth where it has moved or turned enough; never across a kidnapping."""
    poses = track.poses * [1, 1, turn]
    first, last = [], []
    begin = 0
    for k in range(1, track.size):
        if track.part[k] != track.part[begin]:
            begin = k
            continue
        step = poses[k] - poses[begin]
        if np.hypot(step[0], step[1]) >= SEGMENT_M or abs(wrap_angle(step[2])) >= SEGMENT_RAD:
            first.append(begin)
            last.append(k)
            begin = k
    chosen = np.linspace(0, len(first) - 1, min(len(first), MOST_SEGMENTS)).round().astype(int)
    a, b = np.array(first, int)[chosen], np.array(last, int)[chosen]
    step = poses[b] - poses[a]
    ahead, aside = rotated(step[:, 0], step[:, 1], -poses[a, 2])
    return TruthSegments(track.t_s[a], track.t_s[b], np.column_stack([ahead, aside, wrap_angle(step[:, 2])]))


def readings(odometry: RecordedOdometry) -> list[Reading]:
    """List what is tried; the first one is what the numbers should be."""
    frames = ("",) if odometry.poses else ("", "world", "absolute")
    return [Reading(turn, frame) for frame in frames for turn in TURNS]


def motions_read(odometry: RecordedOdometry, reading: Reading) -> F64:
    """Return the robot's motions (K, 3) if the numbers are what the reading says."""
    motions = motions_of(odometry, TURNS[reading.turn])
    if reading.frame == "absolute":
        return motions_between(motions)
    if reading.frame == "world":
        heading = np.cumsum(motions[:, 2]) - motions[:, 2]
        ahead, aside = rotated(motions[:, 0], motions[:, 1], -heading)
        return np.column_stack([ahead, aside, motions[:, 2]])
    return motions


def agreement(
    odometry: RecordedOdometry, legs: TruthSegments, reading: Reading, shift_s: float = 0.0
) -> Agreement | None:
    """Compare odometry, read in one way and moved in time, with the truth; None for too few legs."""
    motions = motions_read(odometry, reading)
    begin, end = _records_in(odometry.t_s - shift_s, legs)
    used = end > begin
    if used.sum() < FEWEST_SEGMENTS:
        return None
    begin, end, moved = begin[used], end[used], legs.moved[used]
    turned = _sums(motions[:, 2], begin, end)
    gain, turn_unexplained = _fit_turns(turned, moved[:, 2])
    ahead, aside = _ways(motions, gain, begin, end)
    scale, offset, way_unexplained = _fit_ways(ahead, aside, moved)
    found = gain, scale, offset, turn_unexplained, way_unexplained
    return Agreement(reading, shift_s, *found, int(used.sum()))


def _records_in(t_s: F64, legs: TruthSegments) -> tuple[I32, I32]:
    """Return the first record of each leg, and the one after its last."""
    begin = np.searchsorted(t_s, legs.begin_s, side="right")
    end = np.searchsorted(t_s, legs.end_s, side="right")
    return np.asarray(begin, np.int32), np.asarray(end, np.int32)


def _sums(values: F64, begin: I32, end: I32) -> F64:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[end] - total[begin])


def _ways(motions: F64, gain: float, begin: I32, end: I32) -> tuple[F64, F64]:
    """Return the displacement over each segment, in the robot's frame at its beginning."""
    turns = motions[:, 2] * gain
    heading = np.cumsum(turns) - turns
    x, y = rotated(motions[:, 0], motions[:, 1], heading + turns / 2)
    at = np.append(heading, heading[-1] + turns[-1])[begin]
    return rotated(_sums(x, begin, end), _sums(y, begin, end), -at)


def _fit_turns(measured: F64, actual: F64) -> tuple[float, float]:
    """Find the gain, and the share of the turning's squares that is not explained with it."""
    whole = _best_part(actual**2)
    if not whole.sum() > 1e-9:
        return 1.0, 0.0
    errors = wrap_angle(actual - GAINS[:, None] * measured) ** 2
    shares = np.sort(errors, axis=1)[:, : len(whole)].sum(axis=1) / whole.sum()
    best = int(shares.argmin())
    return float(GAINS[best]), float(min(shares[best], 2.0))


def _fit_ways(ahead: F64, aside: F64, moved: F64) -> tuple[float, float, float]:
    """Find scale and direction, and the share of the ways' squares that is not explained with them."""
    measured, actual = ahead + 1j * aside, moved[:, 0] + 1j * moved[:, 1]
    far = (np.abs(actual) >= SEGMENT_M / 3) & (np.abs(measured) > 0)
    if far.sum() < FEWEST_SEGMENTS:
        return 1.0, 0.0, 0.0
    scale = float(np.median(np.abs(actual[far]) / np.abs(measured[far])))
    offset = _middle_direction(actual[far] / measured[far])
    errors = np.abs(actual - scale * np.exp(1j * offset) * measured) ** 2
    whole = _best_part(np.abs(actual) ** 2)
    share = float(np.sort(errors)[: len(whole)].sum() / whole.sum())
    return scale, offset, min(share, 2.0)


def _middle_direction(ratios: object) -> float:
    """Return the direction that most of these complex numbers agree on."""
    units = np.asarray(ratios) / np.abs(np.asarray(ratios))
    angles = np.angle(units)
    tried = np.linspace(-np.pi, np.pi, 73)[:-1]
    best = tried[np.cos(angles[:, None] - tried).clip(0.5).sum(axis=0).argmax()]
    near = np.abs(wrap_angle(angles - best)) < np.pi / 4
    return float(np.angle(units[near].sum())) if near.any() else float(best)


def _best_part(squares: F64) -> F64:
    """Leave out the largest few."""
    return np.sort(squares)[: int(np.ceil(len(squares) * (1 - WORST)))]


def shifts(drive: RecordedDrive) -> F64:
    """List the delays that are tried, in seconds: up to two updates, or two seconds of dense records."""
    steps = [np.diff(times) for times in (drive.odometry.t_s, drive.truth.t_s) if len(times) > 1]
    spacing = max((float(np.median(s[s > 0])) for s in steps if (s > 0).any()), default=1.0)
    most = 2.0 if spacing < 0.5 else 2.5 * spacing
    return np.linspace(-most, most, 41)
