"""Two places that explain the pictures about as well: when a cloud was divided, and how."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import F64
from ..filter.estimate import modes
from ..records import StepRecord

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
    return Ambiguity(step, step, step, (first.mass, second.mass), apart_m, truth_in)
