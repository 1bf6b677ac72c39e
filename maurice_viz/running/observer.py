"""Observing runs: an observer gets every moment and record, and never changes the filter."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import rerun as rr

from maurice_mcl.scoring.comparison import Step
from maurice_mcl.scoring.episodes import RunSoFar
from maurice_mcl.scoring.events import EventDetector
from maurice_mcl.values import F64, Moment, StepRecord

from ..entities import Phase
from ..panels.comparison.drawing import ComparisonDrawing
from ..panels.events import LanesDrawing
from ..panels.panel import StepUpdate, set_phase
from ..panels.registry import panels_of
from ..panels.story import VerdictDrawing
from ..playback import ResultCollector, RunResult
from ..scene import Detail, RunView, Scene

UPDATES_AROUND = 2  # updates before and after an event that are drawn in full

# bytes of a recording a step, on drives with a camera and with a laser; fixed, per particle, per channel
FULL_BYTES = (58_500, 6.7, 3_200)
LIGHT_BYTES = (18_500, 0.0, 0)
LIVE_BYTES = (113_000, 38_000)  # more of a live source, full and light: its rows are sent one by one
WHOLE = {Detail.FULL: 1.0, Detail.EVENTS: 0.25, Detail.LIGHT: 0.0}  # share of the steps that is drawn in full
# milliseconds a step: drawn in full, light; the filter with what it reads, and for each particle
FULL_MS, LIGHT_MS, FILTER_MS = 13.0, 3.0, (3.5, 0.0005)


@dataclass(slots=True)
class DetailFilter:
    """Decides which updates are drawn in full. That depends on events to come, so some are held back."""

    detail: Detail = Detail.FULL
    _held: deque[StepUpdate] = field(default_factory=deque)
    _last_event: int = -UPDATES_AROUND - 1  # number of the update, counted from 0
    _seen: int = 0

    def see(self, update: StepUpdate) -> Iterator[StepUpdate]:
        """Take the next update; yield those that can be drawn now, in order."""
        if self.detail is not Detail.EVENTS:
            yield update if self.detail is Detail.FULL else replace(update, whole=False)
            return
        if any(not event.is_routine for event in update.events):
            self._last_event = self._seen
        self._seen += 1
        self._held.append(update)
        if len(self._held) > UPDATES_AROUND:
            yield self._first()

    def rest(self) -> Iterator[StepUpdate]:
        """Yield what was held back."""
        while self._held:
            yield self._first()

    def _first(self) -> StepUpdate:
        number = self._seen - len(self._held)
        near = abs(number - self._last_event) <= UPDATES_AROUND
        return replace(self._held.popleft(), whole=near)


def expected_bytes(detail: Detail, steps: int, particles: int, channels: int, *, live: bool = False) -> int:
    """Estimate the size of one run's recording."""
    full, light = (
        fixed + particles * each + channels * channel + live * more
        for (fixed, each, channel), more in zip((FULL_BYTES, LIGHT_BYTES), LIVE_BYTES, strict=True)
    )
    return round(steps * (light + WHOLE[detail] * (full - light)))


def expected_seconds(detail: Detail, steps: int, particles: int) -> float:
    """Estimate how long one run takes to filter and to draw into a file."""
    fixed, each = FILTER_MS
    return steps * (fixed + each * particles + LIGHT_MS + WHOLE[detail] * (FULL_MS - LIGHT_MS)) / 1e3


class RerunObserver:
    """Draws one run into a Rerun recording by its panels; what does not change is drawn at once."""

    def __init__(
        self, rec: rr.RecordingStream, run: RunView, scene: Scene, detail: Detail = Detail.FULL
    ) -> None:
        self._rec, self._filter = rec, DetailFilter(detail)
        self._detector = EventDetector(scene.scale.say)
        self._was_whole: bool | None = None  # whether the last update was drawn in full; None: none was yet
        self.panels = panels_of(run, scene)
        for panel in self.panels:
            panel.prepare(rec)

    def see(self, moment: Moment, record: StepRecord, run: RunSoFar | None = None) -> StepUpdate:
        """Log one update, phase by phase, and return it; with the detail "events" it is logged two later.

        `run` is what a collector has of it; None: nothing else follows the run.
        """
        detector = self._detector
        events = detector.see(moment, record, run)
        update = StepUpdate(moment, record, events, detector.state, detector.knows, detector.modes)
        for ready in self._filter.see(update):
            self._draw(ready)
        return update

    def end(self) -> None:
        """Log what was held back. Flushing the recording is up to the caller."""
        for update in self._filter.rest():
            self._draw(update)
        for panel in self.panels:
            panel.finish(self._rec)

    def _draw(self, update: StepUpdate) -> None:
        if self._was_whole is None:
            update = replace(update, is_first=True)
        if not update.whole and self._was_whole is not False:
            set_phase(self._rec, update.moment, Phase.PREDICT)
            for panel in self.panels:
                panel.clear(self._rec)
        for panel in self.panels:
            panel.draw(self._rec, update)
        self._was_whole = update.whole


class SceneObserver:
    """Draws all runs of a Rerun recording: each by its own panels, how they compare, and the verdict."""

    def __init__(
        self,
        rec: rr.RecordingStream,
        runs: Sequence[RunView],
        scene: Scene,
        detail: Detail = Detail.FULL,
    ) -> None:
        self._rec, self._scene = rec, scene
        self._runs = {run.label: RerunObserver(rec, run, scene, detail) for run in runs}
        self._comparison: ComparisonDrawing | None = None
        if len(runs) > 1:
            self._comparison = ComparisonDrawing(rec, runs, scene, light=detail is Detail.LIGHT)
        self.most_m = 0.0  # the largest position error so far; without truth the largest spread
        self.most_not_lost_m = 0.0  # the largest of errors that do not count as lost
        self._lanes, self._verdict = LanesDrawing(rec, runs, scene), VerdictDrawing(rec, runs, scene)

    def see(self, steps: Mapping[str, Step], collector: ResultCollector) -> None:
        """Log one update of every run, which the collector has, and for a live drive the verdict."""
        for moment, record in steps.values():
            if moment.truth is not None:
                self._see_length(record.estimate.pose[:2] - moment.truth[:2], record.estimate.radii.lost_m)
            elif not self._scene.has_truth:
                self._see_length(record.mean_estimate.sd_m)
        self._lanes.see([run.see(*steps[label], collector.run(label)) for label, run in self._runs.items()])
        if self._comparison is not None:
            self._comparison.see(steps)
        self._verdict.see(steps, collector.verdicts)
        if self._scene.live:
            self._rec.flush(timeout_sec=0)  # on its way at once, without waiting for viewers

    def _see_length(self, offset_m: F64 | tuple[float, float], lost_m: float = np.inf) -> None:
        length_m = float(np.hypot(*offset_m))
        self.most_m = max(self.most_m, length_m)
        if length_m <= lost_m:
            self.most_not_lost_m = max(self.most_not_lost_m, length_m)

    def ended(self) -> Scene:
        """Return the scene with what is known of errors only in the end."""
        return replace(self._scene, most_m=self.most_m, most_not_lost_m=self.most_not_lost_m)

    def end(self, results: Sequence[RunResult]) -> None:
        """Log what is known only in the end, by the results so far; none: there was no update."""
        verdicts = {result.label: result.verdict for result in results}
        if results:
            if self._comparison is not None:
                self._comparison.end(results)
            self._verdict.end(verdicts)
        self._lanes.end({label: verdict.failures for label, verdict in verdicts.items()})
        for observer in self._runs.values():
            observer.end()
