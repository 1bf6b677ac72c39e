"""Traces: one number per update, over the session."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.reasons.explanation import offset

from ..drawing.arrow import doubles_of, row_of, scalars
from ..drawing.canvas import png
from ..drawing.keys import line_key
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import BAR, DEAD, RGB, RUN_COLORS, font_safe
from .events import EventLines, name_of
from .panel import Panel, StepUpdate, set_phase, set_place
from .population import ANCESTORS, SURVIVORS
from .views import picture_view, plot, plot_of_runs

POSITION_ERROR = "position_error"
HEADING_ERROR = "heading_error"
SPREAD = "spread"
TWO_SIGMA = "two_sigma"  # a band of twice the spread: the errors that the filter holds for possible
CONFIDENCE = "confidence"
EFFECTIVE = "effective_sample"
KNOWS = "knows_where_it_is"  # the lost signal: a probability, which no truth is needed for
TRUTH_RATIO = "truth_over_estimate"
TRUTH_RANK = "truth_rank"
EVIDENCE = "evidence"  # several lines in one entity: of all channels together, and of each alone
LINE_WIDTH = 1.75
LIMIT_WIDTH = 0.8
LIMIT_REACH = 2.0  # a limit is drawn if it is at most so many times the largest error

COLORS: dict[str, RGB] = {
    POSITION_ERROR: RUN_COLORS[0],
    SPREAD: RUN_COLORS[1],
    HEADING_ERROR: RUN_COLORS[0],
    CONFIDENCE: RUN_COLORS[0],
    EFFECTIVE: RUN_COLORS[1],
    KNOWS: RUN_COLORS[3],
    SURVIVORS: RUN_COLORS[2],
    ANCESTORS: RUN_COLORS[3],
    TRUTH_RATIO: RUN_COLORS[0],
    TRUTH_RANK: RUN_COLORS[0],
}
EVIDENCE_COLORS: tuple[RGB, ...] = (*RUN_COLORS, (182, 60, 32), (204, 121, 167))  # of channels, in turn
ALL_TOGETHER: RGB = BAR  # of all channels, as the thickest line
THICK_WIDTH, THIN_WIDTH = 3.0, 1.0  # thin: channels for which no color was left
SHARE_TOPS = {
    CONFIDENCE: 1.1,
    EFFECTIVE: 1.1,
    KNOWS: 1.1,
    SURVIVORS: 1.1,
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
        self._events = EventLines()
        self._ends: list[tuple[int, float]] = []  # step and time of the first and the last update

    def prepare(self, rec: rr.RecordingStream) -> None:
        for quantity, color in COLORS.items():
            name = f"{font_safe(self._paths.label)}: {quantity.replace('_', ' ')}"
            style = rr.SeriesLines(names=[name], colors=[color], widths=[LINE_WIDTH])
            rec.log(self._paths.trace(quantity), style, static=True)
        band = rr.Measurements.from_fields(
            names=[f"{font_safe(self._paths.label)}: spread, band to 2 sigma"],
            colors=[COLORS[SPREAD]],
            widths=[THIN_WIDTH],
        )
        rec.log(self._paths.trace(TWO_SIGMA), band, static=True)
        lines = evidence_lines(self._run.channels)
        names, colors, widths = (list(part) for part in zip(*lines, strict=True))
        style = rr.SeriesLines(names=names, colors=colors, widths=widths)
        rec.log(self._paths.trace(EVIDENCE), style, static=True)
        key = rr.EncodedImage(contents=png(line_key(lines)), media_type="image/png")
        rec.log(self._paths.line_key, key, static=True)
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
        if update.knows is not None:
            self._log(rec, KNOWS, update.knows)
        nats = np.append(record.calibrated_evidence, record.channel_evidence)
        if np.isfinite(nats).all():  # -inf when no particle was in free space
            rec.log(self._paths.trace(EVIDENCE), scalars(nats))
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
        self._draw_limits(rec)
        for quantity, (low, high) in self._extents().items():
            self._events.draw(rec, self._paths.trace(quantity), low, high)

    def _draw_limits(self, rec: rr.RecordingStream) -> None:
        """Draw the errors by which the run is judged, unless all of its own are far smaller."""
        for name, limit, color in self._limits():
            line = f"{self._paths.trace(POSITION_ERROR)}/limits/{name}"
            rec.log(line, rr.SeriesLines(names=[name], colors=[color], widths=[LIMIT_WIDTH]), static=True)
            for step, time_s in self._ends:
                set_place(rec, step, time_s, Phase.ESTIMATE)
                rec.log(line, scalars(limit))

    def _limits(self) -> list[tuple[str, float, RGB]]:
        radii, length = self._run.radii, self._scale.length
        limits = [("right", length(radii.right_m), BAR), ("lost", length(radii.lost_m), DEAD)]
        reach = LIMIT_REACH * self._most.get(POSITION_ERROR, 0.0)
        return [limit for limit in limits if limit[1] <= reach]

    def _extents(self) -> dict[str, tuple[float, float]]:
        """Return the least and largest value of each plot, where its lines of events end."""
        extents = {quantity: (self._least[quantity], most) for quantity, most in self._most.items()}
        for quantity, steps in LABELED_STEPS.items():
            if quantity in extents:
                extents[quantity] = 0.0, round_top(extents[quantity][1], steps)
        if POSITION_ERROR in extents:  # its plot also has the spread and the limits
            limits = [limit for _, limit, _ in self._limits()]
            extents[POSITION_ERROR] = 0.0, max(extents[POSITION_ERROR][1], self._most[SPREAD], *limits)
        return extents | {quantity: (0.0, top) for quantity, top in SHARE_TOPS.items()}

    def _note(self, quantity: str, *values: float) -> None:
        """Remember the extent of a plot."""
        self._most[quantity] = max(*values, self._most.get(quantity, -np.inf))
        self._least[quantity] = min(*values, self._least.get(quantity, np.inf))

    def _log(self, rec: rr.RecordingStream, quantity: str, value: float) -> None:
        self._note(quantity, value)
        rec.log(self._paths.trace(quantity), scalars(value))

    def _draw_rank(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log how well the picture fits the true pose: relative to the estimate, and by rank."""
        logs, truth = update.record.sighting.comparison.log_likelihood, update.moment.truth
        if truth is None or not len(logs):
            return
        at_truth = self._scene.entry_at(truth)
        if at_truth < 0:
            return
        at_estimate = self._scene.entry_at(update.record.estimate.pose)
        self._log(rec, TRUTH_RANK, float((logs > logs[at_truth]).sum() + 1))
        if at_estimate >= 0:
            self._log(rec, TRUTH_RATIO, float(logs[at_truth] - logs[at_estimate]))


def evidence_lines(channels: tuple[str, ...]) -> list[tuple[str, RGB, float]]:
    """Return name, color and width of each line of evidence; colors repeat in thinner lines."""
    colors = [EVIDENCE_COLORS[k % len(EVIDENCE_COLORS)] for k in range(len(channels))]
    widths = [LINE_WIDTH if k < len(EVIDENCE_COLORS) else THIN_WIDTH for k in range(len(channels))]
    return [("all", ALL_TOGETHER, THICK_WIDTH), *zip(channels, colors, widths, strict=True)]


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


def single_plots(paths: RunPaths, scene: Scene) -> list[rrb.TimeSeriesView]:
    """Plot one run: distances, heading error where the truth is known, shares."""
    unit = scene.scale.units.name
    lines = [paths.trace(CONFIDENCE), paths.trace(EFFECTIVE), paths.trace(KNOWS)]
    shares = plot("Shares: confidence orange, ESS blue, knows green", lines, top=1.1)
    if not scene.has_truth:
        return [plot(f"Spread of the cloud ({unit})", [paths.trace(SPREAD)]), shares]
    distances = [paths.trace(POSITION_ERROR), paths.trace(TWO_SIGMA)]
    return [
        plot(f"Position error orange, spread blue, 2 sigma shaded ({unit})", distances),
        plot("Heading error (deg)", [paths.trace(HEADING_ERROR)]),
        shares,
    ]


Who = tuple[str, str]  # whose color is which, at the end of two titles
NO_COLORS_NAMED: Who = ("", "")


def error_plots(
    runs: Sequence[RunView], scene: Scene, who: Who = NO_COLORS_NAMED
) -> list[rrb.TimeSeriesView]:
    """Plot the errors of some runs against the truth, over the band of two sigma and the limits."""
    unit = scene.scale.units.name
    return [
        plot_of_runs(POSITION_ERROR, f"Position error, 2 sigma ({unit}){who[0]}", runs, None, TWO_SIGMA),
        plot_of_runs(HEADING_ERROR, f"Heading error (deg){who[1]}", runs),
    ]


def truth_plots(runs: Sequence[RunView]) -> list[rrb.TimeSeriesView]:
    """Plot how well the pictures of some runs fit the true pose."""
    return [
        plot_of_runs(TRUTH_RATIO, "Log-likelihood of truth less estimate (nats)", runs),
        plot_of_runs(TRUTH_RANK, "Rank of the truth's reference (1 is best)", runs),
    ]


def cloud_plots(
    runs: Sequence[RunView], scene: Scene, who: Who = NO_COLORS_NAMED
) -> list[rrb.TimeSeriesView]:
    """Plot spread, confidence and effective sample size of some runs."""
    near = scene.scale.say(runs[0].radii.confidence_m)
    return [
        plot_of_runs(SPREAD, f"Spread of the cloud ({scene.scale.units.name}){who[0]}", runs),
        plot_of_runs(CONFIDENCE, f"Confidence (share of weight within {near}){who[1]}", runs, top=1.1),
        plot_of_runs(EFFECTIVE, "Effective sample size (share of particles)", runs, top=1.1),
    ]


def knows_plot(runs: Sequence[RunView]) -> rrb.TimeSeriesView:
    """Plot the lost signal of some runs: the probability that the estimate is right, without truth."""
    return plot_of_runs(KNOWS, "Knows where it is (probability, without truth)", runs, top=1.1)


def survival_plots(runs: Sequence[RunView]) -> list[rrb.TimeSeriesView]:
    """Plot the shares of survivors and distinct ancestors of some runs."""
    return [
        plot_of_runs(SURVIVORS, "Survivors of resampling (share)", runs, top=1.1),
        plot_of_runs(ANCESTORS, "Distinct ancestors ten steps back (share)", runs, top=1.1),
    ]


def who_is_who(runs: Sequence[RunView]) -> Who:
    """Return the colors of several runs for two titles, two runs each; empty for one run."""
    if len(runs) == 1:
        return NO_COLORS_NAMED
    names = [f"{run.label} {run.color_word}" for run in runs]
    first, second = ", ".join(names[:2]), ", ".join(names[2:])
    return f": {first}", f": {second}" if second else ""


def evidence_plot(paths: RunPaths, title: str = "") -> rrb.TimeSeriesView:
    """Plot how well the cloud explained each picture, by all channels together and by each one."""
    return plot(f"{title}Evidence of each picture (nats)", [paths.trace(EVIDENCE)])


def evidence_key(paths: RunPaths, title: str = "") -> rrb.Spatial2DView:
    """Show the key of the evidence; a legend would cover lines of the plot."""
    name = f"{title}key" if title else "Key of the evidence: channels"
    return picture_view(name, paths.line_key)


def key_share(run: RunView) -> float:
    """Return the share of a column that the key needs: a row per four channels."""
    return 0.35 + 0.09 * (len(run.channels) // 4)
