"""A path of any length, held with few poses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from maurice_mcl.arrays import F64


@dataclass(slots=True)
class SimplifiedPath:
    """A path of at most `most` poses and the last one: of a longer one every second, fourth, ... pose."""

    most: int
    _kept: list[F64] = field(default_factory=list)
    _last: F64 | None = None
    _stride: int = 1
    _seen: int = 0

    def add(self, pose: F64) -> None:
        """Take in the next pose (3,)."""
        if self._seen % self._stride == 0:
            self._kept.append(pose)
            if len(self._kept) > self.most:
                self._kept, self._stride = self._kept[::2], 2 * self._stride
        self._seen += 1
        self._last = pose

    def poses(self) -> F64:
        """Return what is kept, and the last pose: (N, 3)."""
        kept = self._kept
        if self._last is not None and kept[-1] is not self._last:
            kept = [*kept, self._last]
        return np.array(kept, np.float64).reshape(-1, 3)
