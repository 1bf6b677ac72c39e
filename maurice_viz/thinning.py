"""How much of each update is drawn: all of it, or only what is cheap where nothing happened."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum

from maurice_mcl.events import Event
from maurice_mcl.mode_tracks import TrackedMode
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

AROUND = 2  # updates before and after an event that are drawn whole

# bytes of a recording, measured by benchmarks/recording.py on two drives; fixed, a particle, a channel
FULL_BYTES = (68_000, 10.6, 6_000)
LIGHT_BYTES = (27_000, 0.0, 0)


class Detail(StrEnum):
    """How much is drawn."""

    FULL = "full"  # every panel at every update
    EVENTS = "events"  # the same around events, elsewhere as light
    LIGHT = "light"  # camera, words, traces, estimate, and a cloud of a few hundred particles


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """One update of a run, with what is known of it but for what comes next."""

    moment: Moment
    record: StepRecord
    events: tuple[Event, ...] = ()
    modes: tuple[TrackedMode, ...] = ()  # heaviest first
    whole: bool = True  # is to be drawn whole


@dataclass(slots=True)
class Thinning:
    """Decides which updates are drawn whole. Around events it needs to know what comes next, so it waits."""

    detail: Detail = Detail.FULL
    _held: deque[Update] = field(default_factory=deque)
    _last_event: int = -AROUND - 1  # number of the update, counted from 0
    _seen: int = 0

    def see(self, update: Update) -> Iterator[Update]:
        """Take in the next update; give those that can be drawn now, in order."""
        if self.detail is not Detail.EVENTS:
            yield replace(update, whole=self.detail is Detail.FULL)
            return
        if any(not event.is_routine for event in update.events):
            self._last_event = self._seen
        self._seen += 1
        self._held.append(update)
        if len(self._held) > AROUND:
            yield self._first()

    def rest(self) -> Iterator[Update]:
        """Give what was waited with."""
        while self._held:
            yield self._first()

    def _first(self) -> Update:
        number = self._seen - len(self._held)
        near = abs(number - self._last_event) <= AROUND
        return replace(self._held.popleft(), whole=near)


def expected_bytes(detail: Detail, steps: int, particles: int, channels: int) -> int:
    """Say about how large the recording of one run will be; one step in four is near an event, say."""
    whole = {Detail.FULL: 1.0, Detail.EVENTS: 0.25, Detail.LIGHT: 0.0}[detail]
    full, light = (
        fixed + particles * each + channels * channel for fixed, each, channel in (FULL_BYTES, LIGHT_BYTES)
    )
    return round(steps * (whole * full + (1 - whole) * light))
