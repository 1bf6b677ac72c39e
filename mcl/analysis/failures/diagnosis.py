"""The diagnosis of one run: one cause, with its evidence, for each time that it was lost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ...filter.localizer import Localizer
from ...records import StepRecord
from ...session import Moment
from ..metrics import LOCALIZED_OF, LOST_FOR
from .deciding import decide
from .evidence import EvidenceFinder, UpdateEvidence
from .kinds import Failure
from .story import Story
from .suspicion import suspected

WRONG_FOR = 10  # updates wrong and confident, from which on also a run that finds itself later was lost


@dataclass(slots=True)
class DiagnosisBuilder:
    """Follows one run update by update; keeps a few numbers an update, and no cloud.

    With the run's `localizer` it also looks at references, motion and map.
    """

    localizer: Localizer | None = None
    _finder: EvidenceFinder | None = None
    _updates: list[UpdateEvidence] = field(default_factory=list)
    _known: tuple[int, tuple[Failure, ...]] = (0, ())  # result for so many updates

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Process the next update."""
        if self._finder is None:
            self._finder = EvidenceFinder(self.localizer)
        self._updates.append(self._finder.see(moment, record))

    def result(self) -> tuple[Failure, ...]:
        """Return the failures up to now, in the order of steps; none for a healthy run."""
        count, found = self._known
        if count != len(self._updates):
            judged = any(one.score.correct is not None for one in self._updates)
            found = tuple(decide(one) for one in self.stories()) if judged else suspected(self._updates)
            self._known = len(self._updates), found
        return found

    def stories(self) -> list[Story]:
        """Return each time that the run was lost or had not found itself, with its evidence."""
        around = None if self._finder is None else self._finder.around
        times = troubled(self._updates)
        if not times or around is None:
            return [Story(self._updates, *one) for one in times]
        return [Story(self._updates, *one, around.spacing_m, around.usual) for one in times]


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
