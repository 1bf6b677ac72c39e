"""Clocks of a running robot: times that never decrease, although a source restarts or is set back."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

from ..errors import FieldError
from ..files.text import MOST_T_S, time_falls, up_to

APART_S = 2.0  # between two starts: truth is not interpolated over more than 1 s
SET_BACK = 20  # consecutive records with decreasing times mean that the clock was set back


class LiveClock:
    """Shifts the times of a restarted source behind those before."""

    def __init__(self) -> None:
        self.shift_s = 0.0  # added to the source's times
        self.last_s = -math.inf  # the last time returned
        self.set_back_s = 0.0  # by how much the last call found the clock set back
        self._anew = True
        self._falls = 0

    def restart(self) -> None:
        """Note that the next time may come from another clock."""
        self._anew = True

    def time(self, t_s: float) -> float:
        """Return the session's time for the source's. FieldError for one that decreases, or is too large.

        A clock that was restarted, or decreases for 20 records, is shifted to 2 s behind the last time.
        """
        self.set_back_s = 0.0
        if t_s + self.shift_s < self.last_s:
            self._falls += 1
            if not self._anew and self._falls < SET_BACK:
                raise FieldError(time_falls(t_s, self.last_s - self.shift_s))
            self.set_back_s = self.last_s - self.shift_s - t_s
            self.shift_s = self.last_s + APART_S - t_s
        if abs(t_s + self.shift_s) > MOST_T_S:
            raise FieldError(f"found t {t_s:.15g}, expected {up_to(MOST_T_S)}")
        self._anew, self._falls = False, 0
        self.last_s = t_s + self.shift_s
        return self.last_s


BEHIND_S = 0.25  # further behind the latest of its kind no message comes in a stream that is in order
IN_A_ROW = 3  # messages of a kind so far behind mean that the robot's clock was set back
OLD_S = 1.0  # by our own clock: so long after that, messages from before may still come


@dataclass(frozen=True, slots=True)
class _Message:
    kind: str
    t_s: float
    content: Any


@dataclass(slots=True)
class MessageClock:
    """Finds by the messages of several kinds that the clock of their stamps was set back.

    Messages of one kind come in order; of two kinds, one may lag behind the other.
    """

    was_set_back: bool = False  # by the last message taken
    _latest_s: dict[str, float] = field(default_factory=dict)  # by kind
    _behind: list[_Message] = field(default_factory=list)  # held back until it is known why
    _before_s: float = -math.inf  # the latest time before the clock was set back
    _since_s: float = -math.inf  # when that was noticed, by our own clock

    def take(self, kind: str, t_s: float, content: Any) -> list[tuple[str, float, Any]]:
        """Take a message; return those that can be processed now, with their kinds and times."""
        self.was_set_back, message = False, _Message(kind, t_s, content)
        if self._is_old(kind, t_s):
            return []
        if t_s >= self._latest_s.get(kind, -math.inf) - BEHIND_S:
            late = [waiting for waiting in self._behind if waiting.kind == kind]
            self._behind = [waiting for waiting in self._behind if waiting.kind != kind]
            self._latest_s[kind] = max(t_s, self._latest_s.get(kind, -math.inf))
            return _listed([*late, message])
        self._behind.append(message)
        if sum(waiting.kind == kind for waiting in self._behind) < IN_A_ROW:
            return []
        anew, self._behind, self.was_set_back = self._behind, [], True
        self._before_s, self._since_s = max(self._latest_s.values()), time.monotonic()
        self._latest_s = {}
        for waiting in anew:
            self._latest_s[waiting.kind] = max(waiting.t_s, self._latest_s.get(waiting.kind, -math.inf))
        return _listed(anew)

    def _is_old(self, kind: str, t_s: float) -> bool:
        """Return whether a message was sent before the clock was set back, and comes only now."""
        if kind in self._latest_s or time.monotonic() > self._since_s + OLD_S:
            return False
        return abs(t_s - self._before_s) < abs(t_s - max(self._latest_s.values()))


def _listed(messages: list[_Message]) -> list[tuple[str, float, Any]]:
    return [(message.kind, message.t_s, message.content) for message in messages]
