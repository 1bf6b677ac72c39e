"""Modes followed from step to step, and where particles come from.

Every particle carries the identity of the mode it was last in, and its copies inherit that. A mode continues
the one from which most of its weight descends. So it may move, shrink and grow; of two that join the heavier
one continues; of one that splits the heavier half does, and the other is new. Of equal weights the older
identity continues, in the half that `modes` lists first.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from ..arrays import F32, F64, I32, Bool
from ..filter.estimate import CLUSTER_M, TIE, Modes, first_heaviest, modes
from ..records import Estimate, StepRecord

NO_MODE = 0  # identity of particles that were never in a mode; modes count from 1
ALONE = 0.99  # share of weight beyond which the rest is too light for another mode
LEAST_DESCENT = 0.25  # share of a mode's weight that must descend from another to continue it


@dataclass(frozen=True, slots=True, eq=False)
class TrackedMode:
    """One mode of a weighted cloud, and its identity."""

    identity: int  # from 1; constant over its life, never reused
    estimate: Estimate


@dataclass(slots=True)
class ModeTracker:
    """Follows the modes of one run; keeps one number per particle of the last step, and no cloud.

    Modes are those of `maurice_mcl.filter.estimate.modes`: at most five, each of at least 1 % of the weight.
    """

    _identities: I32 | None = None  # (N,) of the next particles: the mode that each was last in
    _injected: Bool | None = None  # (N,) which of them were freshly injected
    _born: int = field(default=NO_MODE)  # identities assigned so far

    def see(self, record: StepRecord) -> tuple[TrackedMode, ...]:
        """Process the next update; return its modes, heaviest first."""
        size = record.weighted.size
        held = self._identities
        carried = np.zeros(size, np.int32) if held is None or len(held) != size else held
        fresh = self._injected if self._injected is not None and len(self._injected) == size else None
        found = _modes(record, fresh)
        places = _places(record, found)
        named = self._named(places, carried, record.weighted.weights, len(found))
        now = np.where(places >= 0, np.append(named, NO_MODE).astype(np.int32)[places], carried)
        self._identities, self._injected = _handed_on(now, record.parents), record.injected
        return tuple(TrackedMode(name, one) for name, one in zip(named, found, strict=True))

    def _named(self, places: I32, carried: I32, weights: F64, count: int) -> list[int]:
        """Return identities: the largest bonds first, each to one mode; the other modes are new."""
        width = self._born + 1
        cell = (places + 1) * width + carried
        bonds = np.bincount(cell, weights, (count + 1) * width).reshape(count + 1, width)[1:]
        least = LEAST_DESCENT * (1 - TIE)
        bonds = np.where(bonds < least * bonds.sum(axis=1, keepdims=True), 0, bonds)
        bonds[:, NO_MODE] = 0
        named = [NO_MODE] * count
        while bonds.size and bonds.max() > 0:
            mode, identity = divmod(first_heaviest(bonds), width)
            named[mode] = identity
            bonds[mode], bonds[:, identity] = 0, 0
        for mode in range(count):
            if named[mode] == NO_MODE:
                self._born += 1
                named[mode] = self._born
        return named


def _modes(record: StepRecord, injected: Bool | None) -> Modes:
    """Return the modes; an estimate that holds nearly all weight is the only one."""
    alone = record.estimate.mass > ALONE * (1 + TIE)
    return (record.estimate,) if alone else modes(record.weighted, injected)


def _places(record: StepRecord, found: Modes) -> I32:
    """Return the number of the mode that each particle (N,) is in, the heaviest of several; -1: none."""
    poses = record.weighted.poses
    place = np.full(len(poses), -1, np.int32)
    for number in reversed(range(len(found))):
        x, y = found[number].pose[:2] - record.weighted.origin
        near = np.square(poses[:, 0] - x) + np.square(poses[:, 1] - y) <= CLUSTER_M**2
        place[near] = number
    return place


def _handed_on(identities: I32, parents: I32 | None) -> I32:
    """Return the identity that each particle of the next step (N',) inherits; fresh ones have none."""
    if parents is None:
        return identities
    return np.where(parents >= 0, identities[parents], NO_MODE).astype(np.int32)


DEPTH = 10  # updates looked back


@dataclass(frozen=True, slots=True, eq=False)
class _Generation:
    """One update: where the weighted particles were, and which of them each new one copies."""

    poses: F32  # (N, 3) relative to the belief's origin
    origin: F64
    parents: I32 | None  # (N',), -1: fresh; None: not resampled


@dataclass(slots=True)
class Ancestry:
    """Remembers the last `depth` updates of one run, to find the ancestors of particles.

    Resampling copies some particles and drops others, so that after a few updates an entire cloud may descend
    from a handful of ancestors and no longer holds independent guesses, however many particles there are (the
    path degeneracy of Doucet and Johansen 2009).
    """

    depth: int = DEPTH
    _past: deque[_Generation] = field(default_factory=deque)

    def see(self, record: StepRecord) -> None:
        """Process the next update."""
        self._past.append(_Generation(record.weighted.poses, record.weighted.origin, record.parents))
        if len(self._past) > self.depth:
            self._past.popleft()

    def distinct(self) -> int:
        """Count the particles `depth` updates back (or at the start) from which all current ones descend.

        A fresh particle drawn since then counts as an ancestor.
        """
        if not self._past:
            return 0
        alive = np.ones(self._size(), bool)  # which particles of a generation have descendants now
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
        """Return the paths (K, 2) in the map's frame of some particles' ancestors, latest first.

        The particles are spread evenly over the last cloud; a path ends where its particle was drawn, so some
        have a single point.
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
        return [path[:length] for path, length in zip(along, lengths, strict=True) if length]

    def _size(self) -> int:
        last = self._past[-1]
        return len(last.poses) if last.parents is None else len(last.parents)


def _parents_of(current: I32, generation: _Generation) -> I32:
    """Return the parents of these particles of the next cloud; -1 for fresh ones, then and before."""
    if generation.parents is None:
        return current
    return np.where(current < 0, np.int32(-1), generation.parents[np.maximum(current, 0)]).astype(np.int32)
