"""Traces: one number per update, over the session."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.explanation import offset
from maurice_mcl.scoring.modes import Ancestry

from ..drawing.arrow import doubles_of, row_of, scalars
from ..drawing.canvas import png
from ..drawing.keys import line_key
from ..drawing.reference_chart import channel_color
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import BAR, FRESH, LOST, PALE, RGB, font_safe
from .events import EventLines, name_of
from .panel import Panel, StepUpdate, set_phase, set_place
from .views import picture_view, plot, plot_of_runs

POSITION_ERROR = "position_error"
HEADING_ERROR = "heading_error"
SPREAD = "spread"
TWO_SIGMA = "two_sigma"  # a band of twice the spread: the errors that the filter holds for possible
CONFIDENCE = "confidence"
EFFECTIVE = "effective_sample"
ANCESTORS = "ancestors"  # share of the particles ten updates ago from which the cloud descends
KNOWS = "knows_where_it_is"  # the lost signal: a probability, which no truth is needed for
TRUTH_RANK = "truth_rank"
EVIDENCE = "evidence"  # several lines in one entity: of all channels together, and of each alone
LINE_WIDTH = 1.75
LIMIT_WIDTH = 0.8
POINT_SIZE = 5.0  # of a run of one step
MOST_LETTERS = 25  # of a title that is not cut where three plots are side by side
MARKS: tuple[tuple[str, RGB, float], ...] = (  # vertical lines in all plots
    ("lost, carried", LOST, LINE_WIDTH),
    ("new particles", FRESH, LIMIT_WIDTH),
    ("in the log", PALE, LIMIT_WIDTH),
)
SPREAD_WORDS = "spread, band: 2 sigma"  # below an error
LIMIT_REACH = 2.0  # a limit is drawn if it is at most so many times the largest error

QUANTITIES = (
    POSITION_ERROR,
    HEADING_ERROR,
    SPREAD,
    CONFIDENCE,
    EFFECTIVE,
    KNOWS,
    ANCESTORS,
    TRUTH_RANK,
)
ALL_TOGETHER: RGB = BAR  # of all channels, as the thickest line
THICK_WIDTH, THIN_WIDTH = 3.0, 1.0
SHARE_TOPS = {
    CONFIDENCE: 1.1,
    EFFECTIVE: 1.1,
    KNOWS: 1.1,
    ANCESTORS: 1.1,
}  # the ends of their scales
# plots that begin at zero, and how many steps of a scale their smallest panel labels
ABOVE_EVIDENCE = 0.1  # of its extent: the label of 0 is often at the top
ABOVE_LABEL = 1.15  # of the last label, whose upper half would be cut off
LABELED_STEPS = {POSITION_ERROR: 4.5, HEADING_ERROR: 6.5, SPREAD: 4.5}


class TracesPanel(Panel):
    """Logs one value per line; errors and the rank of the truth only if the truth is known."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._most: dict[str, float] = {}  # by quantity
        self._least: dict[str, float] = {}
        self._events, self._ancestry = EventLines(), Ancestry()
        self._ends: list[tuple[int, float]] = []  # step and time of the first and the last update

    def prepare(self, rec: rr.RecordingStream) -> None:
        for quantity in QUANTITIES:
            name = f"{font_safe(self._paths.label)}: {quantity.replace('_', ' ')}"
            style = rr.SeriesLines(names=[name], colors=[self._run.color], widths=[LINE_WIDTH])
            rec.log(self._paths.trace(quantity), style, static=True)
        band = rr.Measurements.from_fields(
            names=[f"{font_safe(self._paths.label)}: spread, band to 2 sigma"],
            colors=[self._run.color],
            widths=[THIN_WIDTH],
        )
        rec.log(self._paths.trace(TWO_SIGMA), band, static=True)
        lines = evidence_lines(self._run.channels)
        names, colors, widths = (list(part) for part in zip(*lines, strict=True))
        style = rr.SeriesLines(names=names, colors=colors, widths=widths)
        rec.log(self._paths.trace(EVIDENCE), style, static=True)
        below = [(SPREAD_WORDS, self._run.color, LIMIT_WIDTH)] if self._scene.has_truth else []
        marks = [*MARKS, *below]
        for path, items in (
            (self._paths.line_key, [*evidence_lines(self._run.all_channels), *marks]),
            (self._paths.marks_key, marks),
        ):
            key = rr.EncodedImage(contents=png(line_key(items)), media_type="image/png")
            rec.log(path, key, static=True)
        unseen = rr.SeriesPoints(colors=[(0, 0, 0, 0)], marker_sizes=[0.0])
        for quantity in (*LABELED_STEPS, EVIDENCE):
            rec.log(top_path(self._paths, quantity), unseen, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, truth, scale = update.record, update.moment.truth, self._scale
        set_phase(rec, update.moment, Phase.ESTIMATE)
        if truth is not None:
            off = offset(record.estimate.pose, truth)
            self._log(rec, POSITION_ERROR, scale.length(off.apart_m))
            self._log(rec, HEADING_ERROR, float(np.degrees(off.turned_rad)))
        spread = scale.length(float(np.hypot(*record.mean_estimate.sd_m)))
        self._log(rec, SPREAD, spread)
        rec.log(
            self._paths.trace(TWO_SIGMA),
            row_of(rr.Measurements, values=doubles_of(spread), variances=doubles_of(spread**2)),
        )
        self._log(rec, EFFECTIVE, record.effective_sample_size / record.weighted.size)
        self._log(rec, CONFIDENCE, record.estimate.confidence)
        self._ancestry.see(record)
        self._log(rec, ANCESTORS, self._ancestry.distinct() / record.belief.size)
        if update.knows is not None:
            self._log(rec, KNOWS, update.knows)
        nats = np.append(record.calibrated_evidence, record.channel_evidence)
        if np.isfinite(nats).all():  # -inf when no particle was in free space
            channels = record.sighting.comparison.channels or self._run.channels  # none without its library
            own = dict(zip(channels, record.channel_evidence, strict=True))
            lines = [own.get(channel, np.nan) for channel in self._run.channels]  # or another preset's
            rec.log(self._paths.trace(EVIDENCE), scalars(np.array([record.calibrated_evidence, *lines])))
            self._note(EVIDENCE, *nats)
        self._draw_rank(rec, update)
        frame = update.moment.frame
        self._ends = [*self._ends[:1], (frame.step, frame.time_s)]
        self._events.see(frame.step, frame.time_s, map(name_of, update.events))

    def finish(self, rec: rr.RecordingStream) -> None:
        """Log where scales end, and the lines of events: only now is the largest value known."""
        for quantity, most in self._most.items():
            if quantity in LABELED_STEPS:
                rec.log(top_path(self._paths, quantity), scalars(round_top(most, LABELED_STEPS[quantity])))
        if EVIDENCE in self._most:
            most, least = self._most[EVIDENCE], self._least[EVIDENCE]
            rec.log(top_path(self._paths, EVIDENCE), scalars(most + ABOVE_EVIDENCE * (most - least)))
        self._draw_limit(rec)
        if len(self._ends) == 1:  # a line of one point draws nothing
            point = rr.SeriesPoints(colors=[self._run.color], markers=["circle"], marker_sizes=[POINT_SIZE])
            for quantity in QUANTITIES:
                rec.log(self._paths.trace(quantity), point, static=True)
        for quantity, (low, high) in self._extents().items():
            self._events.draw(rec, self._paths.trace(quantity), low, high)

    def _draw_limit(self, rec: rr.RecordingStream) -> None:
        """Draw the error above which the run is lost, unless all of its own are far smaller."""
        line = f"{self._paths.trace(POSITION_ERROR)}/limits/lost"
        for limit in self._limits():
            rec.log(line, rr.SeriesLines(names=["lost"], colors=[LOST], widths=[LIMIT_WIDTH]), static=True)
            for step, time_s in self._ends:
                set_place(rec, step, time_s, Phase.ESTIMATE)
                rec.log(line, scalars(limit))

    def _limits(self) -> list[float]:
        lost = self._scale.length(self._run.radii.lost_m)
        return [lost] if lost <= LIMIT_REACH * self._most.get(POSITION_ERROR, 0.0) else []

    def _extents(self) -> dict[str, tuple[float, float]]:
        """Return the least and largest value of each plot, where its lines of events end."""
        extents = {quantity: (self._least[quantity], most) for quantity, most in self._most.items()}
        for quantity, steps in LABELED_STEPS.items():
            if quantity in extents:
                extents[quantity] = 0.0, round_top(extents[quantity][1], steps)
        if POSITION_ERROR in extents:  # its plot also has the spread and the limit
            most = max(extents[POSITION_ERROR][1], self._most[SPREAD], *self._limits())
            extents[POSITION_ERROR] = 0.0, most
        return extents | {quantity: (0.0, top) for quantity, top in SHARE_TOPS.items()}

    def _note(self, quantity: str, *values: float) -> None:
        """Remember the extent of a plot."""
        self._most[quantity] = max(*values, self._most.get(quantity, -np.inf))
        self._least[quantity] = min(*values, self._least.get(quantity, np.inf))

    def _log(self, rec: rr.RecordingStream, quantity: str, value: float) -> None:
        self._note(quantity, value)
        rec.log(self._paths.trace(quantity), scalars(value))

    def _draw_rank(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log how well the picture fits the true pose, by rank."""
        logs, truth = update.record.sighting.comparison.log_likelihood, update.moment.truth
        if truth is None or not len(logs) or not self._run.channels:
            return
        at_truth = self._scene.entry_at(truth)
        if at_truth < 0:
            return
        self._log(rec, TRUTH_RANK, float((logs > logs[at_truth]).sum() + 1))


def evidence_lines(channels: tuple[str, ...]) -> list[tuple[str, RGB, float]]:
    """Return name, color and width of each line of evidence."""
    own = [(channel, channel_color(channel), LINE_WIDTH) for channel in channels]
    return [("all", ALL_TOGETHER, THICK_WIDTH), *own]


def top_path(paths: RunPaths, quantity: str) -> str:
    """Return the entity of the unseen point that a plot's scale reaches up to."""
    return f"{paths.trace(quantity)}/top"


def round_top(most: float, steps: float) -> float:
    """Return where a scale ends whose labels are powers of ten: above the value, and above the last label.

    A value of more than `steps` times the power below it gets a label above it.
    """
    if not 0 < most < np.inf:
        return 0.0
    below = 10.0 ** np.floor(np.log10(most))
    return float(max(most, ABOVE_LABEL * (10 * below if most > steps * below else below)))


def error_plots(runs: Sequence[RunView], scene: Scene) -> list[rrb.TimeSeriesView]:
    """Plot the errors of some runs against the truth, over the band of two sigma and the limit."""
    unit = scene.scale.units.name
    return [
        plot_of_runs(POSITION_ERROR, f"Position error ({unit})", runs, None, TWO_SIGMA),
        plot_of_runs(HEADING_ERROR, "Heading error (deg)", runs),
    ]


def cloud_plots(runs: Sequence[RunView], scene: Scene) -> list[rrb.TimeSeriesView]:
    """Plot spread and confidence of some runs."""
    near = scene.scale.say(runs[0].radii.confidence_m)
    return [
        plot_of_runs(SPREAD, f"Spread ({scene.scale.units.name})", runs),
        plot_of_runs(CONFIDENCE, f"Weight within {near}", runs, top=1.1),
    ]


def knows_plot(runs: Sequence[RunView]) -> rrb.TimeSeriesView:
    """Plot the lost signal of some runs: the probability that the estimate is right, without truth."""
    return plot_of_runs(KNOWS, "Knows where it is (0-1)", runs, top=1.1)


def rank_plot(runs: Sequence[RunView]) -> rrb.TimeSeriesView:
    """Plot how many references fit the picture better than the one nearest to the truth, and that one."""
    return plot_of_runs(TRUTH_RANK, "Rank of the true place", runs)


def particle_plots(runs: Sequence[RunView]) -> list[rrb.TimeSeriesView]:
    """Plot the effective sample size and the distinct ancestors of some runs, as shares."""
    return [
        plot_of_runs(EFFECTIVE, "Effective sample size", runs, top=1.1),
        plot_of_runs(ANCESTORS, "Ancestors, 10 steps back", runs, top=1.1),
    ]


def run_plots(run: RunView, scene: Scene) -> list[rrb.TimeSeriesView]:
    """Plot what tells most of one run: its errors, or its spread, and whether it knows where it is."""
    first = error_plots([run], scene)[0] if scene.has_truth else cloud_plots([run], scene)[0]
    return [first, cloud_plots([run], scene)[1] if run.is_recorded else knows_plot([run])]


def evidence_plot(paths: RunPaths, of: str = "") -> rrb.TimeSeriesView:
    """Plot how well the cloud explained each picture, by all channels together and by each one."""
    return plot(title_of("Evidence (nats)", of), [paths.trace(EVIDENCE)])


def title_of(what: str, label: str) -> str:
    """Return the title of a view of one of several runs, not longer than titles are."""
    room = MOST_LETTERS - len(what) - 2
    short = label if len(label) <= room else f"{label[: room - 1]}…"
    return f"{short}: {what}" if label else what


def evidence_key(paths: RunPaths) -> rrb.Spatial2DView:
    """Show the key of the lines of evidence and of the marks in all plots."""
    return picture_view("Key", paths.line_key)


def marks_key(paths: RunPaths) -> rrb.Spatial2DView:
    """Show the key of the marks in the plots of one run."""
    view = picture_view("Key", paths.marks_key)
    view.titlebar = False
    return view


def key_share(run: RunView) -> float:
    """Return the share of a column that the key needs: a row per three lines."""
    return 0.2 + 0.1 * -(-(len(run.all_channels) + 2 + len(MARKS)) // 3)
