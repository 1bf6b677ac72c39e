"""Simulated sessions: with their survey as files in a folder, or rendered as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from maurice_loaders.errors import ReadingNotes
from maurice_loaders.files.pictures import PictureKind
from maurice_loaders.files.ros_maps import write_ros_map
from maurice_loaders.files.writing import expect_apart, new_folder
from maurice_loaders.reading.recording import Motion, Note, Record
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.session_log.header import SESSION_LOG
from maurice_loaders.session_log.writer import LogLines, SessionWriter
from maurice_mcl.errors import InputError
from maurice_mcl.values import expected_one_of
from maurice_mcl.values.arrays import F64, U8, NamedProgress
from maurice_mcl.values.laser import LaserScan
from maurice_mcl.values.session import KIDNAPPED, NO_PICTURE, Frame, Moment, SessionInfo

from .folders import SIMULATION, SimulationPaths, cached, copy_whole, fingerprint, paths_in, seal
from .render.camera_session import survey_camera
from .render.conditions import parse_lights
from .render.laser import SimulatedLaser, occupancy_of
from .robot.segments import Eye, Segment, begun, records_of, write_segments
from .simulation import SimulationPlan, Stage, parse_span, stage
from .surveys import Surveyor, cached_survey, camera_of, one_thread, write_survey
from .tasks import (
    DEMO,
    GENERATOR,
    KIDNAPPING_SEED,
    KIDNAPPING_UPDATES,
    LASER_GENERATOR,
    LASER_SEED,
    LASER_UPDATES,
    MAP,
    SURVEY,
    TASKS,
    UPDATES,
    simulation_key,
)
from .worlds.world import World


def simulation_plan(
    task: str = "tracking",
    *,
    world: str | Path = "two-rooms",
    lights: str = "",
    slip_at: str = "",
    recording: str | Path | None = None,
    **settings: Any,
) -> SimulationPlan:
    """Return what a simulated drive depends on; InputError for what no drive can be.

    `task` is tracking, global or kidnapped (thesis 1), `world` a name or a TOML file; `lights` is as in
    docs/simulate.md, `slip_at` an update or a range like 34-37 at which the wheels spin; the path of a
    `recording` with truth is followed. `settings` are other fields of `SimulationPlan`: `tier` (nominal, dim
    or hard), `arena_seed` (textures, furniture, lights and the survey), `seed` (the drive and its noise),
    `updates`, `kidnap_at` (halfway), `moved` pieces of furniture, `people` in so many percent of the
    pictures, `gain` (fixed or auto), `half_resolution`, and `laser`, in place of the camera.

        >>> import maurice_datasets as md
        >>> md.simulation_plan("kidnapped", seed=3, updates=40).task.name
        'kidnapped'
    """
    if task not in TASKS:
        raise InputError(None, f"found task {task!r}, {expected_one_of(task, TASKS)}")
    unknown = [name for name in settings if name not in SIMULATED]
    if unknown:
        raise InputError(None, f"found the setting {unknown[0]!r}, {expected_one_of(unknown[0], SIMULATED)}")
    try:
        changes, slips = parse_lights(lights), parse_span(slip_at)
        followed = None if recording is None else Path(recording)
        seen = {"lights": changes, "slip_at": slips, **settings}
        return SimulationPlan(TASKS[task], str(world), recording=followed, **seen)
    except (TypeError, ValueError) as problem:
        raise InputError(None, str(problem)) from None


SIMULATED = tuple(each.name for each in fields(SimulationPlan))


def simulate(
    plan: SimulationPlan | str,
    to: str | Path,
    *,
    force: bool = False,
    progress: NamedProgress | None = None,
) -> SimulationPaths:
    """Drive the simulated Maurice; write its session and survey into a new folder, atomically.

    `plan` is a `simulation_plan`, or its task: tracking, global or kidnapped.

    Returns the paths of both logs. Raises InputError for a folder that holds something (`force` replaces an
    earlier simulation), and for a full disk.

        >>> import maurice_datasets as md
        >>> plan = md.simulation_plan("tracking", updates=2)
        >>> paths = md.simulate(plan, to="drive")  # doctest: +SKIP
        >>> paths.session  # doctest: +SKIP
        PosixPath('drive/session.log')
    """
    simulation = simulation_plan(plan) if isinstance(plan, str) else plan
    return write_simulation(Path(to), simulation, force=force, progress=progress)


def session_info(set_up: Stage) -> SessionInfo:
    """Return the header of a session: its map is the survey's, which does not know of things moved since."""
    plan, eye = set_up.plan, set_up.eye
    things = (f"pieces of furniture moved after the survey: {plan.moved}",) if plan.moved else ()
    changes = (f"tier {plan.tier}", *eye.notes, *things, *set_up.course.notes)
    generator = LASER_GENERATOR if plan.laser else GENERATOR
    return SessionInfo(
        name=f"{plan.task.title} in {Path(plan.world).stem}, arena seed {plan.arena_seed}, seed {plan.seed}",
        display_units="m" if plan.laser else "in",
        robot="Maurice (simulated)",
        motion=set_up.course.motion,
        cameras=() if isinstance(eye, SimulatedLaser) else (camera_of(eye.lens),),
        start=set_up.course.start if plan.task.start_known else None,
        survey=MAP if plan.laser else SURVEY,
        arena=set_up.surveyed.arena,
        notes=(f"simulated: {set_up.surveyed.name}, generator {generator}", *changes),
    )


def play(set_up: Stage, log: LogLines, report: NamedProgress) -> None:
    """Drive the robot and write the session."""
    course, arena = set_up.course, set_up.world.arena
    write_segments(log, course.start, course.segments(), set_up.eye, arena, course.total, report)


def known_of(set_up: Stage, report: NamedProgress) -> Path:
    """Return what is known of the world before a drive, from the cache: a survey's log, or a laser's map."""
    plan, world = set_up.plan, set_up.surveyed
    if not plan.laser:
        survey_folder = cached_survey(world, plan.arena_seed, report, half_resolution=plan.half_resolution)
        return survey_folder / SURVEY.name
    key = f"{GENERATOR}-{fingerprint(world)[:24]}"

    def make(folder: Path) -> None:
        with new_folder(folder) as filling:
            write_ros_map(occupancy_of(world.arena, world.nodes), filling / MAP.name)
            seal(filling, key)

    return cached("maps", key, make) / MAP.name


def write_known(folder: Path, set_up: Stage, report: NamedProgress) -> None:
    """Write what is known of the world before a drive beside its session. InputError if it cannot be."""
    place = MAP if set_up.plan.laser else SURVEY
    copy_whole(known_of(set_up, report).parent, folder / place.parent)


def write_simulation(
    folder: Path,
    plan: SimulationPlan,
    *,
    surveyor: Surveyor | None = None,
    lossless: bool = False,
    force: bool = False,
    progress: NamedProgress | None = None,
) -> SimulationPaths:
    """Write a session and its survey (cached without a surveyor) into a new folder, all of it or nothing.

    `lossless` writes the session's pictures as PNG: a replay is then the run of trials, to the last bit.
    InputError when the folder holds something (`force` replaces an earlier simulation), and for worlds and
    recordings that cannot be used.
    """
    report = progress or (lambda done, total, what: None)
    expect_apart(folder, *(() if plan.recording is None else (plan.recording,)))
    with new_folder(folder, SIMULATION, force=force) as filling, one_thread():
        set_up = stage(plan)
        if plan.laser or surveyor is None:
            write_known(filling, set_up, report)
        else:
            camera = survey_camera(set_up.surveyed, plan.arena_seed, half_resolution=plan.half_resolution)
            write_survey(filling / SURVEY, set_up.surveyed, camera, surveyor, report)
        pictures: PictureKind = "png" if lossless else "jpeg"
        with SessionWriter(filling / SESSION_LOG, session_info(set_up), pictures=pictures) as log:
            play(set_up, log, report)
        key = plan.task.name, plan.arena_seed, plan.seed, plan.updates
        seal(filling, simulation_key(*key, laser=plan.laser))
    return paths_in(folder)


def demo_plan(seed: int = DEMO, updates: int = UPDATES) -> SimulationPlan:
    """Return the demo's drive of one seed: position tracking where nothing changes."""
    return SimulationPlan(TASKS["tracking"], arena_seed=seed, seed=seed, updates=updates, slip_chance=0.0)


def kidnapping_plan() -> SimulationPlan:
    """Return the demo's drive of a robot that is carried away, in the demo's arena."""
    task, updates = TASKS["kidnapped"], KIDNAPPING_UPDATES
    return SimulationPlan(task, arena_seed=DEMO, seed=KIDNAPPING_SEED, updates=updates)


def laser_plan() -> SimulationPlan:
    """Return the demo's drive with a laser: a robot that is carried away in an office."""
    task = TASKS["kidnapped"]
    return SimulationPlan(
        task,
        "office",
        arena_seed=DEMO,
        seed=LASER_SEED,
        updates=LASER_UPDATES,
        slip_chance=0.0,
        laser=True,
    )


def frame_of(number: int, t_s: float, motions: F64, seen: U8 | LaserScan) -> Frame:
    """Return the frame of what the robot saw, after movements (M, 3)."""
    if isinstance(seen, LaserScan):
        return Frame(number, t_s, motions, NO_PICTURE, "", scan=seen)
    return Frame(number, t_s, motions, seen, "")


def moment_of(number: int, segment: Segment, before: Segment | None, eye: Eye) -> Moment:
    """Return the moment of a segment, the `number`-th, after the one `before`; the eye looks at its end."""
    motions = [entry.motion for entry in segment.entries if isinstance(entry, Motion)]
    texts = [KIDNAPPED] if before is not None and before.kidnapped_to is not None else []
    texts += [entry.text for entry in segment.entries if isinstance(entry, Note)]
    moved = np.array(motions).reshape(-1, 3)
    frame = frame_of(number, segment.t_s, moved, eye.take(number, segment.pose))
    return Moment(frame, segment.pose, (*texts, *eye.events(number)))


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRecording:
    """What the log of a drive with a laser holds."""

    set_up: Stage
    info: SessionInfo
    path: Path = Path("drive")  # its name in messages
    pictureless: bool = True

    def records(self, notes: ReadingNotes) -> Iterator[Record]:
        """Drive and scan from the beginning, on every call."""
        course, eye, arena = self.set_up.course, self.set_up.eye, self.set_up.world.arena
        yield from begun(course.start, arena)
        for number, segment in enumerate(course.segments(), start=1):
            yield from records_of(number, segment, eye, arena)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSession:
    """The session of a plan: the moments of its log, without JPEG compression and rounding to text."""

    set_up: Stage
    info: SessionInfo

    def moments(self) -> Iterator[Moment]:
        """Drive and look from the beginning, on every call; which scans are used is decided as in a log."""
        if isinstance(self.set_up.eye, SimulatedLaser):
            yield from RecordedSession(SimulatedRecording(self.set_up, self.info)).moments()
            return
        eye, before = self.set_up.eye, None
        for number, segment in enumerate(self.set_up.course.segments(), start=1):
            yield moment_of(number, segment, before, eye)
            before = segment


def simulated_session(plan: SimulationPlan, surveyed: World | None = None) -> SimulatedSession:
    """Set a plan's session up, in its world unless it was loaded before; many drives then share its light.

    InputError for worlds and recordings that cannot be used.
    """
    set_up = stage(plan, surveyed)
    return SimulatedSession(set_up, session_info(set_up))
