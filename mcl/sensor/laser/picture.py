"""What people are shown of one scan: its points on the map, the beams that disagree, and a sentence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...values.arrays import F64
from ...values.geometry import rotated
from ...values.pose_sensor import Shown, ShownMarks
from .beams import BeamJudgment
from .reading import LaserReading

WORTH_SAYING = 0.05  # share of the beams
# by judgment: what is said of such beams
WORDS: Mapping[str, str] = {
    "short": "end {} before the wall: something stands there",
    "beyond": "end {} behind a wall of the map: it was moved, or is glass",
    "unknown": "end where nobody has mapped",
    "miss": "hit nothing",
}
DRAWN: Mapping[str, str] = {
    "short": "beams that end short of the wall",
    "beyond": "beams that end beyond a wall",
    "unknown": "beams that end in unknown space",
}


def shown(
    reading: LaserReading, judgment: BeamJudgment, poses: Mapping[str, F64], nats: Mapping[str, float]
) -> Shown:
    """Return what to show of a scan that was judged at the estimate."""
    words, lengths = _words(judgment, nats)
    marks = [
        ShownMarks(f"scan at the {name}", "map", _scan_at(reading, pose), of=name)
        for name, pose in poses.items()
    ]
    for name, drawn in DRAWN.items():
        which = judgment.are(name)
        ends, expected = judgment.ends[which], judgment.expected_ends[which]
        strips = ends[:, None] if name == "unknown" else np.stack([ends, expected], axis=1)
        marks.append(ShownMarks(drawn, "map", strips, np.zeros(len(strips), np.bool_)))
    return Shown(words, marks=tuple(marks), lengths_m=lengths)


def _scan_at(reading: LaserReading, pose: F64) -> F64:
    """Return all points (K, 1, 2) of the scan in the map's frame."""
    points = reading.scan.points()
    x, y = rotated(points[:, 0], points[:, 1], pose[2])
    return np.stack([x + pose[0], y + pose[1]], axis=1)[:, None]


def _words(judgment: BeamJudgment, nats: Mapping[str, float]) -> tuple[str, tuple[float, ...]]:
    total, lengths = len(judgment.judged), list[float]()
    words = f"{judgment.count('agrees')} of {total} beams agree with the map at the estimate."
    for name, said in WORDS.items():
        which = judgment.are(name)
        if which.sum() < max(WORTH_SAYING * total, 1):
            continue
        words += f" {which.sum()} {said}."
        if "{}" in said:
            lengths.append(float(np.median(np.abs(judgment.expected_m - judgment.measured_m)[which])))
    at = ", ".join(f"{value:.1f} nats at the {name}" for name, value in nats.items())
    return f"{words} Log-likelihood: {at} (0 if all agreed).", tuple(lengths)
