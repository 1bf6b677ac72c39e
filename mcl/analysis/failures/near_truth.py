"""Why no particle is left near the truth: when the last one went, and what took it away.

The share of the weight near the truth changes three times in an update: by the motion, by the picture, and by
resampling. Its logarithm is a sum of these changes, so each of the three has its part in a loss.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...arrays import F32, F64, Bool
from ...records import Belief, StepRecord
from ...sensor.model import SensorModel
from ..metrics import LOST_FOR, LOST_RAD

NEVER = "never"  # no particle was ever near the truth
MOVED = "moved"  # the motion took them away
OUTWEIGHED = "outweighed"  # the pictures gave their weight to others
DROPPED = "dropped"  # resampling did not copy them, by chance
MISLED = "misled"  # some are near; the pictures fit the wrong place better
CHANGES = (MOVED, OUTWEIGHED, DROPPED)  # the three parts of an update, in order
STILL_HELD = 0.5  # of the largest share so far


@dataclass(frozen=True, slots=True)
class NearTruth:
    """One update around the true pose; "near" is within the radius "confidence", at a like heading."""

    particles: int
    shares: tuple[float, float, float]  # of the weight near the truth: after motion, picture, and resampling
    nearest_m: float  # from the truth to the nearest particle of any heading


@dataclass(frozen=True, slots=True)
class TruthFit:
    """How well one picture fits the true pose, and the pose that the filter estimates."""

    truth: float  # log-likelihood of the reference nearest the truth
    estimate: float  # of the one nearest the estimate
    rank: int  # of the truth's reference among all, from 1
    references: int

    @property
    def is_better(self) -> bool:
        """Whether the picture fits the truth at least as well as the estimate."""
        return self.truth >= self.estimate


@dataclass(frozen=True, slots=True)
class Vanishing:
    """How a run came to have no particle near the truth, as known at one update."""

    kind: str  # one of the above; empty: particles are near, and the pictures fit them
    particles: int  # of the whole cloud
    held: int | None = None  # last update at which particles near the truth had much weight; None: none had
    near: int = 0  # particles near the truth then
    gone: int | None = None  # first update without one, until now; None: some are near
    nearest_m: float = np.inf  # from the truth to the nearest particle, the least since the first update
    pictures: int = 0  # compared since then: since `gone`, else since `held`
    better: int = 0  # of these that fit the truth at least as well as the estimate
    rank: int | None = None  # median rank of the truth's reference in these; None: not known
    references: int = 0

    @property
    def fits(self) -> bool | None:
        """Whether most pictures since then fit the truth better; None where it is not known."""
        return 2 * self.better >= self.pictures if self.pictures else None


def near_truth(record: StepRecord, truth: F64) -> NearTruth:
    """Measure the cloud of one update around the true pose (3,); a particle in a wall counts for nothing."""
    radius_m, inside = record.estimate.radii.confidence_m, record.sighting.entries >= 0
    away_m, near = _around(record.weighted, truth, radius_m)
    moved = float(record.predicted.weights[_around(record.predicted, truth, radius_m)[1] & inside].sum())
    weighed = float(record.weighted.weights[near & inside].sum())
    after = float(record.belief.weights[_around(record.belief, truth, radius_m)[1]].sum())
    nearest_m = float(away_m.min()) if len(away_m) else np.inf
    return NearTruth(int((near & inside).sum()), (moved, weighed, after), nearest_m)


def _around(belief: Belief, truth: F64, radius_m: float) -> tuple[F64, Bool]:
    """Return the distance (N,) of each particle from the truth, and which (N,) are near it."""
    x, y = truth[:2] - belief.origin
    away_m = np.hypot(belief.poses[:, 0] - x, belief.poses[:, 1] - y)
    alike = np.cos(belief.poses[:, 2] - truth[2]) >= np.cos(LOST_RAD)
    return away_m, (away_m <= radius_m) & alike


def has_near(belief: Belief, truth: F64, radius_m: float) -> bool:
    """Return whether a particle is within a radius of the true pose (3,), and of a like heading."""
    poses = belief.poses
    x, y = truth[:2] - belief.origin
    near = np.square(poses[:, 0] - x) + np.square(poses[:, 1] - y) <= radius_m**2
    return bool((np.cos(poses[near, 2] - truth[2]) >= np.cos(LOST_RAD)).any())


def have_near(poses: F32, origin: F64, truth: F64, radius_m: float) -> Bool:
    """Return `has_near` (R,) of R clouds with poses (3, R, N) relative to an origin."""
    x, y = truth[:2] - origin
    away = np.square(poses[0] - x)
    away += np.square(poses[1] - y)
    near = away <= radius_m**2
    alike = np.cos(poses[2][near] - truth[2]) >= np.cos(LOST_RAD)
    return np.bincount(near.nonzero()[0][alike], minlength=len(near)) > 0


def truth_fit(record: StepRecord, truth: F64, sensor: SensorModel) -> TruthFit | None:
    """Compare how well the picture fits the truth (3,) and the estimate; None where one is not on the map."""
    log_likelihood, origin = record.sighting.comparison.log_likelihood, sensor.library.origin
    if not len(log_likelihood):
        return None
    poses = np.array([truth, record.estimate.pose]) - np.append(origin, 0.0)
    entries = sensor.references.entries(np.asarray(poses, np.float32), origin)
    if entries.min() < 0:
        return None
    there, here = (float(value) for value in log_likelihood[entries])
    rank = int((log_likelihood > log_likelihood[entries[0]]).sum()) + 1
    return TruthFit(there, here, rank, len(log_likelihood))


@dataclass(slots=True)
class VanishingFinder:
    """Follows one run; keeps the last update that held the truth, and what was lost since then."""

    sensor: SensorModel | None = None  # None: how well the truth fits is not known
    _most: float = 0.0  # largest share so far
    _held: tuple[int, int] | None = None  # step, and particles near
    _gone: int | None = None
    _nearest_m: float = np.inf
    _after: float = 0.0  # share near the truth after resampling, of the update before
    _lost: F64 = field(default_factory=lambda: np.zeros(3))  # nats since `_held`, by each part of an update
    _fits: list[TruthFit] = field(default_factory=list)
    _size: int = 0

    def see(self, step: int, record: StepRecord, truth: F64 | None) -> None:
        """Process the next update; one without truth, or in which no picture was compared, says nothing."""
        if truth is None or not len(record.sighting.comparison.log_likelihood):
            return
        now, self._size = near_truth(record, truth), record.weighted.size
        self._nearest_m = min(self._nearest_m, now.nearest_m)
        _, weighed, after = now.shares
        if now.particles == 0 and self._gone is None:
            self._gone, self._fits = step, []
            self._lose(self._after, now.shares)
        elif now.particles and weighed >= STILL_HELD * self._most:
            self._most, self._held, self._gone = max(self._most, weighed), (step, now.particles), None
            self._lost, self._fits = np.zeros(3), []
            self._lose(weighed, (weighed, weighed, after))
        elif now.particles:
            self._gone = None
            self._lose(self._after, now.shares)
        self._after = after
        fit = None if self.sensor is None else truth_fit(record, truth, self.sensor)
        self._fits += [] if fit is None else [fit]

    def _lose(self, before: float, shares: tuple[float, float, float]) -> None:
        """Add to the losses what an update changed; a share below half a particle counts as that."""
        logs = np.log(np.maximum((before, *shares), 0.5 / self._size))
        self._lost -= np.diff(logs)

    def found(self) -> Vanishing:
        """Return what is known up to now."""
        step, near = self._held or (None, 0)
        better, ranks = sum(one.is_better for one in self._fits), [one.rank for one in self._fits]
        return Vanishing(
            kind=self._kind(better),
            particles=self._size,
            held=step,
            near=near,
            gone=self._gone,
            nearest_m=self._nearest_m,
            pictures=len(ranks),
            better=better,
            rank=int(np.median(ranks)) if ranks else None,
            references=self._fits[-1].references if self._fits else 0,
        )

    def _kind(self, better: int) -> str:
        if self._gone is None:
            return MISLED if len(self._fits) >= LOST_FOR and 2 * better < len(self._fits) else ""
        return NEVER if self._held is None else CHANGES[int(self._lost.argmax())]
