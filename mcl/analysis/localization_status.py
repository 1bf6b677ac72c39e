"""Localization status: whether a run is localized at every update, and when that changed.

The definitions are those of `metrics`. What only later updates show is reported when it is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from .metrics import LOCALIZED_OF, LOST_FOR, StepScore, first_mostly

Say = Callable[[float], str]  # writes a length in meters, with its unit


def in_meters(length_m: float) -> str:
    """Return a length as text: "0.32 m"."""
    return f"{length_m:.2f} m"


LOCALIZED, SEARCHING, WRONG, LOST = "localized", "searching", "wrong and confident", "lost"
CONVERGED, SPREAD = "converged", "spread"

STATES: Mapping[str, str] = {
    LOCALIZED: "converged and correct",
    SEARCHING: "not converged, or not correct and not converged",
    WRONG: "converged and not correct: nothing in the cloud warns of it",
    LOST: "too far off for four updates in a row, and still so",
    CONVERGED: "truth not known: at least 90 % of the weight within 24 in of the estimate",
    SPREAD: "truth not known: less than that",
}


@dataclass(slots=True)
class LocalizationStatus:
    """Follows one run; keeps five updates."""

    state: str = ""  # at the last update seen: a key of STATES
    _recent: tuple[bool, ...] = ()  # localized or not, of at most the last five updates
    _off: int = 0  # updates in a row that were too far off
    _since: int = 0  # step of the loss or kidnapping that the run has to recover from; 0: none
    _was: str = ""  # "lost" or "kidnapped", of that step
    _found: bool = False  # whether the run has been localized since the last loss
    _ever: bool = False  # whether it has been localized at all

    def see(self, step: int, score: StepScore, kidnapped: bool, say: Say) -> Iterator[tuple[str, str]]:
        """Process the next update; yield kind and text of each change."""
        if kidnapped:
            self._recent, self._since, self._was, self._found = (), step, "carried away", False
        self._recent = (*self._recent, score.localized is True)[-LOCALIZED_OF[1] :]
        self._off = self._off + 1 if score.lost else 0
        self.state = self._state(score)
        if self._off == LOST_FOR:
            yield "lost", _lost(score, step - LOST_FOR + 1, self._ever, say)
            self._found = False
            if not self._since:
                self._since, self._was = step - LOST_FOR + 1, "lost"
        elif not self._found and first_mostly(np.array(self._recent)) == 1:
            yield self._localized(step - LOCALIZED_OF[1] + 1)
            self._found = self._ever = True

    def _localized(self, first: int) -> tuple[str, str]:
        since, self._since = self._since, 0
        if not (since and self._ever):
            return "localized", f"since step {first}"
        took = first - since
        return "recovered", f"since step {first}, {took} step{'s' * (took != 1)} after it was {self._was}"

    def _state(self, score: StepScore) -> str:
        if score.correct is None:
            return CONVERGED if score.converged else SPREAD
        if score.localized:
            return LOCALIZED
        if self._off >= LOST_FOR and (self._ever or score.converged):
            return LOST  # a cloud that never converged is still searching
        return WRONG if score.wrong_and_confident else SEARCHING


def _lost(score: StepScore, first: int, ever: bool, say: Say) -> str:
    if not (ever or score.converged):
        return f"since step {first}: it has not been localized yet"
    off_m, off_rad = score.position_error_m or 0.0, score.heading_error_rad or 0.0
    sure = ", and sure of it" if score.converged else ""
    return f"since step {first}; {say(off_m)}, {np.degrees(off_rad):.0f} deg off{sure}"
