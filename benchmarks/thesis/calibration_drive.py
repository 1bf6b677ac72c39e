"""Calibration trials of the simulated robot, as the thesis made them: turns, and straights on every floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_datasets.robot.motion import Chassis, draw_luck, drive_by, turn_by
from maurice_datasets.tasks import SimPurpose
from maurice_mcl.fitting.motion import Straights, Trials, Turns
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M, wrap_angle
from maurice_mcl.values.map import Arena, Region
from maurice_mcl.values.randomness import Domain, stream

FIRST = 1_000_000_000  # number of the first trial: no drive of the same seed gets that far
HERE = np.zeros(3)


@dataclass(frozen=True, slots=True)
class TrialPlan:
    """The range of trials."""

    turns: int = 41  # as in figure 4
    straights: int = 41  # dealt out to the floors in turn; figure 9 has 37 or 38
    longest_turn_rad: float = float(np.pi)  # turns are drawn evenly to both sides up to this
    shortest_m: float = 6 * INCH_M  # straights are drawn evenly from this (ours) ...
    longest_m: float = 60 * INCH_M  # ... to this: the thesis names 5 ft as a long motion


def calibration_drive(seed: int, plan: TrialPlan | None = None) -> Trials:
    """Make the trials of one seed. Floors are those that the chassis has a drift for."""
    plan, chassis = plan or TrialPlan(), Chassis()
    turns = np.array([_turn(seed, n, plan, chassis) for n in range(plan.turns)]).reshape(-1, 2)
    names = list(chassis.drifts)
    floors = tuple(names[n * len(names) // plan.straights] for n in range(plan.straights))
    ways = np.array([_straight(seed, plan.turns + n, f, plan, chassis) for n, f in enumerate(floors)])
    ways = ways.reshape(-1, 3)
    return Trials(Turns(turns[:, 0], turns[:, 1]), Straights(ways[:, 0], ways[:, 1], ways[:, 2], floors))


def floor_everywhere(name: str, reach_m: float = 1e3) -> Arena:
    """Make a map of one floor, its walls far out of reach."""
    low, high = -reach_m, reach_m
    square = np.array([[low, low], [high, low], [high, high], [low, high]])
    walls = np.column_stack([square, np.roll(square, -1, axis=0)])
    return Arena((low, low, high, high), walls, floors=(Region(name, square),))


def _draws(seed: int, number: int) -> tuple[np.random.Generator, np.random.Generator]:
    command = stream(Domain.SIMULATOR, seed, FIRST + number, SimPurpose.DRIVER)
    return command, stream(Domain.SIMULATOR, seed, FIRST + number, SimPurpose.ROBOT)


def _turn(seed: int, number: int, plan: TrialPlan, chassis: Chassis) -> tuple[float, float]:
    command, luck = _draws(seed, number)
    turn_rad = command.uniform(-plan.longest_turn_rad, plan.longest_turn_rad)
    moved = turn_by(HERE, turn_rad, draw_luck(luck), chassis)
    actual = _changed(moved.path)
    circles = round((turn_rad - actual) / (2 * np.pi))  # a watcher counts them
    return float(moved.measured[2]), actual + circles * 2 * np.pi


def _straight(
    seed: int, number: int, floor: str, plan: TrialPlan, chassis: Chassis
) -> tuple[float, float, float]:
    """Drive straight once: measured and actual distance in m, drift in rad."""
    command, luck = _draws(seed, number)
    length_m = command.uniform(plan.shortest_m, plan.longest_m)
    moved = drive_by(HERE, length_m, draw_luck(luck), floor_everywhere(floor), chassis)
    went = float(np.hypot(*(moved.path[-1] - moved.path[0])[:2]))
    return float(moved.measured[0]), went, _changed(moved.path)


def _changed(path: F64) -> float:
    """Return the heading's change along a path (K, 3), in [-pi, pi)."""
    return wrap_angle(float(path[-1, 2] - path[0, 2]))
