"""What the cloud is made of: its headings, its modes, how few particles it descends from, its weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.scoring.modes import TrackedMode
from maurice_mcl.values import F32, F64, U8, Belief

from .. import style
from ..drawing.arrow import LogRow, blob_of, colors_of, points_of, row_of, strips_of, texts_of
from ..drawing.canvas import Extent, put_text, text_size
from ..drawing.indexed import IndexedColors
from ..entities import Phase, RunPaths
from ..scene import Scene
from ..style import Order, Scale, heading_vector
from .belief import copies_of
from .panel import Panel, StepUpdate, joined_labels, place_drawing, set_phase, set_phase_only
from .views import plane_view

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
        place_drawing(rec, f"{path}/rim", drawing, (-ROSE_REACH, -ROSE_REACH), 1 / RIM_PX, Order.GROUND)
        shape = rr.LineStrips2D.from_fields(
            colors=[style.HEADINGS], radii=radius(1.25), draw_order=Order.MARKS
        )
        arrows = rr.Arrows2D.from_fields(draw_order=Order.ESTIMATE, radii=radius([1.75, 2.5]))
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
    heading, whole = belief.poses[:, 2], np.float32(2 * np.pi)
    turn = np.asarray(heading + (heading < 0) * whole, np.float32)  # the remainder, ten times sooner
    if not (turn.min() >= 0 and turn.max() <= whole):  # of a saved run
        turn = heading % whole
    sector = (turn * np.float32(SECTORS / (2 * np.pi))).astype(np.intp)
    return np.asarray(np.bincount(np.minimum(sector, SECTORS - 1, out=sector), belief.weights, SECTORS))


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


# Modes: a ring around each on the map, in a color that it keeps.

RING_PT = 1.0
AROUND = np.linspace(0, 2 * np.pi, 49)
MODE_ROOM = 0.07  # of the arena's long side: labels of modes that are nearer together overlap
LEAST_RINGED = 0.1  # share of the weight; smaller modes have no ring
CIRCLE = np.column_stack([np.cos(AROUND), np.sin(AROUND)])


class ModesPanel(Panel):
    """Draws a ring around each mode of one run on the map."""

    _has_rings = False  # at the last update

    def prepare(self, rec: rr.RecordingStream) -> None:
        width = rr.components.Radius.ui_points(RING_PT)
        rings = rr.LineStrips2D.from_fields(radii=width, draw_order=Order.OVALS, show_labels=True)
        rec.log(self._paths.mode_rings, rings, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        had, self._has_rings = self._has_rings, len(ringed(update.modes)) > 0
        if had and update.whole:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            rec.log(self._paths.mode_rings, rings_of((), self._scale, 0.0))
        if had or self._has_rings:
            set_phase(rec, update.moment, Phase.WEIGHT)
            rec.log(self._paths.mode_rings, rings_of(update.modes, self._scale, mode_room(self._scene)))


def mode_room(scene: Scene) -> float:
    """Return how far apart, on the map, the labels of modes must be to be read."""
    return MODE_ROOM * scene.scale.length(max(scene.arena.size_m))


def ringed(modes: Sequence[TrackedMode]) -> list[TrackedMode]:
    """Return the modes of a tenth of the weight or more, if there are two."""
    seen = [mode for mode in modes if mode.estimate.mass >= LEAST_RINGED]
    return seen if len(seen) > 1 else []


def rings_of(modes: Sequence[TrackedMode], scale: Scale, room: float) -> LogRow:
    """Return a ring with its share around every mode that has one."""
    seen = ringed(modes)
    reach_m = [mode.estimate.radii.cluster_m * np.sqrt(mode.estimate.mass) for mode in seen]
    places = scale.screen(np.array([mode.estimate.pose for mode in seen]).reshape(-1, 3))
    shares = [f"{100 * mode.estimate.mass:.0f} %" for mode in seen]
    rings = [mode.estimate.pose[:2] + reach * CIRCLE for mode, reach in zip(seen, reach_m, strict=True)]
    return row_of(
        rr.LineStrips2D,
        strips=strips_of([scale.screen(ring) for ring in rings]),
        colors=colors_of([style.packed(style.mode_color(mode.identity)) for mode in seen]),
        labels=texts_of(joined_labels(places, room, shares)),
    )


# Weights against particles, as bars: how many weigh so much, and how much weight they hold. After a
# resampling, in the same places, how many copies they left: the copies expected are the weight in averages.

BINS_PX, HEIGHT_PX = 64, 104  # of a pair of bars, as large as on a screen of 1280 x 800
COLUMN_PX, FIRST_PX, SECOND_PX = 25, 4, 31  # width of a bar, and where in a pair the two begin
AXIS_PX = 2
VALUE_ABOVE, NAME_BELOW, UNDER = 23, 3, 23  # labels hang a little below their points
KEY_ABOVE = 50
LEAST_SAID = 0.005  # share of a bar whose value is written

# from which weight, in averages, or which number of copies, and how that is written
WEIGHTS = (
    (0.0, "< 1/8"),
    (1 / 8, "1/8-1/2"),
    (1 / 2, "1/2-2"),
    (2.0, "2-8"),
    (8.0, "8-32"),
    (32.0, "> 32"),
)
COPIES = ((0.0, "0"), (1.0, "1"), (2.0, "2-3"), (4.0, "4-7"), (8.0, "8-15"), (16.0, "> 15"))

BARS = IndexedColors()
GROUND_INK, DOTS_INK, WEIGHT_INK, AXIS_INK = (
    BARS.flat(color) for color in (style.GROUND, style.CLOUD, style.WEIGHT, style.RULER)
)


@dataclass(frozen=True, slots=True)
class Kind:
    """What bars are of."""

    bins: tuple[tuple[float, str], ...]
    under: str  # what the bins count
    held: str  # what the second bars are of


BY_WEIGHT = Kind(WEIGHTS, "times the average weight", "% of the weight")
BY_COPIES = Kind(COPIES, "copies of a dot", "% of the copies")


class WeightBarsPanel(Panel):
    """Draws the bars of the moved, the weighted and the resampled cloud."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        bars = rr.EncodedImage.from_fields(media_type="image/png", draw_order=Order.OVERLAY)
        rec.log(self._paths.inside("bars"), bars, rr.Transform3D(translation=[0, -HEIGHT_PX, 0]), static=True)
        labels = rr.Points2D.from_fields(radii=rr.components.Radius.ui_points(0.0), show_labels=True)
        rec.log(self._paths.inside("values"), labels, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        if not update.whole:
            return
        record = update.record
        set_phase_only(rec, update.moment, Phase.PREDICT)
        self._log(rec, record.predicted.weights * record.predicted.size, BY_WEIGHT)
        set_phase(rec, update.moment, Phase.WEIGHT)
        self._log(rec, record.weighted.weights * record.weighted.size, BY_WEIGHT)
        if record.parents is not None:
            set_phase_only(rec, update.moment, Phase.RESAMPLE)
            copies = copies_of(record.parents, record.weighted.size)
            self._log(rec, copies.astype(np.float64), BY_COPIES)

    def clear(self, rec: rr.RecordingStream) -> None:
        rec.log(
            self._paths.inside("bars"),
            row_of(rr.EncodedImage, blob=blob_of(bars_of((), ()))),
        )
        nothing = row_of(rr.Points2D, positions=points_of(np.zeros((0, 2))), labels=texts_of([]))
        rec.log(self._paths.inside("values"), nothing)

    def _log(self, rec: rr.RecordingStream, times: F64, kind: Kind) -> None:
        dots, weights = shares_of(times, kind)
        bars = bars_of(heights_of(dots), heights_of(weights))
        rec.log(self._paths.inside("bars"), row_of(rr.EncodedImage, blob=blob_of(bars)))
        labels = [*_names_of(kind)]
        for values, left, color in ((dots, FIRST_PX, DOTS_COLOR), (weights, SECOND_PX, WEIGHT_COLOR)):
            middle = left + COLUMN_PX / 2
            labels += [
                (BINS_PX * k + middle, -HEIGHT_PX * value - VALUE_ABOVE, f"{100 * value:.0f}", color)
                for k, value in enumerate(values.tolist())
                if value >= LEAST_SAID
            ]
        x, y, texts, colors = zip(*labels, strict=True)
        places = points_of(np.array([x, y], np.float32).T)
        row = row_of(rr.Points2D, positions=places, labels=texts_of(texts), colors=colors_of(colors))
        rec.log(self._paths.inside("values"), row)


Label = tuple[float, float, str, int]  # x, y, text, packed color
DOTS_COLOR, WEIGHT_COLOR = style.packed(style.CLOUD), style.packed(style.WEIGHT)


@cache
def _names_of(kind: Kind) -> tuple[Label, ...]:
    """Return the labels that all bars of a kind have."""
    dots, weight, pale = DOTS_COLOR, WEIGHT_COLOR, style.packed(style.PALE)
    width, top = BINS_PX * len(kind.bins), -HEIGHT_PX - KEY_ABOVE
    names = [(BINS_PX * (k + 0.48), NAME_BELOW, name, pale) for k, (_, name) in enumerate(kind.bins)]
    under = width / 2, UNDER, kind.under, pale
    return *names, under, (width / 4, top, "% of the dots", dots), (3 * width / 4, top, kind.held, weight)


def shares_of(times: F64, kind: Kind) -> tuple[F64, F64]:
    """Return the shares (K,) of particles in each bin, and of all their weight or copies `times` (N,)."""
    times = times if np.ptp(times) else times[:1]  # where all are alike one stands for all
    small = np.zeros(len(times), np.uint8)
    for least, _ in kind.bins[1:]:  # sooner than a search for as few
        small += times >= least
    number = small.astype(np.intp)
    dots = np.bincount(number, minlength=len(kind.bins)) / max(len(times), 1)
    weights = np.bincount(number, times, len(kind.bins)) / max(float(times.sum()), 1e-12)
    return dots, weights


def heights_of(shares: F64) -> tuple[int, ...]:
    """Return the heights of bars, in pixels."""
    return tuple(np.rint(HEIGHT_PX * shares).astype(int).tolist())


@lru_cache(maxsize=64)  # before a picture all weigh the same, at every step
def bars_of(dots: tuple[int, ...], held: tuple[int, ...]) -> bytes:
    """Draw two heights a bin as bars, over their axis, as a PNG."""
    image = np.full((HEIGHT_PX + AXIS_PX, BINS_PX * len(WEIGHTS)), GROUND_INK, np.uint8)
    image[HEIGHT_PX:] = AXIS_INK
    for values, first, ink in ((dots, FIRST_PX, DOTS_INK), (held, SECOND_PX, WEIGHT_INK)):
        for number, height in enumerate(values):
            left = BINS_PX * number + first
            image[HEIGHT_PX - height : HEIGHT_PX, left : left + COLUMN_PX] = ink
    return BARS.png(image)


def weight_bars_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show the bars."""
    extent = Extent(-4, BINS_PX * len(WEIGHTS) + 4, -HEIGHT_PX - KEY_ABOVE - 2, 50)
    return plane_view("Weights", [paths.inside("bars"), paths.inside("values")], extent)
