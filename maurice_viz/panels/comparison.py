"""What several runs share: one map with all clouds, how they differ at every step, and where they part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.scoring.comparison import Step, StepComparison
from maurice_mcl.values.arrays import F32, F64, I32, U8
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment

from .. import entities
from ..drawing.canvas import jpeg
from ..drawing.keys import COMPARED, belief_key, extent_with, runs_key
from ..entities import Phase
from ..playback import RunResult
from ..scene import RunView, Scene
from ..style import TRUTH, font_safe
from ..text.summary import NOT_YET, StepWords, result
from .belief import truth_marker
from .camera import SEES, camera_view, draw_jpeg, draw_name, edges_view, prepare_jpeg
from .events import EventLines, line_names
from .panel import MARKDOWN, set_phase
from .traces import LINE_WIDTH
from .views import MAP, picture_view, plane_view, plot
from .world import draw_key

LABEL_LETTERS = 12  # letters of a label in a title of the shared column
TITLE_LETTERS = 30  # letters for which a small map has room
DOTS_A_CLOUD = 200  # per cloud on the shared map: four full clouds would hide each other
DOT_PT = 1.5  # radius in points of the screen


class ComparisonDrawing:
    """Draws what runs share in a recording of several. All are compared with the first run.

    Of runs that replay another drive than the first one, camera and truth are drawn here.
    """

    def __init__(self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene) -> None:
        self._rec, self._runs, self._scale = rec, tuple(runs), scene.scale
        self._labels = tuple(run.label for run in runs)
        self._clouds = {label: entities.cloud_of(label) for label in self._labels}
        self._truths = {  # of other drives
            run.label: truth_marker(entities.truth_of(run.label), scene.arena, scene.scale)
            for run in runs
            if run.own_drive
        }
        self._words = StepWords(self._labels, scene.scale, scene.has_truth)
        self._events = EventLines()
        self._named = set[str]()  # runs whose cameras have their names
        self._extents: dict[str, tuple[float, float]] = {}  # least and largest value, by plot
        self._draw_keys(scene)
        for path in (entities.TEXT, entities.RESULT):
            rec.log(path, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        rec.log(entities.RESULT, rr.TextDocument(NOT_YET, media_type=MARKDOWN), static=True)
        for run in runs:
            self._prepare_run(run)
        self._prepare_lines()

    def see(self, steps: Mapping[str, Step], pairs: Mapping[str, StepComparison]) -> None:
        """Log one update of all runs."""
        moment, _ = steps[self._labels[0]]
        set_phase(self._rec, moment, Phase.WEIGHT)
        for label, (own, record) in steps.items():
            self._rec.log(self._clouds[label], rr.Points2D.from_fields(positions=self._dots(record)))
            if label in self._truths:
                self._draw_drive(label, own)
        set_phase(self._rec, moment, Phase.ESTIMATE)
        self._events.see(moment.frame.step, moment.frame.time_s, line_names(moment.events))
        self._draw_lines(pairs)
        for label, pair in pairs.items():
            if pair.event is not None and pair.apart_m is not None:
                self._rec.log(entities.parted_of(label), rr.Scalars(self._scale.length(pair.apart_m)))
        self._rec.log(
            entities.TEXT, rr.TextDocument.from_fields(text=font_safe(self._words.at(steps, pairs)))
        )

    def end(self, results: Sequence[RunResult]) -> None:
        """Log how the runs compare over the drive so far, and the log's events in the plots."""
        for path, (low, high) in self._extents.items():
            self._events.draw(self._rec, path, low, high)
        text = result(results, self._scale.units)
        self._rec.log(entities.RESULT, rr.TextDocument(font_safe(text), media_type=MARKDOWN), static=True)

    def _draw_keys(self, scene: Scene) -> None:
        key = _key_of_all(self._runs, scene.has_truth)
        draw_key(self._rec, entities.RUNS_KEY, key, scene.arena, scene.scale)
        for run in self._runs:
            own = belief_key(scene.has_truth, run.color, len(self._runs))
            draw_key(self._rec, run.paths.key(COMPARED), own, scene.arena, scene.scale)

    def _prepare_run(self, run: RunView) -> None:
        label, points = run.label, rr.components.Radius.ui_points
        dots = rr.Points2D.from_fields(colors=[run.color], radii=points(DOT_PT), draw_order=20.0)
        self._rec.log(self._clouds[label], dots, static=True)
        mark = rr.SeriesPoints(
            colors=[run.color], names=[f"{font_safe(label)} parts"], markers="diamond", marker_sizes=[5.0]
        )
        self._rec.log(entities.parted_of(label), mark, static=True)
        if label in self._truths:
            self._truths[label].prepare(self._rec)
            prepare_jpeg(self._rec, entities.camera_of(label))

    def _prepare_lines(self) -> None:
        first, *others = self._labels
        colors = [run.color for run in self._runs[1:]]
        what = {
            entities.POSITION_DIFFERENCE: "position error",
            entities.HEADING_DIFFERENCE: "heading error",
            entities.APART: "distance",
        }
        for path, quantity in what.items():
            names = [f"{label}: {quantity} against {first}" for label in others]
            style = rr.SeriesLines(names=names, colors=colors, widths=[LINE_WIDTH] * len(others))
            self._rec.log(path, style, static=True)

    def _draw_lines(self, pairs: Mapping[str, StepComparison]) -> None:
        def known(values: Sequence[float | None], unit: float) -> list[float]:
            return [np.nan if value is None else value * unit for value in values]

        per_m, per_rad = self._scale.units.per_m, float(np.rad2deg(1))
        lines = {
            entities.POSITION_DIFFERENCE: known([pair.position_m for pair in pairs.values()], per_m),
            entities.HEADING_DIFFERENCE: known([pair.heading_rad for pair in pairs.values()], per_rad),
            entities.APART: known([pair.apart_m for pair in pairs.values()], per_m),
        }
        for path, values in lines.items():
            if not np.isnan(values).all():
                self._rec.log(path, rr.Scalars(values))
                least, most = self._extents.get(path, (0.0, 0.0))
                self._extents[path] = (
                    min(least, float(np.nanmin(values))),
                    max(most, float(np.nanmax(values))),
                )

    def _draw_drive(self, label: str, moment: Moment) -> None:
        path, image = entities.camera_of(label), moment.frame.image
        if label not in self._named:
            self._named.add(label)
            draw_name(self._rec, path, f"{label}: {SEES}", image.shape[1], TRUTH)
        draw_jpeg(self._rec, path, jpeg(image))
        if moment.truth is not None:
            self._truths[label].draw(self._rec, moment.truth)

    def _dots(self, record: StepRecord) -> F32:
        cloud = record.weighted
        return self._scale.screen(cloud.poses[by_weight(cloud.weights, DOTS_A_CLOUD), :2] + cloud.origin)


def _key_of_all(runs: Sequence[RunView], has_truth: bool) -> U8:
    return runs_key([run.label for run in runs], has_truth)


def by_weight(weights: F64, count: int) -> I32:
    """Return at most `count` particles of weights (N,) in proportion to their weight, without randomness."""
    ends = np.cumsum(weights)
    chosen = np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1])
    return np.asarray(chosen[np.diff(chosen, prepend=-1) > 0], np.int32)  # each once, in order


def distance_plots(runs: Sequence[RunView], scene: Scene) -> list[rrb.TimeSeriesView]:
    """Plot distances to the first run's estimate; none if all runs replay other drives."""
    if all(run.own_drive for run in runs[1:]):
        return []
    contents = [entities.APART, *(entities.parted_of(run.label) for run in runs[1:])]
    return [plot(f"Distance to {first_label(runs)} ({scene.scale.units.name})", contents)]


def first_label(runs: Sequence[RunView]) -> str:
    """Return a name for the first run in titles, where a long label would be cut off."""
    label = runs[0].label
    return label if len(label) <= LABEL_LETTERS else "the first"


def run_belief_view(run: RunView, count: int, scene: Scene) -> rrb.Spatial2DView:
    """Show the cloud of one of `count` runs; the title names the run's color in shared panels."""
    paths = run.paths
    contents = [*MAP, entities.NODES, paths.key(COMPARED), f"{paths.at('belief')}/**"]
    contents += [f"{entities.truth_of(run.label, run.own_drive)}/**"] if scene.has_truth else []
    unit = scene.scale.units.name
    name = f"{run.label}, {run.color_word}: belief ({unit})"
    if len(name) > TITLE_LETTERS:
        name = f"{run.label}, {run.color_word} ({unit})"
    key = belief_key(scene.has_truth, run.color, count)
    return plane_view(name, contents, extent_with(key, scene.arena, scene.scale))


def all_runs_view(runs: Sequence[RunView], scene: Scene) -> rrb.Spatial2DView:
    """Show all clouds on one map, each with its estimate in the run's color."""
    contents = [*MAP, entities.NODES, entities.RUNS_KEY]
    for run in runs:
        paths = run.paths
        contents += [entities.cloud_of(run.label), paths.estimate, paths.ellipses]
        contents += [f"{entities.truth_of(run.label, run.own_drive)}/**"] if scene.has_truth else []
    key = _key_of_all(runs, scene.has_truth)
    name = f"All runs on one map ({scene.scale.units.name})"
    return plane_view(name, list(dict.fromkeys(contents)), extent_with(key, scene.arena, scene.scale))


def camera_views(runs: Sequence[RunView]) -> list[rrb.Spatial2DView]:
    """Show camera and edges; for runs of different drives, each drive's camera."""
    own = [run.label for run in runs if run.own_drive]
    if not own:
        return [camera_view(), edges_view()]
    views = [picture_view(f"{label}: camera (px)", entities.camera_of(label)) for label in own]
    return [camera_view(f"{runs[0].label}: camera"), *views]


def difference_plots(runs: Sequence[RunView], scene: Scene) -> list[rrb.TimeSeriesView]:
    """Plot how much larger errors are than the first run's: of the position, and of the heading."""
    title = f"Error minus {first_label(runs)}'s ({scene.scale.units.name})"
    return [
        plot(title, [entities.POSITION_DIFFERENCE]),
        plot("Heading diff. (deg)", [entities.HEADING_DIFFERENCE]),
    ]


def comparison_words() -> rrb.Tabs:
    """Show how the runs compare, at this step and over the drive."""
    this_step = rrb.TextDocumentView(name="This step", origin=entities.TEXT)
    return rrb.Tabs(this_step, rrb.TextDocumentView(name="Whole drive", origin=entities.RESULT), active_tab=0)
