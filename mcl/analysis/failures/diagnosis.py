"""The diagnosis of one run: one cause, with its evidence, for each time that it was lost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from ...arrays import F64, U8
from ...filter.localizer import Localizer
from ...records import StepRecord
from ...session import Moment
from ..metrics import LOCALIZED_OF, LOST_FOR
from .around import Surroundings
from .deciding import decide
from .evidence import EvidenceFinder, UpdateEvidence
from .kinds import Failure
from .light import light_fit
from .story import FIRST, HELD, LOOKS_BACK, Story
from .surprise import surprise
from .suspicion import suspected

MOST_PICTURES = 64  # that are kept; of older ones the light is found at once
WRONG_FOR = 10  # updates wrong and confident, from which on also a run that finds itself later was lost


@dataclass(frozen=True, slots=True, eq=False)
class _Movement:
    before: F64 | None  # (3,) the truth at the update before
    truth: F64  # (3,)
    motions: F64  # (M, 3) of odometry since then


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    image: U8
    truth: F64  # (3,)
    estimate: F64  # (3,)


@dataclass(slots=True)
class LaterEvidence:
    """Finds what costs much only around a loss: the light, the movements, the edge of the map.

    Follows one run; `updates` is the list of its evidence, to which it adds what is asked for.
    What that takes is kept until then: a few numbers an update, and pictures that a loss can still be due to.
    """

    updates: list[UpdateEvidence]
    _movements: dict[int, _Movement] = field(default_factory=dict)  # by index, until they are compared
    _pictures: dict[int, _Picture] = field(default_factory=dict)  # by index, until compared or out of reach
    _truth: F64 | None = None  # of the update before
    _off: int = 0  # updates in a row that were off
    _was_right: bool = False  # whether an update was correct so far: before that, no loss begins
    _loss: range = range(0)  # the updates whose pictures the last loss can be due to, until they are compared
    _held: list[int] = field(default_factory=lambda: [-1])  # the last updates that held the truth

    def add(self, moment: Moment, record: StepRecord, around: Surroundings | None) -> None:
        """Keep what the last of `updates` may be asked for; `around` says how its light is found."""
        last, index = self.updates[-1], len(self.updates) - 1
        before, self._truth = self._truth, moment.truth
        self._off = self._off + 1 if last.score.lost else 0
        self._was_right |= last.score.correct is True
        if moment.truth is None or around is None or last.broken:
            return
        self._movements[index] = _Movement(before, moment.truth, moment.frame.motions)
        if last.fit is not None and moment.frame.image.size:
            self._pictures[index] = _Picture(moment.frame.image, moment.truth, record.estimate.pose)
        if last.held >= HELD:
            self._held.append(index)
        self._let_go(index, around)

    def complete(self, story: Story, localizer: Localizer, around: Surroundings) -> None:
        """Add to `updates` what the rules ask for in one trouble."""
        for index in sorted({*story.window, *story.moves} & self._movements.keys()):
            movement, now = self._movements.pop(index), self.updates[index]
            if localizer.motion is not None and movement.before is not None:
                origin = localizer.library.origin
                how = surprise(localizer.motion, origin, movement.before, movement.truth, movement.motions)
                now = replace(now, surprise=how)
            outside, reference_m = around.is_outside(movement.truth), around.to_reference_m(movement.truth)
            self.updates[index] = replace(now, outside=outside, reference_m=reference_m)
        self._light(story.pictures, around)

    def _light(self, indexes: Iterable[int], around: Surroundings) -> None:
        for index in sorted(set(indexes) & self._pictures.keys()):
            picture, now = self._pictures.pop(index), self.updates[index]
            assert now.fit is not None
            found = light_fit(around, picture.image, picture.truth, picture.estimate, now.fit)
            elements = around.elements(picture.image, now.fit)
            self.updates[index] = replace(now, light=found, elements=elements)

    def _let_go(self, index: int, around: Surroundings) -> None:
        """Let go of the pictures that no loss can be due to any more.

        A loss is due to pictures since the truth was held last, and is known some updates later. The first
        pictures are kept: those of a run that never finds itself.
        """
        if self._off == LOST_FOR and self._was_right:
            lost = index - LOST_FOR + 1
            self._due(around)
            self._loss = range(max(self._held_before(lost), 0), lost + FIRST + 1)
        if self._loss:
            if index >= self._loss[-1]:
                self._due(around)
            return
        known = index - LOST_FOR  # a loss that begins later is not known yet
        held = known if self._off > LOST_FOR else self._held_before(known + 1)
        first = held if held >= 0 else known - LOOKS_BACK
        for old in [one for one in self._pictures if FIRST < one < first]:
            del self._pictures[old]
        if len(self._pictures) > MOST_PICTURES + FIRST:
            self._light([min(one for one in self._pictures if one > FIRST)], around)

    def _due(self, around: Surroundings) -> None:
        """Find the light of the pictures that the last loss can be due to."""
        self._light(self._loss, around)
        self._loss = range(0)

    def _held_before(self, index: int) -> int:
        """Return the last update before one that held the truth; -1: none. Forgets those before it."""
        while len(self._held) > 1 and self._held[1] < index:
            self._held.pop(0)
        return self._held[0] if self._held[0] < index else -1


@dataclass(slots=True)
class DiagnosisBuilder:
    """Follows one run update by update; keeps a few numbers an update, and no cloud.

    With the run's `localizer` it also looks at references, motion and map.
    """

    localizer: Localizer | None = None
    _finder: EvidenceFinder | None = None
    _later: LaterEvidence = field(default_factory=lambda: LaterEvidence([]))
    _known: tuple[int, tuple[Failure, ...]] = (0, ())  # result for so many updates

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        if self._finder is None:
            self._finder = EvidenceFinder(self.localizer)
        self._updates.append(self._finder.see(moment, record))
        self._later.add(moment, record, self._finder.around)

    def result(self) -> tuple[Failure, ...]:
        """Return the failures up to now, in the order of steps; none for a healthy run."""
        count, found = self._known
        if count != len(self._updates):
            judged = any(one.score.correct is not None for one in self._updates)
            found = tuple(decide(one) for one in self.stories()) if judged else suspected(self._updates)
            self._known = len(self._updates), found
        return found

    @property
    def _updates(self) -> list[UpdateEvidence]:
        return self._later.updates

    def stories(self) -> list[Story]:
        """Return each time that the run was lost or had not found itself, with its evidence."""
        around = None if self._finder is None else self._finder.around
        times = troubled(self._updates)
        if not times or around is None or self.localizer is None:
            return [Story(self._updates, *one) for one in times]
        found = [Story(self._updates, *one, around.spacing_m, around.usual) for one in times]
        for story in found:
            self._later.complete(story, self.localizer, around)
        return found


def troubled(updates: Sequence[UpdateEvidence]) -> list[tuple[int, int, int]]:
    """Return each time a run was lost: first update that was off, last one, first after the time before.

    A run that had not been localized yet was lost if it never was, or was sure of a wrong place for long.
    """
    found, since, first = list[tuple[int, int, int]](), 0, None
    ever, off = False, 0
    recent: list[bool] = []
    for k, one in enumerate(updates):
        if one.score.correct is None:
            continue
        off = off + 1 if one.score.lost else 0
        recent = [*recent, one.score.localized is True][-LOCALIZED_OF[1] :]
        if first is None and off == LOST_FOR and (ever or updates[0].score.correct):
            first, recent = k - LOST_FOR + 1, []
        settled = len(recent) == LOCALIZED_OF[1] and sum(recent) >= LOCALIZED_OF[0] and recent[0]
        if not settled:
            continue
        begin = k - LOCALIZED_OF[1] + 1
        if first is not None:
            found.append((first, max(begin - 1, first), since))
            since, first = begin, None
        elif not ever and _was_sure(updates[:begin]):
            found.append((0, begin - 1, 0))
            since = begin
        ever = True
    last = len(updates) - 1
    if first is not None:
        found.append((first, last, since))
    elif not ever and any(one.score.correct is not None for one in updates) and last + 1 >= LOST_FOR:
        found.append((0, last, 0))
    return found


def _was_sure(updates: Sequence[UpdateEvidence]) -> bool:
    return sum(one.score.wrong_and_confident is True for one in updates) >= WRONG_FOR


def diagnose_run(
    steps: Iterable[tuple[Moment, StepRecord]], localizer: Localizer | None = None
) -> tuple[Failure, ...]:
    """Diagnose what `run` yields."""
    builder = DiagnosisBuilder(localizer)
    for moment, record in steps:
        builder.add(moment, record)
    return builder.result()
