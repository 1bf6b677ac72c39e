"""When the robot was where the map has an obstacle: a filter that trusts the map has no particle there."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ...arrays import F64
from ...filter.localizer import Localizer
from ...map import SOLID, Region

DEEP_CELLS = 1.0  # of the map's raster: nearer to its outline a pose may be off, or a cell too large


@dataclass(frozen=True, slots=True)
class InObstacle:
    """Updates in a row at which the truth was inside an obstacle of the map."""

    obstacle: str  # its name
    first: int  # step
    last: int


@dataclass(slots=True)
class ObstacleFinder:
    """Follows the truth of one run; without a localizer, or with one that doubts obstacles, finds nothing."""

    localizer: Localizer | None = None
    found: tuple[InObstacle, ...] = ()
    _outlines: list[tuple[str, cv2.typing.MatLike]] = field(default_factory=list)
    _deep_m: float = 0.0

    def __post_init__(self) -> None:
        if self.localizer is None or self.localizer.obstacles != SOLID:
            return
        self._deep_m = DEEP_CELLS * self.localizer.reference.grid.cell_m
        self._outlines = [_outline(one) for one in self.localizer.library.arena.obstacles]

    def see(self, step: int, truth: F64 | None) -> None:
        """Process the next update."""
        if truth is None:
            return
        place = float(truth[0]), float(truth[1])
        for name, outline in self._outlines:
            if cv2.pointPolygonTest(outline, place, measureDist=True) > self._deep_m:
                self._add(name, step)
                return

    def _add(self, name: str, step: int) -> None:
        last = self.found[-1] if self.found else None
        if last is not None and last.obstacle == name and last.last == step - 1:
            self.found = (*self.found[:-1], replace(last, last=step))
        else:
            self.found = (*self.found, InObstacle(name, step, step))


def _outline(obstacle: Region) -> tuple[str, cv2.typing.MatLike]:
    return obstacle.name, obstacle.polygon.astype(np.float32)
