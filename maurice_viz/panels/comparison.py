"""What several runs share: a close-up of all clouds, who is closer at every step and why, the histograms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.scoring.comparison import Step
from maurice_mcl.values import F64, I32, Belief, Moment, StepRecord

from .. import entities
from ..drawing.arrow import LogRow, blob_of, points_of, row_of, strips_of, text_of
from ..drawing.canvas import Extent, jpeg
from ..drawing.histogram_row import CELLS_PX, HIGH_PX, KEY_PX, TITLE_PX, Cell, cell_px, cells_of, draw_row
from ..entities import BARE_FLOORS, COMPARE_CLOSEUP, WALLS, Phase, bars_of, gap_of
from ..playback import RunResult
from ..scene import RunView, Scene, shortly
from ..style import PALE, PICTURE, REFERENCE, TRUTH, Order, font_safe
from ..text.comparison import NOT_YET, drive_words, errors_m, key_words, step_words, unweighed_words
from ..text.phases import of_scans
from .belief import CloseupFrame, frame_marks, sample, truth_marker
from .camera import SEES, draw_jpeg, draw_name, prepare_jpeg
from .panel import MARKDOWN, set_phase, set_phase_only
from .views import Overrides, plane_view

DOTS_A_CLOUD = 200  # per cloud on the shared map: four full clouds would hide each other
DOT_PT = 1.5  # radius in points of the screen
CLOSEUP = Extent(-2.0, 1.15, -1.0, 1.0)  # what is seen of it: the clouds, and left of them
NAMES_LEFT, NAMES_TOP, NAME_ROW = -1.3, -1.0, 0.19  # the names of the runs, one below the other
KEY_ROWS = (-24, 1, 26)  # of a row of histograms: the tops of the labels of its key


class ComparisonDrawing:
    """Draws what runs share in a recording of several.

    Of runs that replay another drive than the first one, camera and truth are drawn here.
    """

    def __init__(self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene) -> None:
        self._rec, self._runs, self._scale, self._library = rec, tuple(runs), scene.scale, scene.library
        self._labels, self._has_truth = tuple(run.label for run in runs), scene.has_truth
        self._sensors = {run.label: run.sensor for run in runs}
        self._clouds = {label: entities.cloud_of(label) for label in self._labels}
        self._truths = {  # of other drives
            run.label: truth_marker(entities.truth_of(run.label), scene.arena, scene.scale)
            for run in runs
            if run.own_drive
        }
        self._named = set[str]()  # runs whose cameras have their names
        self._cells: dict[str, list[Cell]] = {}  # of the histograms of each run that has channels
        self._frame = CloseupFrame(COMPARE_CLOSEUP, scene)
        self._frame.prepare(rec)
        for path in (entities.TEXT, entities.RESULT):
            rec.log(path, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        self._log_result(NOT_YET)
        for run in runs:
            self._prepare_run(run)

    def see(self, steps: Mapping[str, Step]) -> None:
        """Log one update of all runs."""
        moment, _ = steps[self._labels[0]]
        set_phase(self._rec, moment, Phase.PREDICT)
        truths = {id(own): own.truth for own, _ in steps.values() if own.truth is not None}
        self._frame.draw(
            self._rec, [sample(record.weighted) for _, record in steps.values()], [*truths.values()]
        )
        self._draw_before_weighing(steps)
        set_phase(self._rec, moment, Phase.MEASURE)
        for run in self._runs:
            self._draw_bars(run, steps[run.label][1])
        set_phase(self._rec, moment, Phase.WEIGHT)
        off = errors_m(steps)
        for run in self._runs:
            own, record = steps[run.label]
            self._rec.log(self._clouds[run.label], self._dots(record.weighted))
            self._draw_name(run, off.get(run.label))
            if own.truth is not None:
                gap = self._scale.screen(np.stack([record.estimate.pose[:2], own.truth[:2]]))
                self._rec.log(gap_of(run.label), row_of(rr.LineStrips2D, strips=strips_of([gap])))
            if run.label in self._truths:
                self._draw_drive(run, own)
        self._log_text(step_words(steps, self._scale, self._runs[0].radii, self._sensors))

    def _draw_before_weighing(self, steps: Mapping[str, Step]) -> None:
        """Log the clouds as they moved, without errors, on the timeline `phase` alone."""
        moment, _ = steps[self._labels[0]]
        set_phase_only(self._rec, moment, Phase.PREDICT)
        for run in self._runs:
            self._rec.log(self._clouds[run.label], self._dots(steps[run.label][1].predicted))
            self._rec.log(gap_of(run.label), row_of(rr.LineStrips2D, strips=strips_of([])))
            self._draw_name(run, None)
        self._log_text(unweighed_words(moment.frame.step))

    def _log_text(self, words: str) -> None:
        words = shortly(self._runs, words)
        words = of_scans(words) if all(run.sees_alone for run in self._runs) else words
        self._rec.log(entities.TEXT, row_of(rr.TextDocument, text=text_of(f"#### {font_safe(words)}")))

    def end(self, results: Sequence[RunResult]) -> None:
        """Log how the runs compare over the drive so far."""
        self._log_result(drive_words(results, self._scale))

    def _log_result(self, words: str) -> None:
        text = (
            f"{shortly(self._runs, words)}\n\n{key_words(self._scale, self._runs[0].radii, self._has_truth)}"
        )
        self._rec.log(entities.RESULT, rr.TextDocument(font_safe(text), media_type=MARKDOWN), static=True)

    def _prepare_run(self, run: RunView) -> None:
        label, points, rec = run.label, rr.components.Radius.ui_points, self._rec
        dots = rr.Points2D.from_fields(colors=[run.color], radii=points(DOT_PT), draw_order=Order.CLOUD)
        rec.log(self._clouds[label], dots, static=True)
        gap = rr.LineStrips2D.from_fields(colors=[TRUTH], radii=points(0.8), draw_order=Order.OVALS)
        rec.log(gap_of(label), gap, static=True)
        name = rr.Points2D.from_fields(
            positions=[(NAMES_LEFT, NAMES_TOP + run.number * NAME_ROW)],
            colors=[run.color],
            radii=points(0.0),
            show_labels=True,
            draw_order=Order.FRAME,
        )
        rec.log(_name_of(run), name, static=True)
        if label in self._truths:
            self._truths[label].prepare(rec)
            prepare_jpeg(rec, entities.camera_of(label))
        sizes = {channel: len(self._library.index[channel].relevance) for channel in run.distances}
        if sizes:
            self._prepare_bars(run, cells_of(sizes))

    def _prepare_bars(self, run: RunView, cells: list[Cell]) -> None:
        """Log where the histograms of a run stand, the titles of its cells, and its key."""
        self._cells[run.label] = cells
        row = rr.EncodedImage.from_fields(media_type="image/png", draw_order=Order.OVERLAY)
        self._rec.log(bars_of(run.label, "row"), row, rr.Transform3D(translation=[KEY_PX, 0, 0]), static=True)
        wide = cell_px(len(cells))
        places = [(KEY_PX + wide * (number + 0.46), -TITLE_PX) for number in range(len(cells))]
        places += [(KEY_PX / 2, top) for top in KEY_ROWS]
        texts = [*(cell.title for cell in cells), run.short, "bars: the robot's", "line: its match"]
        titles = rr.Points2D(
            places,
            radii=rr.components.Radius.ui_points(0.0),
            colors=[PALE] * len(cells) + [run.color, PICTURE, REFERENCE],
            labels=[font_safe(text) for text in texts],
            show_labels=True,
        )
        self._rec.log(bars_of(run.label, "titles"), titles, static=True)

    def _draw_bars(self, run: RunView, record: StepRecord) -> None:
        comparison, cells = record.sighting.comparison, self._cells.get(run.label)
        if cells is None or not len(comparison.quality):
            return
        best = int(comparison.quality.argmax())
        references = {
            channel: self._library.index[channel].references[best] for channel in comparison.channels
        }
        row = draw_row(cells, comparison.descriptors, references)
        self._rec.log(bars_of(run.label, "row"), row_of(rr.EncodedImage, blob=blob_of(row)))

    def _draw_name(self, run: RunView, error_m: float | None) -> None:
        """Log the name of a run in the close-up, with how far off it is."""
        name = run.short if error_m is None else f"{run.short}: {self._scale.say(error_m)} off"
        self._rec.log(_name_of(run), row_of(rr.Points2D, labels=text_of(font_safe(name))))

    def _draw_drive(self, run: RunView, moment: Moment) -> None:
        label = run.label
        path, image = entities.camera_of(label), moment.frame.image
        if label not in self._named:
            self._named.add(label)
            draw_name(self._rec, path, f"{run.short}: {SEES}", image.shape[1], TRUTH)
        draw_jpeg(self._rec, path, jpeg(image))
        if moment.truth is not None:
            self._truths[label].draw(self._rec, moment.truth)

    def _dots(self, cloud: Belief) -> LogRow:
        some = by_weight(cloud.weights, DOTS_A_CLOUD)
        places = self._scale.screen(cloud.poses[some, :2] + cloud.origin)
        return row_of(rr.Points2D, positions=points_of(places))


def _name_of(run: RunView) -> str:
    return f"{COMPARE_CLOSEUP}/name/{run.number}"


def by_weight(weights: F64, count: int) -> I32:
    """Return at most `count` particles of weights (N,) in proportion to their weight, without randomness."""
    ends = np.cumsum(weights)
    chosen = np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1])
    return np.asarray(chosen[np.diff(chosen, prepend=-1) > 0], np.int32)  # each once, in order


def clouds_view(runs: Sequence[RunView], scene: Scene) -> rrb.Spatial2DView:
    """Show all clouds close up, each with its estimate and a line to the truth."""
    contents = [BARE_FLOORS, WALLS, *frame_marks(COMPARE_CLOSEUP)]
    overrides: Overrides = {}
    for run in runs:
        paths = run.paths
        contents += [entities.cloud_of(run.label), paths.estimate, paths.ellipses]
        contents += [gap_of(run.label), _name_of(run)]
        overrides[paths.estimate] = rr.Points2D.from_fields()  # an arrow would be longer than the cloud
        if scene.has_truth:
            truth = entities.truth_of(run.label, run.own_drive)
            contents.append(truth)
            overrides[truth] = rr.Points2D.from_fields(labels=["truth"], show_labels=True)
    contents = list(dict.fromkeys(contents))
    return plane_view("Clouds", contents, CLOSEUP, overrides, origin=COMPARE_CLOSEUP)


def histograms_view(run: RunView) -> rrb.Spatial2DView:
    """Show the histograms of what the robot saw under those of a run's best match."""
    extent = Extent(0, KEY_PX + CELLS_PX, -TITLE_PX, HIGH_PX + 2)
    return plane_view(f"Histograms of {run.label}"[:25], f"{bars_of(run.label)}/**", extent)


def step_words_view() -> rrb.TextDocumentView:
    """Show who is closer at this step, and why."""
    return rrb.TextDocumentView(name="This step", origin=entities.TEXT)


def drive_words_view() -> rrb.TextDocumentView:
    """Show how the runs compare over the drive."""
    return rrb.TextDocumentView(name="Whole drive", origin=entities.RESULT)
