"""The cloud: how much of it is near the truth, its modes from step to step, and where particles come from."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..filter.estimate import TIE, Modes, first_heaviest, modes
from ..values import F32, F64, I32, Belief, Bool, Estimate, StepRecord
from .table import LOST_RAD

# Around the truth: that share of the weight changes three times, by the motion, the picture, and resampling.


@dataclass(frozen=True, slots=True)
class NearTruth:
    """One update around the true pose; "near" is within the radius "confidence", at a like heading."""

    particles: int
    shares: tuple[float, float, float]  # of the weight near the truth: after motion, picture, and resampling
    nearest_m: float  # from the truth to the nearest particle of any heading


def near_truth(record: StepRecord, truth: F64) -> NearTruth:
    """Measure the cloud of one update around the true pose (3,); a particle in a wall counts for nothing."""
    radius_m, inside = record.estimate.radii.confidence_m, record.sighting.entries >= 0
    nearest_m, near = around(record.weighted, truth, radius_m)
    before = near
    if record.predicted.poses is not record.weighted.poses:
        before = around(record.predicted, truth, radius_m)[1]
    after = near if record.belief is record.weighted else around(record.belief, truth, radius_m)[1]
    near, before = near & inside, before & inside
    shares = [
        float(belief.weights.compress(some).sum())
        for belief, some in ((record.predicted, before), (record.weighted, near), (record.belief, after))
    ]
    return NearTruth(int(np.count_nonzero(near)), (shares[0], shares[1], shares[2]), nearest_m)


LEAST_NEAR = 5  # particles from which a gain is told


def picture_gain(record: StepRecord, truth: F64, radius_m: float) -> float | None:
    """Return how many times as heavy the picture made the particles near the true pose (3,), together.

    Near is within a radius, at a like heading; None for fewer than `LEAST_NEAR` such particles.
    """
    _, near = around(record.weighted, truth, radius_m)
    before = float(record.predicted.weights[near].sum())
    if np.count_nonzero(near) < LEAST_NEAR or before <= 0:
        return None
    return float(record.weighted.weights[near].sum()) / before


def around(belief: Belief, pose: F64, radius_m: float) -> tuple[float, Bool]:
    """Return the distance of the nearest particle from a pose (3,), and which (N,) are near it.

    Near is within a radius, at a like heading; the nearest may have any.
    """
    x, y = (pose[:2] - belief.origin).tolist()
    poses = belief.poses
    away, along = poses[:, 0] - x, poses[:, 1] - y
    away *= away
    along *= along
    away += along
    near = (away <= radius_m**2) & (np.cos(poses[:, 2] - pose[2]) >= np.cos(LOST_RAD))
    return float(np.sqrt(away.min())) if len(away) else np.inf, near


def has_near(belief: Belief, truth: F64, radius_m: float) -> bool:
    """Return whether a particle is within a radius of the true pose (3,), and of a like heading."""
    poses = belief.poses
    x, y = truth[:2] - belief.origin
    near = np.square(poses[:, 0] - x) + np.square(poses[:, 1] - y) <= radius_m**2
    return bool((np.cos(poses[near, 2] - truth[2]) >= np.cos(LOST_RAD)).any())


# Modes.
#
# Particles carry the identity of the mode they were last in, and copies inherit it. A mode continues the one
# from which most of its weight descends; of equal weights the older identity, in the half that `modes` lists
# first.

NO_MODE = 0  # identity of particles that were never in a mode; modes count from 1
SINGLE_MODE_SHARE = 0.99  # share of weight beyond which the rest is too light for another mode
LEAST_DESCENT = 0.25  # share of a mode's weight that must descend from another to continue it


@dataclass(frozen=True, slots=True, eq=False)
class TrackedMode:
    """One mode of a weighted cloud, and its identity."""

    identity: int  # from 1; constant over its life, never reused
    estimate: Estimate


@dataclass(slots=True)
class ModeTracker:
    """Follows the modes (`filter.estimate.modes`) of one run; keeps one number per particle."""

    _identities: I32 | None = None  # (N,) of the next particles: the mode that each was last in
    _born: int = field(default=NO_MODE)  # identities assigned so far

    def see(self, record: StepRecord) -> tuple[TrackedMode, ...]:
        """Process the next update; return its modes, heaviest first."""
        size = record.weighted.size
        identities = self._identities
        carried = np.zeros(size, np.int32) if identities is None or len(identities) != size else identities
        alone = record.estimate.mass > SINGLE_MODE_SHARE * (1 + TIE)
        clusters = (record.estimate,) if alone else modes(record.weighted, record.estimate.radii)
        places = _places(record, clusters)
        names = self._named(places, carried, record.weighted.weights, len(clusters))
        now = np.where(places >= 0, np.append(names, NO_MODE).astype(np.int32)[places], carried)
        if (parents := record.parents) is not None:
            now = np.where(parents >= 0, now[parents], NO_MODE).astype(np.int32)
        self._identities = now
        return tuple(TrackedMode(name, cluster) for name, cluster in zip(names, clusters, strict=True))

    def _named(self, places: I32, carried: I32, weights: F64, count: int) -> list[int]:
        """Return identities: the largest bonds first, each to one mode; the other modes are new."""
        width = self._born + 1
        cell = (places + 1) * width + carried
        bonds = np.bincount(cell, weights, (count + 1) * width).reshape(count + 1, width)[1:]
        least = LEAST_DESCENT * (1 - TIE)
        bonds = np.where(bonds < least * bonds.sum(axis=1, keepdims=True), 0, bonds)
        bonds[:, NO_MODE] = 0
        names = [NO_MODE] * count
        while bonds.size and bonds.max() > 0:
            mode, identity = divmod(first_heaviest(bonds), width)
            names[mode] = identity
            bonds[mode], bonds[:, identity] = 0, 0
        for mode in range(count):
            if names[mode] == NO_MODE:
                self._born += 1
                names[mode] = self._born
        return names


def _places(record: StepRecord, clusters: Modes) -> I32:
    """Return the number of the mode that each particle (N,) is in, the heaviest of several; -1: none."""
    poses, reach_m = record.weighted.poses, record.estimate.radii.cluster_m
    place = np.full(len(poses), -1, np.int32)
    for number in reversed(range(len(clusters))):
        x, y = clusters[number].pose[:2] - record.weighted.origin
        near = np.square(poses[:, 0] - x) + np.square(poses[:, 1] - y) <= reach_m**2
        place[near] = number
    return place


DEPTH = 10  # updates looked back


@dataclass(frozen=True, slots=True, eq=False)
class _Generation:
    """One update: where the weighted particles were, and which of them each new one copies."""

    poses: F32  # (N, 3) relative to the belief's origin
    origin: F64
    parents: NDArray[np.intp] | None  # (N',), -1: fresh; None: not resampled


@dataclass(slots=True)
class Ancestry:
    """Remembers the last `depth` updates of one run, to find the ancestors of particles.

    After a few updates an entire cloud may descend from a handful (path degeneracy, Doucet and Johansen
    2009).
    """

    depth: int = DEPTH
    _past: deque[_Generation] = field(default_factory=deque)

    def see(self, record: StepRecord) -> None:
        """Process the next update. If the number of particles changed, their ancestors are unknown."""
        if self._past and self._size() != len(record.weighted.poses):
            self._past.clear()
        parents = None if record.parents is None else record.parents.astype(np.intp)
        self._past.append(_Generation(record.weighted.poses, record.weighted.origin, parents))
        if len(self._past) > self.depth:
            self._past.popleft()

    def distinct(self) -> int:
        """Count the particles, `depth` updates back or fresh since, from which all descend."""
        if not self._past:
            return 0
        some: NDArray[np.intp] | None = None  # of a generation, that have descendants now; None: all
        fresh = 0
        for generation in reversed(self._past):
            if generation.parents is None:
                continue
            parents = generation.parents if some is None else generation.parents.take(some)  # soon few
            alive = np.zeros(len(generation.poses) + 1, bool)
            alive[parents] = True  # -1 is the last
            if alive[-1]:
                fresh += int(np.count_nonzero(parents < 0))
            some = np.flatnonzero(alive[:-1])
        return fresh + (self._size() if some is None else len(some))

    def _size(self) -> int:
        last = self._past[-1]
        return len(last.poses) if last.parents is None else len(last.parents)
