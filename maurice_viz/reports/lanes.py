"""The lanes of a report: what the log says, and how each run was localized, over the steps of the charts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from maurice_mcl.reasons.causes import Failure
from maurice_mcl.scoring.events import KINDS, OF_LOG
from maurice_mcl.scoring.table import CONVERGED, LOST, PROBABLY_LOST

from ..panels.events import look_of_state, name_of, word_of
from ..running.saved_steps import Collected, Track
from ..style import RGB
from ..text.causes import steps_text
from .charts import LEFT, RIGHT, WIDTH

NAME_PX, BAR_PX, GAP_PX = 16.0, 20.0, 6.0  # heights: of a lane's name, of its bar, between lanes
LETTER_PX = 9.0  # width of a letter where a phone shows it larger


@dataclass(frozen=True, slots=True)
class State:
    """A stretch of steps in which a run was in one state, in px."""

    x: float
    width: float
    word: str
    color: RGB
    steps: str  # "steps 41 to 43"

    @property
    def has_room(self) -> bool:
        """Whether its word fits into it."""
        return len(self.word) * LETTER_PX + 8 <= self.width


@dataclass(frozen=True, slots=True)
class LogMark:
    """Something that the log says, in px; `word` is empty where another word is in the way."""

    x: float
    word: str
    text: str
    anchor: str  # of the word


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLanes:
    """A lane for the log if it says anything, then one a run, as a template writes them.

    Across, its steps lie where they lie in the charts.
    """

    collected: Collected
    width: float = WIDTH

    @property
    def height(self) -> float:
        """Of the drawing, in px."""
        return (len(self.collected.tracks) + bool(self.log)) * (NAME_PX + BAR_PX + GAP_PX)

    @property
    def runs(self) -> Iterator[tuple[str, float, list[State]]]:
        """Name, top in px and states of each run's lane."""
        for number, track in enumerate(self.collected.tracks):
            top = (number + bool(self.log)) * (NAME_PX + BAR_PX + GAP_PX)
            yield track.label, top, list(self._states(track, self.collected.results[number].verdict.failures))

    @property
    def log(self) -> list[LogMark]:
        """What the log says, each event once, words where there is room."""
        events = {
            event.step: event
            for event in reversed(self.collected.tracks[0].events)
            if OF_LOG in KINDS[event.kind].lanes and not event.is_routine and not event.continues
        }
        marks, free, right = list[LogMark](), -math.inf, WIDTH - RIGHT
        for step in sorted(events):
            x, word = self._across(step), word_of(name_of(events[step]))
            room = len(word) * LETTER_PX + 8
            at_end = x + room > right
            begins = x - room if at_end else x
            word = word if begins >= free else ""
            free = (x if at_end else x + room) if word else free
            text = f"step {step}: {events[step].text}"
            marks.append(LogMark(x, word, text, "end" if at_end else "start"))
        return marks

    def _states(self, track: Track, failures: Sequence[Failure]) -> Iterator[State]:
        """Yield the stretches of a run; those in which it was lost with the cause, where that is known."""
        rows = zip(track.table.steps.tolist(), track.table.states, strict=True)
        for (state, cause), stretch in groupby(rows, lambda row: (row[1], _cause(row[0], row[1], failures))):
            numbers = [step for step, _ in stretch]
            look = look_of_state(state if cause is None else LOST, cause)
            first, last = self._across(numbers[0] - 0.5), self._across(numbers[-1] + 0.5)
            yield State(first, last - first, look.word, look.color, steps_text(numbers[0], numbers[-1]))

    def _across(self, step: float) -> float:
        steps = self.collected.tracks[0].table.steps
        first, last = float(steps[0]) - 0.5, float(steps[-1]) + 0.5
        return LEFT + (step - first) / (last - first) * (WIDTH - LEFT - RIGHT)


def _cause(step: int, state: str, failures: Sequence[Failure]) -> Failure | None:
    """Return why a run was lost at a step; None where it was not.

    Without truth some doubts are known only at the end, and the state was that of dots together.
    """
    if state not in (LOST, PROBABLY_LOST, CONVERGED):
        return None
    at_step = (failure for failure in failures if failure.episode.first <= step <= failure.episode.last)
    return next(at_step, None)
