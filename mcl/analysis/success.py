"""Success as the thesis defines it (3.6), in both of its readings, beside our own scores.

The thesis wants more than 90 % of the particles about one point and their standard deviation under 10 % of
the arena's dimensions, and says that this is a circle of one foot in diameter. For its own arena that is not
so (20.4 x 15.6 in), so both are judged. "About one point" of the first is taken to be the 24 in that our
"converged" uses. A run fails when that takes more than five minutes of robot time; of the second way to fail
the text is lost, and leaving the truth by 36 in is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import F64, Bool
from ..filter.estimate import share_within
from ..geometry import INCH_M
from ..records import StepRecord

MORE_THAN = 0.9  # share of the weight about one point
SD_UNDER = 0.1  # of the arena's width and depth
CIRCLE_M = 6 * INCH_M  # radius of a circle one foot in diameter
IN_TIME_S = 300.0
LEFT_M = 36 * INCH_M  # assumed, see above
TOO_LATE, LEFT = "time", "left"


@dataclass(frozen=True, slots=True)
class Success:
    """One run by one reading; neither localized nor failed is a run that ended before five minutes."""

    preset: str  # "tenth" or "circle"
    at_update: int | None = None  # of the first success, counted from 1
    at_m: float | None = None  # driven by then: by the truth where it is known, else by odometry
    at_s: float | None = None  # robot time by then, since the session's first record
    failed: str | None = None  # "time": not in five minutes; "left": was 36 in off the truth (assumed)
    failed_at_update: int | None = None  # also when it had been localized before


def meets_tenth(record: StepRecord, arena_m: tuple[float, float]) -> bool:
    """More than 90 % within 24 in of the scored estimate, sd under 10 % of the arena on each axis."""
    narrow = [sd < SD_UNDER * side for sd, side in zip(record.mean_estimate.sd_m, arena_m, strict=True)]
    return record.estimate.converged > MORE_THAN and all(narrow)


def meets_circle(record: StepRecord, injected: Bool | None) -> bool:
    """More than 90 % within 6 in of the scored estimate."""
    return share_within(record.weighted, record.estimate.pose, CIRCLE_M, injected) > MORE_THAN


@dataclass(slots=True)
class SuccessJudge:
    """Judges one run while it goes, fed like `metrics.Scorer`; keeps a few numbers and no cloud."""

    arena_m: tuple[float, float]  # width and depth
    _found: tuple[Success, Success] = (Success("tenth"), Success("circle"))
    _updates: int = 0
    _way_m: F64 = field(default_factory=lambda: np.zeros(2))  # by the truth, by odometry
    _truth: F64 | None = None  # the last one known
    _injected: Bool | None = None  # which particles of the update to come were freshly injected

    def add(self, record: StepRecord, truth: F64 | None) -> None:
        """Take in the next update, with the true pose (3,) where it is known."""
        self._updates += 1
        self._way_m = self._way_m + self._driven(record.frame.motions, truth)
        self._truth = self._truth if truth is None else truth
        fresh = self._injected
        if fresh is not None and len(fresh) != record.weighted.size:
            fresh = None
        met = (meets_tenth(record, self.arena_m), meets_circle(record, fresh))
        first, second = (
            self._judged(found, now, record, truth) for found, now in zip(self._found, met, strict=True)
        )
        self._found = (first, second)
        self._injected = record.injected

    def result(self) -> tuple[Success, Success]:
        """Return both readings of the run as far as it went."""
        return self._found

    def _driven(self, motions: F64, truth: F64 | None) -> F64:
        true_m = 0.0
        if truth is not None and self._truth is not None:
            true_m = float(np.hypot(*(truth[:2] - self._truth[:2])))
        return np.array([true_m, float(np.hypot(motions[:, 0], motions[:, 1]).sum())])

    def _judged(self, so_far: Success, met: bool, record: StepRecord, truth: F64 | None) -> Success:
        if so_far.failed is not None:
            return so_far
        time_s = record.frame.time_s
        if so_far.at_update is None:
            if time_s > IN_TIME_S:
                return replace(so_far, failed=TOO_LATE, failed_at_update=self._updates)
            if not met:
                return so_far
            way_m = float(self._way_m[0 if self._truth is not None else 1])
            so_far = replace(so_far, at_update=self._updates, at_m=way_m, at_s=time_s)
        if truth is not None and np.hypot(*(record.estimate.pose[:2] - truth[:2])) > LEFT_M:
            return replace(so_far, failed=LEFT, failed_at_update=self._updates)
        return so_far
