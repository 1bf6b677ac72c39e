"""Small watchers, one idea each: what turns a value at every update into an event now and then."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import F64
from ..filter.estimate import CLUSTER_M
from ..records import StepRecord
from .modes import TrackedMode

Say = Callable[[float], str]  # writes a length in meters, with its unit


def in_meters(length_m: float) -> str:
    """Write a length: "0.32 m"."""
    return f"{length_m:.2f} m"


@dataclass(frozen=True, slots=True)
class EventThresholds:
    """When something counts as an event. Chosen so that each line of a list matters to a person."""

    dip_under: float = 0.1  # share of particles; a filter that resamples is far above it nearly always
    dip_over: float = 0.3  # share above which a dip has ended: one dip is one event
    beyond_sd: float = 3.0  # standard deviations; of a right cloud 1.1 % of updates lie beyond (two axes)
    within_sd: float = 2.0  # under which an excursion has ended
    claims_over: float = 0.5  # share of the weight in the cluster; with less the filter claims no place
    beyond_for: int = 2  # updates in a row; single ones are chance, or a mode switch says so already
    least_sd_m: float = 0.0254  # a cloud narrower than 1 in claims no more than that, as truth is measured so
    leads_with: float = 0.3  # share of the weight that a mode needs to take over
    leads_by: float = 0.1  # share that it must be ahead of the last leader, or two equals would alternate
    jump_m: float = CLUSTER_M  # 24 in, a mode's radius: nearer ones are one place to a person
    quiet_for: int = 5  # updates without, after which fresh particles begin a new burst


@dataclass(slots=True)
class Dip:
    """Reports when a value falls under a threshold, once until it has risen over a higher one."""

    _down: bool = False

    def see(self, share: float, limits: EventThresholds) -> float | None:
        """Return the value where a dip begins."""
        begins = not self._down and share < limits.dip_under
        self._down = share < (limits.dip_over if self._down else limits.dip_under)
        return share if begins else None


@dataclass(slots=True)
class Burst:
    """Reports when something happens for the first time in a while."""

    _last: int | None = None

    def begins(self, step: int, happens: bool, limits: EventThresholds) -> bool:
        """Return whether it happens now and did not in the updates just before."""
        if not happens:
            return False
        begins = self._last is None or step - self._last > limits.quiet_for
        self._last = step
        return begins


@dataclass(slots=True)
class BeyondSigma:
    """Reports when the truth leaves the estimate's cluster, once an excursion."""

    _running: int = 0  # updates beyond
    _out: bool = False

    def see(self, record: StepRecord, truth: F64, limits: EventThresholds, say: Say) -> str | None:
        """Return a line where an excursion is known."""
        claims = record.estimate.mass > limits.claims_over
        off_sd = deviations(record, truth, limits.least_sd_m) if claims else 0.0
        self._running = self._running + 1 if off_sd > limits.beyond_sd else 0
        known = not self._out and self._running >= limits.beyond_for
        self._out = known or (self._out and off_sd >= limits.within_sd)
        if not known:
            return None
        off = say(float(np.hypot(*(truth[:2] - record.estimate.pose[:2]))))
        return f"truth {off} from the estimate: {off_sd:.1f} standard deviations"


def deviations(record: StepRecord, truth: F64, least_sd_m: float) -> float:
    """Return the Mahalanobis distance of the truth's x, y from the estimate, by the cluster's covariance.

    The cluster is what lies within 24 in of the estimate; to each axis the square of `least_sd_m` is added.
    """
    middle = record.estimate.pose[:2] - record.weighted.origin
    x, y = (record.weighted.poses[:, axis] - np.float32(middle[axis]) for axis in (0, 1))
    held = record.weighted.weights * (x * x + y * y <= CLUSTER_M**2)
    total = float(held.sum()) or 1.0
    xx, yy, xy = (float(held @ product) / total for product in (x * x, y * y, x * y))
    xx, yy = xx + least_sd_m**2, yy + least_sd_m**2
    dx, dy = (truth[:2] - record.estimate.pose[:2]).tolist()
    return math.sqrt((yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy))


@dataclass(slots=True)
class Leader:
    """Reports when another mode than before has become the heaviest, by enough and far enough away."""

    _leader: TrackedMode | None = None

    def see(self, modes: Sequence[TrackedMode], limits: EventThresholds, say: Say) -> str | None:
        """Return a line where another mode takes over. The first leader of all takes over from none."""
        if not modes:
            return None
        first, last = modes[0], self._leader
        now = next((m for m in modes if last is not None and m.identity == last.identity), None)
        behind = first.estimate.mass - (now.estimate.mass if now else 0.0)
        if now is not None and (now is first or behind < limits.leads_by):
            self._leader = now
            return None
        if first.estimate.mass < limits.leads_with:
            return None
        self._leader = first
        if last is None:
            return None
        old = (now or last).estimate
        apart = float(np.hypot(*(first.estimate.pose[:2] - old.pose[:2])))
        if apart < limits.jump_m:
            return None
        left = f"{now.estimate.mass:.0%}" if now else "gone"
        share = f"{first.estimate.mass:.0%}"
        return f"mode {first.identity} ({share}) leads, {say(apart)} from mode {last.identity} ({left})"
