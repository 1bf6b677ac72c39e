"""Each beam of a scan judged at one pose: what it measured, what the map would have it measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...values.arrays import F32, F64, U8, Bool
from ...values.geometry import compose
from ...values.occupancy import OCCUPIED, UNKNOWN
from .models import LaserMap, nats_of_beams
from .rays import Rays
from .reading import LaserReading

AGREES, SHORT, BEYOND, UNMAPPED, MISS = range(5)
JUDGMENTS = ("agrees", "short", "beyond", "unknown", "miss")  # by these numbers
AGREES_M = 0.2  # a beam that ends nearer to something on the map agrees with it


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


def judge(there: LaserMap, rays: Rays, reading: LaserReading, pose: F64) -> BeamJudgment:
    """Judge all beams of a reading at a pose (3,) in the map's frame."""
    laser = compose(pose, reading.scan.mount)
    angles = reading.angles_rad - reading.scan.mount[2]
    expected = rays.cast(laser[None], angles, reading.max_m)[0]
    along = np.stack([np.cos(laser[2] + angles), np.sin(laser[2] + angles)], axis=1)
    ends, expected_ends = (laser[:2] + reach[:, None] * along for reach in (reading.ranges_m, expected))
    off_m, states = there.distances.at(ends), there.occupancy.states_at(ends)
    judged = np.full(reading.size, SHORT, np.uint8)
    judged[states == UNKNOWN] = UNMAPPED
    judged[reading.ranges_m > expected + AGREES_M] = BEYOND
    judged[(off_m < AGREES_M) | (states == OCCUPIED)] = AGREES
    judged[~reading.hits] = MISS
    nats = np.zeros(reading.size, np.float32)
    nats[reading.hits] = nats_of_beams(there, reading, ends[reading.hits])
    return BeamJudgment(judged, reading.ranges_m, expected, nats, ends, expected_ends)
