"""The simulated robot in a person's hands: it drives, looks, is carried or bumped, and can be saved.

Everything that a person does ends with a picture at once: one completed motion, one update.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import new_folder
from maurice_loaders.reading.recording import Note
from maurice_loaders.session_log.header import SESSION_LOG
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values import F64, U8, LaserScan, Moment, NamedProgress, SessionInfo, wrap

from .folders import SIMULATION, SimulationPaths, paths_in, seal
from .render.camera_session import session_camera
from .render.conditions import LightChange
from .render.laser import SimulatedLaser
from .robot.behaviors import Command
from .robot.drive import BY_HAND, KIDNAP_M, STAY, DriveUpdate, Robot
from .robot.motion import draw_slip
from .robot.planner import free_pose, raster
from .robot.segments import CARRY_S, FRAME_S, Segment, timed, write_segments
from .sessions import known_of, moment_of, session_info, write_known
from .simulation import SimulationPlan, stage
from .surveys import one_thread
from .tasks import SimPurpose

LIGHT_CHANGES = ("dim", "off", "on")  # in this order, again and again; "off" is the first lamp


@dataclass(frozen=True, slots=True, eq=False)
class SeenPictures:
    """What was seen, as the eye that sees it again: of every update its picture or scan, and its light."""

    moments: list[Moment]

    def take(self, number: int, pose: F64) -> U8 | LaserScan:
        """Return what was seen at an update."""
        frame = self.moments[number - 1].frame
        return frame.image if frame.scan is None else frame.scan

    def events(self, number: int) -> tuple[str, ...]:
        """Return what happened to the light at that update."""
        return self.moments[number - 1].told("lights")


class TeleoperatedRobot:
    """A robot that a person drives, and all that happened to it; a session as far as it goes.

    InputError for worlds that cannot be used.
    """

    def __init__(self, plan: SimulationPlan) -> None:
        set_up = stage(plan)
        self.set_up = replace(set_up, course=replace(set_up.course, notes=("driven by hand",)))
        self.path = Path("drive")  # its name in messages
        self.pose = set_up.course.start  # (3,) true
        self.behavior = ""  # whose proposal won, where the last update was a movement
        free = raster(set_up.world.arena)
        assert free is not None  # `stage` raises InputError
        self._map, self._eye = free, set_up.eye
        self._robot = Robot(set_up.world.arena, plan.seed, plan.chassis, BY_HAND)
        self._segments: list[Segment] = []
        self._moments: list[Moment] = []
        self._last: DriveUpdate | None = None
        self._light_changes = cycle(LIGHT_CHANGES)

    @property
    def info(self) -> SessionInfo:
        """The header of its session."""
        return session_info(self.set_up)

    def moments(self) -> Iterator[Moment]:
        """Yield all updates up to now."""
        return iter(self._moments)

    def known(self, report: NamedProgress) -> Path:
        """Return the survey's log, or of a laser the map; made where the cache has none."""
        return known_of(self.set_up, report)

    def drive(self, command: Command | None = None) -> Moment:
        """Move as a person says, or without a command as the arbiter of its behaviors chooses; then look."""
        chosen = self._robot.decide(self._next, self.pose, None, self._last, False, command) or STAY
        self._last = self._robot.move(self._next, self.pose, chosen)
        self.pose, self.behavior = self._last.pose, chosen.behavior
        return self._seen(timed(self._now_s, self._last, self.set_up.world.arena))

    def look(self, *happened: str) -> Moment:
        """Take a picture, after what happened to the robot."""
        self.behavior = ""
        texts = tuple(Note(self._now_s, text) for text in happened)
        return self._seen(Segment(texts, self._now_s + FRAME_S, self.pose))

    def carry(self) -> Moment:
        """Carry it to a place drawn evenly from all far away, and look; its odometry sees nothing."""
        away_m = min(KIDNAP_M, float(np.ptp(self._map.centers, axis=0).max()) / 2)
        rng = self._robot.chance(self._next, SimPurpose.KIDNAP)
        self.pose = free_pose(self._map, rng, self.pose, away_m)
        if self._segments:
            self._segments[-1] = replace(self._segments[-1], kidnapped_to=self.pose)
        self._last = None
        return self.look()

    def bump(self) -> Moment:
        """Push it, so that it stands turned by more than its odometry's errors explain; and look."""
        rng = self._robot.chance(self._next, SimPurpose.SLIP)
        turn_rad = draw_slip(rng, replace(self._robot.chassis, slip_chance=1.0))
        self.pose = np.array([*self.pose[:2], *wrap(self.pose[2:] + turn_rad)])
        return self.look("bump", f"slip {np.degrees(turn_rad):+.1f} deg")

    def change_light(self) -> Moment | None:
        """Dim everything, put out the first lamp, light all again, one a call; look. None with a laser."""
        if isinstance(self._eye, SimulatedLaser):
            return None
        before, plan = self._eye.conditions, self.set_up.plan
        change = LightChange(next(self._light_changes), self._next)
        try:
            after = replace(before, lights=(*before.lights, change))
            self._eye = session_camera(self.set_up.world, plan.seed, after)
        except ValueError:  # no lamp in this world
            return self.change_light()
        return self.look()

    def save(self, folder: Path, *, force: bool = False, progress: NamedProgress) -> SimulationPaths:
        """Write session and survey into a new folder, as `simulate` does; a replay sees the same pictures.

        InputError when the folder holds something (`force` replaces a simulation), or without update.
        """
        if not self._segments:
            raise InputError(folder, "found no picture to save yet")
        course, arena, total = self.set_up.course, self.set_up.world.arena, len(self._segments)
        with new_folder(folder, SIMULATION, force=force) as filling:
            write_known(filling, self.set_up, progress)
            with SessionWriter(filling / SESSION_LOG, self.info, pictures="png") as log:
                seen = SeenPictures(self._moments)
                write_segments(log, course.start, self._segments, seen, arena, total, progress)
            seal(filling, "drive")
        return paths_in(folder)

    @property
    def _next(self) -> int:
        """Number of the next update."""
        return len(self._segments) + 1

    @property
    def _now_s(self) -> float:
        if not self._segments:
            return 0.0
        last = self._segments[-1]
        return last.t_s + (0.0 if last.kidnapped_to is None else CARRY_S)

    def _seen(self, segment: Segment) -> Moment:
        before = self._segments[-1] if self._segments else None
        with one_thread():
            moment = moment_of(self._next, segment, before, self._eye)
        self._segments.append(segment)
        self._moments.append(moment)
        return moment
