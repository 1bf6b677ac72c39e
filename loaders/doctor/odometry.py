"""Odometry against truth: which interpretation of the odometry explains best what the robot really did.

The drive is cut into segments by the truth, the odometry of a segment is combined by each interpretation, and
what counts is the share of the true movement that it leaves unexplained.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.values import F64, I32, motions_between, rotated, wrap_angle

from .findings import (
    DEGREE,
    TURNS,
    Evidence,
    Finding,
    RecordedDrive,
    RecordedOdometry,
    RecordedTruth,
    direction_finding,
    frame_finding,
    gain_finding,
    motions_of,
    scale_finding,
    turn_finding,
)
from .mast import Mast, mast_finding, mast_of

FASTEST_M_S = 12.0  # faster than any robot that looks around drives, as the 95th percentile
STEP_M = 0.05  # poses are compared over steps of this length
ONE_WAY = 0.8  # share of the distance in one direction
SEGMENT_M, SEGMENT_RAD = 0.15, 0.2  # a segment ends after this distance or turn
MOST_SEGMENTS = 400  # spread over the drive
FEWEST_SEGMENTS = 8
WORST_SHARE = 0.15  # share of the segments that slips and jumps of the truth may affect
GAINS: F64 = np.geomspace(0.3, 3.3, 200)  # actual over measured turns; skidding wheels over-read by a third


@dataclass(frozen=True, slots=True)
class Interpretation:
    """What the numbers of an odometry might mean."""

    turn: str = ""  # a key of TURNS
    frame: str = ""  # "": the robot's; "world": steps along fixed axes; "absolute": poses


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well odometry, by one interpretation, agrees with the truth."""

    interpretation: Interpretation
    shift_s: float  # taken from the odometry's times
    gain: float  # true turn over measured turn
    scale: float  # true over measured distance
    offset_rad: float  # true direction of travel minus measured, in the robot's frame
    turn_unexplained: float  # share of the squared turns, 0 to about 1
    way_unexplained: float  # share of the squared distances
    segments: int
    mast: Mast | None = (
        None  # where on the robot the truth is measured; None: at the wheels, as far as is seen
    )

    @property
    def unexplained(self) -> float:
        """The mean of both shares."""
        return (self.turn_unexplained + self.way_unexplained) / 2


@dataclass(frozen=True, slots=True, eq=False)
class TruthSegments:
    """The truth, cut into L segments."""

    begin_s: F64  # (L,)
    end_s: F64  # (L,)
    moved: F64  # (L, 3) the true motion, in the robot's frame at the start of the segment


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


def interpretations(odometry: RecordedOdometry) -> list[Interpretation]:
    """Return the interpretations to try; the first one is the expected one."""
    frames = ("",) if odometry.poses else ("", "world", "absolute")
    return [Interpretation(turn, frame) for frame in frames for turn in TURNS]


def motions_by(odometry: RecordedOdometry, interpretation: Interpretation) -> F64:
    """Return the robot's motions (K, 3) if the numbers are what the interpretation says."""
    motions = motions_of(odometry, TURNS[interpretation.turn])
    if interpretation.frame == "absolute":
        return motions_between(motions)
    if interpretation.frame == "world":
        heading = np.cumsum(motions[:, 2]) - motions[:, 2]
        ahead, aside = rotated(motions[:, 0], motions[:, 1], -heading)
        return np.column_stack([ahead, aside, motions[:, 2]])
    return motions


def agreement(
    odometry: RecordedOdometry, segments: TruthSegments, interpretation: Interpretation, shift_s: float = 0.0
) -> Agreement | None:
    """Compare odometry, interpreted and shifted in time, with the truth; None for too few segments."""
    motions = motions_by(odometry, interpretation)
    t_s = odometry.t_s - shift_s
    ends = (np.searchsorted(t_s, at, side="right") for at in (segments.begin_s, segments.end_s))
    begin, end = (at.astype(np.int32) for at in ends)
    used = end > begin
    if used.sum() < FEWEST_SEGMENTS:
        return None
    begin, end, moved = begin[used], end[used], segments.moved[used]
    turned = _sums(motions[:, 2], begin, end)
    gain, turn_unexplained = _fit_turns(turned, moved[:, 2])
    ahead, aside = _ways(motions, gain, begin, end)
    mast = mast_of(ahead + 1j * aside, moved)
    if mast is not None:
        place = complex(mast.ahead_m, mast.left_m)
        away = (np.exp(1j * moved[:, 2]) - 1) * place
        moved = moved - np.column_stack([away.real, away.imag, np.zeros(len(away))])
    scale, offset, way_unexplained = _fit_ways(ahead, aside, moved)
    count = int(used.sum())
    return Agreement(
        interpretation, shift_s, gain, scale, offset, turn_unexplained, way_unexplained, count, mast
    )


def _sums(values: F64, begin: I32, end: I32) -> F64:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[end] - total[begin])


def _ways(motions: F64, gain: float, begin: I32, end: I32) -> tuple[F64, F64]:
    """Return the displacement over each segment, in the robot's frame at its beginning."""
    turns = motions[:, 2] * gain
    heading = np.cumsum(turns) - turns
    bent = (turns - motions[:, 2]) / 2  # by which an arc's chord turns further than it was measured
    x, y = rotated(motions[:, 0], motions[:, 1], heading + bent)
    at = np.append(heading, heading[-1] + turns[-1])[begin]
    return rotated(_sums(x, begin, end), _sums(y, begin, end), -at)


def _fit_turns(measured: F64, actual: F64) -> tuple[float, float]:
    """Return the gain, and the share of the squared turns that it does not explain."""
    whole = _best_part(actual**2)
    if not whole.sum() > 1e-9:
        return 1.0, 0.0
    errors = wrap_angle(actual - GAINS[:, None] * measured) ** 2
    shares = np.sort(errors, axis=1)[:, : len(whole)].sum(axis=1) / whole.sum()
    best = int(shares.argmin())
    return float(GAINS[best]), float(min(shares[best], 2.0))


def _fit_ways(ahead: F64, aside: F64, moved: F64) -> tuple[float, float, float]:
    """Return scale and direction, and the share of the squared distances that they do not explain."""
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
    directions = np.linspace(-np.pi, np.pi, 73)[:-1]
    best = directions[np.cos(angles[:, None] - directions).clip(0.5).sum(axis=0).argmax()]
    near = np.abs(wrap_angle(angles - best)) < np.pi / 4
    return float(np.angle(units[near].sum())) if near.any() else float(best)


def _best_part(squares: F64) -> F64:
    return np.sort(squares)[: int(np.ceil(len(squares) * (1 - WORST_SHARE)))]


def shifts(drive: RecordedDrive) -> F64:
    """Return the delays to try, in seconds: up to two updates, or two seconds of dense records."""
    steps = [np.diff(times) for times in (drive.odometry.t_s, drive.truth.t_s) if len(times) > 1]
    spacing = max((float(np.median(s[s > 0])) for s in steps if (s > 0).any()), default=1.0)
    most = 2.0 if spacing < 0.5 else 2.5 * spacing
    return np.linspace(-most, most, 41)


def moves_of(poses: F64) -> F64:
    """Return the steps (n, 2) between poses at intervals of `STEP_M`, in the frame at each step's end."""
    distances = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T))
    chosen = np.unique(np.searchsorted(distances, np.arange(0.0, min(distances[-1], 1000.0), STEP_M)))
    some = poses[chosen]
    step = np.diff(some[:, :2], axis=0)
    return np.column_stack(rotated(step[:, 0], step[:, 1], -some[1:, 2]))


def direction_of(odometry: RecordedOdometry, interpretation: Interpretation) -> float:
    """Return the direction of nearly all travel in the robot's frame; 0 if there is none."""
    if odometry.poses:
        return main_direction(moves_of(odometry.values * [1, 1, TURNS[interpretation.turn]]))
    return main_direction(motions_by(odometry, interpretation))


def main_direction(motions: F64) -> float:
    """Return the direction of nearly all of the distance of motions (K, 3); 0 if there is none."""
    x, y = motions[:, 0].sum(), motions[:, 1].sum()
    whole = np.hypot(motions[:, 0], motions[:, 1]).sum()
    return float(np.arctan2(y, x)) if np.hypot(x, y) > ONE_WAY * whole else 0.0


# Findings from that comparison; none where all is well.

ACCEPTED_SHARE = 0.2  # up to which an interpretation is accepted (healthy drives: below 0.02)
FAR_BETTER = 0.4  # another interpretation must leave less than this share of what the first one leaves
UNEXPLAINED_SHARE = 0.4  # unexplained by the best interpretation: none explains the truth
WHOLE_TURN = 6.6  # rad: headings in radians are usually within a full turn
FAR_OFF_RAD = np.radians(25)  # of a direction
FAR_GAIN_LOG = 0.2  # natural log of a ratio of gains
WORTH_S = 0.15  # a smaller delay is not reported


def comparable(drive: RecordedDrive) -> str:
    """Return why odometry and truth cannot be compared; "" where they can."""
    movements = min(len(segments_of(drive.truth).end_s), drive.odometry.size)
    if movements >= FEWEST_SEGMENTS:
        return ""
    return (
        f"there are {movements} movements of {SEGMENT_M:g} m or 11 degrees, and {FEWEST_SEGMENTS} are needed"
    )


def compared_with_truth(drive: RecordedDrive, movement_s: float | None = None) -> list[Finding]:
    """Return what is wrong with the odometry or the truth; `movement_s` aligns the two, for any delay."""
    if drive.truth.size < 2 or drive.odometry.size < 2:
        return []
    findings: list[Finding] = []
    segments, usual = segments_of(drive.truth), None
    if np.abs(drive.truth.poses[:, 2]).max() > WHOLE_TURN:
        segments, findings = _in_degrees(drive, segments)
    usual = agreement(drive.odometry, segments, Interpretation())
    if usual is None:
        return findings
    best = best_agreement(drive, segments, usual)
    if best.unexplained > UNEXPLAINED_SHARE and movement_s is not None:
        late = agreement(drive.odometry, segments, Interpretation(), round(movement_s, 1))
        best = late if late and late.unexplained < FAR_BETTER * best.unexplained else best
    if best.unexplained > UNEXPLAINED_SHARE:
        return [*findings, Finding("disagreement", (_agreement(best),))]
    if best.shift_s:
        findings.append(_delay(best, usual))
    return [*findings, *_about(best, usual, drive)]


def best_agreement(drive: RecordedDrive, segments: TruthSegments, usual: Agreement) -> Agreement:
    """Return the interpretation and delay that explain the truth best, or the usual one unless far worse."""
    agreements = [
        agreed for r in interpretations(drive.odometry) if (agreed := agreement(drive.odometry, segments, r))
    ]
    best = min(agreements, key=lambda agreed: agreed.unexplained)
    if best.unexplained > ACCEPTED_SHARE:  # a delay may hide which interpretation is right
        best = min(
            (_shifted(drive, segments, agreed) for agreed in agreements),
            key=lambda agreed: agreed.unexplained,
        )
    as_it_stands = usual.unexplained <= ACCEPTED_SHARE and abs(usual.offset_rad) <= FAR_OFF_RAD
    if as_it_stands or best.unexplained > FAR_BETTER * usual.unexplained:
        best = usual
    return _shifted(drive, segments, best) if not best.shift_s else best


def _shifted(drive: RecordedDrive, segments: TruthSegments, at_once: Agreement) -> Agreement:
    """Try delays; return the given agreement unless one explains far more."""
    candidates = [
        agreement(drive.odometry, segments, at_once.interpretation, float(s)) for s in shifts(drive)
    ]
    known = [agreed for agreed in candidates if agreed is not None]
    best = min(known, key=lambda agreed: agreed.unexplained, default=at_once)
    if best.unexplained > FAR_BETTER * at_once.unexplained or at_once.unexplained < 0.01:
        return at_once
    near = [agreed for agreed in known if agreed.unexplained <= 1.2 * best.unexplained + 0.002]
    middle = near[len(near) // 2]
    return middle if abs(middle.shift_s) > WORTH_S else at_once


def _in_degrees(drive: RecordedDrive, segments: TruthSegments) -> tuple[TruthSegments, list[Finding]]:
    """Check whether the truth's headings are in degrees; return the segments to use, and findings."""
    other = segments_of(drive.truth, DEGREE)
    best = [
        min(
            (
                a.unexplained
                for r in interpretations(drive.odometry)
                if (a := agreement(drive.odometry, cut, r))
            ),
            default=1.0,
        )
        for cut in (segments, other)
    ]
    if best[1] > FAR_BETTER * best[0]:
        return segments, []
    largest = float(np.abs(drive.truth.poses[:, 2]).max())
    seen = Evidence("degrees", {"largest": largest, "if_degrees": best[1], "if_radians": best[0]})
    options = {"truth_turn_scale": DEGREE}
    return other, [Finding("truth-degrees", (seen,), {"largest": largest}, options)]


def _delay(best: Agreement, usual: Agreement) -> Finding:
    late = round(best.shift_s, 2)
    seen = Evidence("moved", {"by_s": -late, "before": usual.unexplained, "after": best.unexplained})
    return Finding("odometry-delay", (seen,), {"delay_s": late}, {"odometry_offset_s": -late})


def _agreement(best: Agreement, usual: Agreement | None = None) -> Evidence:
    """Return the numbers of a comparison with the truth, with those of the usual interpretation."""
    values: dict[str, float | str] = {
        "segments": best.segments,
        "gain": best.gain,
        "scale": best.scale,
        "turn_unexplained": best.turn_unexplained,
        "way_unexplained": best.way_unexplained,
    }
    if usual is not None and not usual.interpretation == Interpretation() == best.interpretation:
        values |= {"usual_turn": usual.turn_unexplained, "usual_way": usual.way_unexplained}
    return Evidence("agreement", values)


def _about(best: Agreement, usual: Agreement, drive: RecordedDrive) -> list[Finding]:
    findings, seen = list[Finding](), _agreement(best, usual)
    if best.interpretation.turn:
        findings.append(turn_finding(best.interpretation.turn, seen, unexplained=best.unexplained))
    if best.interpretation.frame:
        offset = _offset(best, drive) if best.interpretation.frame == "world" else 0.0
        finding = frame_finding(
            best.interpretation.frame, seen, offset_rad=offset, unexplained=best.unexplained
        )
        findings.append(finding)
    if (
        abs(best.offset_rad) > FAR_OFF_RAD
        and best.interpretation.frame != "world"
        and best.way_unexplained < UNEXPLAINED_SHARE
    ):
        travel = Evidence("travel", {"off_deg": float(np.degrees(best.offset_rad))})
        findings.append(direction_finding(_offset(best, drive), travel, seen))
    if best.mast is not None and not best.interpretation.turn:
        findings.append(mast_finding(best.mast))
    if abs(np.log(best.scale)) > 0.35 and best.way_unexplained < UNEXPLAINED_SHARE:
        findings.append(_scale(best, drive, seen))
    gains_apart = abs(np.log(best.gain / drive.turn_gain)) > FAR_GAIN_LOG
    if not findings and best.turn_unexplained < UNEXPLAINED_SHARE and gains_apart:
        findings.append(gain_finding(best.gain, drive.turn_gain, seen))
    return findings


def _offset(best: Agreement, drive: RecordedDrive) -> float:
    """Return the forward direction: the odometry's own if similar, since that excludes drift."""
    own = -direction_of(drive.odometry, best.interpretation)
    near = own and abs(wrap_angle(np.array(own - best.offset_rad))) < FAR_OFF_RAD
    return own if near else best.offset_rad


def _scale(best: Agreement, drive: RecordedDrive, seen: Evidence) -> Finding:
    """Report whose lengths are wrong: the truth's, if it spans far more than the map."""
    span = float(np.ptp(drive.truth.poses[:, :2], axis=0).max())
    if best.scale > 1 and (span > 3 * drive.size_m or _too_fast(drive)):
        spans = Evidence("span", {"span": span, "map_m": drive.size_m})
        return scale_finding(1 / best.scale, spans, seen, truth=True)
    return scale_finding(best.scale, seen)


def _too_fast(drive: RecordedDrive) -> bool:
    segments = segments_of(drive.truth)
    took_s = np.maximum(segments.end_s - segments.begin_s, 1e-3)
    return bool(np.median(np.hypot(segments.moved[:, 0], segments.moved[:, 1]) / took_s) > FASTEST_M_S)
