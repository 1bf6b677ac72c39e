"""Two to four runs side by side: who is closer at every step, and what each phase did to their clouds.

The clouds before and after each phase are those of `inside`, in frames that show runs alike where they can.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.scoring.comparison import Step
from maurice_mcl.values import F64, I32, Belief, Moment, StepRecord

from ... import entities
from ...drawing.arrow import LogRow, points_of, row_of, strips_of, text_of
from ...drawing.canvas import Extent, jpeg
from ...entities import BARE_FLOORS, WALLS, Phase, frame_of, gap_of
from ...playback import RunResult
from ...scene import RunView, Scene, shortly
from ...style import TRUTH, Order, font_safe
from ...text.comparison import NOT_YET, drive_words, errors_m
from ...text.phases import of_scans
from ...text.side_by_side import BestMatch, is_recorded, phase_words, step_words, why_words
from ..belief import CloseupFrame, frame_marks, sample, seen_whole, truth_marker
from ..camera import SEES, draw_jpeg, draw_name, prepare_jpeg
from ..inside import AFTER, BEFORE
from ..panel import MARKDOWN, set_phase, set_phase_only, set_step_only
from ..views import Overrides, plane_view
from .matches import MatchesDrawing

DOTS_A_CLOUD = 200  # per cloud on the shared map: four full clouds would hide each other
DOT_PT = 1.5  # radius in points of the screen
ALIKE = 4.0  # times its own close-up with the truth: a run has the frame of all up to there
CLOSEUP = Extent(-1.0, 1.0, -1.5, 1.0)  # what is seen of it: the cloud, under a caption of two lines
GROWS = 1.6  # times as large: close-ups also hold the clouds of the step before up to there
LENGTH_ABOVE = 0.32  # of the length above the scale bar
SIDES = (BEFORE, AFTER)
CAPTIONS: Mapping[Phase | None, tuple[str, str]] = {  # of what is before and after a phase
    Phase.PREDICT: ("last step", "predict"),
    Phase.MEASURE: ("moved", "measure"),
    Phase.WEIGHT: ("moved", "weight"),
    Phase.RESAMPLE: ("weighted", "resample"),
    Phase.RESEED: ("resampled", "reseed"),
    Phase.ESTIMATE: ("reseeded", "estimate"),
    None: ("moved", "weighted"),
}


class ComparisonDrawing:
    """Draws what runs share in a recording of several.

    Of runs that replay another drive than the first one, camera and truth are drawn here.
    """

    def __init__(
        self, rec: rr.RecordingStream, runs: Sequence[RunView], scene: Scene, light: bool = False
    ) -> None:
        """Take the runs; `light` draws only what other layouts show: a recording has no tab for the rest."""
        self._light = light
        self._rec, self._runs, self._scale = rec, tuple(runs), scene.scale
        self._labels = tuple(run.label for run in runs)
        self._short = {run.label: run.short for run in runs}
        self._draws_new = {run.label: run.draws_new for run in runs}
        self._clouds = {label: entities.cloud_of(label) for label in self._labels}
        self._truths = {  # of other drives
            run.label: truth_marker(entities.truth_of(run.label), scene.arena, scene.scale)
            for run in runs
            if run.own_drive
        }
        self._named = set[str]()  # runs whose cameras have their names
        self._clouds_before: dict[str, F64] = {}  # of the last update
        self._matches = MatchesDrawing(rec, runs, scene)
        self._frames = {run.label: CloseupFrame(frame_of(run.label), scene, LENGTH_ABOVE) for run in runs}
        self._says_scan = all(run.sees_alone for run in runs)
        for path in (entities.TEXT, entities.WHY, entities.RESULT):
            rec.log(path, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
        self._log_result(NOT_YET)
        what = f"**{'Error' if scene.has_truth else 'Spread'}**, {self._scale.units.name}"
        lost = f"  \nabove {self._scale.say(runs[0].radii.lost_m)}: lost, not shown"
        unit = rr.TextDocument(f"{what}{lost if scene.has_truth else ''}", media_type=MARKDOWN)
        rec.log(entities.COMPARE_UNIT, unit, static=True)
        for run in runs:
            self._prepare_run(run)

    def see(self, steps: Mapping[str, Step]) -> None:
        """Log one update of all runs."""
        moment, _ = steps[self._labels[0]]
        if self._light:
            set_phase(self._rec, moment, Phase.WEIGHT)
            for run in self._runs:
                self._draw_weighted(run, *steps[run.label])
            return
        matches = self._matches.of(steps)
        set_phase(self._rec, moment, Phase.PREDICT)
        self._draw_frames(steps)
        set_phase_only(self._rec, moment, Phase.PREDICT)
        for run in self._runs:
            self._rec.log(self._clouds[run.label], self._dots(steps[run.label][1].predicted))
            self._rec.log(gap_of(run.label), row_of(rr.LineStrips2D, strips=strips_of([])))
        set_phase(self._rec, moment, Phase.MEASURE)
        self._matches.draw(steps, matches)
        set_phase(self._rec, moment, Phase.WEIGHT)
        self._matches.draw_estimates(steps)
        for run in self._runs:
            self._draw_weighted(run, *steps[run.label])
        for phase in Phase:
            set_phase_only(self._rec, moment, phase)
            self._say(steps, phase, matches)
        set_step_only(self._rec, moment)
        self._say(steps, None, matches)

    def end(self, results: Sequence[RunResult]) -> None:
        """Log how the runs compare over the drive so far."""
        self._log_result(drive_words(results, self._scale))

    def _log_result(self, words: str) -> None:
        document = rr.TextDocument(self._readable(words), media_type=MARKDOWN)
        self._rec.log(entities.RESULT, document, static=True)

    def _readable(self, words: str) -> str:
        """Return words with names of runs that leave room for the rest."""
        return font_safe(shortly(self._runs, words))

    def _prepare_run(self, run: RunView) -> None:
        label, points, rec = run.label, rr.components.Radius.ui_points, self._rec
        self._frames[label].prepare(rec)
        dots = rr.Points2D.from_fields(colors=[run.color], radii=points(DOT_PT), draw_order=Order.CLOUD)
        rec.log(self._clouds[label], dots, static=True)
        gap = rr.LineStrips2D.from_fields(colors=[TRUTH], radii=points(0.8), draw_order=Order.OVALS)
        rec.log(gap_of(label), gap, static=True)
        for side in SIDES:
            caption = rr.Points2D.from_fields(
                positions=[(0.0, CLOSEUP.top)],
                colors=[run.color],
                radii=points(0.0),
                show_labels=True,
                draw_order=Order.FRAME,
            )
            rec.log(f"{frame_of(label)}/{side}", caption, static=True)
        if label in self._truths:
            self._truths[label].prepare(rec)
            prepare_jpeg(rec, entities.camera_of(label))

    def _draw_frames(self, steps: Mapping[str, Step]) -> None:
        """Move close-ups alike, but for a run that would be a speck in the frame of all."""
        clouds = {label: sample(record.weighted) for label, (_, record) in steps.items()}
        truths = {
            label: [] if moment.truth is None else [moment.truth] for label, (moment, _) in steps.items()
        }
        every = list({id(truth): truth for some in truths.values() for truth in some}.values())
        before, self._clouds_before = self._clouds_before or clouds, clouds
        _, reach_m = seen_whole([*clouds.values()], every)
        together = _with_last([*clouds.values()], [*before.values()], every)
        for label, frame in self._frames.items():
            own = [clouds[label], *(truth[None, :2] for truth in truths[label])]
            if reach_m <= ALIKE * seen_whole(own, [])[1]:
                frame.draw(self._rec, together, every)
            else:
                alone = _with_last([clouds[label]], [before[label]], truths[label])
                frame.draw(self._rec, alone, truths[label])

    def _draw_weighted(self, run: RunView, moment: Moment, record: StepRecord) -> None:
        self._rec.log(self._clouds[run.label], self._dots(record.weighted))
        if moment.truth is not None:
            gap = self._scale.screen(np.stack([record.estimate.pose[:2], moment.truth[:2]]))
            self._rec.log(gap_of(run.label), row_of(rr.LineStrips2D, strips=strips_of([gap])))
        if run.label in self._truths:
            self._draw_drive(run.label, moment)

    def _say(self, steps: Mapping[str, Step], phase: Phase | None, matches: Sequence[BestMatch]) -> None:
        """Log words and captions of a phase, or of the whole step."""
        radii = self._runs[0].radii
        if phase is None:
            words = step_words(steps, self._scale, radii)
        else:
            words = phase_words(steps, phase, self._scale, radii, matches, self._draws_new)
        for path, text in (
            (entities.TEXT, f"#### {words}"),
            (entities.WHY, why_words(steps, phase, self._scale, matches)),
        ):
            text = of_scans(text) if self._says_scan else text
            self._rec.log(path, row_of(rr.TextDocument, text=text_of(self._readable(text))))
        off = errors_m(steps)
        is_weighed = phase is None or phase >= Phase.WEIGHT
        for label in self._labels:
            error = f"\n{self._scale.say(off[label])} off" if label in off and is_weighed else ""
            before, after = CAPTIONS[phase]
            name = font_safe(self._short[label])
            after = name if is_recorded(steps[label][1]) else after
            for side, text in ((BEFORE, f"{name}\n{before}"), (AFTER, f"{after}{error}")):
                row = row_of(rr.Points2D, labels=text_of(text))
                self._rec.log(f"{frame_of(label)}/{side}", row)

    def _draw_drive(self, label: str, moment: Moment) -> None:
        path, image = entities.camera_of(label), moment.frame.image
        if label not in self._named:
            self._named.add(label)
            draw_name(self._rec, path, f"{self._short[label]}: {SEES}", image.shape[1], TRUTH)
        draw_jpeg(self._rec, path, jpeg(image))
        if moment.truth is not None:
            self._truths[label].draw(self._rec, moment.truth)

    def _dots(self, cloud: Belief) -> LogRow:
        some = by_weight(cloud.weights, DOTS_A_CLOUD)
        places = self._scale.screen(cloud.poses[some, :2] + cloud.origin)
        return row_of(rr.Points2D, positions=points_of(places))


def _with_last(clouds: list[F64], last: list[F64], truths: Sequence[F64]) -> list[F64]:
    """Return clouds (K, 2) with those of the step before, unless these make a close-up much larger."""
    both = [*clouds, *last]
    grows = seen_whole(both, truths)[1] / seen_whole(clouds, truths)[1]
    return both if grows <= GROWS else clouds


def by_weight(weights: F64, count: int) -> I32:
    """Return at most `count` particles of weights (N,) in proportion to their weight, without randomness."""
    ends = np.cumsum(weights)
    chosen = np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1])
    return np.asarray(chosen[np.diff(chosen, prepend=-1) > 0], np.int32)  # each once, in order


def side_views(run: RunView, scene: Scene) -> list[rrb.Spatial2DView]:
    """Show the cloud of a run before and after a phase, close up; of a recorded run it alone."""
    paths, frame = run.paths, frame_of(run.label)
    ground = [BARE_FLOORS, WALLS, *frame_marks(frame)]
    cloud = entities.cloud_of(run.label) if run.is_recorded else paths.inside(AFTER)
    contents = [*ground, cloud, paths.estimate, paths.ellipses, gap_of(run.label), f"{frame}/{AFTER}"]
    contents += [] if run.is_recorded else [paths.inside("best")]
    overrides: Overrides = {paths.estimate: rr.Points2D.from_fields()}  # its arrow would be too long
    if scene.has_truth:
        truth = entities.truth_of(run.label, run.own_drive)
        contents.append(truth)
        overrides[truth] = rr.Points2D.from_fields(labels=["truth"], show_labels=True)
    after = plane_view("After", contents, CLOSEUP, overrides, origin=frame)
    if run.is_recorded:
        return [after]
    contents = [*ground, f"{paths.inside(BEFORE)}/**", f"{frame}/{BEFORE}"]
    truth_alone: Overrides = {f"{paths.inside(BEFORE)}/truth": rr.Points2D.from_fields()}
    return [plane_view("Before", contents, CLOSEUP, truth_alone, origin=frame), after]


def step_words_view() -> rrb.TextDocumentView:
    """Show who is closer at this step, or what a phase did."""
    return rrb.TextDocumentView(name="This step", origin=entities.TEXT)


def why_view() -> rrb.TextDocumentView:
    """Show what explains it."""
    return rrb.TextDocumentView(name="Why", origin=entities.WHY)


def drive_words_view() -> rrb.TextDocumentView:
    """Show how the runs compare over the drive."""
    return rrb.TextDocumentView(name="Whole drive", origin=entities.RESULT)
