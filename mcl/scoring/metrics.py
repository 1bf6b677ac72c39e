"""How well a run went: the definitions by which every table is scored (docs/evaluation.md).

Everything is measured against the truth and the scored estimate: the heaviest cluster, before resampling.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..filter.estimate import CIRCLE_M, share_within
from ..values.arrays import F64, Bool
from ..values.geometry import INCH_M, angle_between, motion_between
from ..values.map import Arena
from ..values.records import Estimate, StepRecord
from ..values.session import Frame, Moment

FIRST_SCORED = 4  # updates are counted from 1; the first three are not scored
LOST_RAD, LOST_FOR = float(np.deg2rad(45)), 4
RIGHT_RAD = float(np.deg2rad(30))
CONVERGED_SHARE = 0.9
LOCALIZED_OF = (4, 5)  # in at least 4 of the 5 updates that start there
RIGHT_AT_END = (7, 10)  # correct in at least 7 of the last 10 updates
GOAL_M = 1000 * INCH_M  # the thesis's goal for position tracking (3.6.2)
SEGMENT_OF_RIGHT = 4.0  # length of a segment of the relative error, in radii of *right*


@dataclass(frozen=True, slots=True)
class StepScore:
    """One update against the truth; errors are None where the truth is not known."""

    position_error_m: float | None
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
    """Return distance and unsigned angle (K, 2) between the true and the estimated motion of each segment.

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
    >>> found = mcl.score(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> found.updates, found.lost
    (6, False)
    """

    updates: int
    distance_m: float  # driven: by the truth where it is known, else by odometry
    position_error_mean_m: float | None
    position_error_median_m: float | None
    position_error_final_m: float | None
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


@dataclass(frozen=True, slots=True, eq=False)
class RunErrors:
    """U updates against the truth, as arrays (U,); NaN and False where it is not known."""

    known: Bool  # whether the truth is
    off_m: F64  # position error
    off_rad: F64  # heading error
    converged: Bool
    correct: Bool
    lost: Bool  # too far off at this update

    @property
    def localized(self) -> Bool:
        """Converged and correct."""
        return self.converged & self.correct

    def score(self, driven_m: F64, odometry_m: float, relative: RelativeError | None) -> RunScore:
        """Return the score; `driven_m` (U,) is the true distance up to each update."""
        known, updates = self.known, len(self.known)
        scored = known & (np.arange(updates) >= FIRST_SCORED - 1)
        off_m, off_rad = self.off_m[scored], self.off_rad[scored]
        lost_at = first_run_of(self.lost.tolist(), LOST_FOR)
        good = updates if lost_at is None else lost_at - LOST_FOR  # updates before it was lost
        anything, some = bool(known.any()), len(off_m) > 0
        return RunScore(
            updates=updates,
            distance_m=float(driven_m[-1]) if anything else odometry_m,
            position_error_mean_m=float(np.mean(off_m)) if some else None,
            position_error_median_m=float(np.median(off_m)) if some else None,
            position_error_final_m=float(self.off_m[known][-1]) if anything else None,
            heading_error_mean_rad=float(np.mean(off_rad)) if some else None,
            heading_error_median_rad=float(np.median(off_rad)) if some else None,
            localized_at_update=first_mostly(self.localized),
            localized_share=_share(self.localized[known]),
            lost=lost_at is not None if anything else None,
            lost_at_update=lost_at,
            reached=bool(good > 0 and driven_m[good - 1] >= GOAL_M) if anything else None,
            wrong_confident_share=_share((self.converged & ~self.correct)[known]),
            right_at_end=mostly_at_end(self.correct[known].tolist()),
            relative=relative,
        )


@dataclass(slots=True)
class Scorer:
    """Scores one run; keeps a few numbers per update. One without truth is in no error or share."""

    _steps: list[StepScore] = field(default_factory=list)
    _driven_m: list[float] = field(default_factory=list)  # true distance up to each update
    _odometry_m: float = 0.0
    _last_truth: F64 | None = None
    _pairs: list[tuple[F64, F64]] = field(default_factory=list)  # truth and estimate, from the first scored
    _right_m: float = 0.0

    def add(self, estimate: Estimate, truth: F64 | None, motions: F64) -> StepScore:
        """Process the next update; `motions` (M, 3) give the distance where there is no truth."""
        score = score_step(estimate, truth)
        self._steps.append(score)
        self._odometry_m += float(np.hypot(motions[:, 0], motions[:, 1]).sum())
        driven = self._driven_m[-1] if self._driven_m else 0.0
        if truth is not None and self._last_truth is not None:
            driven += float(np.hypot(*(truth[:2] - self._last_truth[:2])))
        self._driven_m.append(driven)
        self._last_truth = truth if truth is not None else self._last_truth
        self._right_m = estimate.radii.right_m
        if truth is not None and len(self._steps) >= FIRST_SCORED:
            self._pairs.append((truth, estimate.pose))
        return score

    @property
    def driven_m(self) -> float:
        """How far the robot has driven, by the truth; by odometry while no truth is known."""
        return self._driven_m[-1] if self._last_truth is not None else self._odometry_m

    def result(self) -> RunScore:
        """Return the score of the run so far."""
        return self.errors().score(np.array(self._driven_m), self._odometry_m, self._relative())

    def errors(self) -> RunErrors:
        """Return the errors of all updates so far."""
        steps = self._steps
        numbers = np.array([[one.position_error_m, one.heading_error_rad] for one in steps], np.float64)
        flags = [
            [one.correct is not None, one.converged, one.correct is True, one.lost is True] for one in steps
        ]
        off_m, off_rad = numbers.reshape(-1, 2).T
        known, converged, correct, lost = np.array(flags, bool).reshape(-1, 4).T
        return RunErrors(known, off_m, off_rad, converged, correct, lost)

    def _relative(self) -> RelativeError | None:
        pairs = np.array(self._pairs).reshape(-1, 2, 3)
        return relative_error(pairs[:, 0], pairs[:, 1], SEGMENT_OF_RIGHT * self._right_m)


def first_run_of(flags: list[bool], length: int) -> int | None:
    """Return the update, counted from 1, at which a flag has been set `length` times in a row."""
    running = 0
    for number, flag in enumerate(flags, start=1):
        running = running + 1 if flag else 0
        if running == length:
            return number
    return None


def first_mostly(localized: Bool) -> int | None:
    """Return the first localized update, from 1, that begins five of which at least four are localized."""
    needed, window = LOCALIZED_OF
    flags = localized.tolist()
    for first in range(len(flags) - window + 1):
        if flags[first] and sum(flags[first : first + window]) >= needed:
            return first + 1
    return None


def mostly_at_end(correct: list[bool]) -> bool | None:
    """Return whether at least 7 of the last 10 updates were correct; None for fewer than ten."""
    needed, window = RIGHT_AT_END
    return sum(correct[-window:]) >= needed if len(correct) >= window else None


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
    scorer, judge = Scorer(), None if arena is None else SuccessJudge(arena.size_m)
    for moment, record in steps:
        scorer.add(record.estimate, moment.truth, moment.frame.motions)
        if judge is not None:
            judge.add(record, moment.truth)
    return replace(scorer.result(), success=() if judge is None else judge.result())


MORE_THAN = 0.9  # share of the weight about one point
SD_UNDER = 0.1  # of the arena's width and depth
IN_TIME_S = 300.0
TOO_LATE, LEFT = "time", "left"


@dataclass(frozen=True, slots=True)
class Success:
    """One run by one reading; a run that ended before five minutes may be neither localized nor failed."""

    preset: str  # "tenth" or "circle"
    at_step: int | None = None  # of the first success
    at_m: float | None = None  # driven by then: by the truth where it is known, else by odometry
    at_s: float | None = None  # robot time by then, since the session's first record
    failed: str | None = None  # "time": not in five minutes; "left": was off by the lost radius (assumed)
    failed_at_step: int | None = None  # also after it was localized


def meets_tenth(record: StepRecord, arena_m: tuple[float, float]) -> bool:
    """Return whether over 90 % is converged on the estimate, and sd below 10 % of the arena per axis."""
    return is_tenth(record.estimate.converged, record.mean_estimate.sd_m, arena_m)


def is_tenth(converged: float, mean_sd_m: Sequence[float], arena_m: tuple[float, float]) -> bool:
    """Return `meets_tenth` from the numbers it depends on."""
    narrow = [sd < SD_UNDER * side for sd, side in zip(mean_sd_m, arena_m, strict=True)]
    return converged > MORE_THAN and all(narrow)


def meets_circle(record: StepRecord) -> bool:
    """Return whether over 90 % is within 6 in of the scored estimate."""
    return share_within(record.weighted, record.estimate.pose, CIRCLE_M) > MORE_THAN


@dataclass(slots=True)
class SuccessJudge:
    """Judges one run update by update, like `Scorer`; keeps a few numbers and no cloud."""

    arena_m: tuple[float, float]  # width and depth
    _found: tuple[Success, Success] = (Success("tenth"), Success("circle"))
    _driven_m: F64 = field(default_factory=lambda: np.zeros(2))  # by the truth, by odometry
    _truth: F64 | None = None  # the last one known

    def add(self, record: StepRecord, truth: F64 | None) -> None:
        """Process the next update, with the true pose (3,) where it is known."""
        met = (meets_tenth(record, self.arena_m), meets_circle(record))
        self.see(record.frame, record.estimate, met, truth)

    def see(self, frame: Frame, estimate: Estimate, met: tuple[bool, bool], truth: F64 | None) -> None:
        """Process the next update from its scored estimate and whether it meets either reading."""
        true_m, motions = 0.0, frame.motions
        if truth is not None and self._truth is not None:
            true_m = float(np.hypot(*(truth[:2] - self._truth[:2])))
        moved_m = float(np.hypot(motions[:, 0], motions[:, 1]).sum())
        self._driven_m = self._driven_m + np.array([true_m, moved_m])
        self._truth = self._truth if truth is None else truth
        first, second = (
            self._judged(found, now, frame, estimate, truth)
            for found, now in zip(self._found, met, strict=True)
        )
        self._found = (first, second)

    def result(self) -> tuple[Success, Success]:
        """Return both readings of the run so far."""
        return self._found

    def _judged(
        self, so_far: Success, met: bool, frame: Frame, estimate: Estimate, truth: F64 | None
    ) -> Success:
        step, time_s = frame.step, frame.time_s
        if so_far.failed is not None:
            return so_far
        if so_far.at_step is None:
            if time_s > IN_TIME_S:
                return replace(so_far, failed=TOO_LATE, failed_at_step=step)
            if not met:
                return so_far
            driven_m = float(self._driven_m[0 if self._truth is not None else 1])
            so_far = replace(so_far, at_step=step, at_m=driven_m, at_s=time_s)
        if truth is not None and np.hypot(*(estimate.pose[:2] - truth[:2])) > estimate.radii.lost_m:
            return replace(so_far, failed=LEFT, failed_at_step=step)
        return so_far
