"""Two places that explain the pictures about as well: when a cloud was divided, and how."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...filter.estimate import modes
from ...values.arrays import F64
from ...values.records import StepRecord

SECOND = 0.25  # share of the weight that the second place needs
TOGETHER = 0.7  # share of the weight that both need
APART = 2.0  # times the radius "converged" that they are apart at least
LEAST_UPDATES = 2  # in a row


@dataclass(frozen=True, slots=True)
class Ambiguity:
    """The updates in which two places shared the weight; the numbers are those of the most even one."""

    step: int  # the most even update
    first: int  # update of these
    last: int
    shares: tuple[float, float]
    apart_m: float
    truth_in: int | None  # 1 or 2: the place that holds the truth; 0: neither; None: not known
    fits: tuple[float, float] | None = None  # mean quality of their particles; None: not compared
    usual: float | None = None  # median quality of all references

    @property
    def is_lasting(self) -> bool:
        """Whether it lasted for more than one update."""
        return self.last - self.first + 1 >= LEAST_UPDATES


@dataclass(slots=True)
class AmbiguityFinder:
    """Follows one run; keeps the most even of its divided updates."""

    found: Ambiguity | None = None
    _now: Ambiguity | None = None  # the one that is going on

    def see(self, step: int, record: StepRecord, truth: F64 | None) -> None:
        """Process the next update."""
        divided = _divided(step, record, truth)
        if divided is None:
            self._now = None
            return
        now = self._now
        if now is not None:
            divided = replace(divided, first=now.first)
            divided = divided if divided.shares[1] > now.shares[1] else replace(now, last=step)
        self._now = divided
        best = self.found
        same = best is not None and best.first == divided.first
        if divided.is_lasting and (best is None or same or divided.shares[1] > best.shares[1]):
            self.found = divided


def _divided(step: int, record: StepRecord, truth: F64 | None) -> Ambiguity | None:
    """Return how the weight of one update is divided between two places; None where it is not."""
    estimate = record.estimate
    if not TOGETHER / 2 <= estimate.mass <= 1 - SECOND:
        return None
    first, second = (*modes(record.weighted, estimate.radii), None, None)[:2]
    if first is None or second is None or second.mass < SECOND or first.mass + second.mass < TOGETHER:
        return None
    apart_m = float(np.hypot(*(first.pose - second.pose)[:2]))
    reach_m = estimate.radii.cluster_m
    if apart_m < APART * reach_m:
        return None
    truth_in = None
    if truth is not None:
        off_m = [float(np.hypot(*(one.pose - truth)[:2])) for one in (first, second)]
        truth_in = int(np.argmin(off_m)) + 1 if min(off_m) <= reach_m else 0
    fits = [_fit(record, one.pose, reach_m) for one in (first, second)]
    quality = record.sighting.comparison.quality
    known = len(quality) > 0 and None not in fits
    return Ambiguity(
        step,
        step,
        step,
        (first.mass, second.mass),
        apart_m,
        truth_in,
        (fits[0] or 0.0, fits[1] or 0.0) if known else None,
        float(np.median(quality)) if known else None,
    )


def _fit(record: StepRecord, pose: F64, reach_m: float) -> float | None:
    """Return how well the picture fits a place: the mean quality of the particles there, by weight."""
    weighted, entries = record.weighted, record.sighting.entries
    x, y = pose[:2] - weighted.origin
    near = np.square(weighted.poses[:, 0] - x) + np.square(weighted.poses[:, 1] - y) <= reach_m**2
    near &= entries >= 0
    quality, weights = record.sighting.comparison.quality, weighted.weights[near]
    if not len(quality) or not weights.sum() > 0:
        return None
    return float(np.average(quality[entries[near]], weights=weights))
