"""Observing a run: an observer sees every moment and record, and owns nothing of the filter."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Protocol

import rerun as rr

from maurice_mcl.analysis.events import EventDetector, RunEvent
from maurice_mcl.analysis.modes import TrackedMode
from maurice_mcl.filter.localizer import EXPANDED
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.session import Moment, SessionInfo

from .. import entities
from ..drawing.canvas import long_side
from ..entities import Phase, RunPaths
from ..style import Scale, font_safe, scale_for
from ..text import narration as narrate
from . import belief as draw_belief
from . import headings as draw_rose
from . import pictures as draw_pictures
from . import traces as draw_traces
from . import world as draw_world
from .closeup import Closeup, closeup_of
from .events import EventLane, hold_for
from .explanation import ExplainPanel
from .lineage import Lineage
from .matching import Matching, matching_of
from .modes import River

# How much of each update is drawn: all of it, or only what is cheap where nothing happened.

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
class StepUpdate:
    """One update of a run, with what is known of it but for what comes next."""

    moment: Moment
    record: StepRecord
    events: tuple[RunEvent, ...] = ()
    modes: tuple[TrackedMode, ...] = ()  # heaviest first
    whole: bool = True  # is to be drawn whole


@dataclass(slots=True)
class Thinning:
    """Decides which updates are drawn whole. Around events it needs to know what comes next, so it waits."""

    detail: Detail = Detail.FULL
    _held: deque[StepUpdate] = field(default_factory=deque)
    _last_event: int = -AROUND - 1  # number of the update, counted from 0
    _seen: int = 0

    def see(self, update: StepUpdate) -> Iterator[StepUpdate]:
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

    def rest(self) -> Iterator[StepUpdate]:
        """Give what was waited with."""
        while self._held:
            yield self._first()

    def _first(self) -> StepUpdate:
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


# Watching a run: an observer sees every moment and record, and owns nothing of the filter.

MARKDOWN = "text/markdown"
USUAL_UPDATES = 120  # where nobody knows how many there will be
LEFT_OUT = " · little of it was drawn, see `--detail`"


class Observer(Protocol):
    """Somebody who watches."""

    def begin(self, info: SessionInfo, library: Library) -> None:
        """Hear what is known before the first picture. Called once."""
        ...

    def see(self, moment: Moment, record: StepRecord) -> None:
        """See one update, whole, in order."""
        ...

    def end(self) -> None:
        """Hear that no more will come. Called once, also after a failure."""
        ...


def set_phase(rec: rr.RecordingStream, moment: Moment, slot: Phase) -> None:
    """Set all three timelines to one phase of one update."""
    rec.set_time(entities.STEP, sequence=moment.frame.step)
    rec.set_time(entities.SESSION, duration=moment.frame.time_s)
    rec.set_time(entities.PHASE, sequence=entities.phase_number(moment.frame.step, slot))


def set_phase_only(rec: rr.RecordingStream, moment: Moment, slot: Phase) -> None:
    """Set the phase timeline alone: what is logged now hides nothing on the others."""
    set_phase(rec, moment, slot)
    rec.disable_timeline(entities.STEP)
    rec.disable_timeline(entities.SESSION)


@dataclass(frozen=True, slots=True, eq=False)
class _Tools:
    """What is made once when a run begins."""

    scale: Scale
    arrow: float  # length of heading arrows, in display units
    matching: Matching
    lineage: Lineage
    river: River
    detector: EventDetector
    lane: EventLane
    explain: ExplainPanel
    closeup: Closeup
    traces: draw_traces.Traces
    estimate: draw_belief.PoseMarker
    truth: draw_belief.PoseMarker


@dataclass(slots=True)
class RerunObserver:
    """Draws one run into a recording. Several, with different labels, share a recording.

    `scene` says whether this one also draws what the runs share: map, camera, truth. Exactly one should.
    """

    rec: rr.RecordingStream
    label: str
    distances: Mapping[str, str]  # of the run's sensor model, by channel: which histograms there will be
    scene: bool = True
    has_truth: bool = True  # whether the key mentions the truth
    detail: Detail = Detail.FULL
    sensor: SensorModel | None = None  # to explain with; None: that panel stays empty
    updates: int = 0  # how many there will be; 0 when that is not known
    bookmarks: Mapping[int, Sequence[str]] = field(default_factory=dict)  # notes of one's own, by step
    _paths: RunPaths = field(init=False)
    _tools: _Tools | None = field(init=False, default=None)
    _thinning: Thinning = field(init=False)
    _last_whole: bool | None = field(init=False, default=None)  # of the update drawn last; None: none yet

    def __post_init__(self) -> None:
        self._paths = RunPaths(self.label)
        self._thinning = Thinning(self.detail)

    def begin(self, info: SessionInfo, library: Library) -> None:
        """Log all that does not change."""
        scale = scale_for(info.display_units, library.arena)
        self._tools = tools = _Tools(
            scale=scale,
            arrow=draw_belief.ARROW * long_side(library.arena, scale),
            matching=matching_of(self._paths, library, self.distances, scale, self.has_truth),
            lineage=Lineage(self._paths),
            river=River(self._paths.river),
            detector=EventDetector(scale.say, bookmarks=self.bookmarks),
            explain=ExplainPanel(self._paths, self.sensor, scale, self.has_truth),
            closeup=closeup_of(self._paths, library.arena, scale),
            traces=draw_traces.Traces(self._paths),
            lane=EventLane(self._paths, self.scene, hold_for(self.updates or USUAL_UPDATES)),
            estimate=draw_belief.estimate_marker(self._paths.estimate),
            truth=draw_belief.truth_marker(entities.TRUTH),
        )
        if self.scene:
            draw_world.draw_world(self.rec, library, scale)
            draw_world.draw_keys(self.rec, library, scale, self.has_truth)
            tools.truth.prepare(self.rec)
            for path in (entities.CAMERA, entities.EDGES):
                draw_pictures.prepare_jpeg(self.rec, path)
        self.rec.log(self._paths.text, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        draw_belief.prepare_cloud(self.rec, self._paths.particles)
        draw_traces.prepare_traces(self.rec, self._paths, tuple(self.distances))
        draw_rose.prepare_rose(self.rec, self._paths, self.has_truth)
        tools.closeup.prepare(self.rec, self.has_truth)
        for part in (tools.estimate, tools.matching, tools.lineage, tools.river, tools.lane, tools.explain):
            part.prepare(self.rec)

    def see(self, moment: Moment, record: StepRecord) -> None:
        """Log one update, phase by phase; with the detail "events" two updates later."""
        if self._tools is None:
            raise RuntimeError("begin() comes before see()")
        detector = self._tools.detector
        events = detector.see(moment, record)
        set_phase(self.rec, moment, Phase.ESTIMATE)
        self._tools.lane.draw(self.rec, moment.frame.step, detector.state, events)
        for update in self._thinning.see(StepUpdate(moment, record, events, detector.modes)):
            self._draw(update, self._tools)

    def end(self) -> None:
        """Log what was waited with. Whoever opened the recording writes it out and says if that fails."""
        if self._tools is not None:
            for update in self._thinning.rest():
                self._draw(update, self._tools)
            self._tools.traces.draw_tops(self.rec)

    def _draw(self, update: StepUpdate, tools: _Tools) -> None:
        if not update.whole and self._last_whole is not False:
            self._leave_empty(update.moment, tools)
        self._predict(update, tools)
        self._measure(update, tools)
        self._weight(update, tools)
        tools.lineage.remember(update.record)
        if update.whole:
            self._resample(update, tools)
        self._estimate(update, tools)
        self._last_whole = update.whole

    def _predict(self, update: StepUpdate, tools: _Tools) -> None:
        moment, record = update.moment, update.record
        set_phase(self.rec, moment, Phase.PREDICT)
        cloud = record.predicted if update.whole else draw_belief.thinned(record.weighted)
        draw_belief.draw_predicted(self.rec, self._paths.particles, cloud, tools.scale)
        tools.closeup.draw(self.rec, record.mean_estimate)
        if self.scene and moment.truth is not None:
            tools.truth.draw(self.rec, moment.truth, tools.scale, tools.arrow)
        if not update.whole:
            return
        self._say(narrate.phase(moment, record, Phase.PREDICT, tools.scale))
        set_phase_only(self.rec, moment, Phase.PREDICT)
        tools.lineage.draw_moves(self.rec, record.predicted, tools.scale)
        if self._last_whole is None:
            self._measure_nothing_yet(moment, tools)

    def _measure_nothing_yet(self, moment: Moment, tools: _Tools) -> None:
        """Fill the panels of the very first phase, in which no picture has been taken."""
        if self.scene:
            draw_pictures.draw_no_camera(self.rec, moment.frame.image.shape)
        tools.matching.draw_nothing(self.rec)

    def _measure(self, update: StepUpdate, tools: _Tools) -> None:
        moment, record = update.moment, update.record
        set_phase(self.rec, moment, Phase.MEASURE)
        if self.scene:
            draw_pictures.draw_camera(self.rec, moment.frame.image)
        if not update.whole:
            return
        tools.matching.draw(self.rec, record.sighting.comparison)
        self._say(narrate.phase(moment, record, Phase.MEASURE, tools.scale))
        set_phase_only(self.rec, moment, Phase.MEASURE)
        tools.lineage.clear_moves(self.rec)

    def _weight(self, update: StepUpdate, tools: _Tools) -> None:
        moment, record = update.moment, update.record
        set_phase(self.rec, moment, Phase.WEIGHT)
        if update.whole:
            draw_belief.draw_weighted(self.rec, self._paths.particles, record.weighted)
            self._say(narrate.phase(moment, record, Phase.WEIGHT, tools.scale))

    def _resample(self, update: StepUpdate, tools: _Tools) -> None:
        moment, record = update.moment, update.record
        set_phase_only(self.rec, moment, Phase.RESAMPLE)
        if record.parents is not None:
            draw_belief.draw_resampled(self.rec, self._paths.particles, record)
            tools.lineage.draw_families(self.rec, record, tools.scale)
        self._say(narrate.phase(moment, record, Phase.RESAMPLE, tools.scale))
        if record.injected is not None or EXPANDED in record.events:
            set_phase_only(self.rec, moment, Phase.RESEED)
            tools.lineage.clear_families(self.rec)
            draw_belief.draw_reseeded(self.rec, self._paths.particles, record, tools.scale)
            self._say(narrate.phase(moment, record, Phase.RESEED, tools.scale))

    def _estimate(self, update: StepUpdate, tools: _Tools) -> None:
        moment, record = update.moment, update.record
        set_phase(self.rec, moment, Phase.ESTIMATE)
        tools.estimate.draw(self.rec, record.estimate.pose, tools.scale, tools.arrow)
        draw_rose.draw_rose(self.rec, self._paths, record.weighted, record.estimate.pose, moment.truth)
        draw_traces.draw_traces(self.rec, tools.traces, record, moment.truth, tools.scale)
        draw_traces.draw_inside(self.rec, self._paths, record, tools.lineage.ancestry.distinct())
        tools.river.draw(self.rec, update.modes)
        tools.matching.draw_where(self.rec, moment, record, whole=update.whole)
        if update.whole:
            tools.explain.draw(self.rec, moment, record)
        title, rest = narrate.summary(moment, record, tools.scale).split("\n\n", 1)
        self._say(f"{title}{'' if update.whole else LEFT_OUT}\n\n{rest}")

    def _leave_empty(self, moment: Moment, tools: _Tools) -> None:
        """Empty the panels that are not drawn from here on, or they would show an earlier update."""
        set_phase(self.rec, moment, Phase.PREDICT)
        tools.matching.draw_left_out(self.rec)
        tools.explain.draw_left_out(self.rec)
        for path in (self._paths.moves, self._paths.families):
            self.rec.log(path, rr.Clear(recursive=True))

    def _say(self, text: str) -> None:
        self.rec.log(self._paths.text, rr.TextDocument.from_fields(text=font_safe(text)))
