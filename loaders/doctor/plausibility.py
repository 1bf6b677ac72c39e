"""Whether times and numbers can be what they are called: without pictures, a library or a comparison."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from maurice_mcl.values import F64, path_of, wrap_angle

from ..reading.jumps import jumps_in
from ..reading.options import JUMPING
from .findings import (
    TURNS,
    Evidence,
    Finding,
    RecordedDrive,
    RecordedOdometry,
    RecordedScans,
    Value,
    direction_finding,
    frame_finding,
    motions_of,
    scale_finding,
    turn_finding,
)
from .odometry import FASTEST_M_S, Interpretation, direction_of, interpretations, motions_by, moves_of

# Numbers of the odometry by themselves.

SLOWEST_M_S = 0.002  # minimum speed of a robot that looks around, 95th percentile
FASTEST_RAD_S = 12.0  # two turns a second
USUAL_M_S = 0.3
PER_SECOND = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
FEWEST = 8  # records that move
MOST_OF_ONE = 10.0  # times the median distance: the most that one record counts
OFF_RAD = 0.44  # angle from forward beyond which the main direction is reported
ASIDE, NOT_ASIDE = 0.5, 0.15  # share of the distance that is sideways: too much, and hardly any


def speeds(odometry: RecordedOdometry) -> tuple[float, float]:
    """Return speed (m/s) and turning (rad/s, not wrapped) as 95th percentiles; 0 for nothing."""
    motions = motions_of(odometry)
    turns = np.diff(odometry.values[:, 2], prepend=odometry.values[0, 2]) if odometry.poses else motions[:, 2]
    intervals = np.diff(odometry.t_s, prepend=np.nan)
    ways = np.hypot(motions[:, 0], motions[:, 1])
    return _high(ways, intervals), _high(np.abs(turns), intervals)


def _high(amounts: F64, passed_s: F64) -> float:
    moves = (amounts > 0) & (passed_s > 0)
    if moves.sum() < FEWEST:
        return 0.0
    least_s = np.percentile(passed_s[moves], 75)  # stamps may come in pairs, and hardly apart
    return float(np.percentile(amounts[moves] / np.maximum(passed_s[moves], least_s), 95))


def time_unit(drive: RecordedDrive) -> tuple[float, list[Finding]]:
    """Return the factor that turns times into seconds, and a finding if it is not 1."""
    way, turn = speeds(drive.odometry) if drive.odometry.size else (0.0, 0.0)
    if not (0 < way < SLOWEST_M_S and turn < SLOWEST_M_S):
        return 1.0, []
    unit = min(PER_SECOND, key=lambda name: abs(np.log(way * PER_SECOND[name] / USUAL_M_S)))
    factor = PER_SECOND[unit]
    seen = Evidence("slow", {"m_s": way, "rad_s": turn, "unit": unit, "per_s": factor})
    short = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}[unit]
    finding = Finding("time-unit", (seen,), {"per_s": factor}, {"time_unit": short}, {"unit": unit})
    return 1 / factor, [finding]


MOST_AT_ONE = 3.0  # records that move at one time, on average; a robot's clock has one or two
COARSE_S = 0.5  # between such times


def coarse_times(drive: RecordedDrive) -> list[Finding]:
    """Return a finding where many records share few times: their stamps were written with too few digits."""
    odometry, truth = drive.odometry, drive.truth
    moves = np.abs(motions_of(odometry)).sum(axis=1) > 0 if odometry.size else np.zeros(0, bool)
    went = np.abs(np.diff(truth.poses, axis=0, prepend=truth.poses[:1])).sum(axis=1) > 0
    kinds = {"odometry": odometry.t_s[moves], "truth": truth.t_s[went], drive.sees: drive.picture_t_s}
    findings = []
    for name, t_s in kinds.items():
        times = np.unique(t_s)
        if len(t_s) < FEWEST or len(t_s) < MOST_AT_ONE * len(times):
            continue
        step_s = float(np.median(np.diff(times))) if len(times) > 1 else 0.0  # 0: there is one time
        if len(times) > 1 and step_s < COARSE_S:
            continue
        seen = Evidence("steps", {"step_s": step_s, "each": len(t_s) / len(times)})
        if name != drive.sees and len(times) > 1 and np.isin(times[1:-1], drive.picture_t_s).all():
            continue  # between two pictures or scans order tells enough
        details: dict[str, Value] = {"name": name, "records": len(t_s), "times": len(times)}
        findings.append(Finding("times-coarse", (seen,), {"step_s": step_s}, details=details))
    return findings


def odometry_doubts(drive: RecordedDrive) -> list[Finding]:
    """Return what is wrong with the odometry by its own numbers."""
    odometry = drive.odometry
    if odometry.size < FEWEST:
        return []
    findings, interpretation = [], best_interpretation(odometry)
    way, turn = speeds(odometry)
    aside = aside_share(odometry, Interpretation())
    if interpretation.frame or (interpretation.turn and odometry.poses):
        seen = Evidence("sideways", {"aside": aside, "then": aside_share(odometry, interpretation)})
        if interpretation.frame:
            offset = -direction_of(odometry, interpretation) if interpretation.frame == "world" else 0.0
            findings.append(frame_finding(interpretation.frame, seen, offset_rad=offset))
        findings += [turn_finding(interpretation.turn, seen)] if interpretation.turn else []
    elif turn > FASTEST_RAD_S:
        seen = Evidence("spins", {"rad_s": turn, "in_degrees": turn * TURNS["degrees"]})
        findings.append(turn_finding("degrees", seen, rad_s=turn))
    elif abs(np.sin(side := direction_of(odometry, Interpretation()))) > np.sin(OFF_RAD):
        seen = Evidence("one-way", {"off_deg": float(np.degrees(side)), "aside": aside})
        findings.append(direction_finding(-side, seen, aside=aside))
    if way > FASTEST_M_S and interpretation.frame != "absolute":
        findings.append(_too_fast(way, drive.size_m))
    return findings


def best_interpretation(odometry: RecordedOdometry) -> Interpretation:
    """Return the interpretation with hardly any sideways motion; the usual one if it has little."""
    if aside_share(odometry, Interpretation()) < ASIDE:
        return Interpretation()
    small = odometry.poses and np.abs(odometry.values[:, 2]).max() <= np.pi  # headings of quaternions are
    candidates = [candidate for candidate in interpretations(odometry) if candidate.frame or odometry.poses]
    candidates = [candidate for candidate in candidates if not (small and "degrees" in candidate.turn)]
    best = min(candidates, key=lambda candidate: aside_share(odometry, candidate))
    return best if aside_share(odometry, best) < NOT_ASIDE else Interpretation()


def aside_share(odometry: RecordedOdometry, interpretation: Interpretation) -> float:
    """Return the sideways share of the distance, 0 to 1, under an interpretation."""
    if odometry.poses:
        motions = moves_of(odometry.values * [1, 1, TURNS[interpretation.turn]])
    else:
        motions = motions_by(odometry, interpretation)
    ways = np.hypot(motions[:, 0], motions[:, 1])
    if not ways.any():
        return 0.0
    counted = np.minimum(ways, MOST_OF_ONE * np.median(ways[ways > 0]))  # one outlier does not decide
    aside = np.divide(np.abs(motions[:, 1]), ways, out=np.zeros_like(ways), where=ways > 0)
    return float(counted @ aside / counted.sum())


def _too_fast(way: float, size_m: float) -> Finding:
    scale = min((0.001, 0.01), key=lambda factor: abs(np.log(way * factor / USUAL_M_S)))
    seen = Evidence("fast", {"m_s": way, "map_m": size_m, "then_m_s": way * scale})
    return scale_finding(scale, seen, m_s=way)


# Single jumps of the odometry.

AT_ZERO_M = 0.01  # a pose so near zero after a jump is that of odometry that began again


def odometry_jumps(drive: RecordedDrive) -> list[Finding]:
    """Return a finding where odometry jumps: far faster between two records than between all others."""
    odometry, motions = drive.odometry, motions_of(drive.odometry)
    jumps = jumps_in(odometry.t_s, motions)
    if not len(jumps):
        return []
    most = int(jumps[np.hypot(motions[jumps, 0], motions[jumps, 1]).argmax()])
    numbers = {
        "jump_m": float(np.hypot(*motions[most, :2])),
        "turn_deg": float(np.degrees(wrap_angle(float(motions[most, 2])))),
        "within_s": float(odometry.t_s[most] - odometry.t_s[most - 1]),
        "at_s": float(odometry.t_s[most]) - drive.begin_s,
    }
    began_again = odometry.poses and bool((np.abs(odometry.values[most]) < AT_ZERO_M).all())
    others = np.delete(motions, jumps, axis=0)[1:]
    passed_s = np.delete(np.diff(odometry.t_s, prepend=np.nan), jumps)[1:]
    usual_s = float(np.median(passed_s[passed_s > 0]))
    fastest = float((np.hypot(others[:, 0], others[:, 1]) / np.fmax(passed_s, usual_s)).max())
    seen = Evidence("jump", {"fastest_m_s": fastest, "records": odometry.size})
    details: dict[str, Value] = {"jumps": len(jumps), "began_again": str(began_again)}
    return [Finding("odometry-jump", (seen,), numbers, {"odometry_are": JUMPING}, details)]


def without_jumps(drive: RecordedDrive) -> RecordedDrive:
    """Return a drive whose odometry stands still where it jumped."""
    odometry, motions = drive.odometry, motions_of(drive.odometry)
    jumps = jumps_in(odometry.t_s, motions)
    if not len(jumps):
        return drive
    motions[jumps] = 0.0
    if odometry.poses:
        motions[0] = odometry.values[0]
    values = path_of(motions) if odometry.poses else motions
    return replace(drive, odometry=replace(odometry, values=values))


# Clocks of pictures, odometry and truth that have no time in common, and what would align them.

FEW = 0.2  # share of the pictures
MAX_GAP_S = 1.0  # longest gap across which truth is interpolated
MOST_TIMES = 5000  # of one kind to compare
MOST_PICTURES = 60
ALIKE_S = 2e-3  # times that differ by less are equal
MOST, OTHER = 0.8, 0.5  # share of times that coincide at an offset, and at most at any other


def same_moments(late_t_s: F64, t_s: F64) -> float | None:
    """Return the delay at which nearly all of the fewer times coincide with the others; None for several."""
    most = (MOST_PICTURES, MOST_TIMES) if len(late_t_s) <= len(t_s) else (MOST_TIMES, MOST_PICTURES)
    late, ours = late_t_s[: most[0]], t_s[: most[1]]
    fewer = min(len(late), len(ours))
    if fewer < FEWEST:
        return None
    delays = np.sort((late[:, None] - ours).ravel())
    ends = np.searchsorted(delays, delays + ALIKE_S, side="right") - np.arange(len(delays))
    best = int(ends.argmax())
    others = ends[np.abs(delays - delays[best]) > 2 * ALIKE_S]
    if ends[best] < MOST * fewer or (len(others) and others.max() > OTHER * fewer):
        return None
    return float(np.median(delays[best : best + ends[best]]))


def clocks_apart(drive: RecordedDrive, movement_s: float | None = None) -> list[Finding]:
    """Return findings where pictures, odometry and truth share no time; `movement_s` aligns truth's."""
    findings: list[Finding] = []
    ours, others = drive.picture_t_s, {"odometry": drive.odometry.t_s, "truth": drive.truth.t_s}
    shared = {name: _overlap(times, ours) for name, times in others.items()}
    for name, times in others.items():
        if not len(times) or not len(ours) or shared[name]:
            continue
        other = shared["truth" if name == "odometry" else "odometry"]
        moved_s = None if movement_s is None or not other else movement_s
        late, by = _late(times, ours, moved_s if name == "odometry" or moved_s is None else -moved_s)
        spans: dict[str, Value] = {"name": name, "from_s": float(times.min()), "to_s": float(times.max())}
        spans |= {"pictures_from_s": float(ours.min()), "pictures_to_s": float(ours.max())}
        spans["sees"] = drive.sees
        evidence, options = (Evidence("spans", spans),), {f"{name}_offset_s": -round(late, 3)}
        details: dict[str, Value] = {"by": by, "sees": drive.sees}
        findings.append(Finding(f"{name}-clock", evidence, {"late_s": late}, options, details))
    return findings


def _overlap(times: F64, ours: F64) -> bool:
    return bool(len(times) and len(ours) and times.min() <= ours.max() and ours.min() <= times.max())


def _late(times: F64, ours: F64, moved_s: float | None) -> tuple[float, str]:
    """Return the delay of a clock by the best available source, and the name of that source."""
    exact = same_moments(times, ours)
    if exact is not None:
        return exact, "pictures"
    if moved_s is not None:
        return moved_s, "movement"
    return float(times.min() - ours.min()), "beginnings"


def truth_apart(drive: RecordedDrive) -> list[Finding]:
    """Return a finding if hardly any picture has truth at its time, though their times overlap."""
    truth, pictures = drive.truth, drive.picture_t_s
    if truth.size < FEWEST or len(pictures) < FEWEST:
        return []
    after = np.clip(np.searchsorted(truth.t_s, pictures), 1, truth.size - 1)
    before = after - 1
    exact = (truth.t_s[after] == pictures) | (truth.t_s[before] == pictures)
    between = (truth.t_s[after] - truth.t_s[before] <= MAX_GAP_S) & (truth.t_s[before] <= pictures)
    known = float((exact | (between & (pictures <= truth.t_s[after]))).mean())
    if known >= FEW:
        return []
    late = float(np.median(pictures - truth.t_s[before]))
    seen: dict[str, Value] = {"share": known, "pictures": len(pictures), "gap_s": MAX_GAP_S, "age_s": late}
    evidence, details = (Evidence("no-truth", {**seen, "sees": drive.sees}),), {"sees": drive.sees}
    return [Finding("truth-apart", evidence, {"share": known, "age_s": late}, details=details)]


# Ranges of the laser.

AT_TOP, BELOW = 0.01, 4  # width of the longest ranges, as a share of them, and how many such widths below
CAPPED_SHARE, CAPPED_TIMES = 0.03, 5.0  # of the beams, least, and times as many as in any width below
SAME_M = 1e-3  # ranges that differ by less are one value
SOME_SCANS, SEEN_IN = 500, 0.3  # that are looked at, and the share of them with such a beam
EMPTY_SCANS = 10  # in a row that hit nothing, least


def no_return_ranges(scans: RecordedScans) -> list[Finding]:
    """Return a finding where beams that hit nothing read a range, exact or with noise, below the reach."""
    some = scans.scans[:: max(scans.size // SOME_SCANS, 1)]
    hits = [scan.ranges_m[scan.hits] for scan in some]
    ranges = np.concatenate([np.zeros(0), *hits])
    if not len(ranges):
        return []
    top = float(np.quantile(ranges, 1 - CAPPED_SHARE / 10))
    edges = top * (1 - AT_TOP * np.arange(BELOW + 1, -1, -1))
    shares = np.histogram(ranges, [*edges[:-1], np.inf])[0] / len(ranges)
    least_m = float(edges[-2])
    seen = np.mean([bool((values >= least_m).any()) for values in hits])
    if shares[-1] < max(CAPPED_SHARE, CAPPED_TIMES * shares[:-2].max()) or seen < SEEN_IN:
        return []
    pile = ranges[ranges >= least_m]
    middle = float(np.median(pile))
    exact = np.abs(pile - middle) < SAME_M
    low_m = float(pile[exact].min() if exact.mean() > 0.9 else np.quantile(pile, 0.02))
    limit_m = np.floor(low_m * 1000 + 0.01) / 1000
    values = {"share": float(shares[-1]), "range": middle, "reach": float(some[0].max_m)}
    return [Finding("max-range", (Evidence("capped", values),), {"range_m": float(limit_m)})]


def empty_scans(scans: RecordedScans, begin_s: float) -> list[Finding]:
    """Return a finding where many scans in a row have no beam that hit something."""
    empty = np.array([not scan.hits.any() for scan in scans.scans], bool)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], empty, [0]])))
    rows = ends.reshape(-1, 2)
    long = rows[rows[:, 1] - rows[:, 0] >= EMPTY_SCANS]
    if not len(long):
        return []
    first, end = long[(long[:, 1] - long[:, 0]).argmax()]
    readings = np.concatenate([scan.ranges_m for scan in scans.scans[first:end]])
    read = {"zeros": float((readings == 0).mean()), "nan": float(np.isnan(readings).mean())}
    numbers = {
        "scans": float(end - first),
        "from_s": float(scans.t_s[first]) - begin_s,
        "to_s": float(scans.t_s[end - 1]) - begin_s,
    }
    details: dict[str, Value] = {"rows": len(long), "all": float(empty.sum()), "of": scans.size}
    return [Finding("scans-empty", (Evidence("empty", read | details),), numbers, details=details)]


Check = Callable[[RecordedDrive, RecordedScans], list[Finding]]
# what numbers cannot be, whatever the drive: asked by the doctor, and before every replay, as it costs little
PLAUSIBLE: tuple[Check, ...] = (
    lambda drive, scans: coarse_times(drive),
    lambda drive, scans: odometry_jumps(drive),
    lambda drive, scans: no_return_ranges(scans),
    lambda drive, scans: empty_scans(scans, drive.begin_s),
)


def implausible(drive: RecordedDrive, scans: RecordedScans) -> list[Finding]:
    """Return what cannot be, by the numbers of a drive and of its scans alone."""
    seen = drive if len(drive.picture_t_s) else replace(drive, picture_t_s=scans.t_s, sees="scans")
    return [finding for check in PLAUSIBLE for finding in check(seen, scans)]
