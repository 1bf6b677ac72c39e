"""A planar laser on the simulated robot: it sees walls, furniture and people at its own height."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose
from maurice_mcl.values.laser import FREE, OCCUPIED, UNKNOWN, LaserScan, OccupancyMap
from maurice_mcl.values.map import Arena, make_grid
from maurice_mcl.values.randomness import Domain, stream

from ..tasks import SimPurpose
from ..worlds.world import World, cast, inside, segments_of, sides_of
from .people import stands_at

BEAMS = 360  # a degree apart
NEAREST_M, REACH_M = 0.12, 6.0
MOUNT = (0.08, 0.0, 0.0)  # on the robot: a little ahead of the wheels' center
RANGE_SD_M = 0.01
LOST_SHARE = 0.01  # of the beams come back from nothing: dark or shiny surfaces
PERSON_M = 0.15  # radius of a person's legs, both in one
PERSON_SIDES = 8
MARGIN_M = 0.1  # of the map beyond its walls


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedLaser:
    """The laser of one session. Scans are pure functions of number and pose."""

    world: World
    seed: int
    people: float = 0.0  # share of the scans in which people stand in view
    notes: tuple[str, ...] = ()
    _segments: F64 = field(init=False)  # (S, 4)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_segments", segments_of(self.world.arena))

    def take(self, number: int, pose: F64) -> LaserScan:
        """Take scan `number` from a true pose (3,) of the robot."""
        rng = stream(Domain.SIMULATOR, self.seed, number, SimPurpose.SCAN_NOISE)
        stands = stands_at(self.world.arena, pose, self.seed, number, self.people)
        segments = np.concatenate([self._segments, *(_person(who.x_m, who.y_m) for who in stands)])
        step = 2 * np.pi / BEAMS
        laser = compose(pose, np.array(MOUNT))
        ranges = cast(laser[:2], laser[2] - np.pi + step * np.arange(BEAMS), segments)
        ranges = ranges + RANGE_SD_M * rng.standard_normal(BEAMS)
        ranges[(ranges > REACH_M) | (rng.random(BEAMS) < LOST_SHARE)] = np.inf
        measured = np.round(ranges, 3).astype(np.float32)
        return LaserScan(measured, -np.pi, step, NEAREST_M, REACH_M, np.array(MOUNT))

    def events(self, number: int) -> tuple[str, ...]:
        """Return nothing: a laser does not depend on the light."""
        return ()


def _person(x_m: float, y_m: float) -> F64:
    angles = np.arange(PERSON_SIDES) * (2 * np.pi / PERSON_SIDES)
    return sides_of(np.array([x_m, y_m]) + PERSON_M * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def occupancy_of(arena: Arena, places: F64) -> OccupancyMap:
    """Return the map of an arena as a laser would make it; `places` (K, 2) are where a robot can be."""
    x_min, y_min, x_max, y_max = arena.bounds
    wide = Arena(
        (x_min - MARGIN_M, y_min - MARGIN_M, x_max + MARGIN_M, y_max + MARGIN_M), arena.walls, arena.obstacles
    )
    grid = make_grid(wide, places)
    centers, cells = grid.centers(), np.full(grid.free.size, UNKNOWN, np.uint8)
    cells[grid.free.ravel()] = FREE
    for obstacle in arena.obstacles:
        cells[inside(obstacle.polygon, centers)] = OCCUPIED
    cells[grid.walled.ravel()] = OCCUPIED
    return OccupancyMap(cells.reshape(grid.shape), grid.cell_m, grid.corner)
