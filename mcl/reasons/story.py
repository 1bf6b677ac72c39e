"""One episode with the evidence before and during it: what the rules of a diagnosis look at."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ..scoring.episodes import Episode
from .causes import Failure, Value
from .evidence import UpdateEvidence
from .surroundings import UsualFit

NEAR_SHARE = 0.5  # share of the weight near the truth that counts as having it
BEFORE_UPDATES, AFTER_UPDATES = 3, 1  # before the last one that held the truth, and after the first lost one
FIRST_UPDATES = 10  # of an episode, whose pictures are looked at
AWAY_UPDATES, AWAY_SHARE = 4, 0.75  # at another place: at least so many, and this share of them
CLEAR_SHARE = 0.15  # of the spread of log-likelihoods over the library
LEAST_SHARE = 0.5  # over the number of particles: a smaller share near the truth is none
LOOKBACK_UPDATES = 30  # before a loss, that are looked at if the truth was never held


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
        return min(bisect_left(self.updates, step, key=lambda u: u.step), len(self.updates) - 1)

    @property
    def since_last(self) -> range:
        """The updates from the failure before to the end of the episode."""
        return range(self.since, self.end + 1)

    @cached_property
    def last_near(self) -> int | None:
        """The index of the last update before the loss at which the cloud held the truth; None: never."""
        good = [k for k in range(self.since, self.lost) if self.updates[k].share_near >= NEAR_SHARE]
        return good[-1] if good else None

    @cached_property
    def window(self) -> range:
        """The updates at which a cause must show: from shortly before it was lost until it was."""
        if self.last_near is None:
            first = max(self.since, self.lost - LOOKBACK_UPDATES)
        else:
            first = max(self.since, self.last_near - BEFORE_UPDATES)
        return range(first, min(self.lost + AFTER_UPDATES, self.end) + 1)

    @cached_property
    def nearby(self) -> range:
        """The updates whose pictures are judged: the window, and the first of the episode."""
        return range(self.window.start, min(self.lost + LOOKBACK_UPDATES, self.end) + 1)

    @cached_property
    def moves(self) -> range:
        """The updates whose movements are looked at; of a search, until it held the truth last."""
        if self.last_near is not None:
            return self.window
        shares = [self.updates[k].share_near for k in self.since_last]
        most = max(shares, default=0.0)
        if most < NEAR_SHARE / 2:
            return self.window
        last = max(k for k, share in enumerate(shares, self.since) if share >= most / 2)
        return range(self.window.start, min(max(last + BEFORE_UPDATES, self.window.stop), self.end + 1))

    @property
    def nats_lost(self) -> tuple[float, float]:
        """Nats of the weight near the truth that moving away from it took, and that pictures against it took.

        From the last update that held the truth to the first that was off, and one more.
        """
        first = self.window.start if self.last_near is None else self.last_near
        motion, pictures = 0.0, 0.0
        for before, now in pairwise(self.updates[first : self.window.stop]):
            if before.near is None or now.near is None:
                continue
            least = LEAST_SHARE / now.size
            shares = (before.near.shares[2], *now.near.shares[:2])
            near, moved, weighed = (float(np.log(max(share, least))) for share in shares)
            motion, pictures = motion + near - moved, pictures + moved - weighed
        return motion, pictures

    @cached_property
    def fits_truth(self) -> bool:
        """Whether the pictures of the episode fit the true place clearly better than that of the estimate."""
        away = [
            update
            for update in self.updates[self.lost : self.end + 1]
            if update.fit is not None and update.fit.estimate_behind
        ]
        if len(away) < AWAY_UPDATES:
            return False
        behind = np.array([update.fit.estimate_behind for update in away if update.fit])
        spread = float(np.median([update.spread_nats for update in away]))
        return float((behind < 0).mean()) >= AWAY_SHARE and float(np.median(behind)) < -CLEAR_SHARE * spread

    @cached_property
    def pictures(self) -> range:
        """The updates whose pictures may have led it astray: since it held the truth last."""
        first = self.window.start if self.last_near is None else max(self.last_near, self.since)
        return range(first, min(self.lost + FIRST_UPDATES, self.end) + 1)

    def where(self, indexes: range, holds: Callable[[UpdateEvidence], bool]) -> list[UpdateEvidence]:
        """Return the updates of a range for which something holds."""
        return [self.updates[k] for k in indexes if holds(self.updates[k])]

    @cached_property
    def usual_s(self) -> float:
        """The median time between pictures."""
        return _median([update.after_s for update in self.updates if update.after_s is not None])

    @cached_property
    def usual_speed(self) -> float:
        """The median speed of the true path in m/s, from picture to picture."""
        known = [
            update.moved_m / update.after_s
            for update in self.updates
            if update.moved_m is not None and update.after_s and update.after_s < 2 * self.usual_s
        ]
        return _median(known)

    def failure(self, kind: str, first: int, **evidence: Value) -> Failure:
        """Return the failure of a kind, whose cause shows first at a step."""
        return Failure(kind, first, self.episode, evidence)


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else float("nan")
