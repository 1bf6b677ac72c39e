"""How causes are planted in drives with a laser. Each takes a world with its map, and a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from maurice_datasets.render.laser import occupancy_of
from maurice_datasets.robot.planner import free_pose, raster
from maurice_datasets.sessions import SimulatedSession, session_info
from maurice_datasets.simulation import SimulationPlan, stage
from maurice_datasets.tasks import TASKS
from maurice_datasets.trials.drives import RenderedSession
from maurice_datasets.worlds.build import load_world
from maurice_datasets.worlds.world import World, cast
from maurice_mcl.config.parameters import ALPHAS
from maurice_mcl.reasons.causes import (
    AMBIGUITY,
    FLAT,
    KIDNAPPED,
    LEFT_MAP,
    MOTION,
    MOUNT,
    PROPOSAL,
    START,
    UNSEEN,
    VIEW,
    WRONG_MAP,
)
from maurice_mcl.sensor.map_places import map_library
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose, motion_between
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.library import Library
from maurice_mcl.values.session import Moment

from .drives import anywhere, odometry_changed, started_at, with_moments

MOVEMENTS = 24  # of a drive: some 75 updates
SINCE = (16, 24)  # updates between which a cause begins ...
AFTER = (5, 8)  # ... and movements
HEALTHY = "healthy"
# over the preset "amcl": the robot's own motion, and the model that sums logs, with which it finds its way
FILTER: Mapping[str, Any] = {
    "motion": {"model": "odometry", **dict.fromkeys(ALPHAS, 0.02)},
    "sensor.laser.model": "likelihood_field_prob",
}
SEARCHING: Mapping[str, Any] = {**FILTER, "resampling.adaptive": False, "particles": 10_000}
NAV2: Mapping[str, Any] = {"motion": {"model": "odometry", **dict.fromkeys(ALPHAS, 0.2)}}
SEEING: Mapping[str, Any] = {**FILTER, **NAV2}  # so that scans must keep the robot on its way
FAR_M = 1.5  # a wrong start is at least so far away
REACH_M, CELL_M = 6.0, 0.05
KNOWN_M = 1.2  # of the map around the way up to where it ends
THINGS_M2 = 1.0  # a square meter
SPARSE = 8  # one scan of so many is used
SPARSE_MOVEMENTS = 60
CORRIDOR_UPDATES = 60


@dataclass(frozen=True, slots=True, eq=False)
class LaserGround:
    """A world, and its map."""

    world: World
    name: str
    arena_seed: int
    library: Library

    @property
    def grid(self) -> OccupancyMap:
        """The map."""
        assert self.library.occupancy is not None
        return self.library.occupancy


@dataclass(frozen=True, slots=True, eq=False)
class LaserPlanting:
    """A drive with a cause in it, its map, and the filter that is to run over it."""

    way: str
    since: int  # first update at which it can do harm
    session: RenderedSession
    library: Library
    settings: Mapping[str, Any]
    plain: RenderedSession  # the same drive without the cause
    usual: Mapping[str, Any]  # a filter that is fine there


Way = Callable[[LaserGround, int, np.random.Generator], LaserPlanting]
Change = Callable[[LaserScan, F64, int], LaserScan]  # a scan, the true pose (3,) and the update


@lru_cache(4)
def laser_ground(name: str, arena_seed: int) -> LaserGround:
    """Load a world and make its map."""
    world = load_world(name, arena_seed)
    library = map_library(occupancy_of(world.arena, world.nodes), name)
    return LaserGround(world, name, arena_seed, library)


@lru_cache(8)
def _plain(ground: LaserGround, seed: int) -> RenderedSession:
    return _driven(ground, seed, "tracking")


def drive(ground: LaserGround, seed: int, *, task: str = "tracking", **changes: Any) -> RenderedSession:
    """Drive a seed, and forget what the log would say of it."""
    return (
        _plain(ground, seed) if task == "tracking" and not changes else _driven(ground, seed, task, **changes)
    )


def _driven(ground: LaserGround, seed: int, task: str, **changes: Any) -> RenderedSession:
    plan = SimulationPlan(
        TASKS[task],
        world=ground.name,
        arena_seed=ground.arena_seed,
        seed=seed,
        slip_chance=0.0,
        laser=True,
        **{"updates": MOVEMENTS, **changes},
    )
    set_up = stage(plan, ground.world)
    info = replace(session_info(set_up), survey=None, notes=())
    moments = SimulatedSession(set_up, info).moments()
    return RenderedSession(info, tuple(replace(moment, events=()) for moment in moments))


def _step_after(ground: LaserGround, seed: int, movement: int) -> int:
    """Return the first update after a movement of a drive."""
    plan = SimulationPlan(
        TASKS["tracking"], ground.name, seed=seed, updates=movement, slip_chance=0.0, laser=True
    )
    *_, last = stage(plan, ground.world).course.segments()
    return 1 + sum(moment.frame.time_s <= last.t_s for moment in drive(ground, seed).moments())


def scans_changed(session: RenderedSession, change: Change, since: int = 1) -> RenderedSession:
    """Return a drive whose scans are changed from an update on."""
    changed = []
    for moment in session.moments():
        scan, truth, step = moment.frame.scan, moment.truth, moment.frame.step
        if scan is not None and truth is not None and step >= since:
            moment = replace(moment, frame=replace(moment.frame, scan=change(scan, truth, step)))
        changed.append(moment)
    return with_moments(session, changed)


# Nothing planted that does harm.


def tracked(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """Nothing happens, and the start is known."""
    return _planted("start known", ground, seed)


def found(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """Nothing happens, and the start is not known."""
    session = anywhere(drive(ground, seed))
    return _planted("start not known", ground, seed, session=session, settings=SEARCHING)


def a_few_people(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """People stand in view in a third of the scans, and a piece of furniture was moved."""
    session = drive(ground, seed, moved=1, people=30)
    return _planted("people, one piece moved", ground, seed, session=session)


# The map, and what the laser sees.


def wrong_map(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The map is that of another place: of another arena, upside down, its rooms moved."""
    other = laser_ground(ground.name, ground.arena_seed + 500).grid
    moved = [round(float(rng.uniform(0.2, 0.4)) * side) for side in other.cells.shape]
    cells = np.roll(other.cells[::-1, ::-1], moved, (0, 1))
    library = map_library(replace(other, cells=np.ascontiguousarray(cells)), "other")
    return _planted("the map of another place", ground, seed, library=library)


def part_mapped(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The map ends where the drive goes on."""
    at, grid = _since(rng), ground.grid
    truths = np.array([moment.truth for moment in drive(ground, seed).all_moments])
    rows, columns = np.indices(grid.cells.shape)
    x, y = grid.corner[:, None, None] + grid.cell_m * (np.stack([columns, rows]) + 0.5)
    known = np.zeros(grid.cells.shape, bool)
    for there in truths[:at]:
        known |= np.hypot(x - there[0], y - there[1]) < KNOWN_M
    library = map_library(replace(grid, cells=np.where(known, grid.cells, np.uint8(UNKNOWN))), "part")
    return _planted("the map ends there", ground, seed, at, library=library, settings=SEEING)


def furniture_moved(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """Things that the map does not have stand about the rooms, since an update."""
    at, plain = _since(rng), drive(ground, seed)
    x_min, y_min, x_max, y_max = ground.grid.bounds
    count = round(THINGS_M2 * (x_max - x_min) * (y_max - y_min))
    middles = rng.uniform((x_min, y_min), (x_max, y_max), (count, 2))
    ways = np.array([moment.truth for moment in plain.all_moments])[:, None, :2]
    middles = middles[(np.linalg.norm(ways - middles, axis=2) > 0.5).all(axis=0)]
    corners = 0.3 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    things = np.concatenate([_outline(middle + corners) for middle in middles])

    def seen(scan: LaserScan, truth: F64, step: int) -> LaserScan:
        return _with_ranges(scan, np.minimum(scan.ranges_m, _reach(scan, truth, things)))

    session = scans_changed(plain, seen, at)
    return _planted("things that the map lacks", ground, seed, at, session=session, settings=SEEING)


def crowded(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """People walk beside the robot and hide most of what the laser saw."""
    at, left = _since(rng), float(rng.uniform(-np.pi, np.pi))

    def seen(scan: LaserScan, truth: F64, step: int) -> LaserScan:
        legs = np.random.default_rng([seed, step]).uniform(0.4, 0.9, 12)
        near = legs.repeat(scan.size // len(legs) + 1)[: scan.size]
        hidden = np.cos(scan.angles_rad - left) > -0.6
        return _with_ranges(scan, np.where(hidden, np.minimum(scan.ranges_m, near), scan.ranges_m))

    session = scans_changed(drive(ground, seed), seen, at)
    return _planted("people all around", ground, seed, at, session=session, settings=SEEING)


def glass(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """Nearly all walls are of glass: beams pass through them, to what is around the building."""
    arena, away_m = ground.world.arena, float(rng.uniform(0.8, 2.0))
    kept = arena.walls[rng.random(len(arena.walls)) < 0.1]
    x_min, y_min, x_max, y_max = np.add(arena.bounds, (-away_m, -away_m, away_m, away_m))
    around = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])
    things = np.concatenate(
        [kept, *map(_outline, [around, *(thing.polygon for thing in arena.obstacles[::2])])]
    )

    def seen(scan: LaserScan, truth: F64, step: int) -> LaserScan:
        return _with_ranges(scan, np.maximum(_reach(scan, truth, things), scan.ranges_m))

    session = scans_changed(drive(ground, seed), seen)
    return _planted("walls of glass", ground, seed, session=session, settings=SEEING)


def dark_walls(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """What is farther than a meter or so gives no answer."""
    most = float(rng.uniform(0.5, 0.8))

    def seen(scan: LaserScan, truth: F64, step: int) -> LaserScan:
        return _with_ranges(scan, np.where(scan.ranges_m > most, np.inf, scan.ranges_m))

    session = scans_changed(drive(ground, seed), seen)
    return _planted("dark walls", ground, seed, session=session, settings=SEEING)


def turned_laser(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The laser is mounted turned, unknown to the recording."""
    yaw = float(rng.choice([-1, 1]) * np.radians(rng.choice([25, 45, 90, 180])))

    def seen(scan: LaserScan, truth: F64, step: int) -> LaserScan:
        return replace(scan, start_rad=scan.start_rad + yaw)

    way, session = f"the laser is turned by {np.degrees(yaw):.0f} deg", drive(ground, seed)
    return _planted(way, ground, seed, session=scans_changed(session, seen))


def mirrored_laser(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The laser is upside down, unknown to the recording."""

    def seen(scan: LaserScan, truth: F64, step: int) -> LaserScan:
        return replace(scan, start_rad=-scan.start_rad, step_rad=-scan.step_rad)

    return _planted("upside down", ground, seed, session=scans_changed(drive(ground, seed), seen))


# How the robot moves.


def carried_away(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The robot is carried to another place."""
    movement = int(rng.integers(*AFTER))
    at = _step_after(ground, seed, movement)
    session = drive(ground, seed, task="kidnapped", kidnap_at=movement)
    return _planted("carried away", ground, seed, at, session=session)


def spinning_wheels(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The wheels spin for some updates."""
    movement = int(rng.integers(*AFTER))
    at = _step_after(ground, seed, movement)
    session = drive(ground, seed, slip_at=range(movement + 1, movement + 7))
    return _planted("the wheels spin", ground, seed, at, session=session)


def bad_odometry(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """Turns are read far too large, from an update on."""
    at = _since(rng)

    def more(motions: F64) -> F64:
        motions[:, 2] *= 2.5
        return motions

    plain = drive(ground, seed)
    session = odometry_changed(plain, more, range(at, len(plain.all_moments) + 1))
    return _planted("turns are read 2.5 times too large", ground, seed, at, session=session)


# The filter, and places alike.


def wrong_start(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The initial pose is far from the true one."""
    plain, free = drive(ground, seed), raster(ground.world.arena)
    assert free is not None
    assert plain.info.start is not None
    session = started_at(plain, free_pose(free, rng, plain.info.start, FAR_M))
    return _planted("the initial pose is wrong", ground, seed, session=session)


def too_few(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """Far too few particles for a start that is not known."""
    settings = {**SEARCHING, "particles": int(rng.integers(20, 60))}
    session = anywhere(drive(ground, seed))
    return _planted("too few particles everywhere", ground, seed, session=session, settings=settings)


def flat_field(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """AMCL with Nav2's defaults, and scans that are far apart."""
    kept, motions = list[Moment](), list[F64]()
    plain = drive(ground, seed, updates=SPARSE_MOVEMENTS)
    before = plain.info.start
    for moment in plain.moments():
        assert moment.truth is not None
        assert before is not None
        motion = motion_between(before, moment.truth)
        before = moment.truth
        motions.append(motion * (1 + 0.02 * rng.standard_normal(3)))
        if moment.frame.step % SPARSE == 0:
            frame = replace(moment.frame, step=moment.frame.step // SPARSE, motions=np.array(motions))
            kept.append(replace(moment, frame=frame))
            motions = []
    session = with_moments(plain, kept)
    planting = _planted("Nav2's defaults, scans far apart", ground, seed, session=session, settings=NAV2)
    usual = {"sensor.laser.model": "likelihood_field_prob"}
    return replace(planting, plain=session, usual=usual)


def twin_places(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """The map has two halves that look the same; the start is not known."""
    grid = ground.grid
    wall = np.full((grid.cells.shape[0], 4), OCCUPIED, np.uint8)
    twin = map_library(replace(grid, cells=np.concatenate([grid.cells, wall, grid.cells], axis=1)), "twins")
    session, settings = anywhere(drive(ground, seed)), {**SEARCHING, "particles": 20_000}
    way = "two halves look the same"
    return _planted(way, ground, seed, session=session, library=twin, settings=settings)


def corridor(ground: LaserGround, seed: int, rng: np.random.Generator) -> LaserPlanting:
    """A corridor without doors, and odometry that reads its length a little wrong."""
    length_m, wide_m, step_m = 40.0, 2.0, 0.3
    columns, rows = (round(side / CELL_M) for side in (length_m, wide_m))
    cells = np.pad(np.full((rows, columns), FREE, np.uint8), 2, constant_values=OCCUPIED)
    grid = OccupancyMap(cells, CELL_M, np.array([-2 * CELL_M] * 2))
    walls = _outline(np.array([[0, 0], [length_m, 0], [length_m, wide_m], [0, wide_m]], float))
    scale, moments = 1 + float(rng.choice([-1, 1]) * rng.uniform(0.06, 0.08)), list[Moment]()
    plain = drive(ground, seed)
    start = pose = np.array([8.0, wide_m / 2 + rng.uniform(-0.3, 0.3), 0.0])
    for moment in plain.all_moments[:CORRIDOR_UPDATES]:
        assert moment.frame.scan is not None
        motion = np.array([step_m, 0.0, float(rng.normal(0, 0.01) - 0.2 * pose[2])])
        pose = compose(pose, motion)
        reach = _reach(moment.frame.scan, pose, walls)
        scan = _with_ranges(moment.frame.scan, reach + 0.01 * rng.standard_normal(len(reach)))
        frame = replace(moment.frame, motions=(motion * [scale, 1, 1])[None], scan=scan)
        moments.append(replace(moment, frame=frame, truth=pose))
    settings = {**FILTER, "motion": {"model": "odometry", **dict.fromkeys(ALPHAS, 0.02)}}
    session, library = with_moments(plain, moments, start), map_library(grid, "corridor")
    return _planted("a long corridor", ground, seed, session=session, library=library, settings=settings)


LASER_WAYS: Mapping[str, tuple[Way, ...]] = {
    HEALTHY: (tracked, found, a_few_people),
    KIDNAPPED: (carried_away,),
    LEFT_MAP: (part_mapped,),
    MOTION: (spinning_wheels, bad_odometry),
    MOUNT: (turned_laser, mirrored_laser),
    WRONG_MAP: (wrong_map,),
    UNSEEN: (glass, dark_walls),
    VIEW: (furniture_moved, crowded),
    START: (wrong_start,),
    AMBIGUITY: (twin_places, corridor),
    FLAT: (flat_field,),
    PROPOSAL: (too_few,),
}


def _planted(
    way: str,
    ground: LaserGround,
    seed: int,
    since: int = 1,
    *,
    session: RenderedSession | None = None,
    library: Library | None = None,
    settings: Mapping[str, Any] = FILTER,
) -> LaserPlanting:
    plain = drive(ground, seed)
    session, library = session or plain, library or ground.library
    known = session.info.start is not None
    usual, plain = (settings, plain) if known else (SEARCHING, anywhere(plain))
    return LaserPlanting(way, since, session, library, settings, plain, usual)


def _since(rng: np.random.Generator) -> int:
    return int(rng.integers(*SINCE))


def _outline(polygon: F64) -> F64:
    return np.concatenate([polygon, np.roll(polygon, -1, axis=0)], axis=1)


def _reach(scan: LaserScan, truth: F64, walls: F64) -> F64:
    """Return how far (B,) the beams of a scan reach among walls (S, 4), taken at a true pose (3,)."""
    laser = compose(truth, scan.mount)
    ranges = cast(laser[:2], scan.angles_rad - scan.mount[2] + laser[2], walls)
    return np.where(ranges > REACH_M, np.inf, ranges)


def _with_ranges(scan: LaserScan, ranges: F64) -> LaserScan:
    return replace(scan, ranges_m=ranges.astype(np.float32))
