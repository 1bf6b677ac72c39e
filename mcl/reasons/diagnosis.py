"""The diagnosis of one run: one cause, with its evidence, for each time that it was lost, by `rules`."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from ..filter.localizer import Localizer
from ..scoring.episodes import Episode, RunSoFar, doubts, episodes
from ..scoring.table import LOST_FOR
from ..sensor.laser.fit import ScanFits
from ..sensor.map_places import map_library
from ..values import F64, U8, Moment, OccupancyMap, StepRecord
from .causes import Failure
from .evidence import (
    FIRST_UPDATES,
    LOOKBACK_UPDATES,
    NEAR_SHARE,
    EvidenceFinder,
    Story,
    UpdateEvidence,
)
from .rules import decide, suspected
from .surroundings import Surroundings, light_fit
from .suspicion import scan_doubts

MOST_WAITING = 2000  # updates whose scans and movements are looked at only when a run fails
MOST_PICTURES = 64  # that are kept; of older ones the light is measured at once


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    image: U8
    truth: F64  # (3,)
    estimate: F64  # (3,)


@dataclass(slots=True)
class KeptPictures:
    """Keeps pictures while a loss can still be due to them, and compares their light when one is.

    Follows one run; `updates` is the list of its evidence, to which it adds light and elements.
    """

    updates: list[UpdateEvidence]
    _pictures: dict[int, _Picture] = field(default_factory=dict)  # by index, until compared or out of reach
    _off: int = 0  # updates in a row that were off
    _was_right: bool = False  # whether an update was correct so far: before that, no loss begins
    _loss: range = range(0)  # the updates whose pictures the last loss can be due to, until they are compared
    _near: list[int] = field(default_factory=lambda: [-1])  # the last updates that held the truth

    def add(self, moment: Moment, record: StepRecord, surroundings: Surroundings | None) -> None:
        """Keep the picture of the last of `updates`; `surroundings` say how its light is measured."""
        last, index = self.updates[-1], len(self.updates) - 1
        self._off = self._off + 1 if last.score.lost else 0
        self._was_right |= last.score.correct is True
        if moment.truth is None or surroundings is None or last.broken:
            return
        if last.fit is not None and moment.frame.image.size:
            self._pictures[index] = _Picture(moment.frame.image, moment.truth, record.estimate.pose)
        if last.share_near >= NEAR_SHARE:
            self._near.append(index)
        self._let_go(index, surroundings)

    def compare(self, indexes: Iterable[int], surroundings: Surroundings) -> None:
        """Add light and elements to those of some updates whose pictures are kept."""
        for index in sorted(set(indexes) & self._pictures.keys()):
            picture, now = self._pictures.pop(index), self.updates[index]
            assert now.fit is not None
            light = light_fit(surroundings, picture.image, picture.truth, picture.estimate, now.fit)
            elements = surroundings.elements(picture.image, now.fit)
            self.updates[index] = replace(now, light=light, elements=elements)

    def _let_go(self, index: int, surroundings: Surroundings) -> None:
        """Let go of the pictures that no loss can be due to any more.

        A loss is due to pictures since the truth was held last, and is known some updates later. The first
        pictures are kept: those of a run that is never localized.
        """
        if self._off == LOST_FOR and self._was_right:
            lost = index - LOST_FOR + 1
            self.compare(self._loss, surroundings)
            self._loss = range(max(self._near_before(lost), 0), lost + FIRST_UPDATES + 1)
        if self._loss:
            if index >= self._loss[-1]:
                self.compare(self._loss, surroundings)
                self._loss = range(0)
            return
        known = index - LOST_FOR  # a loss that begins later is not known yet
        near = known if self._off > LOST_FOR else self._near_before(known + 1)
        first = near if near >= 0 else known - LOOKBACK_UPDATES
        for old in [k for k in self._pictures if FIRST_UPDATES < k < first]:
            del self._pictures[old]
        if len(self._pictures) > MOST_PICTURES + FIRST_UPDATES:
            self.compare([min(k for k in self._pictures if k > FIRST_UPDATES)], surroundings)

    def _near_before(self, index: int) -> int:
        """Return the last update before one that held the truth; -1: none. Forgets those before it."""
        while len(self._near) > 1 and self._near[1] < index:
            self._near.pop(0)
        return self._near[0] if self._near[0] < index else -1


@dataclass(slots=True)
class DiagnosisBuilder:
    """Follows one run update by update; keeps a few numbers an update, and no cloud.

    With the run's `localizer` it also looks at references, motion and map; runs of one sensor model and
    radii may share their `surroundings`.
    """

    localizer: Localizer | None = None
    occupancy: OccupancyMap | None = None  # that scans of a run without a localizer are laid on
    surroundings: Surroundings | None = None
    run: RunSoFar = field(default_factory=RunSoFar)
    _finder: EvidenceFinder = field(init=False)
    _pictures: KeptPictures = field(default_factory=lambda: KeptPictures([]))
    _waiting: deque[int] = field(default_factory=deque)  # updates that are not complete, by index
    _known: tuple[int, tuple[Failure, ...]] = (0, ())  # result for so many updates

    def __post_init__(self) -> None:
        scans = None
        if self.occupancy is not None and self.occupancy.free.any():
            scans = ScanFits(self.occupancy, map_library(self.occupancy, "map").poses)
        self._finder = EvidenceFinder(self.localizer, self.surroundings, scans)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        self.run.add(moment, record)
        self._updates.append(self._finder.see(moment, record, self.run.signal.knows))
        self._waiting.append(len(self._updates) - 1)
        self._complete(MOST_WAITING)
        self._pictures.add(moment, record, self._finder.surroundings)

    def result(self) -> tuple[Failure, ...]:
        """Return the failures up to now, in the order of steps; none for a healthy run."""
        count, failures = self._known
        if count != len(self._updates):
            judged = any(update.score.correct is not None for update in self._updates)
            around = self._finder.surroundings
            failures = (
                tuple(map(decide, self.stories()))
                if judged
                else suspected(self._updates, self.doubts, around)
            )
            self._known = len(self._updates), failures
        return failures

    @property
    def doubts(self) -> tuple[tuple[int, int], ...]:
        """The first and last step of each time that the run was probably lost, without truth.

        The lost signal says so; of a run that it never trusted, the scans do.
        """
        if any(update.score.correct is None for update in self._updates):
            self._complete()
        summary = self.run.signal.summary()
        trusted = summary is not None and summary.share > 0
        return doubts(self.run.rows.table()) if trusted else scan_doubts(self._updates)

    @property
    def has_laser(self) -> bool:
        """Whether the run has a laser, and a map in place of references."""
        return self._finder.scans is not None

    @property
    def _updates(self) -> list[UpdateEvidence]:
        return self._pictures.updates

    def stories(self) -> list[Story]:
        """Return each episode in which the filter failed, with its evidence."""
        surroundings = self._finder.surroundings
        stories = stories_of(self._updates, episodes(self.run.rows.table()).episodes)
        if stories:
            self._complete()
        if not stories or surroundings is None:
            return stories
        spacing_m, usual = surroundings.spacing_m, surroundings.usual
        stories = [replace(story, spacing_m=spacing_m, usual=usual) for story in stories]
        for story in stories:
            self._pictures.compare(story.pictures, surroundings)
        return stories

    def _complete(self, most: int = 0) -> None:
        """Add expensive evidence to all waiting updates but the last `most`: healthy runs never need it."""
        while len(self._waiting) > most:
            index = self._waiting.popleft()
            update = self._updates[index]
            if update.later is not None:
                self._updates[index] = replace(update, later=None, **update.later())


def stories_of(updates: Sequence[UpdateEvidence], episodes: Sequence[Episode]) -> list[Story]:
    """Return the failures among some episodes, each with where the one before it ended."""
    stories, since = list[Story](), 0
    for episode in episodes:
        if episode.is_failure:
            stories.append(Story(updates, episode, since))
            since = stories[-1].end + 1
    return stories
