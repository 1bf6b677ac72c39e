"""Inside one update: the cloud before and after each phase, close up at one scale, and a strip of phases.

A dot's area is its weight, or the copies that it leaves, so that before and after can be compared. At most
`DOTS` particles are drawn, evenly spread over all, with the heaviest: two full clouds would take twice the
bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from maurice_mcl.values import F32, F64, I64, U8, U32, Belief, Bool, StepRecord

from ..drawing.arrow import (
    LogRow,
    colors_of,
    places_of,
    points_of,
    row_of,
    strips_of,
    text_of,
    texts_of,
    ui_points_of,
)
from ..drawing.canvas import Extent, blank, long_side
from ..entities import BARE_FLOORS, PHASES, WALLS, Phase, RunPaths
from ..scene import RunView, Scene
from ..style import (
    CLOUD,
    DEAD,
    EMPTY,
    FRESH,
    GROUND,
    PALE,
    PHASE_MARK,
    RANK,
    RGB,
    SETTLED,
    TRUTH,
    Order,
    font_safe,
    heading_vector,
    packed,
)
from ..text.phases import DOES, LIGHT, NO_BEST, of_scans, phase_words, whole_step
from .belief import copies_of, ellipse_of, frame_marks, positions
from .panel import MARKDOWN, Panel, StepUpdate, place_drawing, set_phase, set_phase_only, set_step_only
from .views import plane_view

DOTS = 700  # drawn of a cloud
HEAVIEST = 100  # of them, whatever their number
DOT = 1.3  # radius of a dot of the average weight, in points of the screen
LEAST, MOST, STEPS = 0.7, 15.0, 8  # radii, and steps of a radius in a point: few values compress well
DEAD_DOT = 0.9
FRESH_DOT = 2.2
BEST = 5  # references that are marked
BEFORE, AFTER = "before", "after"
CAPTION_AT = (0.0, -1.0)  # in the frame of the close-up
ARROW, ARROW_OF_CLOUD = 0.03, 0.15  # of the arena's long side, and of the cloud, at most: the truth's heading

WERE, MOVED, MATCHES = "where the dots were", "moved by odometry", "yellow: best 5 matches, where in view"
UNSEEN, UNWEIGHED, HEAVY = "nothing seen yet", "dots not weighed yet", "large is heavy"
COPIED, FRESH_ONES = "large has many copies, red none", "pink is new"
ANSWER, UNCHANGED = "disk and oval: the answer", "unchanged"
WHOLE_STEP = (MOVED, f"{HEAVY}; {ANSWER}")  # on timelines without phases
PARTLY = "This step is drawn in part only: choose another one, or draw all with `--detail full`."


@dataclass(frozen=True, slots=True, eq=False)
class Dots:
    """A cloud as it is drawn, small dots first."""

    places: F32  # (K, 2) as drawn
    radii: F32  # (K,) points of the screen
    colors: U32  # (K,) packed

    def looks(self) -> LogRow:
        """Return sizes and colors to log, of dots whose places are known."""
        return row_of(rr.Points2D, radii=ui_points_of(self.radii), colors=colors_of(self.colors))

    def row(self) -> LogRow:
        """Return all to log."""
        return LogRow(_points(self.places) | self.looks())

    @property
    def settled(self) -> Dots:
        """Those that are alive, all in one color."""
        alive = self.colors != packed(DEAD)
        return Dots(self.places[alive], self.radii[alive], _all(CLOUD, int(alive.sum())))


def radii_of(times: F64, least: float = LEAST) -> F32:
    """Return radii (K,) whose squares are so many times the average, within limits."""
    radii = np.clip(DOT * np.sqrt(times), least, MOST)
    return np.asarray(np.rint(radii * STEPS) / STEPS, np.float32)


def some_of(weights: F64) -> I64:
    """Return numbers (K,) of at most `DOTS` particles, the heaviest among them, lightest first."""
    size = len(weights)
    some = np.arange(size)
    if size > DOTS:
        chosen = _spread_evenly(size).copy()
        chosen[np.argpartition(weights, -HEAVIEST)[-HEAVIEST:]] = True
        some = np.flatnonzero(chosen)
    return np.asarray(some[np.argsort(weights[some], kind="stable")], np.int64)


@lru_cache(maxsize=4)
def _spread_evenly(size: int) -> Bool:
    """Return which particles (N,) are drawn whatever their weight."""
    chosen = np.zeros(size, np.bool_)
    chosen[np.linspace(0, size - 1, DOTS - HEAVIEST).round().astype(np.int64)] = True
    return chosen


class InsidePanel(Panel):
    """Draws the cloud before and after each phase, the answer, and two sentences."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._before, self._after = run.paths.inside(BEFORE), run.paths.inside(AFTER)
        self._best, self._answer = run.paths.inside("best"), run.paths.inside("answer")
        self._kept: Dots | None = None  # what the last update passed on
        self._truth = NO_TRUTH  # of the last update
        self._arrow = ARROW * long_side(scene.library.arena, scene.scale)
        self._captions: dict[tuple[str, bool], str] = {}  # the last of each side, with and without phases

    def prepare(self, rec: rr.RecordingStream) -> None:
        points, color = rr.components.Radius.ui_points, self._run.color
        for side in (self._before, self._after):
            rec.log(side, rr.Points2D.from_fields(draw_order=Order.CLOUD), static=True)
            name = rr.Points2D.from_fields(
                colors=[TRUTH], radii=points(6.0), labels=["truth"], show_labels=True, draw_order=Order.TRUTH
            )
            arrow = rr.Arrows2D.from_fields(colors=[TRUTH], radii=points(1.75), draw_order=Order.TRUTH)
            rec.log(f"{side}/truth", name, arrow, static=True)
        for side in (BEFORE, AFTER):
            caption = rr.Points2D.from_fields(
                positions=[CAPTION_AT], colors=[PALE], radii=points(0.0), show_labels=True
            )
            rec.log(caption_of(self._paths, side), caption, static=True)
        marks = Order.MARKS
        best = rr.Points2D.from_fields(colors=[RANK], radii=points(4.0), show_labels=True, draw_order=marks)
        rec.log(self._best, best, static=True)
        answer = rr.Points2D.from_fields(colors=[color], radii=points(6.0), draw_order=Order.ESTIMATE)
        oval = rr.LineStrips2D.from_fields(
            colors=[color, TRUTH], radii=points([1.5, 0.8]), draw_order=Order.OVALS
        )
        rec.log(self._answer, answer, oval, static=True)
        words = rr.TextDocument.from_fields(media_type=MARKDOWN)
        rec.log(self._paths.inside("words"), words, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        if not update.whole:
            return
        record = update.record
        some = some_of(record.weighted.weights)
        places = self._scale.screen(record.predicted.poses[some, :2] + record.predicted.origin)
        moved, weighed = (_weighed(belief, some, places) for belief in (record.predicted, record.weighted))
        copied = weighed if record.parents is None else _copied(record, some, places)
        particles = self._reseeded(record, copied) if update.is_reseeded else copied
        self._draw_moved(rec, update, moved.row(), places)
        set_phase(rec, update.moment, Phase.WEIGHT)
        weights, copies = weighed.looks(), copied.looks()
        rec.log(self._after, weights)
        self._say(rec, update, Phase.WEIGHT, UNWEIGHED, HEAVY)
        rec.log(self._best, _NO_POINTS)
        is_copied = record.parents is not None
        self._say(rec, update, Phase.RESAMPLE, HEAVY, COPIED if is_copied else UNCHANGED)
        rec.log(self._before, weights)
        rec.log(self._after, copies)
        kind = COPIED if is_copied else HEAVY
        self._say(rec, update, Phase.RESEED, kind, FRESH_ONES if update.is_reseeded else UNCHANGED)
        rec.log(self._before, copies)
        if update.is_reseeded:
            rec.log(self._after, particles.row())
        set_phase(rec, update.moment, Phase.ESTIMATE)
        self._draw_answer(rec, update)
        self._say(rec, update, Phase.ESTIMATE, FRESH_ONES if update.is_reseeded else kind, ANSWER)
        if update.is_reseeded:
            rec.log(self._before, particles.row())
        set_step_only(rec, update.moment)
        self._log_words(rec, whole_step(update.moment, record, self._scale), WHOLE_STEP, with_phases=False)
        self._kept = particles.settled

    def clear(self, rec: rr.RecordingStream) -> None:
        """Empty everything; the next full update has no cloud before it."""
        self._kept, self._truth = None, NO_TRUTH
        for path in (self._before, self._after, self._best):
            rec.log(path, _NO_POINTS)
        rec.log(self._answer, _NO_POINTS, _NO_LINES)
        for side in (self._before, self._after):
            rec.log(f"{side}/truth", NO_TRUTH)
        self._captions.clear()
        self._log_words(rec, PARTLY, ("not drawn", "not drawn"))

    def _draw_moved(self, rec: rr.RecordingStream, update: StepUpdate, moved: LogRow, places: F32) -> None:
        last, self._truth = self._truth, self._truth_row(update.moment.truth, places)
        set_phase(rec, update.moment, Phase.PREDICT)
        rec.log(self._after, moved)
        rec.log(f"{self._after}/truth", self._truth)
        self._say(rec, update, Phase.PREDICT, WERE, MOVED)
        rec.log(self._answer, _NO_POINTS, _NO_LINES)
        rec.log(self._before, _NO_POINTS if self._kept is None else self._kept.row())
        rec.log(f"{self._before}/truth", last)
        set_phase(rec, update.moment, Phase.MEASURE)
        rec.log(self._before, moved)
        rec.log(f"{self._before}/truth", self._truth)
        best = self._best_poses(update.record)
        self._say(
            rec, update, Phase.MEASURE, UNSEEN, MATCHES if len(best) else NO_BEST, next(iter(best), None)
        )
        rec.log(self._best, _ranked(self._scale.screen(best[:, :2])))

    def _best_poses(self, record: StepRecord) -> F64:
        """Return where the best references were taken (K, 3); none in a saved run without its library."""
        comparison = record.sighting.comparison
        compared = len(comparison.quality) == self._library.size
        return self._library.poses[comparison.best(BEST) if compared else np.zeros(0, np.int32)]

    def _truth_row(self, truth: F64 | None, places: F32) -> LogRow:
        """Return the true pose (3,), with an arrow shorter than the cloud (K, 2), or nothing."""
        if truth is None:
            return NO_TRUTH
        at = self._scale.screen(truth[None, :2])
        length = min(self._arrow, ARROW_OF_CLOUD * float(np.ptp(places, axis=0).max()))
        return LogRow(_points(at) | _arrow(at, heading_vector(float(truth[2]), length)))

    def _draw_answer(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the estimate with the oval of its group, and a line to the truth."""
        estimate, truth, cloud = update.record.estimate, update.moment.truth, update.record.weighted
        at = self._scale.screen(estimate.pose[None, :2])
        x, y = (estimate.pose[:2] - cloud.origin).astype(np.float32)
        off = np.square(cloud.poses[:, 0] - x) + np.square(cloud.poses[:, 1] - y)
        lines = [ellipse_of(cloud, self._scale, off <= estimate.radii.cluster_m**2)]
        if truth is not None:
            lines.append(np.concatenate([at, self._scale.screen(truth[None, :2])]))
        rec.log(self._answer, _points(at), row_of(rr.LineStrips2D, strips=strips_of(lines)))

    def _say(
        self,
        rec: rr.RecordingStream,
        update: StepUpdate,
        phase: Phase,
        before: str,
        after: str,
        taken_at: F64 | None = None,
    ) -> None:
        """Log words and captions of a phase; the time stays there, on the timeline `phase` alone."""
        set_phase_only(rec, update.moment, phase)
        words = phase_words(update.moment, update.record, phase, self._scale, self._run.draws_new, taken_at)
        self._log_words(rec, words, (before, after))

    def _log_words(
        self, rec: rr.RecordingStream, words: str, captions: tuple[str, str], with_phases: bool = True
    ) -> None:
        """Log words, and the captions that differ from the last ones."""
        words = of_scans(words) if self._run.sees_alone else words
        text = text_of(f"#### {font_safe(words)}")
        rec.log(self._paths.inside("words"), row_of(rr.TextDocument, text=text))
        for side, caption in zip((BEFORE, AFTER), captions, strict=True):
            if self._captions.get((side, with_phases)) != caption:
                self._captions[side, with_phases] = caption
                label = text_of(f"{side}: {caption}")
                rec.log(caption_of(self._paths, side), row_of(rr.Points2D, labels=label))

    def _reseeded(self, record: StepRecord, copied: Dots) -> Dots:
        """Return what the next update begins with: of those before only the survivors, and the new ones."""
        places = positions(record.belief, self._scale)
        if record.injected is None:  # all of them were moved
            every = np.linspace(0, len(places) - 1, min(len(places), DOTS)).round().astype(np.int64)
            return Dots(places[every], np.full(len(every), DOT, np.float32), _all(CLOUD, len(every)))
        old, new = copied.settled, places[record.injected]
        colors = np.append(old.colors, _all(FRESH, len(new)))
        radii = np.append(old.radii, np.full(len(new), FRESH_DOT, np.float32))
        return Dots(np.concatenate([old.places, new]), radii, colors)


def _weighed(belief: Belief, some: I64, places: F32) -> Dots:
    """Return dots as large as they are heavy; those of little weight are gray."""
    times = belief.weights[some] * belief.size
    colors = np.where(times < LIGHT, np.uint32(packed(SETTLED)), np.uint32(packed(CLOUD)))
    return Dots(places, radii_of(times), colors)


def _copied(record: StepRecord, some: I64, places: F32) -> Dots:
    """Return dots as large as they have copies; those without one are small and red."""
    copies = copies_of(record.parents, record.weighted.size)[some]
    radii = np.where(copies == 0, np.float32(DEAD_DOT), radii_of(copies.astype(np.float64)))
    colors = np.where(copies == 0, np.uint32(packed(DEAD)), np.uint32(packed(CLOUD)))
    return Dots(places, radii, colors)


def _ranked(places: F32) -> LogRow:
    """Return places (K, 2) of the best, each once, with the ranks that are there."""
    ranks: dict[tuple[float, ...], list[str]] = {}
    for rank, place in enumerate(places.tolist(), 1):
        ranks.setdefault(tuple(place), []).append(str(rank))
    labels = texts_of([", ".join(there) for there in ranks.values()])
    return row_of(rr.Points2D, positions=points_of([*ranks]), labels=labels)


def _all(color: RGB, count: int) -> U32:
    return np.full(count, packed(color), np.uint32)


def _points(places: F32) -> LogRow:
    return row_of(rr.Points2D, positions=points_of(places))


def _arrow(origins: ArrayLike, vectors: ArrayLike) -> LogRow:
    return row_of(rr.Arrows2D, origins=points_of(origins), vectors=points_of(vectors))


_NO_POINTS = _points(np.zeros((0, 2), np.float32))
_NO_LINES = row_of(rr.LineStrips2D, strips=strips_of([]))
NO_TRUTH = LogRow(_NO_POINTS | _arrow(np.zeros((0, 2)), []))


def caption_of(paths: RunPaths, side: str) -> str:
    """Return where the caption of a close-up is, in the close-up's frame."""
    return f"{paths.closeup}/{side}"


def side_view(paths: RunPaths, side: str, on_map: Sequence[str] = ()) -> rrb.Spatial2DView:
    """Show the cloud before or after a phase, close up; after it also what is `on_map`, such as a scan."""
    contents = [BARE_FLOORS, WALLS, f"{paths.inside(side)}/**", caption_of(paths, side)]
    contents += frame_marks(paths.closeup)
    contents += [paths.inside("best"), paths.inside("answer"), *on_map] if side == AFTER else []
    return plane_view(side.capitalize(), contents, Extent(-1, 1, -1, 1), origin=paths.closeup)


def inside_words_view(paths: RunPaths) -> rrb.TextDocumentView:
    """Show two sentences about the phase."""
    return rrb.TextDocumentView(name="What this phase did", origin=paths.inside("words"))


# The strip of the six phases: the mark moves to the present one; on the other timelines there is none.

BOX_PX, STRIP_PX = 213, 56  # of each phase, as large as on a screen 1280 wide
GAP_PX = 4
NAME_TOP, DOES_TOP = 2, 24  # of the two labels, which hang a little below their points
NO_MARK = -10_000.0


class PhasesPanel(Panel):
    """Draws the strip of phases, once for all runs."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        box, is_laser = (STRIP_PX - 2 * GAP_PX, BOX_PX - 2 * GAP_PX), self._run.sees_alone
        boxes = np.concatenate([_framed(blank(*box, EMPTY)) for _ in Phase], axis=1)
        place_drawing(rec, f"{PHASES}/boxes", boxes, (0, 0), 1.0, Order.GROUND)
        mark = blank(*box, PHASE_MARK)
        place_drawing(rec, f"{PHASES}/mark/box", mark, (GAP_PX, GAP_PX), 1.0, Order.OVERLAY)
        for name, top, words in (
            ("names", NAME_TOP, [f"{phase + 1} {phase.name.lower()}" for phase in Phase]),
            ("does", DOES_TOP, [of_scans(DOES[phase]) if is_laser else DOES[phase] for phase in Phase]),
        ):
            at = [(BOX_PX * (phase + 0.5), top) for phase in Phase]
            color = TRUTH if name == "names" else PALE
            labels = rr.Points2D(
                at, radii=rr.components.Radius.ui_points(0.0), colors=[color], labels=words, show_labels=True
            )
            rec.log(f"{PHASES}/{name}", labels, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        set_step_only(rec, update.moment)
        if update.is_first:
            self._mark(rec, NO_MARK)
        for phase in Phase if update.whole else ():
            set_phase_only(rec, update.moment, phase)
            self._mark(rec, BOX_PX * float(phase))

    def clear(self, rec: rr.RecordingStream) -> None:
        self._mark(rec, NO_MARK)

    def _mark(self, rec: rr.RecordingStream, left: float) -> None:
        rec.log(f"{PHASES}/mark", row_of(rr.Transform3D, translation=places_of([left, 0.0, 0.0])))


def _framed(box: U8) -> U8:
    """Return a box (H, W, 3) with the gap around it."""
    framed = blank(STRIP_PX, BOX_PX, GROUND)
    framed[GAP_PX:-GAP_PX, GAP_PX:-GAP_PX] = box
    return framed


def phases_view() -> rrb.Spatial2DView:
    """Show the six phases, and which is the present one."""
    extent = Extent(0, len(Phase) * BOX_PX, 0, STRIP_PX)
    return plane_view("Phases", f"{PHASES}/**", extent)
