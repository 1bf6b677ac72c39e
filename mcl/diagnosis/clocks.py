"""Clocks of pictures, odometry and truth that have nothing in common, and what would bring them together."""

from __future__ import annotations

import numpy as np

from ..arrays import F64
from .findings import Evidence, Finding, RecordedDrive

FEW = 0.2  # share of the pictures
FEWEST = 8  # records
MAX_GAP_S = 1.0  # truth is interpolated across no more
MOST_TIMES = 5000  # of one kind that are compared
MOST_PICTURES = 60
ALIKE_S = 2e-3  # times that differ by less are the same
MOST, OTHER = 0.8, 0.5  # share of the times that meet with an offset, and that may meet with any other


def same_moments(late_t_s: F64, t_s: F64) -> float | None:
    """Return by how much some times are late where nearly all of them or of the others are then the same.

    None where no offset does that, or several do, as with times that come evenly.
    """
    most = (MOST_PICTURES, MOST_TIMES) if len(late_t_s) <= len(t_s) else (MOST_TIMES, MOST_PICTURES)
    late, ours = late_t_s[: most[0]], t_s[: most[1]]
    fewer = min(len(late), len(ours))
    if fewer < FEWEST:
        return None
    apart = np.sort((late[:, None] - ours).ravel())
    met = np.searchsorted(apart, apart + ALIKE_S, side="right") - np.arange(len(apart))
    best = int(met.argmax())
    others = met[np.abs(apart - apart[best]) > 2 * ALIKE_S]
    if met[best] < MOST * fewer or (len(others) and others.max() > OTHER * fewer):
        return None
    return float(np.median(apart[best : best + met[best]]))


def clocks_apart(drive: RecordedDrive, movement_s: float | None = None) -> list[Finding]:
    """Return whether pictures, odometry and truth have no time in common.

    `movement_s` is what has to be added to the truth's times so that it moves when the odometry does.
    """
    findings: list[Finding] = []
    shared = {name: _overlap(times, drive.picture_t_s) for name, times in _others(drive)}
    for name, times in _others(drive):
        ours = drive.picture_t_s
        if not len(times) or not len(ours) or shared[name]:
            continue
        other = shared["truth" if name == "odometry" else "odometry"]
        moved_s = None if movement_s is None or not other else movement_s
        late, by = _late(times, ours, moved_s if name == "odometry" or moved_s is None else -moved_s)
        spans: dict[str, float | str] = {
            "name": name,
            "from_s": float(times.min()),
            "to_s": float(times.max()),
        }
        spans |= {"pictures_from_s": float(ours.min()), "pictures_to_s": float(ours.max())}
        evidence, options = (Evidence("spans", spans),), {f"{name}_offset_s": -round(late, 3)}
        findings.append(Finding(f"{name}-clock", evidence, {"late_s": late}, options, {"by": by}))
    return findings


def _others(drive: RecordedDrive) -> tuple[tuple[str, F64], ...]:
    return ("odometry", drive.odometry.t_s), ("truth", drive.truth.t_s)


def _overlap(times: F64, ours: F64) -> bool:
    return bool(len(times) and len(ours) and times.min() <= ours.max() and ours.min() <= times.max())


def _late(times: F64, ours: F64, moved_s: float | None) -> tuple[float, str]:
    """Return how late a clock is, by the best that is known, and what that is: a word for the finding."""
    exact = same_moments(times, ours)
    if exact is not None:
        return exact, "pictures"
    if moved_s is not None:
        return moved_s, "movement"
    return float(times.min() - ours.min()), "beginnings"


def truth_apart(drive: RecordedDrive) -> list[Finding]:
    """Return whether the truth passes the pictures by: none at their times, though it goes on beside them."""
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
    seen = {"share": known, "pictures": len(pictures), "gap_s": MAX_GAP_S, "age_s": late}
    return [Finding("truth-apart", (Evidence("no-truth", seen),), {"share": known, "age_s": late})]
