"""What the comparison of odometry with truth says: findings, and none where all is well."""

from __future__ import annotations

import numpy as np

from ..geometry import wrap_angle
from .findings import (
    DEGREE,
    Evidence,
    Finding,
    RecordedDrive,
    direction_finding,
    frame_finding,
    gain_finding,
    scale_finding,
    turn_finding,
)
from .odometry import Agreement, Reading, TruthSegments, agreement, readings, segments_of, shifts
from .plausibility import FASTEST_M_S, direction_of

GOOD = 0.2  # unexplained share up to which a reading is believed as it stands (healthy drives: under 0.02)
FAR_BETTER = 0.4  # another reading has to leave less than this share of what the first one leaves
POOR = 0.4  # no reading at all explains the truth
WHOLE_TURN = 6.6  # rad: headings in radians are usually within a whole turn
FAR_OFF = np.radians(25)  # of a direction
FAR_GAIN = 0.2  # natural log of a ratio of gains
WORTH_S = 0.15  # a smaller delay is not told


def compared_with_truth(drive: RecordedDrive, movement_s: float | None = None) -> list[Finding]:
    """Return what is wrong with the odometry, or with the truth, by the other.

    `movement_s` is what would be added to the truth's times by how both move, for a delay of any length.
    """
    if drive.truth.size < 2 or drive.odometry.size < 2:
        return []
    findings: list[Finding] = []
    legs, usual = segments_of(drive.truth), None
    if np.abs(drive.truth.poses[:, 2]).max() > WHOLE_TURN:
        legs, findings = _in_degrees(drive, legs)
    usual = agreement(drive.odometry, legs, Reading())
    if usual is None:
        return findings
    best = best_agreement(drive, legs, usual)
    if best.unexplained > POOR and movement_s is not None:
        late = agreement(drive.odometry, legs, Reading(), round(movement_s, 1))
        best = late if late and late.unexplained < FAR_BETTER * best.unexplained else best
    if best.unexplained > POOR:
        return [*findings, Finding("disagreement", (_agreement(best),))]
    if best.shift_s:
        findings.append(_delay(best, usual))
    return [*findings, *_about(best, usual, drive)]


def best_agreement(drive: RecordedDrive, legs: TruthSegments, usual: Agreement) -> Agreement:
    """Find the reading and delay that explain the truth best; the usual one unless another is far better."""
    found = [one for r in readings(drive.odometry) if (one := agreement(drive.odometry, legs, r))]
    best = min(found, key=lambda one: one.unexplained)
    if best.unexplained > GOOD:  # a delay may hide which reading is right
        best = min((_shifted(drive, legs, one) for one in found), key=lambda one: one.unexplained)
    as_it_stands = usual.unexplained <= GOOD and abs(usual.offset_rad) <= FAR_OFF
    if as_it_stands or best.unexplained > FAR_BETTER * usual.unexplained:
        best = usual
    return _shifted(drive, legs, best) if not best.shift_s else best


def _shifted(drive: RecordedDrive, legs: TruthSegments, at_once: Agreement) -> Agreement:
    """Try delays; the agreement that was given unless one explains far more."""
    tried = [agreement(drive.odometry, legs, at_once.reading, float(s)) for s in shifts(drive)]
    known = [one for one in tried if one is not None]
    best = min(known, key=lambda one: one.unexplained, default=at_once)
    if best.unexplained > FAR_BETTER * at_once.unexplained or at_once.unexplained < 0.01:
        return at_once
    near = [one for one in known if one.unexplained <= 1.2 * best.unexplained + 0.002]
    middle = near[len(near) // 2]
    return middle if abs(middle.shift_s) > WORTH_S else at_once


def _in_degrees(drive: RecordedDrive, legs: TruthSegments) -> tuple[TruthSegments, list[Finding]]:
    """Check whether the truth's headings are in degrees; return the segments to use, and findings."""
    other = segments_of(drive.truth, DEGREE)
    best = [
        min(
            (a.unexplained for r in readings(drive.odometry) if (a := agreement(drive.odometry, one, r))),
            default=1.0,
        )
        for one in (legs, other)
    ]
    if best[1] > FAR_BETTER * best[0]:
        return legs, []
    largest = float(np.abs(drive.truth.poses[:, 2]).max())
    seen = Evidence("degrees", {"largest": largest, "if_degrees": best[1], "if_radians": best[0]})
    options = {"truth_turn_scale": DEGREE}
    return other, [Finding("truth-degrees", (seen,), {"largest": largest}, options)]


def _delay(found: Agreement, usual: Agreement) -> Finding:
    """Report that odometry's clock is not the truth's."""
    late = round(found.shift_s, 2)
    seen = Evidence("moved", {"by_s": -late, "before": usual.unexplained, "after": found.unexplained})
    return Finding("odometry-delay", (seen,), {"delay_s": late}, {"odometry_offset_s": -late})


def _agreement(found: Agreement, usual: Agreement | None = None) -> Evidence:
    """Return the numbers of a comparison with the truth, and beside them those of the usual reading."""
    values: dict[str, float | str] = {
        "segments": found.legs,
        "gain": found.gain,
        "scale": found.scale,
        "turn_unexplained": found.turn_unexplained,
        "way_unexplained": found.way_unexplained,
    }
    if usual is not None and not usual.reading == Reading() == found.reading:
        values |= {"usual_turn": usual.turn_unexplained, "usual_way": usual.way_unexplained}
    return Evidence("agreement", values)


def _about(best: Agreement, usual: Agreement, drive: RecordedDrive) -> list[Finding]:
    """Return what the best reading means."""
    findings, seen = list[Finding](), _agreement(best, usual)
    if best.reading.turn:
        findings.append(turn_finding(best.reading.turn, seen, unexplained=best.unexplained))
    if best.reading.frame:
        offset = _offset(best, drive) if best.reading.frame == "world" else 0.0
        found = frame_finding(best.reading.frame, seen, offset_rad=offset, unexplained=best.unexplained)
        findings.append(found)
    if abs(best.offset_rad) > FAR_OFF and best.reading.frame != "world" and best.way_unexplained < POOR:
        travel = Evidence("travel", {"off_deg": float(np.degrees(best.offset_rad))})
        findings.append(direction_finding(_offset(best, drive), travel, seen))
    if abs(np.log(best.scale)) > 0.35 and best.way_unexplained < POOR:
        findings.append(_scale(best, drive, seen))
    if not findings and best.turn_unexplained < POOR and _gains_apart(best, drive):
        findings.append(gain_finding(best.gain, drive.turn_gain, seen))
    return findings


def _offset(best: Agreement, drive: RecordedDrive) -> float:
    """Return where forward is: by the odometry alone if near, as the robot's drift is not in it."""
    own = -direction_of(drive.odometry, best.reading)
    near = own and abs(wrap_angle(np.array(own - best.offset_rad))) < FAR_OFF
    return own if near else best.offset_rad


def _gains_apart(best: Agreement, drive: RecordedDrive) -> bool:
    return bool(abs(np.log(best.gain / drive.turn_gain)) > FAR_GAIN)


def _scale(best: Agreement, drive: RecordedDrive, seen: Evidence) -> Finding:
    """Report whose lengths are wrong: the truth's, where it spans far more than the map is."""
    span = float(np.ptp(drive.truth.poses[:, :2], axis=0).max())
    if best.scale > 1 and (span > 3 * drive.size_m or _too_fast(drive)):
        return scale_finding(
            1 / best.scale, Evidence("span", {"span": span, "map_m": drive.size_m}), seen, truth=True
        )
    return scale_finding(best.scale, seen)


def _too_fast(drive: RecordedDrive) -> bool:
    """Return whether no robot goes as the truth does."""
    legs = segments_of(drive.truth)
    speeds = np.hypot(legs.moved[:, 0], legs.moved[:, 1]) / np.maximum(legs.end_s - legs.begin_s, 1e-3)
    return bool(np.median(speeds) > FASTEST_M_S)
