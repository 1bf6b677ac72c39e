"""The parts whose light can change each on its own: every lamp, and both sides of every window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.arrays import F64

from ..worlds.world import Lamp, World


@dataclass(frozen=True, slots=True)
class LightPart:
    """A source of light, or one side of a window, so that daylight can come from the other."""

    source: str
    side: int = 0  # of a window: 1 left and -1 right, as seen from inside; 0: all of a lamp

    @property
    def whole(self) -> float:
        """Share of what its source gives evenly, like the light of a room, that this part gives."""
        return 0.5 if self.side else 1.0

    def shares(self, lamp: Lamp) -> F64:
        """Give the share of each point (P,) of a lamp of this source that belongs to this part."""
        if not self.side or lamp.facing is None:
            return np.full(len(lamp.points), self.whole)
        left = np.array([lamp.facing[1], -lamp.facing[0]])  # looking at the window, against its light
        along = (lamp.points[:, :2] - lamp.points[:, :2].mean(axis=0)) @ left
        return np.asarray(0.5 + self.side * 0.5 * along / max(float(np.abs(along).max()), 1e-9))


def windows_of(world: World) -> frozenset[str]:
    """Name the sources that are windows: their lamps light one side only."""
    return frozenset(lamp.source for lamp in world.lamps if lamp.facing is not None)


def parts_of(world: World) -> tuple[LightPart, ...]:
    """Name all parts, in the order of the world's sources; of a window first its left side."""
    windows = windows_of(world)
    return tuple(
        LightPart(source, side)
        for source in world.sources
        for side in ((1, -1) if source in windows else (0,))
    )
