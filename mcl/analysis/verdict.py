"""The verdict: what happened to one run, as facts. `maurice_viz.text.verdict` turns it into a sentence.

A trouble is a loss (the definition of `metrics`), a kidnapping that the log tells of, or a cloud that would
have left the map. It ends when the run is localized again; what happens in between belongs to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..filter.localizer import LEFT_MAP
from ..radii import USUAL
from ..records import StepRecord
from ..session import Moment
from .events import KIDNAPPED, LocalizationStatus, in_meters, is_kidnapping
from .metrics import LOCALIZED_OF, LOST_FOR, StepScore, score_step

LOST = "lost"
MOSTLY = 0.5  # share of the updates of a trouble from which on it counts as "sure"


@dataclass(frozen=True, slots=True)
class _Update:
    step: int
    fresh: int  # particles that recovery injected
    sure: bool  # whether it was wrong and confident


@dataclass(frozen=True, slots=True)
class Trouble:
    """One time that a run was lost, kidnapped or off the map."""

    kind: str  # "kidnapped", "lost" or "left the map"
    step: int  # at which it began
    recovered: int | None = None  # first step at which the run was localized again; None: never
    lost: bool = False  # whether it was lost by the definition: too far off for four updates in a row
    fresh: int = 0  # particles that recovery injected until then
    updates: int = 0  # until then
    sure: int = 0  # of them wrong and confident

    def with_updates(self, updates: Sequence[_Update], sign: int) -> Trouble:
        """Return a copy with some updates added (`sign` 1) or removed (-1)."""
        return replace(
            self,
            fresh=self.fresh + sign * sum(update.fresh for update in updates),
            updates=self.updates + sign * len(updates),
            sure=self.sure + sign * sum(update.sure for update in updates),
        )

    @property
    def is_sure(self) -> bool:
        """Whether the filter was confident in most of these updates, at the wrong place."""
        return self.sure > MOSTLY * self.updates


@dataclass(frozen=True, slots=True)
class RunVerdict:
    """A summary of one run. Steps are numbers of pictures, lengths in meters."""

    updates: int = 0
    has_truth: bool = False
    found: int | None = None  # first step at which the run was localized; None: never, or truth not known
    first: int = 0  # step of the first update
    troubles: tuple[Trouble, ...] = ()
    error_mean_m: float | None = None
    error_end_m: float | None = None
    error_most_m: float | None = None
    lost_m: float = USUAL.lost_m  # an error above it is lost
    most_at: int = 0  # step of the largest error
    sure_share: float = 0.0  # of the updates: wrong and confident
    converged_share: float = 0.0  # of the updates
    left_map: tuple[int, ...] = ()  # steps at which the whole cloud would have left the map

    @property
    def is_off_at_end(self) -> bool:
        """Whether the error of the last estimate is above `lost_m`."""
        return self.error_end_m is not None and self.error_end_m > self.lost_m

    @property
    def decisive(self) -> int:
        """The step to look at first: the first trouble, else the first localization, else the worst error."""
        if self.troubles:
            return self.troubles[0].step
        if self.found is not None and self.found > self.first + 1:
            return self.found
        return self.most_at if self.has_truth else (self.left_map[0] if self.left_map else self.first)


def decisive_step(verdicts: Mapping[str, RunVerdict]) -> int:
    """Return the step to look at first: the earliest decisive step of several runs."""
    return min(verdict.decisive for verdict in verdicts.values())


@dataclass(slots=True)
class VerdictBuilder:
    """Follows one run update by update; keeps a few numbers and no cloud."""

    _verdict: RunVerdict = field(default_factory=RunVerdict)
    _status: LocalizationStatus = field(default_factory=LocalizationStatus)
    _sum_m: float = 0.0
    _known: int = 0  # updates with truth
    _sure: int = 0
    _converged: int = 0
    _recent: list[_Update] = field(default_factory=list)  # the last five updates

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        step, verdict = moment.frame.step, self._verdict
        score = score_step(record.estimate, moment.truth)
        fresh = 0 if record.injected is None else int(record.injected.sum())
        sure = score.wrong_and_confident is True
        self._recent = [*self._recent, _Update(step, fresh, sure)][-LOCALIZED_OF[1] :]
        if verdict.updates == 0:
            verdict = replace(verdict, first=step)
        kidnapped = any(is_kidnapping(text) for text in moment.events)
        changes = dict(self._status.see(step, score, kidnapped, in_meters))
        left = LEFT_MAP in record.events
        self._verdict = replace(
            self._with_error(verdict, step, score),
            updates=verdict.updates + 1,
            lost_m=record.estimate.radii.lost_m,
            left_map=(*verdict.left_map, step) if left else verdict.left_map,
            troubles=self._troubles(step, changes, kidnapped),
        )
        if self._verdict.found is None and {"localized", "recovered"} & set(changes):
            self._verdict = replace(self._verdict, found=step - LOCALIZED_OF[1] + 1)
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
            troubles, is_open = (*troubles, Trouble(KIDNAPPED, step)), True
        if LOST in changes and not is_open:
            began = Trouble(LOST, step - LOST_FOR + 1).with_updates(self._recent[-LOST_FOR:-1], 1)
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
