"""A survey by itself: its log and pictures in a folder, and views to judge a world by."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from maurice_loaders.io.files import new_folder
from maurice_mcl.arrays import F64
from maurice_mcl.geometry import INCH_M
from maurice_mcl.randomness import Domain, stream

from .folders import NOTE, seal
from .maurice import GENERATOR, SURVEY, one_thread, surveyor_of, write_survey
from .render.camera_session import survey_camera
from .robot.segments import Progress
from .seeds import SimPurpose
from .tasks import TIERS
from .worlds.build import build_world
from .worlds.world import World, clearance, inside
from .worlds.world_file import check_tier, load_plan

AHEAD_M = 1.6  # of some poses one with so much room ahead is preferred


def surveyed_world(
    name_or_path: str | Path, seed: int, tier: str, spacing_m: float | None, headings: int | None
) -> World:
    """Draw a world, with another spacing or number of headings than its file says where one is given."""
    plan, found = load_plan(name_or_path), check_tier(name_or_path, tier)
    library = plan.library
    if spacing_m is not None:
        library = replace(library, spacing_in=spacing_m / INCH_M)
    if headings is not None:
        library = replace(library, headings=headings)
    return build_world(replace(plan, library=library), seed, TIERS[found])


def write_survey_folder(
    folder: Path,
    world: World,
    seed: int,
    *,
    half_resolution: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write a survey log with its pictures into a new folder, all of it or nothing; gives the log's path."""
    report = progress or (lambda done, total, what: None)
    with new_folder(folder, force=force, ours=NOTE) as filling, one_thread():
        camera = survey_camera(world, seed, half_resolution=half_resolution)
        write_survey(filling / SURVEY.name, world, camera, surveyor_of(world), report)
        seal(filling, f"survey-{GENERATOR}-{seed}")
    return folder / SURVEY.name


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
    """Give about how far one sees straight ahead from a pose (3,), up to 2 m."""
    steps = np.arange(0.1, 2.0, 0.1)
    ahead = pose[:2] + steps[:, None] * np.array([np.cos(pose[2]), np.sin(pose[2])])
    blocked = clearance(world.arena, ahead) < 0.06
    return float(steps[int(blocked.argmax())]) if blocked.any() else 2.0
