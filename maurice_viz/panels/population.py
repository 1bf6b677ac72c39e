"""What the cloud is made of: its headings, its modes over time, and the ancestors of its survivors."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from maurice_mcl.scoring.modes import Ancestry, TrackedMode
from maurice_mcl.values.arrays import F32, F64, U8
from maurice_mcl.values.records import Belief, StepRecord

from .. import style
from ..drawing.arrow import Row, blob_of, colors_of, points_of, row_of, scalars, strips_of, texts_of
from ..drawing.canvas import Extent, put_text, text_size
from ..drawing.indexed import IndexedColors
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import Scale, heading_vector
from .belief import copies_of
from .panel import Panel, StepUpdate, place_drawing, set_phase, set_phase_only
from .views import plane_view, plot

# Headings: a histogram of all directions at once, area by weight.

SECTORS = 36  # of ten degrees
RIM_RADIUS = 1.0  # radius of the rim; a sector's length is the root of its share, so that its area is
ROSE_REACH = 1.42  # from the middle to the edge of the view, with the labels
RIM_PX = 160.0  # radius of the rim in its drawing
ROSE_TEXT_PX = 20.0
DIRECTIONS = ((0, "0"), (90, "90"), (180, "180"), (270, "270"))


class HeadingsPanel(Panel):
    """Draws the cloud's headings by weight, and the arrows of estimate and truth."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        radius = rr.components.Radius.ui_points
        path, drawing = self._paths.headings, rim(self._scene.has_truth, self._run.color)
        place_drawing(rec, f"{path}/rim", drawing, (-ROSE_REACH, -ROSE_REACH), 1 / RIM_PX, -10.0)
        shape = rr.LineStrips2D.from_fields(colors=[style.HEADINGS], radii=radius(1.25), draw_order=1.0)
        arrows = rr.Arrows2D.from_fields(draw_order=2.0, radii=radius([1.75, 2.5]))
        rec.log(path, shape, arrows, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, truth = update.record, update.moment.truth
        known = [] if truth is None else [(truth, style.TRUTH)]
        if update.whole:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            self._log(rec, record.predicted, known)
        set_phase(rec, update.moment, Phase.WEIGHT)
        self._log(rec, record.weighted, [(record.estimate.pose, self._run.color), *known])

    def _log(self, rec: rr.RecordingStream, cloud: Belief, poses: list[tuple[F64, style.RGB]]) -> None:
        vectors = [heading_vector(float(pose[2]), RIM_RADIUS)[0] for pose, _ in poses]
        arrows = row_of(
            rr.Arrows2D,
            origins=points_of(np.zeros((len(poses), 2))),
            vectors=points_of(vectors),
            colors=colors_of([style.packed(color) for _, color in poses]),
        )
        shape = row_of(rr.LineStrips2D, strips=strips_of([outline(cloud)]))
        rec.log(self._paths.headings, shape, arrows)


def rim(has_truth: bool, color: style.RGB) -> U8:
    """Draw the rim (H, W, 3) RGB with its spokes and labels, and the key, an estimate's color in it."""
    size = round(2 * ROSE_REACH * RIM_PX)
    image = np.full((size, size, 3), style.GROUND, np.uint8)
    middle = np.array([size / 2, size / 2])
    cv2.circle(image, (size // 2, size // 2), round(RIM_RADIUS * RIM_PX), style.RULER, 2, cv2.LINE_AA)
    for turn in np.arange(8) * np.pi / 4:
        end = middle + heading_vector(float(turn), RIM_RADIUS * RIM_PX)[0]
        cv2.line(image, (size // 2, size // 2), (round(end[0]), round(end[1])), style.RULER, 1, cv2.LINE_AA)
    for deg, text in DIRECTIONS:
        width, height = text_size(text, ROSE_TEXT_PX)
        x, y = middle + heading_vector(np.radians(deg), 1.2 * RIM_PX)[0]
        put_text(image, text, x - width / 2, y + height / 2, ROSE_TEXT_PX, style.PALE)
    items = [("cloud", style.HEADINGS), ("estimate", color), ("truth", style.TRUTH)]
    items = items if has_truth else items[:2]
    for row, (text, shade) in enumerate(items):
        base = 1.7 * ROSE_TEXT_PX * (row + 1)
        cv2.circle(image, (12, round(base - ROSE_TEXT_PX / 2)), 7, shade, -1, cv2.LINE_AA)
        put_text(image, text, 26, base, ROSE_TEXT_PX, shade)
    return image


def shares(belief: Belief) -> F64:
    """Return the weight (SECTORS,) in each sector of headings, the first from 0 to 10 degrees."""
    turn = belief.poses[:, 2] % np.float32(2 * np.pi) * np.float32(SECTORS / (2 * np.pi))
    sector = np.minimum(turn.astype(np.int64), SECTORS - 1)
    return np.asarray(np.bincount(sector, belief.weights, SECTORS))


def outline(belief: Belief) -> F32:
    """Return the outline (3 SECTORS, 2) as drawn, y down; the longest sector reaches the rim."""
    weights = shares(belief)
    reach = np.sqrt(weights / weights.max())
    radius = np.column_stack([np.zeros(SECTORS), reach, reach]).ravel()
    points = radius[:, None] * _ALONG
    return np.concatenate([points, points[:1]]).astype(np.float32)


_EDGES = np.arange(SECTORS + 1) * (2 * np.pi / SECTORS)
_ANGLES = np.column_stack([_EDGES[:-1], _EDGES[:-1], _EDGES[1:]]).ravel()
_ALONG = np.column_stack([np.cos(_ANGLES), -np.sin(_ANGLES)])  # of each corner of the outline


def headings_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show the headings of the cloud."""
    extent = Extent(-ROSE_REACH, ROSE_REACH, -ROSE_REACH, ROSE_REACH)
    return plane_view("Headings (deg)", f"{paths.headings}/**", extent)


# Modes over time: each keeps its color. They are stacked by age, the oldest at the bottom, so that a band
# does not jump when another overtakes it. Weight in no mode stays empty at the top.

UPDATES_SEEN = 60  # updates that are shown, one column each
BAND_ROWS = 24  # rows for the whole weight
TIME_LABELS = (
    (0.0, f"{UPDATES_SEEN} steps ago"),
    (UPDATES_SEEN / 2, f"{UPDATES_SEEN // 2}"),
    (UPDATES_SEEN, "now"),
)
MODES_MARGIN = (9.0, 4.0, 2.0, 5.5)  # left, right, top, bottom of the drawing, in columns
FRAME_PX = 16  # pixels a column of the frame's drawing
MODES_TEXT_PX = 29.0
RING_PT = 1.0
CIRCLE_ANGLES = np.linspace(0, 2 * np.pi, 49)
LEAST_RINGED = 0.1  # share of the weight; smaller modes are in the bands only
BANDS = IndexedColors()
NO_MODE = BANDS.flat(style.EMPTY)
MODE_INKS = {color: BANDS.flat(color) for color in style.MODE_COLORS}
CIRCLE = np.column_stack([np.cos(CIRCLE_ANGLES), np.sin(CIRCLE_ANGLES)])


class ModesPanel(Panel):
    """Draws the bands of one run, and a ring of the same color around each mode on the map."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._bands = np.full((BAND_ROWS, UPDATES_SEEN), NO_MODE, np.uint8)  # the latest update at the right

    def prepare(self, rec: rr.RecordingStream) -> None:
        left, _, top, _ = MODES_MARGIN
        place_drawing(rec, f"{self._paths.modes}/frame", frame(), (-left, -top), 1 / FRAME_PX, -20.0)
        kind = rr.EncodedImage.from_fields(media_type="image/png", draw_order=-10.0)
        rec.log(f"{self._paths.modes}/bands", kind, static=True)
        width = rr.components.Radius.ui_points(RING_PT)
        rings = rr.LineStrips2D.from_fields(radii=width, draw_order=44.0, show_labels=True)
        rec.log(self._paths.mode_rings, rings, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        self._bands[:, :-1] = self._bands[:, 1:]
        self._bands[:, -1] = column(update.modes)
        if update.whole:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            rec.log(self._paths.mode_rings, rings_of((), self._scale))
        set_phase(rec, update.moment, Phase.WEIGHT)
        rec.log(self._paths.mode_rings, rings_of(update.modes, self._scale))
        picture = row_of(rr.EncodedImage, blob=blob_of(BANDS.png(self._bands)))
        rec.log(f"{self._paths.modes}/bands", picture)


def rings_of(modes: Sequence[TrackedMode], scale: Scale) -> Row:
    """Return a ring with its share around every mode of a tenth of the weight or more, if there are two."""
    seen = [mode for mode in modes if mode.estimate.mass >= LEAST_RINGED]
    seen = seen if len(seen) > 1 else []
    reach_m = [mode.estimate.radii.cluster_m * np.sqrt(mode.estimate.mass) for mode in seen]
    rings = [mode.estimate.pose[:2] + reach * CIRCLE for mode, reach in zip(seen, reach_m, strict=True)]
    return row_of(
        rr.LineStrips2D,
        strips=strips_of([scale.screen(ring) for ring in rings]),
        colors=colors_of([style.packed(style.mode_color(mode.identity)) for mode in seen]),
        labels=texts_of([f"{100 * mode.estimate.mass:.0f} %" for mode in seen]),
    )


def frame() -> U8:
    """Draw the frame (H, W, 3) RGB with labels below and beside it."""
    left, right, top, bottom = MODES_MARGIN
    size = round((top + BAND_ROWS + bottom) * FRAME_PX), round((left + UPDATES_SEEN + right) * FRAME_PX)
    image = np.full((*size, 3), style.GROUND, np.uint8)
    corner = np.array([left, top]) * FRAME_PX
    far = corner + np.array([UPDATES_SEEN, BAND_ROWS]) * FRAME_PX
    image[round(corner[1]) - 2 : round(far[1]) + 2, round(corner[0]) - 2 : round(far[0]) + 2] = style.RULER
    for column, text in TIME_LABELS:
        at = corner[0] + column * FRAME_PX - text_size(text, MODES_TEXT_PX)[0] / 2
        put_text(image, text, max(at, 4), far[1] + 2 * MODES_TEXT_PX, MODES_TEXT_PX, style.PALE)
    for row, text in ((0.0, "100 %"), (BAND_ROWS / 2, "50 %"), (float(BAND_ROWS), "0 %")):
        width, height = text_size(text, MODES_TEXT_PX)
        put_text(
            image,
            text,
            corner[0] - width - 12,
            corner[1] + row * FRAME_PX + height / 2,
            MODES_TEXT_PX,
            style.PALE,
        )
    return image


def column(modes: Sequence[TrackedMode]) -> U8:
    """Draw one update's part of the bands (ROWS,), in colors of `BANDS`."""
    image, mass = np.full(BAND_ROWS, NO_MODE, np.uint8), 0.0
    for mode in sorted(modes, key=lambda mode: mode.identity):
        base, mass = mass, mass + mode.estimate.mass
        rows = slice(BAND_ROWS - round(mass * BAND_ROWS), BAND_ROWS - round(base * BAND_ROWS))
        image[rows] = MODE_INKS[style.mode_color(mode.identity)]
    return image


def modes_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show how the weight was shared among the modes of the last updates."""
    left, right, top, bottom = MODES_MARGIN
    extent = Extent(-left, UPDATES_SEEN + right, -top, BAND_ROWS + bottom)
    return plane_view("Modes: share of the weight (%), rings on the map", f"{paths.modes}/**", extent)


# Ancestry: a copy stands where its parent stood, so lines from parents to children are drawn where they can
# be seen: in the phase `predict` to where each copy has moved, in `resample` along ancestors of survivors.

MOST_MOVES = 150  # lines of moved particles; more cannot be distinguished
MOST_FAMILIES = 15
LINE_PT = 0.6  # radius in points of the screen
SURVIVORS = "survivors"
ANCESTORS = "ancestors"

_NO_LINES = row_of(rr.LineStrips2D, strips=strips_of([]))


class AncestryPanel(Panel):
    """Draws the lines of one run, and logs the shares of survivors and ancestors."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._ancestry = Ancestry()
        self._before: Belief | None = None  # what the last update passed on

    def prepare(self, rec: rr.RecordingStream) -> None:
        radius = rr.components.Radius.ui_points
        for path, color, order in (
            (self._paths.moves, style.MOVED, 15.0),
            (self._paths.families, style.FAMILY, 16.0),
        ):
            lines = rr.LineStrips2D.from_fields(colors=[color], radii=radius(LINE_PT), draw_order=order)
            rec.log(path, lines, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log moves and ancestors in the phases in which they can be seen, and the shares at the end."""
        if update.whole:
            self._draw_moves(rec, update)
        record = update.record
        self._ancestry.see(record)
        self._before = record.belief
        if update.whole and record.parents is not None:
            self._draw_ancestors(rec, update)
        if update.whole and update.is_reseeded:  # so that particles drawn anew can be seen
            set_phase_only(rec, update.moment, Phase.RESEED)
            rec.log(self._paths.families, _NO_LINES)
        set_phase(rec, update.moment, Phase.ESTIMATE)
        rec.log(self._paths.trace(SURVIVORS), scalars(survivors(record)))
        rec.log(self._paths.trace(ANCESTORS), scalars(self._ancestry.distinct() / record.belief.size))

    def clear(self, rec: rr.RecordingStream) -> None:
        for path in (self._paths.moves, self._paths.families):
            rec.log(path, rr.Clear(recursive=True))

    def _draw_moves(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log lines from where some particles were to where the motion model put them, in one phase."""
        before, after = self._before, update.record.predicted
        set_phase_only(rec, update.moment, Phase.PREDICT)
        rec.log(self._paths.families, _NO_LINES)
        if before is not None and before.size == after.size:  # else particles have no single parent
            some = spread_over(after.size, MOST_MOVES)
            ends = np.stack([self._scale.screen(b.poses[some, :2] + b.origin) for b in (before, after)], 1)
            rec.log(self._paths.moves, row_of(rr.LineStrips2D, strips=strips_of(ends)))
        set_phase_only(rec, update.moment, Phase.MEASURE)
        rec.log(self._paths.moves, _NO_LINES)

    def _draw_ancestors(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        set_phase_only(rec, update.moment, Phase.RESAMPLE)
        lines = [self._scale.screen(line) for line in self._ancestry.lines(MOST_FAMILIES) if len(line) > 1]
        rec.log(self._paths.families, row_of(rr.LineStrips2D, strips=strips_of(lines)))


def spread_over(count: int, most: int) -> NDArray[np.int64]:
    """Return at most `most` indices, spread evenly over `count` items."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.int64) if count else np.zeros(0, int)


def survivors(record: StepRecord) -> float:
    """Return the share of the weighted particles that left a copy; 1 where there was no resampling."""
    return float((copies_of(record.parents, record.weighted.size) > 0).mean())


def ancestry_plot(paths: RunPaths) -> rrb.TimeSeriesView:
    """Plot the shares of particles that survive, and of ancestors from which the cloud descends."""
    lines = [paths.trace(SURVIVORS), paths.trace(ANCESTORS)]
    return plot("Survivors violet, ancestors 10 steps back green (share)", lines, top=1.1)
