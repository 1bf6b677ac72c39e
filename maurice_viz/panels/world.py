"""The map, drawn once: floors, obstacles, walls, library nodes, keys; and on it the true pose."""

from __future__ import annotations

import numpy as np
import rerun as rr

from maurice_mcl.scoring.events import KIDNAPPED
from maurice_mcl.values import F64, U8, Arena, Library, distinct_places

from .. import entities
from ..drawing import keys
from ..drawing.canvas import draw_ground, long_side
from ..entities import Phase
from ..scene import RunView, Scene
from ..style import CARRIED, NODE, WALL, Order, Scale
from .belief import truth_marker
from .panel import Panel, StepUpdate, place_drawing, set_phase


class WorldPanel(Panel):
    """Draws the map, once for all runs."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        draw_world(rec, self._library, self._scale)


class KeysPanel(Panel):
    """Draws the keys above the maps of one run."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        run, arena, scale, has_truth = self._run, self._library.arena, self._scale, self._scene.has_truth
        drawn = keys.keys_of(has_truth, run.color, run.is_recorded, arena)
        if not run.is_recorded:
            drawn[keys.EXPLAINED] = keys.explain_key(has_truth, run.color)
        for name, key in drawn.items():
            draw_key(rec, self._paths.key(name), key, arena, scale)


# of the arena's long side: where the arrow to the truth ends, or its disk would hide it
ARROW_GAP_SHARE = 0.05
CARRIED_UPDATES = 10  # updates for which the line of a kidnapping stays


class TruthPanel(Panel):
    """Draws the true pose, and for some updates an arrow from where to where a robot was carried."""

    def __init__(self, run: RunView, scene: Scene) -> None:
        super().__init__(run, scene)
        self._marker = truth_marker(entities.TRUTH, scene.arena, scene.scale)
        self._last: F64 | None = None  # the true pose before
        self._carried_for: int | None = None  # updates since the line was drawn; None: there is none

    def prepare(self, rec: rr.RecordingStream) -> None:
        self._marker.prepare(rec)
        width = rr.components.Radius.ui_points(1.75)
        arrow = rr.Arrows2D.from_fields(colors=[CARRIED], radii=width, draw_order=Order.CARRIED)
        rec.log(entities.CARRIED, arrow, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        truth = update.moment.truth
        if truth is None:
            return
        set_phase(rec, update.moment, Phase.PREDICT)
        carried = any(event.kind == KIDNAPPED for event in update.events)
        self._marker.draw(rec, truth, carried)
        if carried and self._last is not None:
            self._draw_carried(rec, self._last, truth)
        elif self._carried_for is not None:
            self._carried_for += 1
            if self._carried_for == CARRIED_UPDATES:
                rec.log(entities.CARRIED, rr.Arrows2D.from_fields(origins=[], vectors=[], labels=[]))
                self._carried_for = None
        self._last = truth

    def _draw_carried(self, rec: rr.RecordingStream, start: F64, end: F64) -> None:
        length = self._scale.say(float(np.hypot(*(end[:2] - start[:2]))))
        origin, place = self._scale.screen(np.stack([start[:2], end[:2]]))
        way, gap = place - origin, ARROW_GAP_SHARE * long_side(self._library.arena, self._scale)
        way *= max(1 - gap / max(float(np.hypot(*way)), gap), 0.5)
        arrow = rr.Arrows2D.from_fields(
            origins=[origin], vectors=[way], labels=[f"carried {length}"], show_labels=True
        )
        rec.log(entities.CARRIED, arrow)
        self._carried_for = 0


def draw_world(rec: rr.RecordingStream, library: Library, scale: Scale) -> None:
    """Log everything about the map, static, and what separates the layers of every view."""
    for order in [*Order][1:]:
        separator = rr.Points2D(positions=[], draw_order=order - 0.5)
        rec.log(f"{entities.SEPARATORS}/{order.name.lower()}", separator, static=True)
    for path, named in ((entities.FLOORS, True), (entities.BARE_FLOORS, False)):
        ground = draw_ground(library.arena, scale, named=named)
        corner = ground.extent.left, ground.extent.top
        place_drawing(
            rec, path, ground.image, corner, ground.extent.width / ground.image.shape[1], Order.GROUND
        )
    inside = clipped(library.arena.walls, library.arena.bounds)
    if len(inside):
        walls = rr.LineStrips2D(
            list(scale.screen(inside.reshape(-1, 2)).reshape(-1, 2, 2)),
            colors=[WALL],
            radii=rr.components.Radius.ui_points(1.75),
            draw_order=Order.WALLS,
        )
        rec.log(entities.WALLS, walls, static=True)
    if library.is_map:  # its places are no references
        return
    nodes = rr.Points2D(
        scale.screen(distinct_places(library.poses[:, :2])[0]),
        colors=[NODE],
        radii=rr.components.Radius.ui_points(1.25),
        draw_order=Order.NODES,
    )
    rec.log(entities.NODES, nodes, static=True)


def clipped(walls: F64, bounds: tuple[float, float, float, float]) -> F64:
    """Cut wall segments (W, 4) at the map's bounds, without those wholly outside (Liang, Barsky 1984)."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    parallel = along == 0
    step = np.where(parallel, 1.0, along)
    first, second = (low - start) / step, (high - start) / step
    enter = np.where(parallel, 0.0, np.minimum(first, second)).max(axis=1, initial=0.0)
    leave = np.where(parallel, 1.0, np.maximum(first, second)).min(axis=1, initial=1.0)
    beside = (parallel & ((start < low) | (start > high))).any(axis=1)
    visible = (enter <= leave) & ~beside
    ends = [start + at[:, None] * along for at in (enter, leave)]
    return np.asarray(np.concatenate(ends, axis=1)[visible])


def draw_key(rec: rr.RecordingStream, path: str, strip: U8, arena: Arena, scale: Scale) -> None:
    """Log one key (H, W, 3) above the map, static; its view has room for it, see `extent_with`."""
    extent = keys.key_extent(strip, arena, scale)
    place_drawing(rec, path, strip, (extent.left, extent.top), extent.width / strip.shape[1], Order.KEYS)
