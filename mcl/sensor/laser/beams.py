"""Each beam of a scan judged at one pose, and what people are shown of that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...values import F32, F64, OCCUPIED, U8, UNKNOWN, Bool, Shown, ShownMarks, compose, rotated
from .models import LaserMap, nats_of_beams
from .rays import Rays
from .reading import LaserReading

AGREES, SHORT, BEYOND, UNMAPPED, MISS = range(5)
JUDGMENTS = ("agrees", "short", "beyond", "unknown", "miss")  # by these numbers
AGREES_M = 0.2  # a beam that ends nearer to something on the map agrees with it
SHORT_WORTH = 0.5  # a short beam counts half as much as one beyond a wall: people end beams early, none late
LEAST_MAPPED = 0.5  # of the beams that hit something: where most end in unknown space, they tell nothing
WORTH_SAYING = 0.05  # share of the beams
SAID: Mapping[str, str] = {
    "short": "end {} before the wall: something stands there",
    "beyond": "end {} behind a wall of the map: the robot is elsewhere, or the wall was moved or is glass",
    "unknown": "end where nobody has mapped",
    "miss": "hit nothing",
}


@dataclass(frozen=True, slots=True, eq=False)
class BeamJudgment:
    """The B beams of a reading at one pose.

    "short" ends well before what the map has, "beyond" passes through it, "unknown" ends where nobody has
    been, "miss" hit nothing.
    """

    judged: U8  # (B,) numbers of `JUDGMENTS`
    measured_m: F32  # (B,) the laser's reach where nothing was hit
    expected_m: F32  # (B,) to the first occupied cell, the laser's reach where there is none
    nats: F32  # (B,) by the calibrated model, <= 0; 0 for misses
    ends: F64  # (B, 2) x_m, y_m in the map's frame
    expected_ends: F64  # (B, 2)

    def are(self, judgment: str) -> Bool:
        """Which beams (B,) are judged so: a word of `JUDGMENTS`."""
        return np.asarray(self.judged == JUDGMENTS.index(judgment))

    def count(self, judgment: str) -> int:
        """Return how many beams are judged so."""
        return int(self.are(judgment).sum())

    @property
    def against(self) -> float | None:
        """The share of the beams that speak against the pose; None where most end in unknown space."""
        hits = len(self.judged) - self.count("miss")
        mapped = hits - self.count("unknown")
        wrong = self.count("beyond") + SHORT_WORTH * self.count("short")
        return wrong / mapped if mapped > LEAST_MAPPED * hits else None

    def gap_m(self, judgment: str) -> float:
        """Return how far beams that are judged so end from where the map has a wall: the median."""
        return float(np.median(np.abs(self.expected_m - self.measured_m)[self.are(judgment)]))

    @property
    def words(self) -> tuple[str, tuple[float, ...]]:
        """How many beams agree and how the others do not, with {} for each of the lengths in meters."""
        total, lengths = len(self.judged), list[float]()
        fits = self.count("agrees") >= self.count("short") + self.count("beyond")  # else the pose is doubtful
        words = f"{self.count('agrees')} of {total} beams agree with the map at the estimate."
        for name, said in SAID.items():
            if (count := self.count(name)) < max(WORTH_SAYING * total, 1):
                continue
            words += f" {count} {said if fits else said.partition(':')[0]}."
            if "{}" in said:
                lengths.append(self.gap_m(name))
        return words if fits else f"{words} The robot is elsewhere, or much has changed.", tuple(lengths)


def judge(map_: LaserMap, rays: Rays, reading: LaserReading, pose: F64) -> BeamJudgment:
    """Judge all beams of a reading at a pose (3,) in the map's frame."""
    laser = compose(pose, reading.scan.mount)
    angles = reading.angles_rad - reading.scan.mount[2]
    expected = rays.cast(laser[None], angles, reading.max_m)[0]
    along = np.stack([np.cos(laser[2] + angles), np.sin(laser[2] + angles)], axis=1)
    ends, expected_ends = (laser[:2] + reach[:, None] * along for reach in (reading.ranges_m, expected))
    states = map_.occupancy.states_at(ends)
    judged = np.full(reading.size, SHORT, np.uint8)
    judged[states == UNKNOWN] = UNMAPPED
    judged[reading.ranges_m > expected + AGREES_M] = BEYOND
    judged[(map_.distances.at(ends) < AGREES_M) | (states == OCCUPIED)] = AGREES
    judged[~reading.hits] = MISS
    nats = np.zeros(reading.size, np.float32)
    nats[reading.hits] = nats_of_beams(map_, reading, ends[reading.hits])
    return BeamJudgment(judged, reading.ranges_m, expected, nats, ends, expected_ends)


def shown(
    reading: LaserReading, judgment: BeamJudgment, poses: Mapping[str, F64], nats: Mapping[str, float]
) -> Shown:
    """Return the scan on the map at each of the poses, and the beams that disagree with the estimate."""
    points, marks = reading.scan.points(), list[ShownMarks]()
    for name, pose in poses.items():
        x, y = rotated(points[:, 0], points[:, 1], pose[2])
        places = np.stack([x + pose[0], y + pose[1]], axis=1)[:, None]
        marks.append(ShownMarks(f"scan at the {name}", "map", places, of=name))
    for name in ("short", "beyond", "unknown"):
        ends, expected = judgment.ends[judgment.are(name)], judgment.expected_ends[judgment.are(name)]
        strips = ends[:, None] if name == "unknown" else np.stack([ends, expected], axis=1)
        none = np.zeros(len(strips), np.bool_)
        marks.append(ShownMarks(f"beams judged {name}", "map", strips, none, of=name))
    words, lengths = judgment.words
    at = ", ".join(f"{value:z.1f} nats at the {name}" for name, value in nats.items())
    return Shown(f"{words} Log-likelihood: {at} (0 if all agreed).", {}, tuple(marks), lengths)
