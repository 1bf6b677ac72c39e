"""The simulated Maurice: what it really does when told to turn or to drive, and what its encoders say.

The laws of error are the thesis's (3.2, 3.3): turning is over-read by a gain and scatters once a turn,
straights fall short once a movement, and the heading drifts with distance, by floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maurice_mcl.arena import Arena
from maurice_mcl.geometry import INCH_M, wrap
from maurice_mcl.typing import F64

from .world import floor_at

SUBSTEP_M = 0.5 * INCH_M  # a straight is followed in steps of about this


@dataclass(frozen=True, slots=True)
class Drift:
    """How the heading drifts on one floor, counter-clockwise, in proportion to distance."""

    bias_rad_per_m: float
    sd_rad_per_m: float  # one draw a straight, times its length


PER_YARD = float(np.radians(1) / (36 * INCH_M))  # one degree per 36 in
DRIFTS = {"wood": Drift(0.0, 1 * PER_YARD), "carpet": Drift(8 * PER_YARD, 3 * PER_YARD)}
NO_DRIFT = Drift(0.0, 0.0)  # off the map


@dataclass(frozen=True, slots=True)
class Chassis:
    """Maurice's errors as measured in the thesis; what it leaves open is marked invented."""

    turn_over_read: float = 1.3695  # measured over actual turn (figure 5)
    turn_bias_rad: float = float(np.radians(0.2681))  # mean residual of a turn (figure 8)
    turn_sd_rad: float = float(np.radians(4.916))  # its scatter, once a turn
    straight_bias_m: float = -0.6978 * INCH_M  # mean of actual - measured, once a movement (figure 11)
    straight_sd_m: float = 0.6356 * INCH_M  # its scatter
    drifts: dict[str, Drift] = field(default_factory=lambda: dict(DRIFTS))  # by floor; numbers invented
    track_m: float = 10 * INCH_M  # between left and right wheels; invented
    encoder_sd_m: float = 0.15 * INCH_M  # front against rear wheel of a side; invented

    def motion_header(self) -> dict[str, Any]:
        """Give the motion parameters as a session's header names them, for a filter to read."""
        return {
            "model": "maurice",
            "turn_gain": 1 / self.turn_over_read,
            "turn_bias_rad": self.turn_bias_rad,
            "turn_sd_rad": self.turn_sd_rad,
            "straight_bias_m": self.straight_bias_m,
            "straight_sd_m": self.straight_sd_m,
            "drift": {
                floor: {"bias_rad_per_m": d.bias_rad_per_m, "sd_rad_per_m": d.sd_rad_per_m}
                for floor, d in self.drifts.items()
            },
        }


@dataclass(frozen=True, slots=True)
class Luck:
    """The standard normal draws of one update, taken before the driver decides."""

    turn: float
    straight: float
    drift: float
    wheels: tuple[float, float]  # left and right side


def draw_luck(rng: np.random.Generator) -> Luck:
    """Draw what chance has in store for one update; always five numbers."""
    z = [float(v) for v in rng.standard_normal(5)]
    return Luck(z[0], z[1], z[2], (z[3], z[4]))


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """One movement: what was measured, and where the robot went."""

    measured: F64  # (3,) forward_m, left_m, turn_rad
    encoders_m: F64  # (4,) front left, front right, rear left, rear right
    path: F64  # (K, 3) true poses, the first where it started, the last where it ended


def turn_by(pose: F64, told_rad: float, luck: Luck, chassis: Chassis) -> Movement:
    """Turn on the spot: the robot stops when its encoders show the turn it was told, over-reading included.

    actual = measured / 1.3695 + N(0.2681, 4.916) degrees.
    """
    actual = told_rad + chassis.turn_bias_rad + chassis.turn_sd_rad * luck.turn
    measured = np.array([0.0, 0.0, chassis.turn_over_read * told_rad])
    end = np.array([pose[0], pose[1], pose[2] + actual])
    end[2:] = wrap(end[2:])
    return Movement(measured, encoders(measured, luck, chassis), np.stack([pose, end]))


def drive_by(pose: F64, told_m: float, luck: Luck, arena: Arena, chassis: Chassis) -> Movement:
    """Drive straight on: falls short once, and drifts by the floor beneath as it goes."""
    length = max(told_m + chassis.straight_bias_m + chassis.straight_sd_m * luck.straight, 0.0)
    measured = np.array([told_m, 0.0, 0.0])
    path = follow(pose, length, luck.drift, arena, chassis)
    return Movement(measured, encoders(measured, luck, chassis), path)


def follow(pose: F64, length_m: float, drift_z: float, arena: Arena, chassis: Chassis) -> F64:
    """Follow a drifting straight in small steps; gives the true poses (K, 3)."""
    count = max(1, round(length_m / SUBSTEP_M))
    step = length_m / count
    x, y, heading = (float(v) for v in pose)
    poses = [[x, y, heading]]
    for _ in range(count):
        drift = chassis.drifts.get(floor_at(arena, x, y), NO_DRIFT)
        bend = (drift.bias_rad_per_m + drift.sd_rad_per_m * drift_z) * step
        x += step * float(np.cos(heading + bend / 2))
        y += step * float(np.sin(heading + bend / 2))
        heading += bend
        poses.append([x, y, heading])
    path = np.array(poses)
    path[:, 2] = wrap(path[:, 2])
    return path


def encoders(measured: F64, luck: Luck, chassis: Chassis) -> F64:
    """Give four wheel advances (4,) whose mean and difference are exactly the measured movement.

    Front and rear wheel of one side differ by chance; their mean does not.
    """
    forward, _, turn = (float(v) for v in measured)
    half = turn * chassis.track_m / 2
    left = chassis.encoder_sd_m * luck.wheels[0]
    right = chassis.encoder_sd_m * luck.wheels[1]
    return np.array(
        [forward - half + left, forward + half + right, forward - half - left, forward + half - right]
    )
