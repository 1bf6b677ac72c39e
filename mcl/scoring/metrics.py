"""How well a run went: the definitions by which every table is scored (docs/evaluation.md).

Everything is measured against the truth and the scored estimate: the heaviest cluster, before resampling.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..values.arrays import F64, Bool
from ..values.geometry import INCH_M, angle_between, motion_between
from ..values.map import Arena
from ..values.records import Estimate, StepRecord
from ..values.session import Moment
from .table import CONVERGED_SHARE, LOST_FOR, LOST_RAD, RIGHT_RAD, RunTable, TableRows, mostly

FIRST_SCORED = 4  # updates are counted from 1; the first three are not scored
RIGHT_AT_END = (7, 10)  # correct in at least 7 of the last 10 updates
GOAL_M = 1000 * INCH_M  # the thesis's goal for position tracking (3.6.2)
SEGMENT_RADII = 4.0  # length of a segment of the relative error, in radii of *right*


@dataclass(frozen=True, slots=True)
class StepScore:
    """One update against the truth; errors are None where the truth is not known."""

    error_m: float | None
    heading_error_rad: float | None
    converged: bool
    correct: bool | None
    lost: bool | None  # too far off at this update; a run is lost after four in a row

    @property
    def localized(self) -> bool | None:
        """Converged and correct."""
        return None if self.correct is None else self.converged and self.correct

    @property
    def wrong_and_confident(self) -> bool | None:
        """Converged and not correct: the worst case, since nothing in the cloud warns of it."""
        return None if self.correct is None else self.converged and not self.correct


def score_step(estimate: Estimate, truth: F64 | None) -> StepScore:
    """Score one estimate against one true pose (3,), by the estimate's radii."""
    radii = estimate.radii
    converged = estimate.converged >= CONVERGED_SHARE
    if truth is None:
        return StepScore(None, None, converged, None, None)
    off_m = float(np.hypot(*(estimate.pose[:2] - truth[:2])))
    off_rad = angle_between(float(estimate.pose[2]), float(truth[2]))
    correct = off_m <= radii.right_m and off_rad <= RIGHT_RAD
    return StepScore(off_m, off_rad, converged, correct, off_m > radii.lost_m or off_rad > LOST_RAD)


@dataclass(frozen=True, slots=True)
class RelativeError:
    """Relative pose error: how far off the estimated motion is over segments of the true path."""

    segment_m: float  # driven at least, by the truth, in every segment
    segments: int
    position_mean_m: float
    position_median_m: float
    position_rmse_m: float
    heading_mean_rad: float
    heading_median_rad: float
    heading_rmse_rad: float


def relative_error(truths: F64, estimates: F64, segment_m: float) -> RelativeError | None:
    """Score estimates (N, 3) by the truth (N, 3) at the same updates; None for a drive without a segment."""
    errors = segment_errors(truths, estimates, segment_m)
    if not len(errors):
        return None
    means, medians = errors.mean(axis=0), np.median(errors, axis=0)
    both = np.stack([means, medians, np.sqrt(np.square(errors).mean(axis=0))], axis=1)
    return RelativeError(segment_m, len(errors), *(float(value) for value in both.ravel()))


def segment_errors(truths: F64, estimates: F64, segment_m: float) -> F64:
    """Return distance and unsigned angle (S, 2) between the true and the estimated motion of each segment.

    Segments follow one another; each ends at the first pose at which the truth has driven at least
    `segment_m` since it began. These are the pairs and errors of `evo_rpe --pairs_from_reference`.
    """
    steps_m = np.hypot(*np.diff(truths[:, :2], axis=0).T)
    first, driven_m = 0, 0.0
    errors: list[tuple[float, float]] = []
    for last, step_m in enumerate(steps_m.tolist(), start=1):
        driven_m += step_m
        if driven_m >= segment_m:
            true, ours = (motion_between(poses[first], poses[last]) for poses in (truths, estimates))
            errors.append(
                (float(np.hypot(*(ours - true)[:2])), angle_between(float(ours[2]), float(true[2])))
            )
            first, driven_m = last, 0.0
    return np.array(errors).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class RunScore:
    """One run in numbers; None where the truth is not known or the run is too short for the figure.

    >>> import maurice_mcl as mcl
    >>> score = mcl.score(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> score.updates, score.lost
    (6, False)
    """

    updates: int
    distance_m: float  # driven: by the truth where it is known, else by odometry
    error_mean_m: float | None
    error_median_m: float | None
    error_final_m: float | None
    heading_error_mean_rad: float | None
    heading_error_median_rad: float | None
    localized_at_update: int | None
    localized_share: float | None
    lost: bool | None
    lost_at_update: int | None
    reached: bool | None  # drove 1000 true inches without being lost
    wrong_confident_share: float | None
    right_at_end: bool | None = None  # correct in at least 7 of the last 10 updates
    success: tuple[Success, ...] = ()  # by the thesis's two readings, where judged
    relative: RelativeError | None = None  # over segments of 4 radii of *right*


def score_table(run: RunTable, arena_m: tuple[float, float] | None = None) -> RunScore:
    """Score a run; with the arena's width and depth, success is also judged as the thesis does."""
    known, true_m, updates = run.known, run.true_m, run.updates
    scored = known & (np.arange(updates) >= FIRST_SCORED - 1)
    error_m, is_localized = run.error_m, run.is_localized
    off_m, off_rad = error_m[scored], run.heading_error_rad[scored]
    judged = np.flatnonzero(known)  # the others neither begin nor end anything
    lost, localized = first_run_of(run.is_off[known], LOST_FOR), first_mostly(is_localized[known])
    lost_at = None if lost is None else int(judged[lost - 1]) + 1
    good = updates if lost is None else int(judged[lost - LOST_FOR])  # updates before it was lost
    any_known, any_scored = bool(known.any()), len(off_m) > 0
    is_correct = run.is_correct
    return RunScore(
        updates=updates,
        distance_m=float((true_m if any_known else run.odometry_m.cumsum())[-1]) if updates else 0.0,
        error_mean_m=float(np.mean(off_m)) if any_scored else None,
        error_median_m=float(np.median(off_m)) if any_scored else None,
        error_final_m=float(error_m[known][-1]) if any_known else None,
        heading_error_mean_rad=float(np.mean(off_rad)) if any_scored else None,
        heading_error_median_rad=float(np.median(off_rad)) if any_scored else None,
        localized_at_update=None if localized is None else int(judged[localized - 1]) + 1,
        localized_share=_share(is_localized[known]),
        lost=lost_at is not None if any_known else None,
        lost_at_update=lost_at,
        reached=bool(good > 0 and true_m[good - 1] >= GOAL_M) if any_known else None,
        wrong_confident_share=_share((run.is_converged & ~is_correct)[known]),
        right_at_end=mostly_at_end(is_correct[known].tolist()),
        success=() if arena_m is None else successes(run, arena_m),
        relative=relative_error(run.truths[scored], run.poses[scored], SEGMENT_RADII * run.radii.right_m),
    )


def first_run_of(flags: Iterable[bool], length: int) -> int | None:
    """Return the update, counted from 1, at which a flag has been set `length` times in a row."""
    running = 0
    for number, flag in enumerate(flags, start=1):
        running = running + 1 if flag else 0
        if running == length:
            return number
    return None


def first_mostly(localized: Bool) -> int | None:
    """Return the first localized update, from 1, that begins five of which at least four are localized."""
    begins = mostly(localized)
    return int(begins.argmax()) + 1 if begins.any() else None


def mostly_at_end(correct: list[bool]) -> bool | None:
    """Return whether at least 7 of the last 10 updates were correct; None for fewer than ten."""
    least, window = RIGHT_AT_END
    return sum(correct[-window:]) >= least if len(correct) >= window else None


def _share(flags: Bool) -> float | None:
    return int(flags.sum()) / len(flags) if len(flags) else None


def score(steps: Iterable[tuple[Moment, StepRecord]], arena: Arena | None = None) -> RunScore:
    """Score what `run` yields: errors in meters and radians, when it was localized, whether it was lost.

    Figures are None where the true pose is not known or the run is too short for them (docs/evaluation.md
    has the definitions). With the arena, usually `library.arena`, success is also judged as the thesis does.

        >>> import maurice_mcl as mcl
        >>> library, session = mcl.tiny_library(), mcl.tiny_session()
        >>> mcl.score(mcl.run(mcl.make_localizer(library), session)).lost
        False
    """
    rows = TableRows()
    for moment, record in steps:
        rows.add(moment, record)
    return score_table(rows.table(), None if arena is None else arena.size_m)


SUCCESS_SHARE = 0.9  # share of the weight about one point
SUCCESS_SD_SHARE = 0.1  # of the arena's width and depth
IN_TIME_S = 300.0
TOO_LATE, LEFT_TRUTH = "time", "left"


@dataclass(frozen=True, slots=True)
class Success:
    """One run by one reading; a run that ended before five minutes may be neither localized nor failed."""

    preset: str  # "tenth" or "circle"
    at_step: int | None = None  # of the first success
    at_m: float | None = None  # driven by then: by the truth where it is known, else by odometry
    at_s: float | None = None  # robot time by then, since the session's first record
    failed: str | None = None  # "time": not in five minutes; "left": was off by the lost radius (assumed)
    failed_at_step: int | None = None  # also after it was localized


def successes(run: RunTable, arena_m: tuple[float, float], since: int = 0) -> tuple[Success, Success]:
    """Judge a run by the thesis's two readings, from some update on.

    "tenth": over 90 % is converged on the estimate, and the sd of all is below 10 % of the arena per axis.
    "circle": over 90 % is within 6 in of the estimate.
    """
    narrow = (run.mean_sd_m < SUCCESS_SD_SHARE * np.array(arena_m)).all(axis=1)
    tenth, circle = (run.converged > SUCCESS_SHARE) & narrow, run.circle > SUCCESS_SHARE
    return _success("tenth", tenth, run, since), _success("circle", circle, run, since)


def _success(preset: str, met: Bool, run: RunTable, since: int) -> Success:
    driven_m, times_s, steps = run.driven_m[since:], run.times_s[since:], run.steps[since:]
    too_far = run.error_m > run.radii.lost_m
    begun_m, begun_s = (float(driven_m[0]), float(times_s[0])) if since else (0.0, 0.0)
    if since:  # a cloud that is still where the robot was carried from is no success
        met = met & ~too_far
    late, at = _first(times_s - begun_s > IN_TIME_S), _first(met[since:])
    if late is not None and (at is None or late <= at):
        return Success(preset, failed=TOO_LATE, failed_at_step=int(steps[late]))
    if at is None:
        return Success(preset)
    first_out = _first(too_far[since + at :])
    return Success(
        preset,
        at_step=int(steps[at]),
        at_m=float(driven_m[at]) - begun_m,
        at_s=float(times_s[at]) - begun_s,
        failed=None if first_out is None else LEFT_TRUTH,
        failed_at_step=None if first_out is None else int(steps[at + first_out]),
    )


def _first(flags: Bool) -> int | None:
    """Return the index of the first flag that is set."""
    return int(flags.argmax()) if flags.any() else None
