"""The story of a recording: the verdict in one line, what each step teaches, the errors with their limits."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.place import PlaceKnown, place_known
from maurice_mcl.reasons.tour import tour_of
from maurice_mcl.reasons.verdict import RunVerdict, decisive_step
from maurice_mcl.scoring.comparison import Step
from maurice_mcl.sensor.laser.sensor import Laser
from maurice_mcl.values import F64, Moment, StepRecord

from .. import entities
from ..drawing.arrow import row_of, scalars, text_of
from ..drawing.canvas import map_extent
from ..entities import ERROR_UNIT, LIMITS, TOUR, VERDICT, Phase
from ..scene import RunView, Scene, shortly
from ..style import STATES, font_safe
from ..text.lesson import say_lesson
from ..text.summary import failure_json
from ..text.tour import FEWEST_LETTERS, LETTERS, MOST_CROWDED, tour_pages, words
from ..text.verdict import NOTHING_YET, headline, now_line
from .events import lanes_px
from .laser.scan import reading_of
from .panel import MARKDOWN, Panel, StepUpdate, set_phase, set_place
from .traces import POSITION_ERROR, SPREAD
from .views import MAP, Overrides, labeled, plane_view

EVERY = 5  # updates between two verdicts on a live drive
UNSEEN = (0, 0, 0, 0)  # of a line that only keeps the axis of a live drive above the limit
FAINT = 0.8  # width of lines that are beside the point
ABOVE = 1.1  # times the largest error, or the first label: where the axis ends
BELOW_TOP = 1.08  # times the last label: nearer to the top it would be cut
LABELS_PX = 25  # between two labels of an axis, at least: nearer ones are faint, and below 21 there are none
BELOW_AXIS_PX = 16  # of a plot, for the labels of its steps
WIDTH_PX, HEIGHT_PX = 1280, 702  # what is left of 1280 x 800 below the tabs and above the time panel
HEADLINE_PX, ERRORS_PX = 92, 124
OWN_LANES = 3  # of one run: the log's, its status, what was noticed in it
MAP_SHARES = 0.3, 0.5  # of the width, at least and at most: beside a wide map words need their lines
LETTERS_BESIDE = 0.63  # of the width, for which letters were counted
DOT, FINE_DOT = 1.5, 1.0  # radius of a particle of a thinned and of a whole cloud, in points of the screen


def heights_px(count: int) -> tuple[int, int]:
    """Return the heights of the lanes of so many runs, and of the map above them, at 1280 x 800."""
    lanes = lanes_px(OWN_LANES if count == 1 else 1 + count)
    return lanes, HEIGHT_PX - HEADLINE_PX - lanes - ERRORS_PX


def map_share(count: int, scene: Scene) -> float:
    """Return the share of the width that the map of so many runs has, by its shape; the rest is beside it."""
    extent, (_, middle) = map_extent(scene.arena, scene.scale), heights_px(count)
    return float(np.clip(extent.width / extent.height * middle / WIDTH_PX, *MAP_SHARES))


def letters_beside(count: int, scene: Scene) -> int:
    """Return how many letters there is room for beside the map of so many runs, below their pictures."""
    most = FEWEST_LETTERS if count >= MOST_CROWDED else LETTERS
    return round(most * min((1 - map_share(count, scene)) / LETTERS_BESIDE, 1.0))


class LimitsPanel(Panel):
    """Draws the error above which runs count as lost, and what is plotted beside it."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        lost, has_truth = self._scale.say(self._run.radii.lost_m), self._scene.has_truth
        line = rr.SeriesLines(
            colors=[STATES["lost"], UNSEEN], widths=[FAINT, FAINT], names=[f"lost above {lost}", "room above"]
        )
        rec.log(LIMITS, line, static=True)
        what = f"**{'Error' if has_truth else 'Spread'}**, {self._scale.units.name}"
        text = f"{what}\n\nlost above {lost}" if has_truth else what
        rec.log(ERROR_UNIT, rr.TextDocument(text, media_type=MARKDOWN), static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the limit; also in the very first phase, where lanes begin: the plot begins there, too."""
        lost = self._scale.length(self._run.radii.lost_m) if self._scene.has_truth else np.nan
        for phase in (*((Phase.PREDICT,) if update.is_first else ()), Phase.ESTIMATE):
            set_phase(rec, update.moment, phase)
            rec.log(LIMITS, scalars([lost, ABOVE * lost]))


MOST_LESSONS = 20_000  # steps whose words get the moments of the tour at the end: memory is bounded
AT_THE_END = "The replay runs. What happened stands here when it ends."


class VerdictDrawing:
    """Draws the verdict on all runs of a recording. It is known at the end; of a live drive, so far."""

    def __init__(self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene) -> None:
        self._rec, self._runs, self._scene, self._scale = rec, tuple(runs), scene, scene.scale
        self._lasers = {run.label: scene.laser_of(run) for run in runs}
        self._every = EVERY if any(run.localizer is not None for run in runs) else 1
        self._words = words(runs, scene.has_truth)
        self._lessons: dict[int, str] = {}  # of the last `MOST_LESSONS` steps
        self._times_s: dict[int, float] = {}
        self._count = 0
        rec.log(TOUR, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        self._log(NOTHING_YET if scene.live else AT_THE_END)

    def see(self, steps: Mapping[str, Step], verdicts: Callable[[], Mapping[str, RunVerdict]]) -> None:
        """Take the next update; log what it teaches.

        Of a live drive log the verdict now and then: deciding it costs much. Without a localizer, by which
        causes are told, it costs little and is always logged.
        """
        moment, _ = next(iter(steps.values()))
        step = moment.frame.step
        places = {label: place_of(*steps[label], self._scene, self._lasers.get(label)) for label in steps}
        self._times_s[step], self._lessons[step] = moment.frame.time_s, say_lesson(places, self._scale)
        self._log_pages({step: self._lessons[step]}, {})
        self._count += 1
        if self._count > MOST_LESSONS:
            oldest = next(iter(self._lessons))
            del self._lessons[oldest], self._times_s[oldest]
        if self._scene.live and (self._count == 1 or self._count % self._every == 0):
            verdicts_now = verdicts()
            self._decide(verdicts_now, f"{now_line(verdicts_now)}Up to step {step}: ")

    def end(self, verdicts: Mapping[str, RunVerdict]) -> None:
        """Log the verdict, the step to look at, and where to look at each moment of the tour."""
        self._decide(verdicts)
        self._log_pages(self._lessons, verdicts)

    def _log_pages(self, lessons: Mapping[int, str], verdicts: Mapping[str, RunVerdict]) -> None:
        """Log the words of steps, with the moments of a tour where verdicts are known."""
        verdicts = self._shortly(verdicts)
        lessons = {step: shortly(self._runs, lesson) for step, lesson in lessons.items()}
        tour = tour_of(verdicts) if verdicts else ()
        letters = letters_beside(len(self._runs), self._scene)
        pages = tour_pages(tour, verdicts, self._scale, lessons, self._words, self._scene.opens, letters)
        for step, text in pages:
            set_place(self._rec, step, self._times_s[step], Phase.PREDICT)
            self._rec.log(TOUR, row_of(rr.TextDocument, text=text_of(font_safe(text))))

    def _shortly(self, verdicts: Mapping[str, RunVerdict]) -> dict[str, RunVerdict]:
        """Return verdicts by the short names of runs, as all others name them on the screen."""
        return {run.short: verdicts[run.label] for run in self._runs if run.label in verdicts}

    def _decide(self, verdicts: Mapping[str, RunVerdict], so_far: str = "") -> None:
        """Log the verdict, which may be one so far."""
        step = decisive_step(verdicts)
        look = f" Look at **step {step}.**" if self._count > 1 else ""
        self._log(f"{so_far}{headline(self._shortly(verdicts), self._scale)}{look}")
        failures = {
            label: [failure_json(failure, self._scale) for failure in verdict.failures]
            for label, verdict in verdicts.items()
        }
        self._rec.log(VERDICT, rr.AnyValues(decisive_step=step, failures=json.dumps(failures)), static=True)

    def _log(self, text: str) -> None:
        document = rr.TextDocument(f"#### {font_safe(text)}", media_type=MARKDOWN)
        self._rec.log(VERDICT, document, static=True)


def place_of(
    moment: Moment, record: StepRecord, scene: Scene, laser: Laser | None, fits: F64 | None = None
) -> PlaceKnown | None:
    """Return what a run knows of the place where its robot is, or, without truth, where the picture fits."""
    truth, agree = moment.truth, None
    if truth is None:
        return place_known(record, None, -1, scene.library, fits=fits)
    if laser is not None and not record.sighting.comparison.channels:
        reading = reading_of(moment, record, laser)
        if reading is not None:
            agree = laser.judged(reading, truth).count("agrees"), reading.size
    return place_known(record, truth, scene.entry_at(truth), scene.library, agree)


def verdict_view() -> rrb.TextDocumentView:
    """Show the verdict."""
    return rrb.TextDocumentView(name="What happened", origin=VERDICT)


def tour_view() -> rrb.TextDocumentView:
    """Show where to look at the step that the time cursor is at."""
    return rrb.TextDocumentView(name="Tour: where to look", origin=TOUR)


def error_unit_view(path: str = ERROR_UNIT) -> rrb.TextDocumentView:
    """Show what the plot beside it is of."""
    return rrb.TextDocumentView(name="Unit", origin=path)


def story_map(runs: Sequence[RunView], scene: Scene) -> rrb.Spatial2DView:
    """Show the clouds of all runs on one map, in the runs' colors, each estimate and the truth by name."""
    contents: list[str] = [*MAP]
    overrides: Overrides = {}
    for run in runs:
        cloud = run.paths.particles if len(runs) == 1 else entities.cloud_of(run.label)
        contents += [cloud, run.paths.estimate, run.paths.ellipses, run.paths.name]
        radius = FINE_DOT if len(runs) == 1 else DOT  # larger ones of a whole cloud would cover its oval
        overrides[cloud] = rr.Points2D.from_fields(
            colors=[run.color], radii=rr.components.Radius.ui_points(radius)
        )
        if scene.has_truth:
            truth = entities.truth_of(run.label, run.own_drive)
            contents += [truth, entities.CARRIED]
            overrides[truth] = labeled("truth" if not run.own_drive else f"truth of {font_safe(run.label)}")
    extent = map_extent(scene.arena, scene.scale)
    return plane_view("Map", list(dict.fromkeys(contents)), extent, overrides)


@dataclass(frozen=True, slots=True)
class ErrorAxis:
    """The axis of the position error, or of the spread, from zero, in display units."""

    top: float
    last_label: float


def error_axis(
    runs: Sequence[RunView], scene: Scene, height_px: float, fitted: bool = False
) -> ErrorAxis | None:
    """Return the axis that has room for the largest value; None where that is not known yet.

    `fitted`: for the largest that does not count as lost; a lost run leaves the plot at the top.

    The viewer labels steps of a power of ten, where they are far enough apart. An axis that ended below the
    first of them would have no label but zero, so it ends above it.
    """
    if scene.most_m is None:
        return None
    lost_m = runs[0].radii.lost_m if scene.has_truth else 0.0
    most_m = max(scene.most_m, lost_m)
    most = ABOVE * scene.scale.length((fitted and scene.most_not_lost_m) or most_m) or 1.0
    step = float(10.0 ** np.ceil(np.log10(most * LABELS_PX / (height_px - BELOW_AXIS_PX))))
    top = max(most, ABOVE * step)
    last = step * float(np.floor(top / step))
    return ErrorAxis(max(top, BELOW_TOP * last), last)


def errors_plot(
    runs: Sequence[RunView], scene: Scene, height_px: float, fitted: bool = False
) -> rrb.TimeSeriesView:
    """Plot the position error of all runs, and where they count as lost; without truth the spread.

    `fitted` to errors that do not count as lost.
    """
    axis = error_axis(runs, scene, height_px, fitted)
    quantity = POSITION_ERROR if scene.has_truth else SPREAD
    contents = [run.paths.trace(quantity) for run in runs]
    return rrb.TimeSeriesView(
        name="Position error" if scene.has_truth else "Spread of the cloud",
        origin="/",
        contents=[*contents, *([] if fitted and axis is None else [LIMITS])],
        axis_y=None if axis is None else rrb.ScalarAxis(range=(0.0, axis.top)),
        plot_legend=rrb.PlotLegend(visible=False),
        background=rrb.archetypes.PlotBackground(show_grid=False),
    )
