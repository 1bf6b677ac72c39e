"""Surveys and sessions of the simulated Maurice as files: the survey of a world, and the demo's two logs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2

from maurice_loaders.io.files import new_folder
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.session import Camera, SessionInfo

from .folders import NOTE, cached, copy_whole, fingerprint, seal
from .render.camera import Lens
from .render.camera_session import CameraSession, survey_camera
from .robot.motion import Chassis
from .robot.segments import FRAME_S, Log, Progress, write_segments
from .simulation import SimulationPlan, Stage, stage
from .survey import Surveyor, references
from .tasks import TASKS, UPDATES
from .worlds.world import World

GENERATOR = 2  # raise it whenever the same seed gives other files: old caches are then not used
SURVEY = Path("survey") / "survey.log"  # beside the session's log
SURVEY_S = 12.0  # to place the robot and take one reference; invented


@dataclass(frozen=True, slots=True)
class DemoPaths:
    """Where the two logs are."""

    session: Path
    survey: Path


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep OpenCV to one thread for a while: faces are too small to be worth sharing out."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def camera_of(lens: Lens) -> Camera:
    """Describe the lens as a header does."""
    return Camera("front", lens.width_px, lens.height_px, lens.horizontal_fov_rad, 0.0, lens.height_m)


def survey_info(world: World, camera: CameraSession) -> SessionInfo:
    """Give the header of a world's survey."""
    return SessionInfo(
        name=f"survey of {world.name}",
        display_units="in",
        robot="Maurice (simulated)",
        motion=Chassis().motion_header(),
        cameras=(camera_of(camera.lens),),
        arena=world.arena,
        notes=(f"simulated: {world.name}, generator {GENERATOR}", *camera.notes),
    )


def session_info(set_up: Stage) -> SessionInfo:
    """Give the header of a session: its map is the survey's, which does not know of things moved since."""
    plan = set_up.plan
    return SessionInfo(
        name=f"{plan.task.title} in {Path(plan.world).stem}, arena seed {plan.arena_seed}, seed {plan.seed}",
        display_units="in",
        robot="Maurice (simulated)",
        motion=set_up.course.motion,
        cameras=(camera_of(set_up.camera.lens),),
        start=set_up.course.start if plan.task.start_known else None,
        survey=SURVEY,
        arena=set_up.surveyed.arena,
        notes=(f"simulated: {set_up.surveyed.name}, generator {GENERATOR}", *notes_of(set_up)),
    )


def notes_of(set_up: Stage) -> tuple[str, ...]:
    """Say in the header what a reader of the session may want to know."""
    moved = set_up.plan.moved
    things = (f"pieces of furniture moved after the survey: {moved}",) if moved else ()
    return (f"tier {set_up.plan.tier}", *set_up.camera.notes, *things, *set_up.course.notes)


def play(set_up: Stage, log: Log, report: Progress) -> None:
    """Let the robot drive, and write down what happens."""
    course = set_up.course
    write_segments(
        log, course.start, course.segments(), set_up.camera, set_up.world.arena, course.total, report
    )


def write_survey(
    path: Path, world: World, camera: CameraSession, surveyor: Surveyor, report: Progress
) -> None:
    """Write the covered pictures, then every reference with its nominal pose."""
    total = len(world.nodes) * surveyor.headings
    with SessionWriter(path, survey_info(world, camera), kind="survey") as log:
        for number in range(surveyor.covered):
            log.image(number * FRAME_S, camera.take_covered(number), covered=True, camera="front")
        t_s = surveyor.covered * FRAME_S
        for number, (pose, picture) in enumerate(references(world.nodes, camera, surveyor), start=1):
            log.image(t_s + number * SURVEY_S, picture, pose=pose, camera="front")
            report(number, total, "survey")


def survey_folder(plan: SimulationPlan, world: World, report: Progress) -> Path:
    """Give the folder of a world's survey from the cache: it depends on world, tier and arena seed alone."""
    camera = "-half" if plan.half_resolution else ""
    key = f"{GENERATOR}-{fingerprint(world)[:24]}-{plan.arena_seed}{camera}"

    def make(folder: Path) -> None:
        with new_folder(folder) as filling:
            camera = survey_camera(world, plan.arena_seed, half_resolution=plan.half_resolution)
            write_survey(filling / SURVEY.name, world, camera, surveyor_of(world), report)
            seal(filling, key)

    return cached("surveys", key, make)


def surveyor_of(world: World) -> Surveyor:
    """Give the surveyor that takes as many headings as the world says."""
    return Surveyor(headings=world.headings)


def write_simulation(
    folder: Path,
    plan: SimulationPlan,
    *,
    surveyor: Surveyor | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> DemoPaths:
    """Write a session and the survey it belongs to into a new folder, all of it or nothing.

    InputError when the folder exists and holds something (`force` replaces an earlier one), for worlds and
    recordings that cannot be used. Without a surveyor the survey comes from the cache.
    """
    report = progress or (lambda done, total, what: None)
    with new_folder(folder, force=force, ours=NOTE) as filling, one_thread():
        set_up = stage(plan)
        if surveyor is None:
            kept = survey_folder(plan, set_up.surveyed, report)
            copy_whole(kept, filling / SURVEY.parent)
        else:
            camera = survey_camera(set_up.surveyed, plan.arena_seed, half_resolution=plan.half_resolution)
            write_survey(filling / SURVEY, set_up.surveyed, camera, surveyor, report)
        with SessionWriter(filling / "session.log", session_info(set_up)) as log:
            play(set_up, log, report)
        seal(filling, key_of(plan))
    return paths_in(folder)


def write_demo(
    folder: Path,
    seed: int = 0,
    *,
    updates: int = UPDATES,
    surveyor: Surveyor | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> DemoPaths:
    """Write survey and session of one seed into a new folder: position tracking where nothing changes."""
    plan = demo_plan(seed, updates)
    return write_simulation(folder, plan, surveyor=surveyor or Surveyor(), force=force, progress=progress)


def demo_plan(seed: int, updates: int) -> SimulationPlan:
    """Give the demo's plan: no slips, so that a first picture is not one of bad luck."""
    return SimulationPlan(TASKS["tracking"], arena_seed=seed, seed=seed, updates=updates, slip_chance=0.0)


def key_of(plan: SimulationPlan) -> str:
    """Name what is made from a plan so that another generator or plan never takes its place."""
    return f"{plan.task.name}-{GENERATOR}-seed{plan.arena_seed}-{plan.seed}-{plan.updates}"


def paths_in(folder: Path) -> DemoPaths:
    """Name the two logs of a folder."""
    return DemoPaths(folder / "session.log", folder / SURVEY)


def demo_paths(seed: int = 0, progress: Progress | None = None) -> DemoPaths:
    """Give the demo from the user's cache (MAURICE_CACHE names another place), made when it is not there."""
    key = key_of(demo_plan(seed, UPDATES))
    return paths_in(cached("demos", key, lambda folder: write_demo(folder, seed, progress=progress)))
