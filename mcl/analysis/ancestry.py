"""Ancestry: where particles come from, some updates back.

Resampling copies some particles and drops others, so that after a few updates a whole cloud may come from a
handful of ancestors. Then it no longer holds independent guesses, however many particles there are (the path
degeneracy of Doucet and Johansen 2009).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from ..arrays import F32, F64, I32
from ..records import StepRecord

DEPTH = 10  # updates looked back


@dataclass(frozen=True, slots=True, eq=False)
class _Generation:
    """One update: where the weighted particles were, and which of them each renewed one copies."""

    poses: F32  # (N, 3) relative to the belief's origin
    origin: F64
    parents: I32 | None  # (N',), -1: fresh; None: not resampled


@dataclass(slots=True)
class Ancestry:
    """Remembers the last `depth` updates of one run."""

    depth: int = DEPTH
    _past: deque[_Generation] = field(default_factory=deque)

    def see(self, record: StepRecord) -> None:
        """Take in the next update."""
        self._past.append(_Generation(record.weighted.poses, record.weighted.origin, record.parents))
        if len(self._past) > self.depth:
            self._past.popleft()

    def distinct(self) -> int:
        """Count the particles of `depth` updates back (or of the start) from which all of today's come.

        A particle drawn afresh since then counts as an ancestor of its own.
        """
        if not self._past:
            return 0
        alive = np.ones(self._size(), bool)  # which particles of a generation have descendants today
        fresh = 0
        for generation in reversed(self._past):
            if generation.parents is None:
                continue
            parents = generation.parents[alive]
            fresh += int((parents < 0).sum())
            alive = np.zeros(len(generation.poses), bool)
            alive[parents[parents >= 0]] = True
        return fresh + int(alive.sum())

    def lines(self, count: int) -> list[F64]:
        """Return the ways (K, 2) in the map's frame of some particles' ancestors, latest first.

        The particles are spread evenly over the cloud of the last update; a way ends where its particle was
        drawn afresh, so some have a single point.
        """
        if not self._past:
            return []
        size = self._size()
        current = np.linspace(0, size - 1, min(count, size)).round().astype(np.int32)
        points, lengths = [], np.zeros(len(current), np.int64)
        for generation in reversed(self._past):
            current = _parents_of(current, generation)
            points.append(generation.poses[np.maximum(current, 0), :2] + generation.origin)
            lengths += current >= 0
        along = np.stack(points, axis=1)
        return [way[:length] for way, length in zip(along, lengths, strict=True) if length]

    def _size(self) -> int:
        last = self._past[-1]
        return len(last.poses) if last.parents is None else len(last.parents)


def _parents_of(current: I32, generation: _Generation) -> I32:
    """Return whom these particles of the next cloud copy; -1 for fresh ones, then and before."""
    if generation.parents is None:
        return current
    return np.where(current < 0, np.int32(-1), generation.parents[np.maximum(current, 0)]).astype(np.int32)
