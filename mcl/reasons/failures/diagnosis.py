"""The diagnosis of one run: one cause, with its evidence, for each time that it was lost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from ...filter.localizer import Localizer
from ...scoring.episodes import Episode, EpisodeFinder
from ...scoring.metrics import LOST_FOR
from ...values.arrays import F64, U8
from ...values.records import StepRecord
from ...values.session import Moment
from .around import Surroundings
from .deciding import decide
from .evidence import EvidenceFinder, UpdateEvidence
from .kinds import Failure
from .light import light_fit
from .story import FIRST, HELD, LOOKS_BACK, Story
from .surprise import surprise
from .suspicion import suspected

MOST_PICTURES = 64  # that are kept; of older ones the light is found at once


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
        pictures are kept: those of a run that is never localized.
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
    episodes: EpisodeFinder = field(default_factory=EpisodeFinder)
    _finder: EvidenceFinder | None = None
    _later: LaterEvidence = field(default_factory=lambda: LaterEvidence([]))
    _known: tuple[int, tuple[Failure, ...]] = (0, ())  # result for so many updates

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        if self._finder is None:
            self._finder = EvidenceFinder(self.localizer)
        self.episodes.add(moment, record)
        self._updates.append(self._finder.see(moment, record, self.episodes))
        self._later.add(moment, record, self._finder.around)

    def result(self) -> tuple[Failure, ...]:
        """Return the failures up to now, in the order of steps; none for a healthy run."""
        count, failures = self._known
        if count != len(self._updates):
            judged = any(one.score.correct is not None for one in self._updates)
            doubts = self.episodes.doubts
            failures = tuple(map(decide, self.stories())) if judged else suspected(self._updates, doubts)
            self._known = len(self._updates), failures
        return failures

    @property
    def _updates(self) -> list[UpdateEvidence]:
        return self._later.updates

    def stories(self) -> list[Story]:
        """Return each episode in which the filter failed, with its evidence."""
        around = None if self._finder is None else self._finder.around
        stories = stories_of(self._updates, self.episodes.episodes)
        if not stories or around is None or self.localizer is None:
            return stories
        stories = [replace(one, spacing_m=around.spacing_m, usual=around.usual) for one in stories]
        for story in stories:
            self._later.complete(story, self.localizer, around)
        return stories


def stories_of(updates: Sequence[UpdateEvidence], episodes: Sequence[Episode]) -> list[Story]:
    """Return the failures among some episodes, each with where the one before it ended."""
    stories, since = list[Story](), 0
    for episode in episodes:
        if episode.is_failure:
            stories.append(Story(updates, episode, since))
            since = stories[-1].end + 1
    return stories


def diagnose_run(
    steps: Iterable[tuple[Moment, StepRecord]], localizer: Localizer | None = None
) -> tuple[Failure, ...]:
    """Diagnose what `run` yields."""
    builder = DiagnosisBuilder(localizer)
    for moment, record in steps:
        builder.add(moment, record)
    return builder.result()
