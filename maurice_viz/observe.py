"""Watching a run: an observer sees every moment and record, and owns nothing of the filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import rerun as rr

from maurice_mcl.library import Library
from maurice_mcl.localizer import EXPANDED
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment, SessionInfo

from . import (
    draw_belief,
    draw_circles,
    draw_histograms,
    draw_pictures,
    draw_traces,
    draw_world,
    entities,
    narrate,
)
from .canvas import long_side
from .contact_sheet import ContactSheet, best_matches
from .entities import RunPaths, Slot
from .look import Scale, scale_for

MARKDOWN = "text/markdown"


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


def set_phase(rec: rr.RecordingStream, moment: Moment, slot: Slot) -> None:
    """Set all three timelines to one phase of one update."""
    rec.set_time(entities.STEP, sequence=moment.frame.step)
    rec.set_time(entities.SESSION, duration=moment.frame.time_s)
    rec.set_time(entities.PHASE, sequence=entities.phase_number(moment.frame.step, slot))


def set_phase_only(rec: rr.RecordingStream, moment: Moment, slot: Slot) -> None:
    """Set the phase timeline alone: what is logged now hides nothing on the others."""
    set_phase(rec, moment, slot)
    rec.disable_timeline(entities.STEP)
    rec.disable_timeline(entities.SESSION)


@dataclass(frozen=True, slots=True, eq=False)
class _Tools:
    """What is made once when a run begins."""

    library: Library
    scale: Scale
    arrow: float  # length of heading arrows, in display units
    circles: draw_circles.Circles
    sheet: ContactSheet
    estimate: draw_belief.PoseMarker
    truth: draw_belief.PoseMarker
    seen: list[int] = field(default_factory=list)  # the first step, once it has been seen


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
    _paths: RunPaths = field(init=False)
    _tools: _Tools | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._paths = RunPaths(self.label)

    def begin(self, info: SessionInfo, library: Library) -> None:
        """Log all that does not change."""
        scale = scale_for(info.display_units, library.arena)
        self._tools = tools = _Tools(
            library,
            scale,
            draw_belief.ARROW * long_side(library.arena, scale),
            draw_circles.circles_for(library, scale),
            ContactSheet(library, scale),
            draw_belief.estimate_marker(self._paths.estimate),
            draw_belief.truth_marker(entities.TRUTH),
        )
        if self.scene:
            draw_world.draw_world(self.rec, library, scale)
            draw_world.draw_keys(self.rec, library, scale, self.has_truth)
            tools.truth.prepare(self.rec)
            for path in (entities.CAMERA, entities.EDGES):
                draw_pictures.prepare_jpeg(self.rec, path)
        draw_pictures.prepare_jpeg(self.rec, self._paths.contact_sheet)
        self.rec.log(self._paths.text, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        draw_belief.prepare_cloud(self.rec, self._paths.particles)
        tools.estimate.prepare(self.rec)
        tools.circles.prepare(self.rec, self._paths)
        draw_histograms.prepare_histograms(self.rec, self._paths, self.distances, library)
        draw_traces.prepare_traces(self.rec, self._paths)

    def see(self, moment: Moment, record: StepRecord) -> None:
        """Log one update, phase by phase."""
        tools = self._tools
        if tools is None:
            raise RuntimeError("begin() comes before see()")
        self._predict(moment, record, tools)
        self._measure(moment, record, tools)
        self._weight(moment, record, tools)
        self._resample(moment, record, tools)
        self._estimate(moment, record, tools)

    def end(self) -> None:
        """Nothing is kept back here: whoever opened the recording writes it out and says if that fails."""

    def _predict(self, moment: Moment, record: StepRecord, tools: _Tools) -> None:
        set_phase(self.rec, moment, Slot.PREDICT)
        draw_belief.draw_predicted(self.rec, self._paths.particles, record.predicted, tools.scale)
        if self.scene and moment.truth is not None:
            tools.truth.draw(self.rec, moment.truth, tools.scale, tools.arrow)
        self._say(narrate.phase(moment, record, Slot.PREDICT, tools.scale))
        if not tools.seen:
            self._measure_nothing_yet(moment, tools)

    def _measure_nothing_yet(self, moment: Moment, tools: _Tools) -> None:
        """Fill the panels of the very first phase, in which no picture has been taken."""
        tools.seen.append(moment.frame.step)
        set_phase_only(self.rec, moment, Slot.PREDICT)
        if self.scene:
            draw_pictures.draw_no_camera(self.rec, moment.frame.image.shape)
        draw_pictures.draw_sheet(self.rec, self._paths.contact_sheet, tools.sheet.draw(()))

    def _measure(self, moment: Moment, record: StepRecord, tools: _Tools) -> None:
        set_phase(self.rec, moment, Slot.MEASURE)
        if self.scene:
            draw_pictures.draw_camera(self.rec, moment.frame.image)
        seen = record.sighting.comparison
        if len(seen.quality):  # a saved run may be shown without its library
            tools.circles.draw(self.rec, self._paths, seen)
            draw_histograms.draw_histograms(self.rec, self._paths, seen, tools.library, self.distances)
        sheet = tools.sheet.draw(best_matches(seen))
        draw_pictures.draw_sheet(self.rec, self._paths.contact_sheet, sheet)
        self._say(narrate.phase(moment, record, Slot.MEASURE, tools.scale))

    def _weight(self, moment: Moment, record: StepRecord, tools: _Tools) -> None:
        set_phase(self.rec, moment, Slot.WEIGHT)
        draw_belief.draw_weighted(self.rec, self._paths.particles, record.weighted)
        self._say(narrate.phase(moment, record, Slot.WEIGHT, tools.scale))

    def _resample(self, moment: Moment, record: StepRecord, tools: _Tools) -> None:
        set_phase_only(self.rec, moment, Slot.RESAMPLE)
        if record.parents is not None:
            draw_belief.draw_resampled(self.rec, self._paths.particles, record, tools.scale)
        self._say(narrate.phase(moment, record, Slot.RESAMPLE, tools.scale))
        if record.injected is not None or EXPANDED in record.events:
            set_phase_only(self.rec, moment, Slot.RESEED)
            draw_belief.draw_reseeded(self.rec, self._paths.particles, record, tools.scale)
            self._say(narrate.phase(moment, record, Slot.RESEED, tools.scale))

    def _estimate(self, moment: Moment, record: StepRecord, tools: _Tools) -> None:
        set_phase(self.rec, moment, Slot.ESTIMATE)
        tools.estimate.draw(self.rec, record.estimate.pose, tools.scale, tools.arrow)
        draw_traces.draw_traces(self.rec, self._paths, record, moment.truth, tools.scale)
        self._say(narrate.summary(moment, record, tools.scale))

    def _say(self, text: str) -> None:
        self.rec.log(self._paths.text, rr.TextDocument.from_fields(text=text))
