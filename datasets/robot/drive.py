"""A drive: the robot senses, its behaviors propose, the arbiter chooses, the robot moves, and then it looks.

The robot gets the bearing of the next point on the path to its goal; everything else it decides from its
proximity sensors. Every update is a turn of any size, a straight, and a picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from maurice_mcl.values import F64, INCH_M, Arena, Domain, stream

from ..tasks import SimPurpose
from .behaviors import (
    DICE,
    AvoidCollision,
    Behavior,
    BehaviorProposal,
    Command,
    GoToPoint,
    Localize,
    Ring,
    Senses,
    Teleoperate,
    Wander,
    choose,
    sense,
)
from .motion import Chassis, Movement, draw_luck, draw_slip, drive_by, standing, turn_by
from .planner import Raster, free_pose

REACHED_M = 9.0 * INCH_M  # a goal counts as reached from here
KIDNAP_M = 48 * INCH_M  # a kidnapped robot is put down at least so far away
BEHAVIORS: tuple[Behavior, ...] = (Localize(), AvoidCollision(), GoToPoint(), Wander())
BY_HAND: tuple[Behavior, ...] = (Teleoperate(), AvoidCollision(), Wander())  # of a robot that a person drives
STAY = BehaviorProposal("nobody", -1)


@dataclass(frozen=True, slots=True, eq=False)
class DriveUpdate:
    """One update of a drive: a turn, a straight, and then the robot looks."""

    turn: Movement
    straight: Movement
    behavior: str  # whose proposal it was
    kidnapped_to: F64 | None = None  # (3,) where it is carried after it has looked

    @property
    def pose(self) -> F64:
        """Return the true pose (3,) at its end, where it looks."""
        return np.asarray(self.straight.path[-1])


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """Everything that stays the same during one drive."""

    arena: Arena
    seed: int
    chassis: Chassis = field(default_factory=Chassis)
    behaviors: Sequence[Behavior] = BEHAVIORS
    ring: Ring = field(default_factory=Ring)
    spins_at: range = range(0)  # updates at which its wheels spin

    def decide(
        self,
        step: int,
        pose: F64,
        goal_rad: float | None,
        last: DriveUpdate | None,
        unseen: bool,
        command: Command | None = None,
    ) -> BehaviorProposal | None:
        """Sense everything once and let the arbiter choose among the behaviors."""
        proximity = sense(self.arena, pose, self.ring, self.chance(step, SimPurpose.PROXIMITY))
        dice = self.chance(step, SimPurpose.WANDER).random(DICE)
        bumped = last is not None and last.straight.bumped
        return choose(self.behaviors, Senses(proximity, dice, bumped, unseen, goal_rad, command))

    def move(self, step: int, pose: F64, chosen: BehaviorProposal) -> DriveUpdate:
        """Carry out what was chosen, as well as chance lets it."""
        slip = draw_slip(self.chance(step, SimPurpose.SLIP), self.chassis)
        luck = draw_luck(self.chance(step, SimPurpose.ROBOT), slip)
        turned = chosen.turn_rad
        turn = standing(pose) if turned is None else turn_by(pose, turned, luck, self.chassis)
        spins = step in self.spins_at
        straight = drive_by(turn.path[-1], chosen.forward_m, luck, self.arena, self.chassis, spins=spins)
        return DriveUpdate(turn, straight, chosen.behavior)

    def chance(self, step: int, purpose: SimPurpose) -> np.random.Generator:
        """Open the random stream of one update and purpose."""
        return stream(Domain.SIMULATOR, self.seed, step, purpose)


class Guide:
    """Walks beside the robot: chooses goals anywhere in free space, and the next point to go to."""

    def __init__(self, map_: Raster, seed: int) -> None:
        self._map = map_
        self._rng = stream(Domain.SIMULATOR, seed, 0, SimPurpose.DRIVER)
        self._goal = free_pose(map_, self._rng)
        self._way = map_.way_to(self._goal[:2])

    def bearing(self, pose: F64) -> float:
        """Return the bearing of the next point on the path from a pose (3,), counter-clockwise from ahead."""
        while float(np.hypot(*(self._goal - pose)[:2])) < REACHED_M:
            self._goal = free_pose(self._map, self._rng)
            self._way = self._map.way_to(self._goal[:2])
        x, y = self._map.next_point(pose[:2], self._way) - pose[:2]
        return float(np.arctan2(y, x)) - float(pose[2])


def drive(
    robot: Robot, map_: Raster, updates: int, kidnap_at: int | None = None, start: F64 | None = None
) -> tuple[F64, Iterator[DriveUpdate]]:
    """Return the start pose (3,), drawn evenly unless given, and so many updates from goal to goal.

    After update `kidnap_at` the robot is carried to a place drawn evenly from all that are far enough away.
    """
    begin = free_pose(map_, robot.chance(0, SimPurpose.START)) if start is None else start
    return begin, _updates(robot, map_, begin, updates, kidnap_at)


def _updates(
    robot: Robot, map_: Raster, pose: F64, updates: int, kidnap_at: int | None
) -> Iterator[DriveUpdate]:
    """Run the behaviors from a pose (3,): one completed motion is one update."""
    guide, last, unseen, step = Guide(map_, robot.seed), None, False, 1
    while step <= updates:
        chosen = robot.decide(step, pose, guide.bearing(pose), last, unseen) or STAY
        if last is None or not chosen.look:
            last, unseen = robot.move(step, pose, chosen), True
            pose = last.pose
            continue
        at = robot.chance(step, SimPurpose.KIDNAP)
        carried = free_pose(map_, at, pose, KIDNAP_M) if step == kidnap_at else None
        yield replace(last, kidnapped_to=carried)
        pose = pose if carried is None else carried
        step, unseen = step + 1, False
