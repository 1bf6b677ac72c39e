"""Scans against each other along the drive: how the laser is mounted, and its clock.

Two scans taken near each other see the same walls. How far the points of one are from those of the other,
once moved as odometry or truth say, tells how the laser is mounted and when it measured.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from maurice_mcl.sensor.laser.fit import YAWS
from maurice_mcl.sensor.laser.reading import LEAST_HITS
from maurice_mcl.values import F64, motion_between, path_of, rotated, wrap_angle

from .findings import Evidence, Finding, RecordedDrive, RecordedScans, motions_of

LEAST_USED = 0.5  # share of the scans
PAIRS, LATE_PAIRS = 60, 120  # of scans, spread over the drive: for the mount, and for the clock
WAY_M, TURN_RAD = (0.3, 1.2), (0.25, 0.9)  # between the two of a pair
FARTHEST_M = 300.0  # no planar laser sees farther
FAR_M = 0.3  # from the nearest point: farther counts no more
FEWEST_PAIRS = 8
CLEAR_T = 4.0  # standard errors by which another mount or clock fits better
CLEAR_SHARE, LATE_SHARE = 0.8, 0.9  # of the distance that is left then, for a mount and for a clock
LEAST_YAW_DEG, LEAST_OFFSET_S = 8, 0.08
OFFSETS_S = np.arange(-20, 21) * 0.05
EQUAL_M, EQUAL_RAD, EQUAL_SHARE = 2e-3, 2e-3, 0.9  # odometry and truth that are one
BODY_M, SAME_M = 1.0, 0.03  # a beam that stays within the latter of a range below the former ...
BODY_SHARE, BODY_BEAMS = (
    0.6,
    0.02,
)  # ... in this share of the headings is the robot's own; of all beams, least
PLACES_M, LEAST_PLACE_M = np.arange(-4, 5) * 0.1, 0.1


C128 = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    first: int  # numbers of scans
    second: int
    motion: F64  # (3,) of the robot between them
    walls: cKDTree  # the first scan's points, in the frame of its laser
    points: C128  # (K,) the second scan's, x_m + i y_m in the frame of its laser
    mounts: tuple[F64, F64]  # (3,) of both lasers


def examine_scans(
    scans: RecordedScans, drive: RecordedDrive, near_s: float
) -> tuple[RecordedScans, list[Finding], str]:
    """Return scans without the robot itself, what is wrong, and what was checked.

    A scan within `near_s` of a picture counts as its own.
    """
    findings, check = _truth_is_odometry(drive), f"{scans.size} scans"
    findings += _unused(scans, drive, near_s)
    paths = [path for path in (truth_path(drive), _odometry_path(drive)) if path is not None]
    for body in _own_body(scans, *paths[0]) if paths else ():
        findings.append(body)
        scans = replace(scans, scans=tuple(replace(s, min_m=body.numbers["range_m"]) for s in scans.scans))
    pairs = _pairs(scans, *paths[0]) if paths else []
    if len(pairs) >= FEWEST_PAIRS:
        check += f", {len(pairs)} pairs of them against each other"
        mount = _mounts(pairs) or _elsewhere(pairs)
        findings += mount or _late(scans, *paths[-1])
    return scans, findings, check


Path = tuple[F64, F64]  # times (K,) and poses (K, 3)


def truth_path(drive: RecordedDrive) -> Path | None:
    """Return the true poses; None if there are too few."""
    truth = drive.truth  # carried off it went too far between two scans for a pair
    return (truth.t_s, truth.poses) if truth.size >= FEWEST_PAIRS else None


def _odometry_path(drive: RecordedDrive) -> Path | None:
    odometry = drive.odometry
    if odometry.size < FEWEST_PAIRS or (np.diff(odometry.t_s) < 0).any():
        return None
    poses = odometry.values if odometry.poses else path_of(motions_of(odometry, drive.turn_gain))
    return odometry.t_s, poses


def poses_at(times: F64, t_s: F64, poses: F64) -> F64:
    """Return the poses (S, 3) at some times."""
    turns = np.unwrap(poses[:, 2])
    return np.column_stack([np.interp(times, t_s, column) for column in (poses[:, 0], poses[:, 1], turns)])


def _pairs(scans: RecordedScans, t_s: F64, poses: F64, most: int = PAIRS) -> list[_Pair]:
    """Return pairs of scans between which the robot drove or turned somewhat, spread over the drive."""
    if (np.diff(t_s) < 0).any():
        return []
    known = (scans.t_s >= t_s[0]) & (scans.t_s <= t_s[-1])
    places = poses_at(scans.t_s, t_s, poses)
    pairs, last = list[tuple[int, int, F64]](), 0
    for k in np.flatnonzero(known):
        motion = motion_between(places[last], places[k])
        way_m, turn_rad = float(np.hypot(*motion[:2])), abs(float(wrap_angle(float(motion[2]))))
        if way_m < WAY_M[0] and turn_rad < TURN_RAD[0]:
            continue
        if way_m < WAY_M[1] and turn_rad < TURN_RAD[1] and known[last]:
            pairs.append((last, int(k), motion))
        last = int(k)
    chosen = np.linspace(0, len(pairs) - 1, min(len(pairs), most)).round().astype(int)
    return [_pair(scans, *pairs[k]) for k in dict.fromkeys(chosen.tolist())]


def _pair(scans: RecordedScans, first: int, second: int, motion: F64) -> _Pair:
    both = scans.scans[first], scans.scans[second]
    walls, points = (replace(scan, mount=np.zeros(3)).points() for scan in both)
    ends, mounts = points[:, 0] + 1j * points[:, 1], (both[0].mount, both[1].mount)
    return _Pair(first, second, motion, cKDTree(walls), ends, mounts)


def _apart(
    pair: _Pair,
    yaws_rad: F64 | float = 0.0,
    sign: int = 1,
    motions: F64 | None = None,
    shifts: C128 | complex = 0j,
) -> F64:
    """Return how far a pair's second scan is from the first, on average, in meters, in each of N ways (N,).

    Lasers are turned on the robot by `yaws_rad` and shifted by `shifts` (x_m + i y_m), scans mirrored (-1),
    and the robot moves by `motions` (N, 3).
    """
    x, y, turn = (pair.motion[None] if motions is None else motions).T[:, :, None]
    yaws, moved = np.reshape(yaws_rad, (-1, 1)), np.reshape(shifts, (-1, 1))
    places = [mount[0] + 1j * mount[1] + moved for mount in pair.mounts]
    turns = [np.exp(1j * (mount[2] + yaws)) for mount in pair.mounts]
    points = x + 1j * y + np.exp(1j * turn) * (places[1] + turns[1] * _mirrored(pair.points, sign))
    points = _mirrored((points - places[0]) / turns[0], sign)
    if min(points.shape[1], pair.walls.n) < 10:
        return np.full(len(points), FAR_M)
    away = pair.walls.query(np.stack([points.real, points.imag], axis=2), distance_upper_bound=FAR_M)[0]
    return np.asarray(np.minimum(away, FAR_M).mean(axis=1))


def _mirrored(points: C128, sign: int) -> C128:
    return points.conj() if sign < 0 else points


def _mounts(pairs: list[_Pair]) -> list[Finding]:
    """Return how the laser would have to be mounted, if that differs from the recording."""
    usual = np.concatenate([_apart(pair) for pair in pairs])
    some, yaws = pairs[:: max(len(pairs) // 30, 1)], YAWS[::2]
    means = {sign: np.mean([_apart(pair, yaws, sign) for pair in some], axis=0) for sign in (1, -1)}
    sign = min(means, key=lambda sign: means[sign].min())
    near = yaws[np.argmin(means[sign])] + np.radians(np.arange(-8, 9, 2))
    totals = np.array([_apart(pair, near, sign) for pair in pairs])
    best = int(totals.mean(axis=0).argmin())
    yaw_deg = float(round(np.degrees(wrap_angle(float(near[best])))))
    if not is_clear(usual, totals[:, best]) or (sign == 1 and abs(yaw_deg) < LEAST_YAW_DEG):
        return []
    values = {"pairs": len(pairs), "before": usual.mean(), "after": totals[:, best].mean()}
    seen = (Evidence("scan-pairs", values),)
    if sign < 0:
        return [Finding("scan-mirrored", seen, {"yaw_deg": yaw_deg})]
    return [Finding("scan-yaw", seen, {"yaw_deg": yaw_deg}, {"scan_yaw_rad": float(np.radians(yaw_deg))})]


def _elsewhere(pairs: list[_Pair]) -> list[Finding]:
    """Return where the laser is on the robot, if not where the recording says; only turns show it."""
    turning = [pair for pair in pairs if abs(wrap_angle(float(pair.motion[2]))) >= TURN_RAD[0]]
    if len(turning) < FEWEST_PAIRS:
        return []
    usual = moved = np.concatenate([_apart(pair) for pair in turning])
    shift = 0j
    for places in (PLACES_M, PLACES_M[3:6] / 2):
        shifts = shift + (places[:, None] + 1j * places).ravel()
        totals = np.array([_apart(pair, shifts=shifts) for pair in turning])
        best = int(totals.mean(axis=0).argmin())
        shift, moved = complex(shifts[best]), totals[:, best]
    if abs(shift) < LEAST_PLACE_M or not is_clear(usual, moved):
        return []
    seen = Evidence("scan-pairs", {"pairs": len(turning), "before": usual.mean(), "after": moved.mean()})
    return [Finding("scan-place", (seen,), {"ahead_m": shift.real, "left_m": shift.imag})]


def _unused(scans: RecordedScans, drive: RecordedDrive, near_s: float) -> list[Finding]:
    """Return why most scans, or most pictures with a scan, say nothing to a filter, if that is so."""
    hits = [scan.hits & (scan.ranges_m < FARTHEST_M) for scan in scans.scans]
    others = {"pictures": drive.picture_t_s if drive.sees == "pictures" else np.zeros(0)}
    others |= {"odometry": drive.odometry.t_s if drive.odometry.poses else np.zeros(0)}
    used = {"hits": float(np.mean([some.sum() >= LEAST_HITS for some in hits]))}
    used |= {name: _near(scans.t_s, times, near_s) for name, times in others.items() if len(times)}
    why = min(used, key=lambda name: used[name])
    if used[why] >= LEAST_USED:
        return []
    values = {"share": used[why], "near_s": near_s, "hits": LEAST_HITS}
    return [Finding("scans-unused", (Evidence(f"scans-{why}", values),), details={"why": why, **values})]


def _own_body(scans: RecordedScans, t_s: F64, poses: F64) -> list[Finding]:
    """Return a finding where beams read one short range at all headings, as of the robot's own body."""
    headings = (poses_at(scans.t_s, t_s, poses)[:, 2] // TURN_RAD[0]).astype(int)
    some = [scans.scans[k] for k in np.unique(headings, return_index=True)[1]]
    some = [scan for scan in some if scan.size == some[0].size]
    ranges_m = np.array([np.where(scan.hits, scan.ranges_m, np.float32(np.inf)) for scan in some])
    middle_m = np.median(ranges_m, axis=0)
    own = np.flatnonzero(middle_m < BODY_M)
    own = own[(np.abs(ranges_m[:, own] - middle_m[own]) < SAME_M).mean(axis=0) > BODY_SHARE]
    if len(some) < FEWEST_PAIRS or len(own) < BODY_BEAMS * some[0].size:
        return []
    numbers = {"share": len(own) / some[0].size, "range_m": float(middle_m[own].max()) + 2 * SAME_M}
    return [Finding("own-body", (Evidence("same-range", numbers | {"scans": len(some)}),), numbers)]


def _near(t_s: F64, others: F64, near_s: float) -> float:
    """Return the share of the shorter list of times that has a time of the other within `near_s`."""
    few, many = sorted((np.sort(t_s), np.sort(others)), key=len)
    after = (
        np.clip(np.searchsorted(many, few), 1, len(many) - 1) if len(many) > 1 else np.zeros(len(few), int)
    )
    apart = np.minimum(np.abs(many[after] - few), np.abs(many[after - 1] - few))
    return float((apart <= near_s).mean())


def _late(scans: RecordedScans, t_s: F64, poses: F64) -> list[Finding]:
    """Return by how much the scans' clock differs from the odometry's."""
    pairs, totals = _pairs(scans, t_s, poses, LATE_PAIRS), list[F64]()
    if len(pairs) < FEWEST_PAIRS:
        return []
    for pair in pairs:
        before, after = (poses_at(scans.t_s[k] + OFFSETS_S, t_s, poses) for k in (pair.first, pair.second))
        x, y, turn = (after - before).T
        totals.append(_apart(pair, motions=np.column_stack([*rotated(x, y, -before[:, 2]), turn])))
    by_offset = np.array(totals).T
    usual, best = by_offset[len(OFFSETS_S) // 2], int(by_offset.mean(axis=1).argmin())
    offset_s = float(round(OFFSETS_S[best], 3))
    at_edge = best in (0, len(OFFSETS_S) - 1)  # whatever is there, it is no minimum
    if at_edge or abs(offset_s) < LEAST_OFFSET_S or not is_clear(usual, by_offset[best], LATE_SHARE):
        return []
    seen = Evidence(
        "scan-pairs", {"pairs": len(pairs), "before": usual.mean(), "after": by_offset[best].mean()}
    )
    return [Finding("scan-delay", (seen,), {"delay_s": -offset_s}, {"picture_offset_s": offset_s})]


def is_clear(usual: F64, better: F64, share: float = CLEAR_SHARE) -> bool:
    """Whether what is left (N,) is clearly less than usual (N,), and less than a share of it."""
    gain = usual - better
    error = max(float(gain.std() / np.sqrt(len(gain))), 1e-9)
    return bool(gain.mean() > CLEAR_T * error and better.mean() < share * usual.mean())


def _truth_is_odometry(drive: RecordedDrive) -> list[Finding]:
    """Return a finding where odometry repeats the truth: it was made from it."""
    path = _odometry_path(drive)
    if path is None or drive.truth.size < FEWEST_PAIRS:
        return []
    t_s, poses = path
    chosen = drive.truth.t_s[(drive.truth.t_s >= t_s[0]) & (drive.truth.t_s <= t_s[-1])]
    if len(chosen) < FEWEST_PAIRS:
        return []
    odometry, truth = poses_at(chosen, t_s, poses), poses_at(chosen, drive.truth.t_s, drive.truth.poses)
    off = np.array([motion_between(a, b) for a, b in pairwise(odometry)])
    off -= np.array([motion_between(a, b) for a, b in pairwise(truth)])
    moved = np.hypot(*np.diff(truth[:, :2], axis=0).T) > 0.01
    equal = (np.hypot(*off[:, :2].T) < EQUAL_M) & (np.abs(wrap_angle(off[:, 2])) < EQUAL_RAD)
    if moved.sum() < FEWEST_PAIRS or equal[moved].mean() < EQUAL_SHARE:
        return []
    seen = Evidence("equal-steps", {"share": float(equal[moved].mean()), "steps": int(moved.sum())})
    return [Finding("odometry-is-truth", (seen,))]
