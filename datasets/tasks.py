"""Tasks, tiers and seeds: the thesis's three problems, at three levels of difficulty, from numbered draws.

A tier sets what the world looks like and what happens during the session. Its numbers are invented;
docs/simulate.md has what they do to the filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Tier:
    """One tier."""

    name: str
    light: float = 1.0  # all lamps and windows times this
    bare: float = 0.0  # share of textures and things on walls that are left out, 0 to 1
    occluded: float = 0.0  # share of the session's frames in which people stand in the view
    drift: float = 0.0  # slow drift of the light within the session: largest change of gain as a share
    tint: float = 0.0  # the same for the white balance of red and blue


TIERS: dict[str, Tier] = {
    tier.name: tier
    for tier in (
        Tier("nominal"),
        Tier("dim", light=0.3),
        Tier("hard", light=0.45, bare=0.6, occluded=0.3, drift=0.2, tint=0.1),
    )
}


UPDATES = 120  # of a drive, unless asked otherwise: more than 1000 in


@dataclass(frozen=True, slots=True)
class Task:
    """What is known at the start, and what is done to the robot."""

    name: str
    title: str
    start_known: bool  # the session's header says where the drive begins
    kidnapped: bool  # once the robot is carried elsewhere, and its odometry does not see it

    def kidnap_at(self, updates: int, asked: int | None) -> int | None:
        """Return the update after which the robot is carried away, or None; ValueError for a wrong one."""
        if not self.kidnapped:
            if asked is not None:
                raise ValueError(
                    f"found a kidnapping in the task {self.name}; leave --kidnap-at out or choose kidnapped"
                )
            return None
        if updates < 2:
            raise ValueError(f"found {updates} update, expected 2 or more: one comes after the kidnapping")
        at = updates // 2 if asked is None else asked
        if not 1 <= at < updates:
            fault = f"found kidnapping after movement {at} of {updates}"
            raise ValueError(f"{fault}, expected 1 to {updates - 1}")
        return at


TASKS: dict[str, Task] = {
    task.name: task
    for task in (
        Task("tracking", "drive", start_known=True, kidnapped=False),
        Task("global", "drive without a known start", start_known=False, kidnapped=False),
        Task("kidnapped", "kidnapped robot", start_known=True, kidnapped=True),
    )
}


# What the simulator draws for: the last word of its random addresses (see maurice_mcl.values.randomness).


class SimPurpose(IntEnum):
    """One stream a purpose, so that changing one part of a world leaves the others as they were."""

    WORLD = 1
    SURVEY_LIGHT = 2
    SURVEY_PLACING = 3
    SURVEY_NOISE = 4
    COVERED_NOISE = 5
    SESSION_LIGHT = 6
    SESSION_NOISE = 7
    DRIVER = 8
    ROBOT = 9
    MOVED = 10
    OCCLUDERS = 11
    LIGHT_DRIFT = 12
    KIDNAP = 13
    SLIP = 14
    START = 15
    WANDER = 16
    PROXIMITY = 17
    BARE = 18
    SCAN_NOISE = 19


# Which seeds may be fitted on and which may only be tested on: the split never changes.

DEMO = 0  # the first, not a chosen one: for arena, survey, drive and filter alike
FITTING = range(1, 100)  # anything may be fitted or tuned on these
TEST = range(1000, 2000)  # nothing ever is


# Files and folders that are made from these.

GENERATOR = 2  # raise it whenever the same seed gives other files: old caches are then not used
LASER_GENERATOR = 3  # the same of drives with a laser
SURVEY = Path("survey") / "survey.log"  # beside the session's log
MAP = Path("map") / "map.yaml"  # in its place, of a robot with a laser
LASER_SEED, LASER_UPDATES = 20, 36  # a drive on which AMCL keeps its place until it is carried away
KIDNAPPING_SEED, KIDNAPPING_UPDATES = 2, 80  # a drive after which the thesis's filter is lost, and sure of it


def simulation_key(task: str, arena_seed: int, seed: int, updates: int, *, laser: bool = False) -> str:
    """Return what a simulation's folder in the cache is called."""
    kind = f"laser-{task}-{LASER_GENERATOR}" if laser else f"{task}-{GENERATOR}"
    return f"{kind}-seed{arena_seed}-{seed}-{updates}"
