"""A simulated session, planned and set up: which world, which task, what changes, and what the robot does."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.values import F64, Domain, expected_one_of, stream

from .render.camera_session import CameraSession, session_camera
from .render.conditions import GAINS, Conditions, LightChange, conditions_for
from .render.laser import SimulatedLaser
from .robot.drive import KIDNAP_M, Robot, drive
from .robot.motion import CALIBRATED, Chassis
from .robot.planner import SCALES, Raster, fit, raster
from .robot.recorded_path import read_recording
from .robot.segments import Segment, driven_segments, scanned_segments
from .tasks import TIERS, UPDATES, SimPurpose, Task
from .worlds.build import load_world
from .worlds.rearrange import move_things
from .worlds.world import World

SLIP_CHANCE = 0.15  # at a crossing into another floor: about two in a drive of 1000 in


@dataclass(frozen=True, slots=True)
class SimulationPlan:
    """All that a session depends on. ValueError for what no session can be."""

    task: Task
    world: str = "two-rooms"  # a name, or the path of a TOML file
    tier: str = "nominal"
    arena_seed: int = 0  # textures, furniture, lights, survey
    seed: int = 0  # drive, the session's light, noise
    updates: int = UPDATES  # at most, where a recording is followed
    kidnap_at: int | None = None  # None: halfway
    lights: tuple[LightChange, ...] = ()
    moved: int = 0  # pieces of furniture moved after the survey
    people: int = 0  # percent of the pictures in which people stand in view; the tier may have more
    gain: str = "fixed"
    recording: Path | None = None  # a recorded path to drive along
    slip_chance: float = SLIP_CHANCE
    slip_at: range = range(0)  # updates at which the wheels spin
    half_resolution: bool = False  # of survey and session alike: it is one camera
    laser: bool = False  # the robot has a laser in place of its camera

    def __post_init__(self) -> None:
        if self.tier not in TIERS:
            raise ValueError(f"no tier called {self.tier!r}; {expected_one_of(self.tier, TIERS)}")
        if self.recording is not None and self.task.kidnapped:
            raise ValueError("found task kidnapped for a recorded path; choose tracking or global")
        if self.gain not in GAINS:
            raise ValueError(f"no gain called {self.gain!r}; {expected_one_of(self.gain, GAINS)}")
        if self.updates < 1:
            raise ValueError(f"found {self.updates} updates, expected 1 or more")
        if not 0 <= self.people <= 100:
            raise ValueError(f"found people in {self.people} percent of the pictures, expected 0 to 100")
        if self.laser and (self.lights or self.gain != "fixed" or self.half_resolution):
            raise ValueError("found a laser with lights, gain or half resolution, which are a camera's")
        self.task.kidnap_at(self.updates, self.kidnap_at)
        if self.slip_at and (self.recording is not None or self.slip_at[-1] > self.updates):
            why = f"of {self.updates}" if self.recording is None else "on a recorded path"
            raise ValueError(f"found a slip in movement {self.slip_at[-1]} {why}; change --slip-at")
        for change in self.lights:
            if change.update > self.updates:
                raise ValueError(f"found a change of light at update {change.update} of {self.updates}")

    @property
    def chassis(self) -> Chassis:
        """What the robot drives on."""
        return replace(CALIBRATED if self.laser else Chassis(), slip_chance=self.slip_chance)

    @property
    def conditions(self) -> Conditions:
        """What changes during the session."""
        half, tier = self.half_resolution, TIERS[self.tier]
        people = self.people / 100
        return conditions_for(tier, self.lights, people=people, gain=self.gain, half_resolution=half)


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What the robot does."""

    start: F64  # (3,)
    total: int  # updates
    segments: Callable[[], Iterator[Segment]]  # from the beginning on every call
    motion: dict[str, Any] | None  # the robot's motion parameters, as a header has them
    notes: tuple[str, ...] = ()  # for the header


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Everything in its place; nothing has moved yet, and no picture has been taken."""

    plan: SimulationPlan
    surveyed: World  # as the survey saw it
    world: World  # as it is now
    eye: CameraSession | SimulatedLaser  # the session's camera or laser
    course: Course


def parse_span(text: str) -> range:
    """Read updates like "34" or "34-37", or none from empty text. ValueError for anything else."""
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", text.strip())
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
    if text.strip() and not 1 <= first <= last:
        raise ValueError(f"found updates {text!r}, expected one like 34, or a range like 34-37")
    return range(first, last + 1)


def stage(plan: SimulationPlan, surveyed: World | None = None) -> Stage:
    """Set everything up, in the plan's world unless it was loaded before.

    InputError for worlds and recordings that cannot be used.
    """
    surveyed = surveyed or load_world(plan.world, plan.arena_seed, plan.tier)
    world = move_things(surveyed, plan.moved, plan.seed) if plan.moved else surveyed
    map_ = raster(world.arena)
    if map_ is None:
        why = "found no room for the robot to drive in; leave 12 in between things"
        raise InputError(Path(plan.world), why)
    path = plan.recording
    course = driven(plan, world, map_) if path is None else followed(plan, world, map_, path)
    if plan.laser:
        share = max(plan.people / 100, TIERS[plan.tier].occluded)
        return Stage(plan, surveyed, world, SimulatedLaser(world, plan.seed, share), course)
    try:
        camera = session_camera(world, plan.seed, plan.conditions)
    except ValueError as problem:  # a lamp that this world does not have
        raise InputError(Path(plan.world), str(problem)) from None
    return Stage(plan, surveyed, world, camera, course)


def driven(plan: SimulationPlan, world: World, map_: Raster) -> Course:
    """Drive the robot by its behaviors. InputError if a kidnapped robot cannot be placed far enough away."""
    robot = Robot(world.arena, plan.seed, plan.chassis, spins_at=plan.slip_at)
    kidnap_at = plan.task.kidnap_at(plan.updates, plan.kidnap_at)
    reach_m = float(np.ptp(map_.centers, axis=0).max())  # one of the two ends is half of it away, or more
    if kidnap_at is not None and reach_m < 2 * KIDNAP_M:
        raise InputError(Path(plan.world), "found too small a place for a kidnapping; choose a larger world")

    def segments() -> Iterator[Segment]:
        begin, updates = drive(robot, map_, plan.updates, kidnap_at, world.start)
        if plan.laser:
            return scanned_segments(begin, updates, world.arena)
        return driven_segments(updates, world.arena)

    start = drive(robot, map_, 0, start=world.start)[0]
    notes = (f"slips: {plan.slip_chance:g} a crossing",)
    motion = None if plan.laser else plan.chassis.motion_header()
    return Course(start, plan.updates, segments, motion, notes)


def followed(plan: SimulationPlan, world: World, map_: Raster, path: Path) -> Course:
    """Follow a recorded path, moved to where it fits. InputError if it fits nowhere."""
    recorded = read_recording(path, plan.updates)
    at = fit(map_, recorded.track, stream(Domain.SIMULATOR, plan.seed, 0, SimPurpose.START))
    if at is None:
        size = " x ".join(f"{v:.1f} m" for v in np.ptp(recorded.track, axis=0))
        smallest = f"{SCALES[-1]:.0%} of its size"
        why = f"found a path of {size} that fits nowhere into {world.name}, not even at {smallest}"
        raise InputError(path, f"{why}; take a larger world or fewer --updates")
    scaled = "" if at.scale == 1 else f", path and odometry scaled to {at.scale:.0%} to fit"
    notes = [f"path and odometry are recorded: {recorded.name}{scaled}"]
    if recorded.carried:
        notes.append(f"the recorded robot was carried: {recorded.carried} times")
    start, count = at.pose(recorded.start), len(recorded.segments)
    return Course(start, count, lambda: recorded.placed(at), recorded.motion, tuple(notes))
