"""The verdict: what happened to one run, as facts. `maurice_viz.text.verdict` turns it into a sentence.

A trouble is a loss (the definition of `metrics`), a kidnapping that the log tells of, or a cloud that would
have left the map. It ends when the run is localized again; what happens in between belongs to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace

from ...filter.localizer import LEFT_MAP, Localizer
from ...filter.motion import PictureMotion
from ...radii import USUAL
from ...records import StepRecord
from ...session import Moment
from ..dead_reckoning import OdometryAlone
from ..events import KIDNAPPED, LOST, SEARCHING, LocalizationStatus, in_meters
from ..metrics import LOCALIZED_OF, LOST_FOR, StepScore, score_step
from .ambiguity import Ambiguity, AmbiguityFinder
from .causes import (
    CARRIED,
    DARK,
    JUMPED,
    OVERSTATED,
    SLIPPED,
    Cause,
    CauseFinder,
    InObstacle,
    ObstacleFinder,
)
from .diagnosis import DiagnosisBuilder
from .kinds import Failure
from .near_truth import has_near

EXPLAINS_FOR = 10  # updates after a cause in which a loss is due to it
MOSTLY = 0.5  # share of the updates of a trouble from which on it counts as "sure"


@dataclass(frozen=True, slots=True)
class _Update:
    step: int
    fresh: int  # particles that recovery injected
    sure: bool  # whether it was wrong and confident
    bereft: bool  # whether no particle was near the truth


@dataclass(frozen=True, slots=True)
class Trouble:
    """One time that a run was lost, kidnapped or off the map."""

    kind: str  # "kidnapped", "lost", or "searching": it had not been localized before
    step: int  # at which it began
    recovered: int | None = None  # first step at which the run was localized again; None: never
    lost: bool = False  # whether it was lost by the definition: too far off for four updates in a row
    fresh: int = 0  # particles that recovery injected until then
    updates: int = 0  # until then
    sure: int = 0  # of them wrong and confident
    bereft: int = 0  # of them without a particle near the truth
    cause: Cause | None = None  # what befell the robot shortly before; None: nothing that is known

    def with_updates(self, updates: Sequence[_Update], sign: int) -> Trouble:
        """Return a copy with some updates added (`sign` 1) or removed (-1)."""
        return replace(
            self,
            fresh=self.fresh + sign * sum(update.fresh for update in updates),
            updates=self.updates + sign * len(updates),
            sure=self.sure + sign * sum(update.sure for update in updates),
            bereft=self.bereft + sign * sum(update.bereft for update in updates),
        )

    @property
    def is_sure(self) -> bool:
        """Whether the filter was confident in most of these updates, at the wrong place."""
        return self.sure > MOSTLY * self.updates

    @property
    def has_loud_cause(self) -> bool:
        """Whether something befell the robot right before, which is told by itself."""
        return self.kind == KIDNAPPED or (self.cause is not None and self.cause.kind in LOUD)

    @property
    def is_bereft(self) -> bool:
        """Whether in most of these updates no particle was near the truth: weighting alone cannot find it."""
        return self.bereft > MOSTLY * self.updates


@dataclass(frozen=True, slots=True)
class SureAndWrong:
    """The update at which a confident cloud was farthest from the truth."""

    step: int
    error_m: float
    share: float  # of the weight, near the estimate
    bereft: bool = False  # whether no particle was near the truth


@dataclass(frozen=True, slots=True)
class RunVerdict:
    """A summary of one run. Steps are numbers of pictures, lengths in meters."""

    updates: int = 0
    has_truth: bool = False
    found: int | None = None  # first step at which the run was localized; None: never, or truth not known
    first: int = 0  # step of the first update
    last: int = 0  # and of the last one
    troubles: tuple[Trouble, ...] = ()
    error_mean_m: float | None = None
    error_end_m: float | None = None
    error_most_m: float | None = None
    lost_m: float = USUAL.lost_m  # an error above it is lost
    most_at: int = 0  # step of the largest error
    sure_share: float = 0.0  # of the updates: wrong and confident
    converged_share: float = 0.0  # of the updates
    left_map: tuple[int, ...] = ()  # steps at which the whole cloud would have left the map
    in_obstacles: tuple[InObstacle, ...] = ()  # when the truth was where the map has something solid
    causes: tuple[Cause, ...] = ()  # what befell the robot and its camera
    failures: tuple[Failure, ...] = ()  # each time it was lost or never found itself, with its one cause
    ambiguity: Ambiguity | None = None  # two places that shared the weight
    sure_and_wrong: SureAndWrong | None = None  # the worst update of this kind
    odometry_alone: OdometryAlone | None = None  # without its sensors; None: no known start, or no truth

    @property
    def is_off_at_end(self) -> bool:
        """Whether the error of the last estimate is above `lost_m`."""
        return self.error_end_m is not None and self.error_end_m > self.lost_m

    @property
    def telling(self) -> Ambiguity | None:
        """The two places that shared the weight, where this tells something: before it was localized."""
        found, one = self.found, self.ambiguity
        is_early = one is not None and (found is None or one.step < found)
        return None if any(t.kind == KIDNAPPED or t.is_sure for t in self.troubles) or not is_early else one

    @property
    def telling_causes(self) -> tuple[Cause, ...]:
        """What befell the robot, without what is small and explains no trouble."""
        explaining = [trouble.cause for trouble in self.troubles]
        return tuple(one for one in self.causes if one.kind in LOUD or one in explaining)

    @property
    def decisive(self) -> int:
        """The step to look at first: that of a loss, else of a cause, else of the worst error."""
        losses = [trouble for trouble in self.troubles if trouble.kind != SEARCHING or trouble.is_sure]
        if losses:
            return self._shown(losses[0])
        if self.telling is not None:
            return self.telling.step
        if loud := [cause for cause in self.causes if cause.kind in LOUD]:
            return loud[0].shown_at
        if self.found is not None and self.found > self.first + 1:
            return self.found
        if self.sure_and_wrong is not None and self.found is None:
            return self.sure_and_wrong.step
        if self.has_truth:
            return self.most_at
        if self.failures:
            return self.failures[0].first
        return self.left_map[0] if self.left_map else self.first

    def _shown(self, trouble: Trouble) -> int:
        """Return the step at which a trouble is seen best."""
        sure = self.sure_and_wrong
        if not trouble.has_loud_cause and trouble.is_sure and sure is not None and sure.step >= trouble.step:
            return sure.step
        return trouble.step


LOUD = (CARRIED, JUMPED, SLIPPED, DARK)  # causes that are told even where they did no harm


def decisive_step(verdicts: Mapping[str, RunVerdict]) -> int:
    """Return the step to look at first: the earliest decisive step of several runs."""
    return min(verdict.decisive for verdict in verdicts.values())


@dataclass(slots=True)
class VerdictBuilder:
    """Follows one run update by update; keeps a few numbers and no cloud.

    With the run's `localizer` its failures are diagnosed by references, motion and map, too.
    """

    localizer: InitVar[Localizer | None] = None
    _verdict: RunVerdict = field(default_factory=RunVerdict)
    _status: LocalizationStatus = field(default_factory=LocalizationStatus)
    _causes: CauseFinder = field(default_factory=CauseFinder)
    _ambiguity: AmbiguityFinder = field(default_factory=AmbiguityFinder)
    _obstacles: ObstacleFinder = field(default_factory=ObstacleFinder)
    _diagnosis: DiagnosisBuilder = field(default_factory=DiagnosisBuilder)
    _sum_m: float = 0.0
    _known: int = 0  # updates with truth
    _sure: int = 0
    _converged: int = 0
    _was_right: bool = False  # whether an update was localized so far
    _recent: list[_Update] = field(default_factory=list)  # the last five updates

    def __post_init__(self, localizer: Localizer | None) -> None:
        self._diagnosis = DiagnosisBuilder(localizer)
        self._obstacles = ObstacleFinder(localizer)
        if localizer is not None and isinstance(localizer.motion, PictureMotion):
            self._causes = CauseFinder(too_long=OVERSTATED)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        step, verdict = moment.frame.step, self._verdict
        score = score_step(record.estimate, moment.truth)
        fresh = 0 if record.injected is None else int(record.injected.sum())
        sure = score.wrong_and_confident is True
        truth, reach_m = moment.truth, record.estimate.radii.cluster_m
        bereft = not score.localized and truth is not None and not has_near(record.weighted, truth, reach_m)
        self._recent = [*self._recent, _Update(step, fresh, sure, bereft)][-LOCALIZED_OF[1] :]
        self._causes.see(moment, record)
        self._ambiguity.see(step, record, moment.truth)
        self._obstacles.see(step, moment.truth)
        self._diagnosis.add(moment, record)
        if verdict.updates == 0:
            verdict = replace(verdict, first=step)
        kidnapped = moment.kidnapped
        changes = dict(self._status.see(step, score, kidnapped, in_meters))
        left = LEFT_MAP in record.events
        self._verdict = replace(
            self._with_error(verdict, step, score),
            updates=verdict.updates + 1,
            last=step,
            lost_m=record.estimate.radii.lost_m,
            left_map=(*verdict.left_map, step) if left else verdict.left_map,
            troubles=self._troubles(step, changes, kidnapped),
            sure_and_wrong=_worse(verdict.sure_and_wrong, step, score, record, bereft)
            if sure
            else verdict.sure_and_wrong,
        )
        if self._verdict.found is None and {"localized", "recovered"} & set(changes):
            self._verdict = replace(self._verdict, found=step - LOCALIZED_OF[1] + 1)
        self._was_right |= score.localized is True
        self._sure += sure
        self._converged += int(score.converged)

    def result(self) -> RunVerdict:
        """Return the verdict up to now."""
        count, known = max(self._verdict.updates, 1), self._known
        return replace(
            self._verdict,
            has_truth=known > 0,
            error_mean_m=self._sum_m / known if known else None,
            sure_share=self._sure / count,
            converged_share=self._converged / count,
            in_obstacles=self._obstacles.found,
            causes=self._causes.found,
            failures=self._diagnosis.result(),
            ambiguity=self._ambiguity.found,
        )

    def _with_error(self, verdict: RunVerdict, step: int, score: StepScore) -> RunVerdict:
        error_m = score.position_error_m
        if error_m is None:
            return verdict
        self._known, self._sum_m = self._known + 1, self._sum_m + error_m
        verdict = replace(verdict, error_end_m=error_m)
        if verdict.error_most_m is None or error_m > verdict.error_most_m:
            verdict = replace(verdict, error_most_m=error_m, most_at=step)
        return verdict

    def _troubles(self, step: int, changes: Mapping[str, str], kidnapped: bool) -> tuple[Trouble, ...]:
        """Return the troubles after this update, which is the last of `_recent`."""
        troubles = self._verdict.troubles
        is_open = bool(troubles) and troubles[-1].recovered is None
        if kidnapped:
            troubles, is_open = (*troubles, Trouble(KIDNAPPED, step, cause=self._cause_of(step, step))), True
        if LOST in changes and not is_open:
            first = step - LOST_FOR + 1
            kind = LOST if self._was_right or self._converged > 0 else SEARCHING
            began = Trouble(kind, first, cause=self._cause_of(first - EXPLAINS_FOR, first))
            began = began.with_updates(self._recent[-LOST_FOR:-1], 1)
            troubles, is_open = (*troubles, began), True
        if not is_open:
            return troubles
        last = troubles[-1].with_updates(self._recent[-1:], 1)
        last = replace(last, lost=last.lost or LOST in changes)
        if {"recovered", "localized"} & set(changes):  # known only now, some updates later
            found = step - LOCALIZED_OF[1] + 1
            since = [update for update in self._recent if update.step >= max(found, last.step)]
            last = replace(last.with_updates(since, -1), recovered=found)
        return (*troubles[:-1], last)

    def _cause_of(self, first: int, last: int) -> Cause | None:
        """Return the latest cause that a trouble in between can be due to: at first the loud ones."""
        near = [one for one in self._causes.found if one.step <= last and one.last >= first]
        loud = [one for one in near if one.kind in LOUD]
        chosen = loud or near
        return chosen[-1] if chosen else None


def _worse(
    worst: SureAndWrong | None, step: int, score: StepScore, record: StepRecord, bereft: bool
) -> SureAndWrong | None:
    """Return the worst update so far that was sure and wrong."""
    error_m = score.position_error_m or 0.0
    if not score.wrong_and_confident or (worst is not None and worst.error_m >= error_m):
        return worst
    return SureAndWrong(step, error_m, record.estimate.converged, bereft)
