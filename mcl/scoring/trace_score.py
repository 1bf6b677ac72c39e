"""The score of a run from its trace: the same numbers as `maurice_mcl.score` of its records.

What is known of a drive is the same for all runs over it, and so is made once; a run's updates are judged as
arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..filter.batch import RunTrace
from ..values.arrays import F64, Bool
from ..values.geometry import wrap_angle
from ..values.map import Arena
from ..values.session import Moment
from .metrics import (
    CONVERGED_SHARE,
    FIRST_SCORED,
    IN_TIME_S,
    LEFT,
    LOST_RAD,
    MORE_THAN,
    RIGHT_RAD,
    SD_UNDER,
    SEGMENT_OF_RIGHT,
    TOO_LATE,
    RunErrors,
    RunScore,
    Success,
    relative_error,
)


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPath:
    """The true poses, times and lengths of a drive of U updates: the same for every run on it."""

    truths: F64  # (U, 3) NaN where not known
    times_s: F64  # (U,)
    true_m: F64  # (U,) driven up to each update, by the truth
    odometry_m: F64  # (U,) by odometry

    @classmethod
    def of(cls, moments: Sequence[Moment]) -> DrivenPath:
        """Follow a drive; its pictures are not looked at."""
        truths = np.full((len(moments), 3), np.nan)
        true_m, odometry_m = np.zeros(len(moments)), np.zeros(len(moments))
        last: F64 | None = None
        for update, moment in enumerate(moments):
            truth, motions = moment.truth, moment.frame.motions
            if truth is not None:
                truths[update] = truth
                true_m[update] = 0.0 if last is None else np.hypot(*(truth[:2] - last[:2]))
                last = truth
            odometry_m[update] = np.hypot(motions[:, 0], motions[:, 1]).sum()
        times_s = np.array([moment.frame.time_s for moment in moments], np.float64)
        return cls(truths, times_s, true_m.cumsum(), odometry_m.cumsum())

    @property
    def known(self) -> Bool:
        """Where (U,) the truth is known."""
        return ~np.isnan(self.truths[:, 0])

    @property
    def driven_m(self) -> F64:
        """How far the robot has driven (U,): by the truth, by odometry while no truth is known."""
        return np.where(np.logical_or.accumulate(self.known), self.true_m, self.odometry_m)


def score_trace(
    trace: RunTrace, drive: DrivenPath | Sequence[Moment], arena: Arena | None = None
) -> RunScore:
    """Score a trace of `run_batch` against the truth of the moments it was made from.

    Of many traces over one drive, `DrivenPath.of` its moments is made once and handed over.
    """
    path = drive if isinstance(drive, DrivenPath) else DrivenPath.of(drive)
    errors, known = trace_errors(trace, path), path.known
    scored = known & (np.arange(len(known)) >= FIRST_SCORED - 1)
    segment_m = SEGMENT_OF_RIGHT * trace.radii.right_m
    relative = relative_error(path.truths[scored], trace.poses[scored], segment_m)
    odometry_m = float(path.odometry_m[-1]) if len(known) else 0.0
    score = errors.score(path.true_m, odometry_m, relative)
    return score if arena is None else replace(score, success=_successes(trace, path, errors.off_m, arena))


def trace_errors(trace: RunTrace, path: DrivenPath) -> RunErrors:
    """Return what `score_step` finds at every update."""
    off = trace.poses - path.truths
    off_m = np.hypot(off[:, 0], off[:, 1])
    off_rad = np.abs(wrap_angle(off[:, 2]))
    return RunErrors(
        known=path.known,
        off_m=off_m,
        off_rad=off_rad,
        converged=trace.converged >= CONVERGED_SHARE,
        correct=(off_m <= trace.radii.right_m) & (off_rad <= RIGHT_RAD),
        lost=(off_m > trace.radii.lost_m) | (off_rad > LOST_RAD),
    )


def _successes(trace: RunTrace, path: DrivenPath, off_m: F64, arena: Arena) -> tuple[Success, Success]:
    """Judge a run by the thesis's two readings, as `SuccessJudge` does."""
    narrow = (trace.mean_sd_m < SD_UNDER * np.array(arena.size_m)).all(axis=1)
    tenth, circle = (trace.converged > MORE_THAN) & narrow, trace.circle > MORE_THAN
    too_far = off_m > trace.radii.lost_m
    return _success("tenth", tenth, path, too_far), _success("circle", circle, path, too_far)


def _success(preset: str, met: Bool, path: DrivenPath, too_far: Bool) -> Success:
    late, at = _first(path.times_s > IN_TIME_S), _first(met)
    if late is not None and (at is None or late <= at):
        return Success(preset, failed=TOO_LATE, failed_at_step=late + 1)
    if at is None:
        return Success(preset)
    driven_m, at_s = float(path.driven_m[at]), float(path.times_s[at])
    found = Success(preset, at_step=at + 1, at_m=driven_m, at_s=at_s)
    left = _first(too_far[at:])
    return found if left is None else replace(found, failed=LEFT, failed_at_step=at + left + 1)


def _first(flags: Bool) -> int | None:
    """Return the index of the first flag that is set."""
    return int(flags.argmax()) if flags.any() else None
