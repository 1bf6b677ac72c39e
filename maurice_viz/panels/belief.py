"""The belief: the cloud through one update, on the map and in a close-up, with estimate and truth."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray

from maurice_mcl.values import F32, F64, I32, U8, Arena, Belief

from .. import entities
from ..drawing.arrow import LogRow, colors_of, places_of, points_of, row_of, strips_of, text_of, ui_points_of
from ..drawing.canvas import Extent, arena_extent, long_side
from ..drawing.keys import WEIGHTS, keys_of
from ..entities import Phase, RunPaths
from ..scene import RunView, Scene
from ..style import (
    LUT,
    PALE,
    RGB,
    RUN_COLORS,
    TRUTH,
    Order,
    Scale,
    faint,
    font_safe,
    heading_vector,
    weight_colors,
    weight_shades,
)
from .panel import Panel, StepUpdate, set_phase, set_phase_only
from .views import BARE_MAP, MAP, map_view, plane_view

PARTICLE_PT = 1.75  # radius in points of the screen
_PARTICLE = ui_points_of([PARTICLE_PT])
FEW_PARTICLES = 300  # particles drawn in updates with less detail
TRAIL_POSES = 25  # of a trail, that are kept: more would bury the cloud, and cost more the longer it runs
ARROW_SHARE = 0.055  # length of a heading arrow, as a share of the arena's long side

# the frame of the close view is 2 wide and 2 high
BAR_LENGTHS: dict[str, tuple[float, ...]] = {  # lengths of the bar, by unit
    "in": (1.0, 2.0, 3.0, 6.0, *(12.0 * 2**k for k in range(10))),
    "m": (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0),
}
BAR_SHARE = 0.6  # of half the frame
SAMPLED_PARTICLES = 400  # particles, by weight, from which the extent of the cloud is estimated
EXTENT_MARGIN = 1.25  # of the view, over what it must hold
FOLLOW_SHARE = 0.15  # of half the frame: the frame follows a cloud farther from its middle
SHRINK_SHARE = 0.6  # of the frame: a smaller cloud makes the frame smaller
TRUTH_TIMES = 2.5  # times the cloud: a truth that needs more is pointed to
LEAST_SIDE_M = 0.05  # of what is shown
BAR_LEFT, BAR_BOTTOM = -0.96, 0.93


class CloudPanel(Panel):
    """Draws the particles: moved, then weighted; what else happens to them is in `inside`."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        prepare_cloud(rec, self._paths.particles)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        moment, record, path = update.moment, update.record, self._paths.particles
        set_phase(rec, moment, Phase.PREDICT)
        if not update.whole:
            draw_cloud(rec, path, few_of(record.weighted), self._scale)
            return
        # light ones first: equal colors together take a quarter off the bytes, and heavy ones are on top
        shades = weight_shades(record.weighted.log_weights)
        order = np.argsort(shades, kind="stable")
        draw_cloud(rec, path, record.predicted, self._scale, order)
        set_phase(rec, moment, Phase.WEIGHT)  # only colors: positions are most of a recording's size
        rec.log(path, row_of(rr.Points2D, colors=colors_of(LUT[shades[order]])))


def prepare_cloud(rec: rr.RecordingStream, path: str) -> None:
    """Log that the cloud lies over the map and under the markers, static."""
    rec.log(path, rr.Points2D.from_fields(draw_order=Order.CLOUD), static=True)


def draw_cloud(
    rec: rr.RecordingStream,
    path: str,
    belief: Belief,
    scale: Scale,
    order: NDArray[np.intp] | slice = slice(None),
) -> None:
    """Log a cloud in an order (N,), colored by its weights: one color where all are equal."""
    equal = bool(np.ptp(belief.log_weights) == 0)
    weights = belief.log_weights[:1] if equal else belief.log_weights[order]
    places = scale.screen(belief.poses[order, :2] + belief.origin)
    colors = colors_of(weight_colors(weights, belief.size))
    rec.log(path, row_of(rr.Points2D, positions=points_of(places), colors=colors, radii=_PARTICLE))


def few_of(belief: Belief) -> Belief:
    """Return a few hundred particles, spread evenly over the numbering, with their weights."""
    size = belief.size
    some = np.linspace(0, size - 1, min(size, FEW_PARTICLES)).round().astype(np.int64)
    return Belief(belief.poses[some], belief.log_weights[some] + np.log(size / len(some)), belief.origin)


def positions(belief: Belief, scale: Scale) -> F32:
    """Return the drawn positions (N, 2) of a cloud."""
    return scale.screen(belief.poses[:, :2] + belief.origin)


def copies_of(parents: I32 | None, size: int) -> NDArray[np.int64]:
    """Return how many copies each weighted particle (N,) left; 1 where there was no resampling."""
    if parents is None:
        return np.ones(size, np.int64)
    return np.bincount(parents + 1, minlength=size + 1)[1:]  # without -1, the fresh ones


@dataclass(slots=True)
class PoseMarker:
    """One pose that moves: a disk, an arrow, a trail of its last poses, broken where it jumps."""

    path: str
    color: RGB
    radius: float  # in points of the screen
    order: Order
    scale: Scale
    arrow: float  # length in display units
    # whether a line begins there, and the place
    _trail: deque[tuple[bool, list[float]]] = field(default_factory=lambda: deque(maxlen=TRAIL_POSES))

    def prepare(self, rec: rr.RecordingStream) -> None:
        points, color = rr.components.Radius.ui_points, [self.color]
        disk = rr.Points2D.from_fields(colors=color, radii=points(self.radius), draw_order=self.order)
        arrow = rr.Arrows2D.from_fields(colors=color, radii=points(1.75), draw_order=self.order)
        order, trail_color = Order.TRAILS + 0.01 * self.order, [faint(self.color)]  # the truth's below
        trail = rr.LineStrips2D.from_fields(colors=trail_color, radii=points(0.75), draw_order=order)
        rec.log(self.path, disk, arrow, trail, static=True)

    def draw(self, rec: rr.RecordingStream, pose: F64, jumped: bool = False) -> None:
        """Log one pose (3,); `jumped` begins a new line."""
        at = self.scale.screen(pose[None, :2])
        self._trail.append((jumped, at[0].tolist()))
        rec.log(  # all in one: a call costs more than what it carries
            self.path,
            row_of(rr.Points2D, positions=points_of(at)),
            _arrows(at, heading_vector(float(pose[2]), self.arrow)),
            row_of(rr.LineStrips2D, strips=strips_of(self._strips())),
        )

    def _strips(self) -> list[F32]:
        begins = [number for number, (jumped, _) in enumerate(self._trail) if jumped and number]
        trail = np.array([place for _, place in self._trail], np.float32)
        return np.split(trail, begins) if begins else [trail]


def _arrows(origins: ArrayLike, vectors: ArrayLike) -> LogRow:
    return row_of(rr.Arrows2D, origins=points_of(origins), vectors=points_of(vectors))


_NO_POSE = LogRow(row_of(rr.Points2D, positions=points_of([])) | _arrows([], []))


def truth_marker(path: str, arena: Arena, scale: Scale) -> PoseMarker:
    """Return the marker of the true pose: white and larger, so that it is visible under the estimate."""
    return PoseMarker(path, TRUTH, 6.0, Order.TRUTH, scale, ARROW_SHARE * long_side(arena, scale))


def estimate_marker(path: str, arena: Arena, scale: Scale, color: RGB = RUN_COLORS[0]) -> PoseMarker:
    """Return the marker of an estimate, in its run's color."""
    return PoseMarker(path, color, 4.5, Order.ESTIMATE, scale, ARROW_SHARE * long_side(arena, scale))


NAME_ABOVE, NAME_ROW = 0.08, 0.055  # of the arena's long side: a name above its estimate, and the next run's


class EstimatePanel(Panel):
    """Draws the scored estimate."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._marker = estimate_marker(run.paths.estimate, scene.arena, scene.scale, run.color)
        self._last: F64 | None = None  # the estimate before
        above = (NAME_ABOVE + run.number * NAME_ROW) * long_side(scene.arena, scene.scale)
        self._above = np.array([0.0, -above], np.float32)  # each run's own, or names would cover each other

    def prepare(self, rec: rr.RecordingStream) -> None:
        self._marker.prepare(rec)
        name = rr.Points2D.from_fields(
            colors=[self._run.color],
            radii=rr.components.Radius.ui_points(0.0),
            labels=[font_safe(self._run.short)],
            show_labels=True,
            draw_order=Order.FRAME,
        )
        rec.log(self._paths.name, name, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the estimated pose, which is known once the cloud is weighted; before that there is none."""
        pose, last = update.record.estimate.pose, self._last
        if update.whole:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            rec.log(self._marker.path, _NO_POSE)
        moved = float(np.hypot(*update.record.frame.motions[:, :2].T).sum())
        reach = update.record.estimate.radii.cluster_m + moved
        jumped = last is not None and np.hypot(*(pose[:2] - last[:2])) > reach
        self._last = pose
        set_phase(rec, update.moment, Phase.WEIGHT)
        self._marker.draw(rec, pose, bool(jumped))
        at = self._scale.screen(pose[None, :2]) + self._above
        rec.log(self._paths.name, row_of(rr.Points2D, positions=points_of(at)))


SIGMAS = 2.0  # an ellipse reaches so many standard deviations
ELLIPSE_ANGLES = np.linspace(0, 2 * np.pi, 33)


class EllipsesPanel(Panel):
    """Draws the covariance of the weighted cloud; of a recorded localizer along its last poses."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._path, self._is_own = run.paths.ellipses, not run.is_recorded
        self._map = arena_extent(scene.arena, scene.scale)
        self._drawn: deque[F32] = deque(maxlen=1 if self._is_own else TRAIL_POSES)

    def prepare(self, rec: rr.RecordingStream) -> None:
        radius = rr.components.Radius.ui_points(1.0)
        lines = rr.LineStrips2D.from_fields(colors=[self._run.color], radii=radius, draw_order=Order.OVALS)
        rec.log(self._path, lines, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        if update.whole and self._is_own:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            rec.log(self._path, row_of(rr.LineStrips2D, strips=strips_of([])))
        self._drawn.append(self._map.cut(ellipse_of(update.record.weighted, self._scale)))
        set_phase(rec, update.moment, Phase.WEIGHT)
        rec.log(self._path, row_of(rr.LineStrips2D, strips=strips_of(list(self._drawn))))


def ellipse_of(belief: Belief, scale: Scale, some: NDArray[np.bool_] | None = None) -> F32:
    """Return the outline (33, 2), as drawn, of two standard deviations of a cloud's positions.

    `some` (N,) chooses particles; the weight of those counts as all.
    """
    weights, off = belief.weights, belief.poses[:, :2].T.astype(np.float64)
    if some is not None:
        weights = weights * some
        weights /= max(float(weights.sum()), 1e-300)
    middle = off @ weights
    off -= middle[:, None]
    variances, axes = np.linalg.eigh((off * weights) @ off.T)
    away = np.column_stack([np.cos(ELLIPSE_ANGLES), np.sin(ELLIPSE_ANGLES)]) * np.sqrt(
        np.maximum(variances, 0)
    )
    return scale.screen(middle + belief.origin + SIGMAS * away @ axes.T)


class CloseupPanel(Panel):
    """Moves the frame of a view that follows the cloud, with a scale bar; it points to a truth outside."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._frame = CloseupFrame(run.paths.closeup, scene)

    def prepare(self, rec: rr.RecordingStream) -> None:
        self._frame.prepare(rec)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, truth = update.record, update.moment.truth
        clouds = [sample(record.predicted), sample(record.weighted)]
        if record.injected is not None:
            clouds.append(record.belief.poses[record.injected, :2] + record.belief.origin)
        set_phase(rec, update.moment, Phase.PREDICT)
        self._frame.draw(rec, clouds, [] if truth is None else [truth])


class CloseupFrame:
    """The frame of a close-up: 2 wide and 2 high, moved to what is to be seen."""

    def __init__(self, path: str, scene: Scene, label_above: float = 0.18) -> None:
        """Take the path, and how far above the bar its length stands: in small views far."""
        self._path, self._scale, self._label_above = path, scene.scale, label_above
        self._long = long_side(scene.arena, scene.scale)
        self._half = 0.0  # of its side, in display units
        self._at = np.zeros(2, np.float32)  # its middle, as drawn
        self._points = False  # whether it points to a truth

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change."""
        radius, order = rr.components.Radius.ui_points, Order.FRAME
        lines = rr.LineStrips2D.from_fields(colors=[PALE], radii=radius(1.25), draw_order=order)
        rec.log(f"{self._path}/bar", lines, static=True)
        # no labels yet: static ones would hide all later ones
        style = rr.Points2D.from_fields(colors=[PALE], radii=radius(0.0), show_labels=True, draw_order=order)
        rec.log(f"{self._path}/length", style, static=True)
        away = rr.Arrows2D.from_fields(colors=[TRUTH], radii=radius(1.75), show_labels=True, draw_order=order)
        rec.log(f"{self._path}/away", away, static=True)

    def draw(self, rec: rr.RecordingStream, clouds: Sequence[F64], truths: Sequence[F64]) -> None:
        """Log where the frame is to hold the clouds (K, 2), and poses (3,) that are not far from them."""
        middle, reach_m = seen_whole(clouds, truths)
        half, at = (
            min(self._scale.length(reach_m), EXTENT_MARGIN * self._long / 2),
            self._scale.screen(middle[None])[0],
        )
        resized = not SHRINK_SHARE * self._half < half <= self._half
        # a still view is easier to read and costs nothing
        if resized or np.abs(at - self._at).max() > FOLLOW_SHARE * self._half:
            self._half, self._at = half if resized else self._half, at
            frame = places_of([*at.tolist(), 0]), places_of([self._half] * 3)
            rec.log(self._path, row_of(rr.Transform3D, translation=frame[0], scale=frame[1]))
            if resized:
                self._draw_bar(rec)
        self._draw_away(rec, truths)

    def _draw_bar(self, rec: rr.RecordingStream) -> None:
        """Draw the scale bar: the ground of a close-up has no ruler."""
        unit = self._scale.units.name
        length = bar_for(self._half * BAR_SHARE, unit)
        end = BAR_LEFT + length / self._half
        bar = [
            [BAR_LEFT, BAR_BOTTOM - 0.02],
            [BAR_LEFT, BAR_BOTTOM],
            [end, BAR_BOTTOM],
            [end, BAR_BOTTOM - 0.02],
        ]
        rec.log(f"{self._path}/bar", row_of(rr.LineStrips2D, strips=strips_of([np.array(bar, np.float32)])))
        at = points_of([max((BAR_LEFT + end) / 2, BAR_LEFT + 0.08), BAR_BOTTOM - self._label_above])
        label = text_of(f"{length:g} {unit}")
        rec.log(f"{self._path}/length", row_of(rr.Points2D, positions=at, labels=label))

    def _draw_away(self, rec: rr.RecordingStream, truths: Sequence[F64]) -> None:
        """Point to a truth outside of the frame, with its distance from the frame's middle."""
        ways = [self._scale.screen(truth[None, :2])[0] - self._at for truth in truths]
        outside = [way for way in ways if np.abs(way).max() > self._half]
        if not outside and not self._points:
            return
        self._points = bool(outside)
        along = np.array([way / np.abs(way).max() for way in outside]).reshape(-1, 2)
        unit = self._scale.units
        labels = [f"truth: {np.hypot(*way):.{unit.digits}f} {unit.name} away" for way in outside]
        arrows = rr.Arrows2D.from_fields(origins=0.6 * along, vectors=0.25 * along, labels=labels)
        rec.log(f"{self._path}/away", arrows)


_SAMPLED = (np.arange(SAMPLED_PARTICLES) + 0.5) / SAMPLED_PARTICLES  # shares of the weight before each


def sample(belief: Belief) -> F64:
    """Return places (K, 2) of particles by weight, heavy ones several times."""
    ends = np.cumsum(belief.weights)
    chosen = np.searchsorted(ends, _SAMPLED * ends[-1])
    return np.asarray(belief.poses[chosen, :2] + belief.origin, np.float64)


def seen_whole(clouds: Sequence[F64], truths: Sequence[F64]) -> tuple[F64, float]:
    """Return middle (2,) and half the side of a square that holds nearly all of each cloud (K, 2).

    It also holds poses (3,) that would not make it more than `TRUTH_TIMES` times as large.
    """
    ends = [np.sort(cloud, axis=0) for cloud in clouds if len(cloud)]
    low = np.min([ordered[len(ordered) // 100] for ordered in ends], axis=0)
    high = np.max([ordered[-1 - len(ordered) // 100] for ordered in ends], axis=0)
    size = max(float((high - low).max()), LEAST_SIDE_M)
    for truth in truths:
        lower, upper = np.minimum(low, truth[:2]), np.maximum(high, truth[:2])
        if float((upper - lower).max()) <= TRUTH_TIMES * size:
            low, high = lower, upper
    return (low + high) / 2, EXTENT_MARGIN * max(float((high - low).max()), LEAST_SIDE_M) / 2


def bar_for(room: float, unit: str) -> float:
    """Return the longest round length of a bar that is at most what there is room for, else the shortest."""
    lengths = BAR_LENGTHS[unit]
    return next((length for length in reversed(lengths) if length <= room), lengths[0])


def run_key(name: str, scene: Scene) -> U8:
    """Return the key of a map, in any run's color."""
    return keys_of(scene.has_truth, RUN_COLORS[0], False, scene.arena)[name]


def belief_view(paths: RunPaths, scene: Scene) -> rrb.Spatial2DView:
    """Show the map with the weighted cloud, the estimate and the truth."""
    contents = [*MAP, entities.NODES, paths.key(WEIGHTS), f"{paths.at('belief')}/**"]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    name = f"Belief: particles by weight, rings: modes ({scene.scale.units.name})"
    return map_view(name, contents, scene, key=run_key(WEIGHTS, scene))


def closeup_view(paths: RunPaths, scene: Scene) -> rrb.Spatial2DView:
    """Show the close-up of the cloud."""
    contents = [*BARE_MAP, entities.NODES, f"{paths.at('belief')}/**", *frame_marks(paths.closeup)]
    contents += [f"{entities.TRUTH}/**"] if scene.has_truth else []
    return plane_view("Cloud close up", contents, Extent(-1, 1, -1, 1), origin=paths.closeup)


def frame_marks(path: str) -> list[str]:
    """Return what stands in the frame of a close-up: scale bar, and where the truth is."""
    return [f"{path}/bar", f"{path}/length", f"{path}/away"]
