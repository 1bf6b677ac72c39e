"""The embedded default: a survey and a recorded drive in the simulated arena, as files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from maurice_loaders.errors import LogError
from maurice_loaders.folders import cache_root, discard, new_folder
from maurice_loaders.session_writer import SessionWriter
from maurice_mcl.arena import Arena
from maurice_mcl.session import Camera, SessionInfo
from maurice_mcl.typing import F64

from .camera import Lens
from .drive import Update, drive
from .light import bake
from .robot import Chassis
from .survey import Outing, Surveyor, references, session_outing, survey_outing
from .two_rooms import free_nodes, two_rooms
from .world import World, floor_at

GENERATOR = 1  # raise it whenever the same seed gives other files: old caches are then not used
UPDATES = 120
FINISHED = "demo.json"  # written last: without it a demo is not whole
SURVEY = Path("survey") / "survey.log"  # beside the session's log

FRAME_S = 3.3  # to fetch an 88 x 143 frame at 115,200 baud (worked out from the CMUcam2's manual)
SETTLE_S = 0.5  # before and after each movement; invented
TURN_RAD_S = float(np.radians(45))  # invented
DRIVE_M_S = 0.15  # invented
SURVEY_S = 12.0  # to place the robot and take one reference; invented

Progress = Callable[[int, int, str], None]  # done, all, what is being made


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


def info_of(world: World, seed: int, name: str) -> SessionInfo:
    """Give what survey and session have in common."""
    notes = (f"simulated: {world.name}, generator {GENERATOR}",)
    return SessionInfo(
        name=f"{name}, seed {seed}",
        display_units="in",
        robot="Maurice (simulated)",
        motion=Chassis().motion_header(),
        cameras=(camera_of(Lens()),),
        arena=world.arena,
        notes=notes,
    )


def write_demo(
    folder: Path,
    seed: int = 0,
    *,
    updates: int = UPDATES,
    surveyor: Surveyor | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> DemoPaths:
    """Write survey and session of one seed into a new folder, all of it or nothing.

    LogError when the folder exists and holds something (`force` replaces an earlier demo).
    """
    report = progress or (lambda done, total, what: None)
    with new_folder(folder, force=force, ours=FINISHED) as filling, one_thread():
        world = two_rooms(seed)
        scene = bake(world)
        write_survey(filling / SURVEY, world, survey_outing(scene, seed), surveyor or Surveyor(), report)
        write_session(filling / "session.log", world, session_outing(scene, seed), updates, report)
        (filling / FINISHED).write_text(finished_note(filling, cache_key(seed, updates)), encoding="utf-8")
    return paths_in(folder)


def paths_in(folder: Path) -> DemoPaths:
    """Name the two logs of a demo's folder."""
    return DemoPaths(folder / "session.log", folder / SURVEY)


def write_survey(path: Path, world: World, outing: Outing, surveyor: Surveyor, report: Progress) -> None:
    """Write the covered pictures, then every reference with its nominal pose."""
    nodes = free_nodes(world.arena)
    total = len(nodes) * surveyor.headings
    with SessionWriter(
        path, info_of(world, outing.seed, "survey of the Maurice arena"), kind="survey"
    ) as log:
        for number in range(surveyor.covered):
            log.image(number * FRAME_S, outing.take_covered(number), covered=True, camera="front")
        t_s = surveyor.covered * FRAME_S
        for number, (pose, picture) in enumerate(references(nodes, outing, surveyor), start=1):
            log.image(t_s + number * SURVEY_S, picture, pose=pose, camera="front")
            report(number, total, "survey")


def write_session(path: Path, world: World, outing: Outing, updates: int, report: Progress) -> None:
    """Write one drive: for each update a turn, a straight and a picture, with the truth beside them."""
    start, steps = drive(world.arena, outing.seed, updates)
    info = info_of(world, outing.seed, "position tracking in the Maurice arena")
    with SessionWriter(path, replace(info, start=start, survey=SURVEY)) as log:
        log.event(0.0, f"floor {floor_at(world.arena, start[0], start[1])}")
        log.truth(0.0, start)
        t_s = 0.0
        for number, update in enumerate(steps, start=1):
            t_s = write_update(log, t_s, update, world.arena)
            log.image(t_s, outing.take(number, update.pose), camera="front")
            log.truth(t_s, update.pose)
            report(number, updates, "session")


def write_update(log: SessionWriter, t_s: float, update: Update, arena: Arena) -> float:
    """Write the movements of one update and the floors it crossed; gives the time of its picture."""
    turned = t_s + 2 * SETTLE_S + abs(float(update.turn.measured[2])) / TURN_RAD_S
    log.odometry(turned, update.turn.measured, update.turn.encoders_m)
    path, took = update.straight.path, float(update.straight.measured[0]) / DRIVE_M_S
    for share, floor in crossings(path, arena):
        log.event(turned + SETTLE_S + share * took, f"floor {floor}")
    driven = turned + 2 * SETTLE_S + took
    log.odometry(driven, update.straight.measured, update.straight.encoders_m)
    return driven + FRAME_S


def crossings(path: F64, arena: Arena) -> list[tuple[float, str]]:
    """Give how far along a path (K, 3) the floor changes, as a share of it, and to which floor."""
    names = [floor_at(arena, float(x), float(y)) for x, y, _ in path]
    return [(k / (len(names) - 1), names[k]) for k in range(1, len(names)) if names[k] != names[k - 1]]


def cache_key(seed: int, updates: int) -> str:
    """Name a demo so that another generator, seed or length never takes its place."""
    return f"maurice-{GENERATOR}-seed{seed}-{updates}"


def digest(folder: Path) -> str:
    """Give a checksum of all files of a demo but the note that holds it: names and contents."""
    total = hashlib.sha256()
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name != FINISHED:
            total.update(file.relative_to(folder).as_posix().encode())
            total.update(file.read_bytes())
    return total.hexdigest()


def finished_note(folder: Path, key: str) -> str:
    """Write down what a finished demo is and what its files sum to."""
    return json.dumps({"demo": key, "sha256": digest(folder)}) + "\n"


def whole(folder: Path, key: str) -> bool:
    """Tell whether a demo is finished and its files are as they were written."""
    try:
        return (folder / FINISHED).read_text(encoding="utf-8") == finished_note(folder, key)
    except OSError:
        return False


def demo_paths(seed: int = 0, progress: Progress | None = None) -> DemoPaths:
    """Give the demo from the user's cache (MAURICE_CACHE names another place).

    It is made when absent, and made again when damaged. Two who make it at once do no harm.
    """
    key = cache_key(seed, UPDATES)
    folder = cache_root() / "demos" / key
    if folder.exists() and not whole(folder, key):
        discard(folder)
    if not folder.exists():
        try:
            write_demo(folder, seed, progress=progress)
        except LogError:
            if not whole(folder, key):  # otherwise somebody else was faster
                raise
    return paths_in(folder)
