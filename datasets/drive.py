"""A drive through the arena: goals drawn at random, the way there found on a raster, one update at a time.

The driver sees the arena and knows nothing of library nodes. Every update is a turn of any size and a
straight. The chances of an update are drawn first and are never drawn again: of the commands that chance
proposes, the driver drops those that would end in a wall, as somebody walking beside the robot would.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from maurice_mcl.arena import Arena
from maurice_mcl.geometry import INCH_M
from maurice_mcl.randomness import Domain, stream
from maurice_mcl.typing import F64

from .addresses import Purpose
from .robot import Chassis, Movement, draw_luck, drive_by, turn_by
from .world import clearance


@dataclass(frozen=True, slots=True)
class Habits:
    """How the driver drives."""

    keep_m: float = 6.0 * INCH_M  # from the robot's middle to anything solid, always
    shortest_m: float = 4.0 * INCH_M  # told length of a straight, drawn evenly from this ...
    longest_m: float = 16.0 * INCH_M  # ... to this: 1000 in are reached within 120 updates
    reached_m: float = 9.0 * INCH_M  # a goal counts as reached from here
    proposals: int = 48  # commands looked at before one is chosen
    cell_m: float = 3.0 * INCH_M  # raster on which the way is found


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """One update of a drive: a turn, then a straight."""

    turn: Movement
    straight: Movement

    @property
    def pose(self) -> F64:
        """The true pose (3,) at its end."""
        return np.asarray(self.straight.path[-1])


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Free cells and which are neighbors; made once a drive."""

    centers: F64  # (K, 2) of the free cells
    steps: csr_array[np.float64, tuple[int, int]]  # (K, K), each pair once: distances between neighbors

    def nearest(self, point: F64) -> int:
        """Give the free cell nearest to a point (2,)."""
        return int(np.argmin(np.linalg.norm(self.centers - point, axis=1)))

    def way_to(self, goal: F64) -> F64:
        """Give how far it is from every free cell to a goal (K,), inf where there is no way."""
        return np.asarray(dijkstra(self.steps, directed=False, indices=[self.nearest(goal)])[0])


def raster(arena: Arena, habits: Habits) -> Raster:
    """Cut the arena into cells, keep those with room enough, join each with its eight neighbors."""
    x_min, y_min, x_max, y_max = arena.bounds
    x = np.arange(x_min + habits.cell_m / 2, x_max, habits.cell_m)
    y = np.arange(y_min + habits.cell_m / 2, y_max, habits.cell_m)
    centers = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    centers = centers[clearance(arena, centers) > habits.keep_m]
    pairs = cKDTree(centers).query_pairs(1.5 * habits.cell_m, output_type="ndarray")
    gaps = np.linalg.norm(centers[pairs[:, 0]] - centers[pairs[:, 1]], axis=1)
    steps = coo_array((gaps, (pairs[:, 0], pairs[:, 1])), shape=(len(centers), len(centers)))
    return Raster(centers, steps.tocsr())


def start_pose(map_: Raster, rng: np.random.Generator) -> F64:
    """Draw where a drive begins: any free place, any heading."""
    place = map_.centers[int(rng.integers(len(map_.centers)))]
    return np.array([*place, rng.uniform(-np.pi, np.pi)])


@dataclass(frozen=True, slots=True, eq=False)
class Driver:
    """Everything that stays the same during one drive."""

    arena: Arena
    map: Raster
    chassis: Chassis
    habits: Habits
    seed: int

    def update(self, step: int, pose: F64, way: F64) -> Update:
        """Choose the command that should lead on best among those that stay clear."""
        luck = draw_luck(stream(Domain.SIMULATOR, self.seed, step, Purpose.ROBOT))
        rng = stream(Domain.SIMULATOR, self.seed, step, Purpose.DRIVER)
        while True:
            for turn_rad, length_m in self.ranked(pose, way, rng):
                turn = turn_by(pose, turn_rad, luck, self.chassis)
                straight = drive_by(turn.path[-1], length_m, luck, self.arena, self.chassis)
                if self.clear(straight.path):
                    return Update(turn, straight)

    def ranked(self, pose: F64, way: F64, rng: np.random.Generator) -> F64:
        """Propose commands (P, 2): turn_rad all around, length_m even; the one that should end best first."""
        habits = self.habits
        turns = rng.uniform(-np.pi, np.pi, habits.proposals)
        lengths = rng.uniform(habits.shortest_m, habits.longest_m, habits.proposals)
        headings = pose[2] + turns
        ends = pose[:2] + lengths[:, None] * np.stack([np.cos(headings), np.sin(headings)], axis=1)
        left = np.array([way[self.map.nearest(end)] for end in ends])
        order = np.argsort(left - 0.2 * lengths)  # longer straights are liked, or all would be short
        return np.stack([turns, lengths], axis=1)[order]

    def done_with(self, goal: F64, way: F64, pose: F64) -> bool:
        """Tell whether a goal (2,) is reached, or cannot be."""
        near = float(np.linalg.norm(goal - pose[:2])) < self.habits.reached_m
        return near or not np.isfinite(way[self.map.nearest(pose[:2])])

    def clear(self, path: F64) -> bool:
        """Tell whether a path (K, 3) keeps its distance from everything solid."""
        return bool((clearance(self.arena, path[:, :2]) > self.habits.keep_m).all())


def drive(
    arena: Arena, seed: int, updates: int, chassis: Chassis | None = None, habits: Habits | None = None
) -> tuple[F64, Iterator[Update]]:
    """Give the start pose (3,), and so many updates, driven as they are asked for."""
    habits = habits or Habits()
    driver = Driver(arena, raster(arena, habits), chassis or Chassis(), habits, seed)
    rng = stream(Domain.SIMULATOR, seed, 0, Purpose.DRIVER)
    start = start_pose(driver.map, rng)
    return start, driven(driver, start, updates, rng)


def driven(driver: Driver, start: F64, updates: int, rng: np.random.Generator) -> Iterator[Update]:
    """Drive on from a pose (3,), to one goal after the other."""
    pose, goal = start, start[:2]
    way = driver.map.way_to(goal)
    for step in range(1, updates + 1):
        while driver.done_with(goal, way, pose):
            goal = driver.map.centers[int(rng.integers(len(driver.map.centers)))]
            way = driver.map.way_to(goal)
        update = driver.update(step, pose, way)
        yield update
        pose = update.pose
