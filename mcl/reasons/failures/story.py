"""One episode with the evidence before and during it: what the rules of a diagnosis look at."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...scoring.episodes import Episode
from .around import UsualFit
from .evidence import UpdateEvidence
from .kinds import Failure, Value

HELD = 0.5  # share of the weight near the truth that counts as having it
BEFORE, AFTER = 3, 1  # updates before the last one that held the truth, and after the first lost one
FIRST = 10  # updates of an episode whose pictures are looked at
LEAST_AWAY, NEARLY_ALL = 4, 0.75  # updates at another place, and share of them
CLEARLY = 0.15  # of the spread of log-likelihoods over the library
LEAST_WEIGHT = 0.5  # over the number of particles: a smaller share near the truth is none
LOOKS_BACK = 30  # updates before a loss that are looked at if the truth was never held


@dataclass(frozen=True, eq=False)
class Story:
    """The updates of one run and one of its episodes; the other numbers are indexes of updates."""

    updates: Sequence[UpdateEvidence]  # from the run's first
    episode: Episode
    since: int = 0  # of the first update after the failure before
    spacing_m: float = float("nan")  # of the library's places
    usual: UsualFit | None = None  # of the library's own pictures; None: not known

    @cached_property
    def lost(self) -> int:
        """The first update that was off."""
        return self._index(self.episode.onset)

    @cached_property
    def end(self) -> int:
        """The last update of the episode."""
        return self._index(self.episode.last)

    def _index(self, step: int) -> int:
        return min(bisect_left(self.updates, step, key=lambda one: one.step), len(self.updates) - 1)

    @cached_property
    def held(self) -> int | None:
        """The index of the last update before the loss at which the cloud held the truth; None: never."""
        good = [k for k in range(self.since, self.lost) if self.updates[k].held >= HELD]
        return good[-1] if good else None

    @cached_property
    def window(self) -> range:
        """The updates at which a cause must show: from shortly before it was lost until it was."""
        if self.held is None:
            first = max(self.since, self.lost - LOOKS_BACK)
        else:
            first = max(self.since, self.held - BEFORE)
        return range(first, min(self.lost + AFTER, self.end) + 1)

    @cached_property
    def around(self) -> range:
        """The updates whose pictures are judged: the window, and the first of the episode."""
        return range(self.window.start, min(self.lost + LOOKS_BACK, self.end) + 1)

    @cached_property
    def moves(self) -> range:
        """The updates whose movements are looked at; of a search, until it held the truth last."""
        if self.held is not None:
            return self.window
        shares = [self.updates[k].held for k in range(self.since, self.end + 1)]
        most = max(shares, default=0.0)
        if most < HELD / 2:
            return self.window
        last = max(k for k, share in enumerate(shares, self.since) if share >= most / 2)
        return range(self.window.start, min(max(last + BEFORE, self.window.stop), self.end + 1))

    @property
    def lost_by_motion(self) -> float:
        """Nats of the weight near the truth that were lost as particles moved away from it."""
        return self._losses[0]

    @property
    def lost_by_pictures(self) -> float:
        """Nats of the weight near the truth that were lost as pictures spoke against it."""
        return self._losses[1]

    @cached_property
    def _losses(self) -> tuple[float, float]:
        """Add up both from the last update that held the truth to the first that was off, and one more."""
        first = self.window.start if self.held is None else self.held
        motion, pictures = 0.0, 0.0
        for before, now in pairwise(self.updates[first : self.window.stop]):
            if before.near is None or now.near is None:
                continue
            least = LEAST_WEIGHT / now.size
            shares = (before.near.shares[2], *now.near.shares[:2])
            held, moved, weighed = (float(np.log(max(share, least))) for share in shares)
            motion, pictures = motion + held - moved, pictures + moved - weighed
        return motion, pictures

    @cached_property
    def fits_truth(self) -> bool:
        """Whether the pictures of the episode fit the true place clearly better than that of the estimate."""
        away = [
            one
            for one in self.updates[self.lost : self.end + 1]
            if one.fit is not None and one.fit.estimate_behind
        ]
        if len(away) < LEAST_AWAY:
            return False
        behind = np.array([one.fit.estimate_behind for one in away if one.fit])
        spread = float(np.median([one.spread_nats for one in away]))
        return float((behind < 0).mean()) >= NEARLY_ALL and float(np.median(behind)) < -CLEARLY * spread

    @cached_property
    def pictures(self) -> range:
        """The updates whose pictures may have led it astray: since it held the truth last."""
        first = self.window.start if self.held is None else max(self.held, self.since)
        return range(first, min(self.lost + FIRST, self.end) + 1)

    def some(self, where: range, holds: Callable[[UpdateEvidence], bool]) -> list[UpdateEvidence]:
        """Return the updates of a range for which something holds."""
        return [self.updates[k] for k in where if holds(self.updates[k])]

    @cached_property
    def usual_s(self) -> float:
        """The median time between pictures."""
        return _median([one.after_s for one in self.updates if one.after_s is not None])

    @cached_property
    def usual_speed(self) -> float:
        """The median speed of the true path in m/s, from picture to picture."""
        known = [
            one.moved_m / one.after_s
            for one in self.updates
            if one.moved_m is not None and one.after_s and one.after_s < 2 * self.usual_s
        ]
        return float(np.median(known)) if known else float("nan")

    def failure(self, kind: str, first: int, **evidence: Value) -> Failure:
        """Return the failure of a kind, whose cause shows first at a step."""
        return Failure(kind, first, self.episode, evidence)


def _median(values: Sequence[float | None]) -> float:
    known = [one for one in values if one is not None]
    return float(np.median(known)) if known else float("nan")
