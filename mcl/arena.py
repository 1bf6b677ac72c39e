"""The map: walls, obstacles, floors and rooms, in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .typing import F64


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A named polygon: an obstacle ("sofa"), a floor ("carpet") or a room ("north room")."""

    name: str
    polygon: F64  # (K, 2) x_m, y_m, K >= 3, not closed


@dataclass(frozen=True, slots=True, eq=False)
class Arena:
    """Where a robot can be. Everything is in metres; no wall at all means that all inside is free."""

    bounds: tuple[float, float, float, float]  # x_min, y_min, x_max, y_max
    walls: F64  # (W, 4) x1, y1, x2, y2; W may be 0
    obstacles: tuple[Region, ...] = ()
    floors: tuple[Region, ...] = ()  # later ones lie on top of earlier ones
    rooms: tuple[Region, ...] = ()

    @property
    def size_m(self) -> tuple[float, float]:
        """Width along x and depth along y."""
        x_min, y_min, x_max, y_max = self.bounds
        return x_max - x_min, y_max - y_min


def open_arena(poses: F64, margin_m: float = 1.0) -> Arena:
    """Make a map with no walls around poses (L, 3), for libraries that come without a map."""
    low = poses[:, :2].min(axis=0) - margin_m
    high = poses[:, :2].max(axis=0) + margin_m
    return Arena((float(low[0]), float(low[1]), float(high[0]), float(high[1])), np.zeros((0, 4)))
