"""Observing a run: an observer gets every moment and record, and never changes the filter."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import rerun as rr

from maurice_mcl.reasons.failures.kinds import Failure
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values.library import Library
from maurice_mcl.values.radii import USUAL, Radii
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment, SessionInfo

from ..entities import Phase, RunPaths
from ..scene import Detail
from ..style import RGB, RUN_COLORS, scale_for
from .panel import DrawnRun, EntryFinder, Panel, StepUpdate, set_phase
from .registry import panels_of

AROUND = 2  # updates before and after an event that are drawn in full

# bytes of a recording, by benchmarks/speed/recording.py on two drives; fixed, per particle, per channel
FULL_BYTES = (68_000, 10.6, 6_000)
LIGHT_BYTES = (27_000, 0.0, 0)


@dataclass(slots=True)
class DetailFilter:
    """Decides which updates are drawn in full. That depends on events to come, so some are held back."""

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
    """Estimate the size of one run's recording; with the detail "events" a quarter of the steps are full."""
    whole = {Detail.FULL: 1.0, Detail.EVENTS: 0.25, Detail.LIGHT: 0.0}[detail]
    full, light = (
        fixed + particles * each + channels * channel for fixed, each, channel in (FULL_BYTES, LIGHT_BYTES)
    )
    return round(steps * (whole * full + (1 - whole) * light))


class Observer(Protocol):
    """What a run is reported to, update by update."""

    failures: Sequence[Failure]  # why the run failed; set before `end`

    def begin(self, info: SessionInfo, library: Library) -> None:
        """Take what is known before the first picture. Called once."""

    def see(self, moment: Moment, record: StepRecord) -> None:
        """Take one update. Updates come in order, none left out."""

    def end(self) -> None:
        """Finish. Called once, also after a failure."""


@dataclass(slots=True)
class RerunObserver:
    """Draws one run into a recording. Several, with different labels, share a recording.

    `scene` makes this one also draw what the runs share: map, camera, truth. Exactly one should.
    """

    rec: rr.RecordingStream
    label: str
    distances: Mapping[str, str]  # of the run's sensor model, by channel: which histograms there will be
    scene: bool = True
    has_truth: bool = True  # whether keys mention the truth
    detail: Detail = Detail.FULL
    sensor: SensorModel | None = None  # to explain with; None: that panel stays empty
    updates: int = 0  # how many there will be; 0 where that is not known
    radii: Radii = USUAL  # by which the run is judged
    color: RGB = RUN_COLORS[0]  # of its estimate
    failures: Sequence[Failure] = ()  # why the run failed: known only before `end`
    _panels: list[Panel] = field(init=False, default_factory=list)
    _detector: EventDetector | None = field(init=False, default=None)
    _filter: DetailFilter = field(init=False)
    _was_whole: bool | None = field(init=False, default=None)  # of the last update drawn; None: none yet

    def __post_init__(self) -> None:
        RunPaths(self.label)  # a label that cannot be drawn is refused before anything runs
        self._filter = DetailFilter(self.detail)

    def begin(self, info: SessionInfo, library: Library) -> None:
        """Log all that does not change."""
        scale = scale_for(info.display_units, library.arena)
        self._detector = EventDetector(scale.say)
        run = DrawnRun(
            paths=RunPaths(self.label),
            library=library,
            scale=scale,
            distances=self.distances,
            finder=EntryFinder.of(library) if library.size else None,
            sensor=self.sensor,
            has_truth=self.has_truth,
            draws_scene=self.scene,
            updates=self.updates,
            radii=self.radii,
            color=self.color,
        )
        self._panels = panels_of(run)
        for panel in self._panels:
            panel.prepare(self.rec)

    def see(self, moment: Moment, record: StepRecord) -> None:
        """Log one update, phase by phase; with the detail "events" two updates later."""
        if self._detector is None:
            raise RuntimeError("begin() comes before see()")
        events = self._detector.see(moment, record)
        found = self._detector
        update = StepUpdate(moment, record, events, found.state, found.knows, found.modes)
        for ready in self._filter.see(update):
            self._draw(ready)

    def end(self) -> None:
        """Log what was held back. Flushing the recording and reporting failures is up to the caller."""
        for update in self._filter.rest():
            self._draw(update)
        for panel in self._panels:
            panel.diagnosed(self.rec, self.failures)
            panel.finish(self.rec)

    def _draw(self, update: StepUpdate) -> None:
        update = replace(update, is_first=self._was_whole is None)
        if not update.whole and self._was_whole is not False:
            set_phase(self.rec, update.moment, Phase.PREDICT)
            for panel in self._panels:
                panel.clear(self.rec)
        for panel in self._panels:
            panel.draw(self.rec, update)
        self._was_whole = update.whole
