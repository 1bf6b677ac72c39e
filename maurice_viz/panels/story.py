"""The story of a recording: the verdict in one line, the errors with their limits, the best match."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.tour import tour_of
from maurice_mcl.reasons.verdict import RunVerdict, decisive_step
from maurice_mcl.scoring.events import KIDNAPPED
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.session import Moment

from ..drawing.arrow import points_of, row_of, strips_of, texts_of
from ..drawing.canvas import long_side
from ..entities import LIMITS, PHASE, SESSION, STEP, TOUR, VERDICT, Phase, phase_number
from ..scene import RunView, Scene
from ..style import BAR, DEAD, font_safe
from ..text.score_json import failure_json
from ..text.tour import tour_pages, words
from ..text.verdict import NOTHING_YET, verdict_line
from .panel import MARKDOWN, Panel, StepUpdate, set_phase, set_phase_only
from .traces import LINE, POSITION_ERROR, SPREAD, TWO_SIGMA
from .views import Overrides, plot

EVERY = 10  # updates between two points of the limits, which are straight lines
LABELS_BESIDE = (
    0.0,
    0.05,
    -0.05,
    0.1,
)  # of the arena's long side: a run's error is so far below its line
FAINT = 0.8  # width of lines that are beside the point


class LimitsPanel(Panel):
    """Draws the errors that runs are judged by: right below one, lost above the other."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        limits_m = (run.radii.right_m, run.radii.lost_m)
        self._values = [scene.scale.length(limit_m) for limit_m in limits_m]
        self._names = [scene.scale.say(limit_m) for limit_m in limits_m]
        self._has_truth, self._seen = scene.has_truth, 0
        self._last: Moment | None = None

    def prepare(self, rec: rr.RecordingStream) -> None:
        names = [f"right below {self._names[0]}", f"lost above {self._names[1]}"]
        rec.log(LIMITS, rr.SeriesLines(colors=[BAR, DEAD], widths=[FAINT] * 2, names=names), static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        self._last = update.moment
        if self._seen % EVERY == 0:
            self._log(rec)
        self._seen += 1

    def finish(self, rec: rr.RecordingStream) -> None:
        self._log(rec)

    def _log(self, rec: rr.RecordingStream) -> None:
        if self._last is not None and self._has_truth:
            set_phase(rec, self._last, Phase.ESTIMATE)
            rec.log(LIMITS, rr.Scalars(self._values))


class ErrorLinePanel(Panel):
    """Draws how far the estimate is from the truth, with the length, where it is far off.

    Not in the update of a kidnapping: there the arrow along which the robot was carried says it.
    """

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        below = LABELS_BESIDE[run.number % len(LABELS_BESIDE)]  # or those of nearby lines would overlap
        self._beside = np.array([0.0, below * long_side(scene.arena, scene.scale)], np.float32)
        self._is_shown = False

    def prepare(self, rec: rr.RecordingStream) -> None:
        radius = rr.components.Radius.ui_points
        line = rr.LineStrips2D.from_fields(colors=[self._run.color], radii=radius(1.0), draw_order=44.0)
        label = rr.Points2D.from_fields(
            colors=[self._run.color], radii=radius(0.1), draw_order=44.0, show_labels=True
        )
        rec.log(self._paths.error_line, line, label, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        truth, estimate = update.moment.truth, update.record.estimate
        if self._is_shown:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            self._log(rec, [], "")
        if truth is None or any(event.kind == KIDNAPPED for event in update.events):
            off_m = 0.0
        else:
            off_m = float(np.hypot(*(estimate.pose[:2] - truth[:2])))
        is_off = off_m > estimate.radii.confidence_m
        if is_off or self._is_shown:
            set_phase(rec, update.moment, Phase.WEIGHT)
            ends = [] if truth is None or not is_off else [estimate.pose[:2], truth[:2]]
            self._log(rec, ends, f"{self._scale.say(off_m)} off")
        self._is_shown = is_off

    def _log(self, rec: rr.RecordingStream, ends: Sequence[F64], label: str) -> None:
        """Log a line from the first end to the second one; without ends none."""
        line = self._scale.screen(np.array(ends).reshape(-1, 2))
        at = (line[:1] + line[1:]) / 2 + self._beside
        rec.log(
            self._paths.error_line,
            row_of(rr.LineStrips2D, strips=strips_of([line] if len(line) else [])),
            row_of(rr.Points2D, positions=points_of(at), labels=texts_of([label] if len(line) else [])),
        )


class VerdictDrawing:
    """Draws the verdict on all runs of a recording. It is known at the end; of a live drive, so far."""

    def __init__(self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene) -> None:
        self._rec, self._scale, self._live = rec, scene.scale, scene.live
        self._words = words(runs)
        self._times_s: dict[int, float] = {}  # of each step
        rec.log(TOUR, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        self._log(NOTHING_YET)

    def see(self, moment: Moment, verdicts: Callable[[], Mapping[str, RunVerdict]]) -> None:
        """Take the next update; log the verdict of a live drive now and then: deciding it costs much."""
        self._times_s[moment.frame.step] = moment.frame.time_s
        if self._live and len(self._times_s) % EVERY == 0:
            self.end(verdicts())

    def end(self, verdicts: Mapping[str, RunVerdict]) -> None:
        """Log the verdict, and the step to look at."""
        step = decisive_step(verdicts)
        self._log(f"{verdict_line(verdicts, self._scale)} Look at **step {step}**.")
        failures = {
            label: [failure_json(failure, self._scale) for failure in verdict.failures]
            for label, verdict in verdicts.items()
        }
        self._rec.log(VERDICT, rr.AnyValues(decisive_step=step, failures=json.dumps(failures)), static=True)
        if not self._live:
            self._log_tour(verdicts)

    def _log_tour(self, verdicts: Mapping[str, RunVerdict]) -> None:
        """Log where to look at each moment of the tour, from its step on."""
        for step, page in tour_pages(tour_of(verdicts), verdicts, self._scale, self._words):
            self._rec.set_time(STEP, sequence=step)
            self._rec.set_time(SESSION, duration=self._times_s.get(step, 0.0))
            self._rec.set_time(PHASE, sequence=phase_number(step, Phase.PREDICT))
            self._rec.log(TOUR, rr.TextDocument.from_fields(text=font_safe(page)))

    def _log(self, text: str) -> None:
        document = rr.TextDocument(f"#### {font_safe(text)}", media_type=MARKDOWN)
        self._rec.log(VERDICT, document, static=True)


def verdict_view() -> rrb.TextDocumentView:
    """Show the verdict."""
    return rrb.TextDocumentView(name="What happened", origin=VERDICT)


def tour_view() -> rrb.TextDocumentView:
    """Show where to look at the step that the time cursor is at."""
    return rrb.TextDocumentView(name="Tour: where to look", origin=TOUR)


def errors_plot(runs: Sequence[RunView], scene: Scene) -> rrb.TimeSeriesView:
    """Plot position error and spread of all runs, with the limits that errors are judged by."""
    unit, contents = scene.scale.units.name, list[str]()
    styles: Overrides = {}
    for run in runs:
        trace = run.paths.trace
        error, spread, band = trace(POSITION_ERROR), trace(SPREAD), trace(TWO_SIGMA)
        styles[error] = rr.SeriesLines.from_fields(colors=[run.color], widths=[LINE])
        styles[spread] = rr.SeriesLines.from_fields(colors=[run.color], widths=[FAINT])
        styles[band] = rr.Measurements.from_fields(colors=[run.color], widths=[FAINT])
        contents += [error, band] if scene.has_truth else [spread]
    names = [f"{run.label} {run.color_word}" for run in runs]
    who = f": {', '.join(names)}" if len(runs) > 1 else ""
    if not scene.has_truth:
        return plot(f"Spread of the cloud ({unit}){who}", contents, overrides=styles)
    say, radii = scene.scale.say, runs[0].radii
    what = f"Position error thick, spread thin, shaded up to 2 sigma of the belief ({unit}){who}"
    limits = f"gray {say(radii.right_m)}: right below, red {say(radii.lost_m)}: lost above"
    return plot(f"{what}; {limits}", [*contents, LIMITS], overrides=styles)
