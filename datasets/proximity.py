"""Infrared proximity: a ring of short-sighted distance sensors, and what they say about the way ahead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.arena import Arena
from maurice_mcl.geometry import INCH_M
from maurice_mcl.typing import F64


@dataclass(frozen=True, slots=True)
class Ring:
    """The sensors. The thesis names infrared detectors (its appendix) and no numbers: all are invented."""

    count: int = 24  # evenly all around, the first straight ahead: a box of 5 in is never missed at 20 in
    reach_m: float = 30 * INCH_M  # nothing farther is seen: triangulating infrared sensors end at 0.8 m
    noise: float = 0.02  # sd of a reading as a share of it


@dataclass(frozen=True, slots=True, eq=False)
class Proximity:
    """One reading of the ring."""

    bearings_rad: F64  # (S,) counter-clockwise from straight ahead
    ranges_m: F64  # (S,) from the robot's middle to what is there; `reach_m` where nothing is
    reach_m: float

    @property
    def nearest_m(self) -> float:
        """The smallest range."""
        return float(self.ranges_m.min())

    def open_m(self, bearing_rad: float, half_width_m: float) -> float:
        """Give how far a disc of that half width can go towards a bearing before it touches what is seen."""
        angle = self.bearings_rad - bearing_rad
        ahead, aside = self.ranges_m * np.cos(angle), np.abs(self.ranges_m * np.sin(angle))
        there = (self.ranges_m < self.reach_m) & (ahead > 0) & (aside < half_width_m)
        touch = ahead[there] - np.sqrt(half_width_m**2 - aside[there] ** 2)
        return max(0.0, float(touch.min(initial=self.reach_m - half_width_m)))


def sense(arena: Arena, pose: F64, ring: Ring, rng: np.random.Generator) -> Proximity:
    """Read the whole ring once at a pose (3,)."""
    bearings: F64 = np.linspace(0, 2 * np.pi, ring.count, endpoint=False, dtype=np.float64)
    true = distances(arena, pose[:2], pose[2] + bearings)
    read = true * (1 + ring.noise * rng.standard_normal(ring.count))
    return Proximity(bearings, np.clip(read, 0, ring.reach_m), ring.reach_m)


def distances(arena: Arena, point: F64, headings_rad: F64) -> F64:
    """Give how far it is from a point (2,) along headings (S,) to the first wall or obstacle, else inf."""
    starts, ends = outlines(arena)
    along = np.stack([np.cos(headings_rad), np.sin(headings_rad)], axis=1)[:, None]  # (S, 1, 2)
    wall, away = ends - starts, starts - point  # (W, 2)
    cross = along[..., 0] * wall[:, 1] - along[..., 1] * wall[:, 0]  # (S, W)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (away[:, 0] * wall[:, 1] - away[:, 1] * wall[:, 0]) / cross
        share = (away[:, 0] * along[..., 1] - away[:, 1] * along[..., 0]) / cross
    hit = (cross != 0) & (far >= 0) & (share >= 0) & (share <= 1)
    return np.asarray(np.where(hit, far, np.inf).min(axis=1, initial=np.inf))


def outlines(arena: Arena) -> tuple[F64, F64]:
    """Give where every wall and every edge of an obstacle starts and ends, (W, 2) each."""
    polygons = [obstacle.polygon for obstacle in arena.obstacles]
    starts = np.concatenate([arena.walls[:, :2], *polygons])
    ends = np.concatenate([arena.walls[:, 2:], *(np.roll(p, -1, axis=0) for p in polygons)])
    return starts, ends
