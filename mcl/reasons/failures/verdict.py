"""The verdict: what happened to one run, as facts. `maurice_viz.text.verdict` turns it into a sentence.

Its `episodes` are when it was wrong, its `causes` what befell the robot, its `failures` why it was lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field, replace

from ...filter.localizer import LEFT_MAP, Localizer
from ...filter.motion import PictureMotion
from ...scoring.dead_reckoning import OdometryAlone
from ...scoring.episodes import KIDNAPPED, SEARCHING, Episode
from ...scoring.metrics import FIRST_SCORED, StepScore
from ...values.radii import USUAL, Radii
from ...values.records import StepRecord
from ...values.session import Moment
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

EXPLAINS_FOR = 10  # steps after a cause in which a loss is due to it


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
    episodes: tuple[Episode, ...] = ()  # each time that it was wrong; none without truth
    doubts: tuple[tuple[int, int], ...] = ()  # first and last step of each time that it was probably lost
    error_mean_m: float | None = None  # over the scored updates, as in the table of scores
    error_most_m: float | None = None  # of these
    most_at: int = 0  # step of the largest error
    off: int = 0  # updates that were not correct
    beyond: int = 0  # of these, those that were too far off: beyond the radius *lost*, or 45 degrees
    end: StepScore | None = None  # of the last update with truth
    radii: Radii = USUAL  # by which it was judged
    sure_share: float = 0.0  # of the updates: wrong and confident
    converged_share: float = 0.0  # of the updates
    left_map: tuple[int, ...] = ()  # steps at which the whole cloud would have left the map
    in_obstacles: tuple[InObstacle, ...] = ()  # when the truth was where the map has something solid
    causes: tuple[Cause, ...] = ()  # what befell the robot and its camera
    failures: tuple[Failure, ...] = ()  # each time it was lost or never localized, with its one cause
    ambiguity: Ambiguity | None = None  # two places that shared the weight
    sure_and_wrong: SureAndWrong | None = None  # the worst update of this kind
    odometry_alone: OdometryAlone | None = None  # without its sensors; None: no known start, or no truth

    @property
    def error_end_m(self) -> float | None:
        """The error of the last estimate with truth."""
        return None if self.end is None else self.end.position_error_m

    def cause_of(self, episode: Episode) -> Cause | None:
        """Return the latest cause that an episode can be due to: at first the loud ones."""
        if episode.kind == KIDNAPPED:
            near = [one for one in self.causes if one.step == episode.first]
        else:
            since = episode.onset - EXPLAINS_FOR
            near = [one for one in self.causes if one.step <= episode.onset and one.last >= since]
        loud = [one for one in near if one.kind in LOUD]
        chosen = loud or near
        return chosen[-1] if chosen else None

    def has_loud_cause(self, episode: Episode) -> bool:
        """Return whether something befell the robot right before an episode, which is told by itself."""
        cause = self.cause_of(episode)
        return episode.kind == KIDNAPPED or (cause is not None and cause.kind in LOUD)

    @property
    def telling(self) -> Ambiguity | None:
        """The two places that shared the weight, where this tells something: before it was localized."""
        found, one = self.found, self.ambiguity
        is_early = one is not None and (found is None or one.step < found)
        told = any(episode.kind == KIDNAPPED or episode.is_sure for episode in self.episodes)
        return None if told or not is_early else one

    @property
    def telling_causes(self) -> tuple[Cause, ...]:
        """What befell the robot, without what is small and explains no episode."""
        explaining = [self.cause_of(one) for one in self.episodes if one.kind != SEARCHING or one.is_failure]
        return tuple(one for one in self.causes if one.kind in LOUD or one in explaining)

    @property
    def decisive(self) -> int:
        """The step to look at first: that of a loss, else of a cause, else of the worst error."""
        losses = [one for one in self.episodes if one.kind != SEARCHING or one.is_sure]
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

    def _shown(self, episode: Episode) -> int:
        """Return the step at which an episode is seen best."""
        sure, told = self.sure_and_wrong, self.has_loud_cause(episode)
        if not told and episode.is_sure and sure is not None and sure.step >= episode.first:
            return sure.step
        return episode.first


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
    _causes: CauseFinder = field(default_factory=CauseFinder)
    _ambiguity: AmbiguityFinder = field(default_factory=AmbiguityFinder)
    _obstacles: ObstacleFinder = field(default_factory=ObstacleFinder)
    _diagnosis: DiagnosisBuilder = field(default_factory=DiagnosisBuilder)
    _sum_m: float = 0.0
    _scored: int = 0  # updates
    _sure: int = 0
    _converged: int = 0

    def __post_init__(self, localizer: Localizer | None) -> None:
        self._diagnosis = DiagnosisBuilder(localizer)
        self._obstacles = ObstacleFinder(localizer)
        if localizer is not None and isinstance(localizer.motion, PictureMotion):
            self._causes = CauseFinder(too_long=OVERSTATED)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        step, verdict = moment.frame.step, self._verdict
        self._causes.see(moment, record)
        self._ambiguity.see(step, record, moment.truth)
        self._obstacles.see(step, moment.truth)
        self._diagnosis.add(moment, record)
        episodes = self._diagnosis.episodes
        score, left = episodes.score, LEFT_MAP in record.events
        self._sure += score.wrong_and_confident is True
        self._converged += int(score.converged)
        self._verdict = replace(
            self._with_error(verdict, step, score),
            updates=verdict.updates + 1,
            first=verdict.first if verdict.updates else step,
            last=step,
            found=episodes.localized,
            radii=record.estimate.radii,
            left_map=(*verdict.left_map, step) if left else verdict.left_map,
            episodes=episodes.episodes,
            doubts=episodes.doubts,
            sure_and_wrong=_worse(verdict.sure_and_wrong, step, score, record, episodes.is_bereft),
        )

    def result(self) -> RunVerdict:
        """Return the verdict up to now."""
        count = max(self._verdict.updates, 1)
        return replace(
            self._verdict,
            has_truth=self._verdict.end is not None,
            error_mean_m=self._sum_m / self._scored if self._scored else None,
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
        off, beyond = verdict.off + (score.correct is False), verdict.beyond + (score.lost is True)
        verdict = replace(verdict, end=score, off=off, beyond=beyond)
        if verdict.updates + 1 < FIRST_SCORED:
            return verdict
        self._scored, self._sum_m = self._scored + 1, self._sum_m + error_m
        is_most = verdict.error_most_m is None or error_m > verdict.error_most_m
        return replace(verdict, error_most_m=error_m, most_at=step) if is_most else verdict


def _worse(
    worst: SureAndWrong | None, step: int, score: StepScore, record: StepRecord, bereft: bool
) -> SureAndWrong | None:
    """Return the worst update so far that was sure and wrong."""
    error_m = score.position_error_m or 0.0
    if not score.wrong_and_confident or (worst is not None and worst.error_m >= error_m):
        return worst
    return SureAndWrong(step, error_m, record.estimate.converged, bereft)
