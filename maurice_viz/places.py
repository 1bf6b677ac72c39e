"""Which library entry stands for a pose, by the library's own rule."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.library import Library
from maurice_mcl.selection import NearestReference, nearest_reference
from maurice_mcl.typing import F64


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The nearest reference of any pose in a map."""

    nearest: NearestReference
    origin: F64  # (2,)

    def entry_at(self, pose: F64) -> int:
        """Give the entry that a pose (3,) in the map's frame is nearest to; -1 outside free space."""
        relative = (pose - np.append(self.origin, 0)).astype(np.float32)
        return int(self.nearest.entries(relative[None], self.origin)[0])


def places_of(library: Library) -> Places:
    """Make the tables for a library with at least one entry."""
    return Places(nearest_reference(library.poses, library.arena), library.origin)
