"""How much of each update is drawn: all of it, or only what is cheap where nothing happens."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum

from .panel import StepUpdate

AROUND = 2  # updates before and after an event that are drawn whole

# bytes of a recording, measured by benchmarks/recording.py on two drives; fixed, a particle, a channel
FULL_BYTES = (68_000, 10.6, 6_000)
LIGHT_BYTES = (27_000, 0.0, 0)


class Detail(StrEnum):
    """How much is drawn."""

    FULL = "full"  # every panel at every update
    EVENTS = "events"  # the same around events, elsewhere as light
    LIGHT = "light"  # camera, words, traces, estimate, and a cloud of a few hundred particles


@dataclass(slots=True)
class DetailFilter:
    """Decides which updates are drawn whole. That depends on events to come, so it holds some back."""

    detail: Detail = Detail.FULL
    _held: deque[StepUpdate] = field(default_factory=deque)
    _last_event: int = -AROUND - 1  # number of the update, counted from 0
    _seen: int = 0

    def see(self, update: StepUpdate) -> Iterator[StepUpdate]:
        """Take the next update; yield those that can be drawn now, in order."""
        if self.detail is not Detail.EVENTS:
            yield replace(update, whole=self.detail is Detail.FULL)
            return
        if any(not event.is_routine for event in update.events):
            self._last_event = self._seen
        self._seen += 1
        self._held.append(update)
        if len(self._held) > AROUND:
            yield self._first()

    def rest(self) -> Iterator[StepUpdate]:
        """Yield what was held back."""
        while self._held:
            yield self._first()

    def _first(self) -> StepUpdate:
        number = self._seen - len(self._held)
        near = abs(number - self._last_event) <= AROUND
        return replace(self._held.popleft(), whole=near)


def expected_bytes(detail: Detail, steps: int, particles: int, channels: int) -> int:
    """Estimate the size of the recording of one run; around events, one step in four is taken as whole."""
    whole = {Detail.FULL: 1.0, Detail.EVENTS: 0.25, Detail.LIGHT: 0.0}[detail]
    full, light = (
        fixed + particles * each + channels * channel for fixed, each, channel in (FULL_BYTES, LIGHT_BYTES)
    )
    return round(steps * (whole * full + (1 - whole) * light))
