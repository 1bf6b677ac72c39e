"""Pictures that wait for the filter, few enough: what cannot be kept up with is left out and counted."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from threading import Condition
from threading import Event as Flag

from maurice_mcl.typing import F64

from .log_records import PictureRecord
from .recording import moved

ROOM = 4  # pictures that wait; the view is at most so many updates behind
MOST_MOTIONS = 1000  # kept apart for one picture; more are joined, two by two
MOST_EVENTS = 1000  # kept for one picture; more are dropped


@dataclass(slots=True, eq=False)
class Waiting:
    """A picture, and what belongs to it."""

    picture: PictureRecord
    truth: F64 | None
    motions: list[F64] = field(default_factory=list)  # (3,) each, since the picture before
    events: list[str] = field(default_factory=list)

    def follow(self, earlier: Waiting) -> None:
        """Take over what moved and happened before a picture that was left out."""
        self.motions = joined([*earlier.motions, *self.motions])
        self.events = [*earlier.events, *self.events][:MOST_EVENTS]


class Backlog:
    """Hands pictures from the one who listens to the one who filters.

    With `keep_up` the oldest that waits is left out when there is no room; its motions and events go to the
    next one. Otherwise whoever puts waits, which a file or a pipe does not mind.
    """

    def __init__(self, *, keep_up: bool, room: int = ROOM) -> None:
        self.skipped = 0
        self._keep_up, self._room = keep_up, room
        self._waiting: deque[Waiting] = deque()
        self._changed = Condition()
        self._over = False

    def put(self, one: Waiting, stop: Flag) -> None:
        """Add a picture, unless told to stop while waiting for room."""
        with self._changed:
            while len(self._waiting) >= self._room and not self._keep_up and not stop.is_set():
                self._changed.wait(LOOK_S)
            self._waiting.append(one)
            if len(self._waiting) > self._room:
                left_out = self._waiting.popleft()
                self._waiting[0].follow(left_out)
                self.skipped += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Say that no more will come; what waits is still given."""
        with self._changed:
            self._over = True
            self._changed.notify_all()

    def __iter__(self) -> Iterator[Waiting]:
        while True:
            with self._changed:
                while not self._waiting and not self._over:
                    self._changed.wait(LOOK_S)
                if not self._waiting:
                    return
                one = self._waiting.popleft()
                self._changed.notify_all()
            yield one


def joined(motions: list[F64]) -> list[F64]:
    """Join neighbors of too many motions: where they lead stays the same."""
    while len(motions) > MOST_MOTIONS:
        pairs = zip(motions[::2], motions[1::2], strict=False)
        odd = motions[-1:] if len(motions) % 2 else []
        motions = [moved(first, second) for first, second in pairs] + odd
    return motions
