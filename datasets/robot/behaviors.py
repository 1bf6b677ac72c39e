"""The robot's behaviors, the proximity ring that they sense with, and the arbiter that chooses one.

This is the thesis's hybrid control (3.5, appendix B): small behaviors that know nothing of each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from maurice_mcl.values import F64, INCH_M, Arena, wrap_angle

from ..worlds.world import cast, segments_of

# Infrared proximity: a ring of short-sighted distance sensors, and what they show of the space ahead.


@dataclass(frozen=True, slots=True)
class Ring:
    """The sensors. The thesis names infrared detectors (2) and no numbers: all are invented."""

    count: int = 24  # evenly all around, the first straight ahead: a box of 5 in is never missed at 20 in
    reach_m: float = 30 * INCH_M  # nothing farther is seen: triangulating infrared sensors end at 0.8 m
    noise: float = 0.02  # sd of a reading as a share of it


@dataclass(frozen=True, slots=True, eq=False)
class Proximity:
    """One reading of the ring."""

    bearings_rad: F64  # (S,) counter-clockwise from straight ahead
    ranges_m: F64  # (S,) from the robot's middle to what is there; `reach_m` where nothing is
    reach_m: float

    @property
    def nearest_m(self) -> float:
        """Return the smallest range."""
        return float(self.ranges_m.min())

    def open_m(self, bearing_rad: float, half_width_m: float) -> float:
        """Return how far a disc of this half width can go toward a bearing before it touches anything."""
        angle = self.bearings_rad - bearing_rad
        ahead, aside = self.ranges_m * np.cos(angle), np.abs(self.ranges_m * np.sin(angle))
        blocking = (self.ranges_m < self.reach_m) & (ahead > 0) & (aside < half_width_m)
        touch = ahead[blocking] - np.sqrt(half_width_m**2 - aside[blocking] ** 2)
        return max(0.0, float(touch.min(initial=self.reach_m - half_width_m)))


def sense(arena: Arena, pose: F64, ring: Ring, rng: np.random.Generator) -> Proximity:
    """Read the complete ring once at a pose (3,)."""
    bearings: F64 = np.linspace(0, 2 * np.pi, ring.count, endpoint=False, dtype=np.float64)
    true = cast(pose[:2], pose[2] + bearings, segments_of(arena))
    read = true * (1 + ring.noise * rng.standard_normal(ring.count))
    return Proximity(bearings, np.clip(read, 0, ring.reach_m), ring.reach_m)


# The robot's behaviors: each looks at what the robot senses and proposes a movement, or nothing.

DICE = 16  # uniform numbers per update; a behavior that leaves something to chance looks at them

Command = tuple[float | None, float]  # turn_rad, None: no turn; then forward_m, below 0 backward


@dataclass(frozen=True, slots=True, eq=False)
class Senses:
    """All that a behavior may look at."""

    proximity: Proximity
    dice: F64  # (DICE,) uniform between 0 and 1, drawn anew every update
    bumped: bool = False  # the last motion ended where the robot ran into something: contact switches
    unseen: bool = False  # a motion was completed and no picture has been taken since
    goal_rad: float | None = None  # bearing of the next point on the path to the goal; None without a goal
    command: Command | None = None  # of a person; None: they leave it to the robot


@dataclass(frozen=True, slots=True)
class BehaviorProposal:
    """What a behavior would do now."""

    behavior: str
    priority: int  # the largest wins
    turn_rad: float | None = 0.0  # None: no turn at all, and so none of its errors
    forward_m: float = 0.0  # below 0: backward
    look: bool = False  # stand still and take a picture instead


class Behavior(Protocol):
    """Anything that makes proposals."""

    def propose(self, senses: Senses) -> BehaviorProposal | None:
        """Return its proposal, or None if it does not apply."""
        ...


@dataclass(frozen=True, slots=True)
class Stride:
    """How far the robot goes in one motion, and the width it assumes for itself."""

    shortest_m: float = 5 * INCH_M  # drawn evenly from this ...
    longest_m: float = 18 * INCH_M  # ... to this: 1000 in are reached within 120 updates
    half_width_m: float = 6 * INCH_M  # body and an inch to spare

    def length(self, die: float, open_m: float) -> float:
        """Choose a length by a die, cut to what is open."""
        return min(self.shortest_m + die * (self.longest_m - self.shortest_m), open_m)


@dataclass(frozen=True, slots=True)
class Localize:
    """Stop and look: one completed motion, one update (thesis 3.5: motion is blocked meanwhile)."""

    def propose(self, senses: Senses) -> BehaviorProposal | None:
        """Look once after every motion."""
        return BehaviorProposal("localization", 4, look=True) if senses.unseen else None


@dataclass(frozen=True, slots=True)
class AvoidCollision:
    """Get away from what is so near that the robot all but touches it, or from what it ran into."""

    near_m: float = 5.6 * INCH_M  # from the robot's middle; its body ends at 5 in
    back_rad: float = float(np.radians(60))  # after contact: straight back, give or take this
    stride: Stride = Stride()

    def propose(self, senses: Senses) -> BehaviorProposal | None:
        """Turn away, and go: back after contact, else in the most open direction when something is near."""
        if senses.bumped:  # a thin edge may stand between two sensors, so do not trust them here
            bearing = (2 * senses.dice[7] - 1) * self.back_rad
            bearing += np.pi if bearing < 0 else -np.pi
            open_m = senses.proximity.open_m(bearing, self.stride.half_width_m)
        elif senses.proximity.nearest_m <= self.near_m:
            bearing, open_m = most_open(senses.proximity, self.stride)
        else:
            return None
        return BehaviorProposal("collision avoidance", 2, bearing, self.stride.length(senses.dice[0], open_m))


@dataclass(frozen=True, slots=True)
class Teleoperate:
    """Do what a person says, whatever the sensors see."""

    def propose(self, senses: Senses) -> BehaviorProposal | None:
        """Pass the command on."""
        return None if senses.command is None else BehaviorProposal("teleoperation", 3, *senses.command)


@dataclass(frozen=True, slots=True)
class GoToPoint:
    """Head for the next point on the path, up to 22.5 degrees off: no heading is preferred."""

    loose_rad: float = float(np.radians(22.5))  # steers off by up to this
    stride: Stride = Stride()

    def propose(self, senses: Senses) -> BehaviorProposal | None:
        """Turn roughly there and go a random distance; None where that direction is blocked."""
        if senses.goal_rad is None:
            return None
        for die in senses.dice[1:5]:
            bearing = senses.goal_rad + (2 * die - 1) * self.loose_rad
            open_m = senses.proximity.open_m(bearing, self.stride.half_width_m)
            if open_m >= self.stride.shortest_m:
                turn = wrap_angle(bearing)
                length = self.stride.length(senses.dice[5], open_m)
                return BehaviorProposal("going to a point", 1, turn, length)
        return None


@dataclass(frozen=True, slots=True)
class Wander:
    """Go anywhere that is open: the behavior of lowest priority."""

    stride: Stride = Stride()

    def propose(self, senses: Senses) -> BehaviorProposal | None:
        """Take the first of some bearings drawn at random that is open, else the most open one."""
        bearings = (2 * senses.dice[8:] - 1) * np.pi
        length = self.stride.length(senses.dice[6], np.inf)
        for bearing in bearings:
            if senses.proximity.open_m(float(bearing), self.stride.half_width_m) >= length:
                return BehaviorProposal("wandering", 0, float(bearing), length)
        bearing, open_m = most_open(senses.proximity, self.stride)
        return BehaviorProposal("wandering", 0, bearing, min(length, open_m))


def most_open(proximity: Proximity, stride: Stride) -> tuple[float, float]:
    """Return the sensor's bearing in which the robot can go farthest, in [-pi, pi), and how far."""
    open_m = [proximity.open_m(float(b), stride.half_width_m) for b in proximity.bearings_rad]
    best = int(np.argmax(open_m))
    bearing = wrap_angle(float(proximity.bearings_rad[best]))
    return bearing, open_m[best]


# The arbiter: asks all behaviors and does what the most urgent one proposes.


def choose(behaviors: Sequence[Behavior], senses: Senses) -> BehaviorProposal | None:
    """Return the proposal of the highest priority, the first of equals; None if there is none."""
    proposals = [p for p in (behavior.propose(senses) for behavior in behaviors) if p is not None]
    return max(proposals, key=lambda p: p.priority, default=None)
