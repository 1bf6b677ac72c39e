"""Return whether numbers can be what they are called: without truth, pictures or a library."""

from __future__ import annotations

import numpy as np

from ..arrays import F64
from .findings import (
    TURNS,
    Evidence,
    Finding,
    RecordedDrive,
    RecordedOdometry,
    direction_finding,
    frame_finding,
    motions_of,
    rotated,
    scale_finding,
    turn_finding,
)
from .odometry import Reading, motions_read, readings

SLOWEST_M_S, FASTEST_M_S = 0.002, 12.0  # what a robot that looks about drives at, as the 95th percentile
FASTEST_RAD_S = 12.0  # two turns a second
USUAL_M_S = 0.3
PER_SECOND = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
FEWEST = 8  # records that move
MOST_OF_ONE = 10.0  # times the median way, that one record counts
STEP_M = 0.05  # poses are compared over steps of so much
ONE_WAY, OFF_RAD = 0.8, 0.44  # share of the way that goes one way, and how far off forward that is told
ASIDE, NOT_ASIDE = 0.5, 0.15  # share of the way that goes sideways: too much, and hardly any


def speeds(odometry: RecordedOdometry) -> tuple[float, float]:
    """Return how fast the robot goes (m/s) and turns (rad/s): 95th percentiles of what moves; 0 for nothing.

    Turns are taken as they stand, so that degrees show.
    """
    motions = motions_of(odometry)
    turns = np.diff(odometry.values[:, 2], prepend=odometry.values[0, 2]) if odometry.poses else motions[:, 2]
    passed = np.diff(odometry.t_s, prepend=np.nan)
    ways = np.hypot(motions[:, 0], motions[:, 1])
    return _high(ways, passed), _high(np.abs(turns), passed)


def _high(amounts: F64, passed_s: F64) -> float:
    moves = (amounts > 0) & (passed_s > 0)
    if moves.sum() < FEWEST:
        return 0.0
    return float(np.percentile(amounts[moves] / passed_s[moves], 95))


def time_unit(drive: RecordedDrive) -> tuple[float, list[Finding]]:
    """Return whether times are no seconds; give what they have to be multiplied by."""
    way, turn = speeds(drive.odometry) if drive.odometry.size else (0.0, 0.0)
    if not (0 < way < SLOWEST_M_S and turn < SLOWEST_M_S):
        return 1.0, []
    unit = min(PER_SECOND, key=lambda one: abs(np.log(way * PER_SECOND[one] / USUAL_M_S)))
    factor = PER_SECOND[unit]
    seen = Evidence("slow", {"m_s": way, "rad_s": turn, "unit": unit, "per_s": factor})
    short = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}[unit]
    found = Finding("time-unit", (seen,), {"per_s": factor}, {"time_unit": short}, {"unit": unit})
    return 1 / factor, [found]


def odometry_doubts(drive: RecordedDrive) -> list[Finding]:
    """Return what is wrong with the odometry by its own numbers."""
    odometry = drive.odometry
    if odometry.size < FEWEST:
        return []
    findings, reading = [], best_reading(odometry)
    way, turn = speeds(odometry)
    aside = aside_share(odometry, Reading())
    if reading.frame or (reading.turn and odometry.poses):
        seen = Evidence("sideways", {"aside": aside, "then": aside_share(odometry, reading)})
        if reading.frame:
            offset = -direction_of(odometry, reading) if reading.frame == "world" else 0.0
            findings.append(frame_finding(reading.frame, seen, offset_rad=offset))
        findings += [turn_finding(reading.turn, seen)] if reading.turn else []
    elif turn > FASTEST_RAD_S:
        seen = Evidence("spins", {"rad_s": turn, "in_degrees": turn * TURNS["degrees"]})
        findings.append(turn_finding("degrees", seen, rad_s=turn))
    elif abs(np.sin(side := direction_of(odometry, Reading()))) > np.sin(OFF_RAD):
        seen = Evidence("one-way", {"off_deg": float(np.degrees(side)), "aside": aside})
        findings.append(direction_finding(-side, seen, aside=aside))
    if way > FASTEST_M_S and reading.frame != "absolute":
        findings.append(_too_fast(way, drive.size_m))
    return findings


def best_reading(odometry: RecordedOdometry) -> Reading:
    """Find the reading by which a robot that cannot go sideways does not; the usual one where that does."""
    if aside_share(odometry, Reading()) < ASIDE:
        return Reading()
    small = odometry.poses and np.abs(odometry.values[:, 2]).max() <= np.pi  # headings of quaternions are
    tried = [one for one in readings(odometry) if one.frame or odometry.poses]
    tried = [one for one in tried if not (small and "degrees" in one.turn)]
    best = min(tried, key=lambda one: aside_share(odometry, one))
    return best if aside_share(odometry, best) < NOT_ASIDE else Reading()


def aside_share(odometry: RecordedOdometry, reading: Reading) -> float:
    """Return the share of the way that goes sideways, 0 to 1, if the odometry is what the reading says."""
    if odometry.poses:
        motions = _steps(odometry.values * [1, 1, TURNS[reading.turn]])
    else:
        motions = motions_read(odometry, reading)
    ways = np.hypot(motions[:, 0], motions[:, 1])
    if not ways.any():
        return 0.0
    counted = np.minimum(ways, MOST_OF_ONE * np.median(ways[ways > 0]))  # one wild record does not decide
    aside = np.divide(np.abs(motions[:, 1]), ways, out=np.zeros_like(ways), where=ways > 0)
    return float(counted @ aside / counted.sum())


def _steps(poses: F64) -> F64:
    """Return the way between poses (n, 2) some centimeters apart, seen from each step's end."""
    gone = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T))
    chosen = np.unique(np.searchsorted(gone, np.arange(0.0, min(gone[-1], 1000.0), STEP_M)))
    some = poses[chosen]
    step = np.diff(some[:, :2], axis=0)
    return np.column_stack(rotated(step[:, 0], step[:, 1], -some[1:, 2]))


def direction_of(odometry: RecordedOdometry, reading: Reading) -> float:
    """Return the direction in which nearly all of the way goes, as the robot sees it; 0 for no direction."""
    if odometry.poses:
        return main_direction(_steps(odometry.values * [1, 1, TURNS[reading.turn]]))
    return main_direction(motions_read(odometry, reading))


def main_direction(motions: F64) -> float:
    """Return the direction in which nearly all of the way of motions (K, 3) goes; 0 for no direction."""
    x, y = motions[:, 0].sum(), motions[:, 1].sum()
    whole = np.hypot(motions[:, 0], motions[:, 1]).sum()
    return float(np.arctan2(y, x)) if np.hypot(x, y) > ONE_WAY * whole else 0.0


def _too_fast(way: float, size_m: float) -> Finding:
    """Report that lengths are not in meters."""
    scale = min((0.001, 0.01), key=lambda one: abs(np.log(way * one / USUAL_M_S)))
    seen = Evidence("fast", {"m_s": way, "map_m": size_m, "then_m_s": way * scale})
    return scale_finding(scale, seen, m_s=way)
