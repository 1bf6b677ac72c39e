"""The map, drawn once: floors, obstacles, walls, library nodes, keys."""

from __future__ import annotations

import numpy as np
import rerun as rr

from maurice_mcl.arrays import F64, U8
from maurice_mcl.library import Library
from maurice_mcl.map import Arena

from .. import entities
from ..drawing import keys
from ..drawing.canvas import draw_ground, map_extent
from ..style import NODE, WALL, Scale
from .panel import Panel, place_drawing


class WorldPanel(Panel):
    """Draws the map, once for all runs."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        draw_world(rec, self._library, self._scale)


class KeysPanel(Panel):
    """Draws the keys above the maps of one run."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        run = self._run
        for name, strip in keys.keys_of(run.has_truth, run.color, run.is_recorded).items():
            draw_key(rec, self._paths.key(name), strip, self._library.arena, self._scale)


def draw_world(rec: rr.RecordingStream, library: Library, scale: Scale) -> None:
    """Log everything about the map, static."""
    ground = draw_ground(library.arena, scale)
    left, top, width = ground.extent.left, ground.extent.top, ground.extent.width
    place_drawing(rec, entities.FLOORS, ground.image, (left, top), width / ground.image.shape[1], -10.0)
    inside = clipped(library.arena.walls, library.arena.bounds)
    if len(inside):
        walls = rr.LineStrips2D(
            list(scale.screen(inside.reshape(-1, 2)).reshape(-1, 2, 2)),
            colors=[WALL],
            radii=rr.components.Radius.ui_points(1.75),
            draw_order=1.0,
        )
        rec.log(entities.WALLS, walls, static=True)
    nodes = rr.Points2D(
        scale.screen(distinct_places(library.poses)),
        colors=[NODE],
        radii=rr.components.Radius.ui_points(1.25),
        draw_order=2.0,
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
    kept = (enter <= leave) & ~beside
    ends = [start + at[:, None] * along for at in (enter, leave)]
    return np.asarray(np.concatenate(ends, axis=1)[kept])


def draw_key(rec: rr.RecordingStream, path: str, strip: U8, arena: Arena, scale: Scale) -> None:
    """Log one key (H, W, 3) above the map, static."""
    extent = map_extent(arena, scale)
    per_px = extent.width / strip.shape[1]
    if len(strip) > keys.HEIGHT_PX:  # of several rows: its view has room for it, see `extent_with`
        extent = keys.key_extent(strip, arena, scale)
    else:
        per_px = min(per_px, 0.036 * extent.width / keys.HEIGHT_PX)
    place_drawing(rec, path, strip, (extent.left, extent.top), per_px, -10.0)


def distinct_places(poses: F64) -> F64:
    """Return the positions (P, 2) of library poses (L, 3), each once (to the millimeter)."""
    _, first = np.unique(np.round(poses[:, :2] * 1000), axis=0, return_index=True)
    return np.asarray(poses[np.sort(first), :2])
