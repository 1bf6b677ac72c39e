"""The survey: reference pictures at every free node in eight headings, and some with the lens covered.

References are placed by hand, so a little off; they are labeled with where they should have been.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.files.text import MOST_TABLE_BYTES, read_bounded
from maurice_loaders.files.writing import new_folder
from maurice_loaders.session_log.writer import SessionWriter
from maurice_mcl.values import F64, INCH_M, U8, Camera, Domain, NamedProgress, SessionInfo, stream, wrap

from .folders import SIMULATED_SURVEY, cached, fingerprint, seal
from .render.camera import Lens
from .render.camera_session import CameraSession, survey_camera
from .robot.motion import Chassis
from .robot.segments import FRAME_S
from .tasks import GENERATOR, SURVEY, TIERS, SimPurpose
from .worlds.build import build_world, check_tier, load_plan
from .worlds.world import World, clearance, inside

SURVEY_S = 12.0  # to place the robot and take one reference; invented
LATER = 1_000_000  # number of the first reference of a later survey: its noise is its own
POSE_COLUMNS, FARTHEST = ("x_m", "y_m", "heading_deg"), 1e6
AHEAD_M = 1.6  # of some poses one with so much room ahead is preferred


@dataclass(frozen=True, slots=True)
class Surveyor:
    """How accurately the survey is made."""

    place_sd_m: float = 0.4 * INCH_M  # of each reference along x and y: tape on the floor
    heading_sd_rad: float = float(np.radians(1.5))  # of each reference: set by eye
    headings: int = 8  # per node, from 0 (thesis 3.3)
    covered: int = 10  # pictures with the lens covered, for the noise floor


def reference_poses(nodes: F64, headings: int) -> F64:
    """Return the nominal poses (K * headings, 3) of nodes (K, 2), node by node."""
    angles = wrap(np.arange(headings) * (2 * np.pi / headings))
    poses = [[x, y, angle] for x, y in nodes for angle in angles]
    return np.array(poses)


def placed_poses(nominal: F64, seed: int, surveyor: Surveyor, first: int = 0) -> F64:
    """Return where the references (L, 3) really were: each a little off its nominal pose."""
    rng = stream(Domain.SIMULATOR, seed, first, SimPurpose.SURVEY_PLACING)
    sd = np.array([surveyor.place_sd_m, surveyor.place_sd_m, surveyor.heading_sd_rad])
    return np.asarray(nominal + rng.standard_normal(nominal.shape) * sd)


def references(
    nominal: F64, camera: CameraSession, surveyor: Surveyor, first: int = 0
) -> Iterator[tuple[F64, U8]]:
    """Return nominal pose (3,) and picture of each reference (L, 3); a later survey's from LATER on."""
    placed = placed_poses(nominal, camera.seed, surveyor, first)
    for number, (label, pose) in enumerate(zip(nominal, placed, strict=True), start=first):
        yield label, camera.take(number, pose)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit OpenCV to one thread inside the block: faces are too small to gain from more."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def camera_of(lens: Lens) -> Camera:
    """Describe the lens as a header does."""
    return Camera("front", lens.width_px, lens.height_px, lens.horizontal_fov_rad, 0.0, lens.height_m)


def _survey_info(world: World, camera: CameraSession) -> SessionInfo:
    return SessionInfo(
        name=f"survey of {world.name}",
        display_units="in",
        robot="Maurice (simulated)",
        motion=Chassis().motion_header(),
        cameras=(camera_of(camera.lens),),
        arena=world.arena,
        notes=(f"simulated: {world.name}, generator {GENERATOR}", *camera.notes),
    )


def _surveyor_of(world: World) -> Surveyor:
    return Surveyor(headings=world.headings)


def write_survey(
    path: Path,
    world: World,
    camera: CameraSession,
    surveyor: Surveyor,
    report: NamedProgress,
    poses: F64 | None = None,
) -> None:
    """Write the covered pictures, then every reference with its nominal pose, or those at `poses` (L, 3)."""
    nominal, first = (reference_poses(world.nodes, surveyor.headings), 0) if poses is None else (poses, LATER)
    pictures = references(nominal, camera, surveyor, first)
    with SessionWriter(path, _survey_info(world, camera), kind="survey") as log:
        for number in range(surveyor.covered):
            log.image(number * FRAME_S, camera.take_covered(number), covered=True, camera="front")
        t_s = surveyor.covered * FRAME_S
        for number, (pose, picture) in enumerate(pictures, start=1):
            log.image(t_s + number * SURVEY_S, picture, pose=pose, camera="front")
            report(number, len(nominal), "survey")


def cached_survey(world: World, seed: int, report: NamedProgress, *, half_resolution: bool = False) -> Path:
    """Return the folder of a world's survey, from the cache; it depends on world and arena seed alone."""
    key = f"{GENERATOR}-{fingerprint(world)[:24]}-{seed}{'-half' if half_resolution else ''}"

    def make(folder: Path) -> None:
        with new_folder(folder) as filling:
            camera = survey_camera(world, seed, half_resolution=half_resolution)
            write_survey(filling / SURVEY.name, world, camera, _surveyor_of(world), report)
            seal(filling, key)

    return cached("surveys", key, make)


def write_survey_folder(
    folder: Path,
    world: World,
    seed: int,
    *,
    half_resolution: bool = False,
    poses: F64 | None = None,
    force: bool = False,
    progress: NamedProgress | None = None,
) -> Path:
    """Write a survey log with its pictures into a new folder, all or nothing; return the log's path."""
    report = progress or (lambda done, total, what: None)
    with new_folder(folder, SIMULATED_SURVEY, force=force) as filling, one_thread():
        camera = survey_camera(world, seed, half_resolution=half_resolution)
        write_survey(filling / SURVEY.name, world, camera, _surveyor_of(world), report, poses)
        seal(filling, f"survey-{GENERATOR}-{seed}")
    return folder / SURVEY.name


def survey(
    world: str | Path,
    to: str | Path,
    *,
    tier: str = "nominal",
    seed: int = 0,
    spacing_m: float | None = None,
    headings: int | None = None,
    poses: F64 | None = None,
    half_resolution: bool = False,
    force: bool = False,
    progress: NamedProgress | None = None,
) -> Path:
    """Take the reference pictures of a simulated world; return the path of the survey's log.

    `world` is a name or a TOML file (docs/simulate.md), `tier` nominal, dim or hard; `seed` draws everything
    that the file leaves to it. `spacing_m` between places and `headings` per place override the file;
    with `poses` (L, 3), in meters and radians, only these are taken. Raises
    InputError for a world, tier or folder that cannot be used (`force` replaces an earlier survey),
    and for a full disk.

        >>> import maurice_datasets as md, maurice_loaders as ml
        >>> log = md.survey("two-rooms", to="rooms")  # doctest: +SKIP
        >>> library = ml.build_library(log)  # doctest: +SKIP
    """
    drawn = surveyed_world(world, seed, tier, spacing_m, headings)
    return write_survey_folder(
        Path(to), drawn, seed, half_resolution=half_resolution, poses=poses, force=force, progress=progress
    )


def read_poses(path: Path) -> F64:
    """Read poses (L, 3) from a table with the columns x_m, y_m and heading_deg. InputError for any other."""
    expected = "expected a table (.csv) with the columns x_m, y_m and heading_deg, as `library check` writes"
    try:
        rows = list(csv.DictReader(read_bounded(path, "a table", MOST_TABLE_BYTES).decode().splitlines()))
        values = [[float(row[name]) for name in POSE_COLUMNS] for row in rows]
    except (OSError, UnicodeDecodeError, KeyError, TypeError, ValueError, csv.Error) as problem:
        raise InputError(path, f"cannot be read ({' '.join(str(problem).split())}); {expected}") from None
    poses = np.array(values, np.float64).reshape(-1, 3)
    if not len(poses) or not (np.abs(poses) < FARTHEST).all():
        raise InputError(path, f"found {'a pose out of range' if len(poses) else 'no pose'}; {expected}")
    return np.column_stack([poses[:, :2], wrap(np.radians(poses[:, 2]))])


def surveyed_world(
    name_or_path: str | Path, seed: int, tier: str, spacing_m: float | None, headings: int | None
) -> World:
    """Draw a world, with another spacing or number of headings than its file says where one is given."""
    plan, known_tier = load_plan(name_or_path), check_tier(name_or_path, tier)
    library = plan.library
    if spacing_m is not None:
        library = replace(library, spacing_in=spacing_m / INCH_M)
    if headings is not None:
        library = replace(library, headings=headings)
    return build_world(replace(plan, library=library), seed, TIERS[known_tier])


def views(world: World, seed: int, count: int) -> F64:
    """Choose poses (count, 3) to look at a world from: every room in turn, with some depth ahead."""
    rng = stream(Domain.SIMULATOR, seed, 0, SimPurpose.START)
    rooms = [world.nodes[inside(room.polygon, world.nodes)] for room in world.arena.rooms]
    rooms = [nodes for nodes in rooms if len(nodes)]
    poses = []
    for k in range(count):
        nodes = rooms[k % len(rooms)]
        best = max(
            (np.array([*nodes[int(rng.integers(len(nodes)))], rng.uniform(-np.pi, np.pi)]) for _ in range(6)),
            key=lambda pose: min(depth(world, pose), AHEAD_M),
        )
        poses.append(best)
    return np.array(poses)


def depth(world: World, pose: F64) -> float:
    """Return about how far one sees straight ahead from a pose (3,), up to 2 m."""
    steps = np.arange(0.1, 2.0, 0.1)
    ahead = pose[:2] + steps[:, None] * np.array([np.cos(pose[2]), np.sin(pose[2])])
    blocked = clearance(world.arena, ahead) < 0.06
    return float(steps[int(blocked.argmax())]) if blocked.any() else 2.0
