"""The simulated Maurice: how it really moves, and what its encoders report.

Turning is over-read by a gain and scatters once per turn, straights fall short once per movement, the heading
drifts with distance, by floor (thesis 3.2). Where a floor ends the robot may slip (3.6). Backward is
forward mirrored: a straight falls short as well, and its drift keeps the robot on the arc that it came by.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from maurice_mcl.filter.motion import FloorDrift
from maurice_mcl.values import F64, INCH_M, Arena, wrap, wrap_angle

from ..worlds.world import clearance, floor_at

SUBSTEP_M = 0.5 * INCH_M  # a straight is followed in steps of about this


PER_YARD = float(np.radians(1) / (36 * INCH_M))  # one degree per 36 in
DRIFTS = {"wood": FloorDrift(0.0, 1 * PER_YARD), "carpet": FloorDrift(8 * PER_YARD, 3 * PER_YARD)}
NO_DRIFT = FloorDrift()  # off the map


@dataclass(frozen=True, slots=True)
class Chassis:
    """Maurice's errors as measured in the thesis; what it leaves open is marked invented."""

    turn_over_read: float = 1.3695  # measured over actual turn (figure 5)
    turn_bias_rad: float = float(np.radians(0.2681))  # mean residual of a turn (figure 8)
    turn_sd_rad: float = float(np.radians(4.916))  # its scatter, once per turn
    straight_bias_m: float = -0.6978 * INCH_M  # mean of actual - measured, once per movement (figure 11)
    straight_sd_m: float = 0.6356 * INCH_M  # its scatter
    drifts: dict[str, FloorDrift] = field(default_factory=DRIFTS.copy)  # by floor; numbers invented
    track_m: float = 10 * INCH_M  # between left and right wheels; invented
    encoder_sd_m: float = 0.15 * INCH_M  # front against rear wheel of a side; invented
    grip: float = 0.2  # share of a straight that a robot with spinning wheels gets ahead; invented
    radius_m: float = 5 * INCH_M  # of its body, a disc: nothing solid comes nearer to its middle; invented
    stall_m: float = 0.5 * INCH_M  # what the wheels still turn when it has run into something; invented
    slip_chance: float = 0.0  # of a slip at a movement's first crossing into another floor; simulate has 0.15
    slip_from_sd: float = 3.5  # size of a slip in sd of a turn, drawn evenly from this: beyond three sd ...
    slip_to_sd: float = 6.0  # ... to this; thesis 3.6 gives neither number nor size, so both are invented

    def motion_header(self) -> dict[str, Any]:
        """Return the motion parameters as a session's header names them, for a filter to read."""
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


# the same with odometry that is free of the mean errors, as one expects of a robot with a laser
CALIBRATED = Chassis(turn_over_read=1.0, turn_bias_rad=0.0, straight_bias_m=0.0)


@dataclass(frozen=True, slots=True)
class Luck:
    """The standard normal draws of one update, taken before the driver decides."""

    turn: float
    straight: float
    drift: float
    wheels: tuple[float, float]  # left and right side
    slip_rad: float = 0.0  # by which the robot is turned where the floor changes, if it does; mostly 0


def draw_luck(rng: np.random.Generator, slip_rad: float = 0.0) -> Luck:
    """Draw what chance has in store for one update; always five numbers."""
    z = [float(v) for v in rng.standard_normal(5)]
    return Luck(z[0], z[1], z[2], (z[3], z[4]), slip_rad)


def draw_slip(rng: np.random.Generator, chassis: Chassis) -> float:
    """Draw the slip of one update: mostly 0, else beyond three standard deviations of a turn, either way."""
    happens, size, side = (float(v) for v in rng.random(3))
    if happens >= chassis.slip_chance:
        return 0.0
    sds = chassis.slip_from_sd + size * (chassis.slip_to_sd - chassis.slip_from_sd)
    return (1 if side < 0.5 else -1) * sds * chassis.turn_sd_rad


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """One movement: what was measured, and where the robot went."""

    measured: F64  # (3,) forward_m, left_m, turn_rad
    encoders_m: F64  # (4,) front left, front right, rear left, rear right
    path: F64  # (K, 3) true poses, the first where it started, the last where it ended
    slipped_rad: float = 0.0  # by which it was turned where the floor changed
    bumped: bool = False  # it ran into something and stopped there
    spun_m: float = 0.0  # what the wheels counted while they only spun

    def at(self, share: float) -> F64:
        """Return the true pose (3,) at a share of the movement, between two of its path."""
        place = share * (len(self.path) - 1)
        begin, end = self.path[int(place)], self.path[int(np.ceil(place))]
        step, turn = end - begin, float(self.measured[2])
        step[2] = turn + wrap_angle(float(step[2]) - turn)  # a large turn is not the shorter way around
        pose = begin + (place - int(place)) * step
        pose[2:] = wrap(pose[2:])
        return np.asarray(pose)


def standing(pose: F64) -> Movement:
    """Do not move, and measure nothing."""
    return Movement(np.zeros(3), np.zeros(4), np.stack([pose, pose]))


def turn_by(pose: F64, commanded_rad: float, luck: Luck, chassis: Chassis) -> Movement:
    """Turn on the spot: actual = measured / 1.3695 + N(0.2681, 4.916) degrees."""
    actual = commanded_rad + chassis.turn_bias_rad + chassis.turn_sd_rad * luck.turn
    measured = np.array([0.0, 0.0, chassis.turn_over_read * commanded_rad])
    end = np.array([pose[0], pose[1], pose[2] + actual])
    end[2:] = wrap(end[2:])
    return Movement(measured, encoders(measured, luck, chassis), np.stack([pose, end]))


def drive_by(
    pose: F64, commanded_m: float, luck: Luck, arena: Arena, chassis: Chassis, *, spins: bool = False
) -> Movement:
    """Drive straight: with one error of length, a drift by floor on the way, and a stop at contact.

    A length of 0 is no movement, one below 0 goes backward; a robot that is stopped has measured what it
    drove, and a little more. One whose wheels spin has measured all of it, and gets hardly ahead.
    """
    error = chassis.straight_bias_m + chassis.straight_sd_m * luck.straight
    way, ahead = abs(commanded_m), -1 if commanded_m < 0 else 1
    length = max(way + error, 0.0) if way > 0 else 0.0
    spun_m = length * (1 - chassis.grip) if spins else 0.0
    path, slipped = follow(pose, ahead * (length - spun_m), luck, arena, chassis)
    whole = len(path)
    path = path[: touches(path, arena, chassis.radius_m)]
    if bumped := len(path) < whole:
        way = min(way, way * (len(path) - 1) / (whole - 1) + chassis.stall_m)
        slipped = slipped if _floors_change(path, arena) else 0.0
    measured = np.array([ahead * way, 0.0, 0.0])
    return Movement(measured, encoders(measured, luck, chassis), path, slipped, bumped, spun_m)


def follow(pose: F64, length_m: float, luck: Luck, arena: Arena, chassis: Chassis) -> tuple[F64, float]:
    """Follow a drifting straight in small steps; gives the true poses (K, 3), K >= 2, and the slip.

    A length below 0 goes backward.
    """
    count = max(1, round(abs(length_m) / SUBSTEP_M))
    step = length_m / count
    x, y, heading = (float(v) for v in pose)
    poses, slipped, begun_on = [[x, y, heading]], 0.0, floor_at(arena, x, y)
    for _ in range(count):
        floor = floor_at(arena, x, y)
        if luck.slip_rad and not slipped and floor != begun_on:
            slipped = luck.slip_rad
            heading += slipped
        drift = chassis.drifts.get(floor, NO_DRIFT)
        bend = (drift.bias_rad_per_m + drift.sd_rad_per_m * luck.drift) * step
        x += step * float(np.cos(heading + bend / 2))
        y += step * float(np.sin(heading + bend / 2))
        heading += bend
        poses.append([x, y, heading])
    path = np.array(poses)
    path[:, 2] = wrap(path[:, 2])
    return path, slipped


def touches(path: F64, arena: Arena, radius_m: float) -> int:
    """Count the poses of a path (K, 3) up to where a disc touches something or comes nearer to it."""
    if not len(arena.walls) and not arena.obstacles:
        return len(path)
    room = clearance(arena, path[:, :2])
    stuck = (room[1:] < radius_m) & (room[1:] < room[:-1])
    return int(np.argmax(stuck)) + 1 if stuck.any() else len(path)


def _floors_change(path: F64, arena: Arena) -> bool:
    return len({floor_at(arena, float(x), float(y)) for x, y, _ in path[:-1]}) > 1


def encoders(measured: F64, luck: Luck, chassis: Chassis) -> F64:
    """Return four wheel advances (4,) whose mean and difference are exactly the measured movement."""
    forward, _, turn = (float(v) for v in measured)
    half = turn * chassis.track_m / 2
    left, right = (chassis.encoder_sd_m * wheel for wheel in luck.wheels)
    front = [forward - half + left, forward + half + right]
    return np.array([*front, forward - half - left, forward + half - right])
