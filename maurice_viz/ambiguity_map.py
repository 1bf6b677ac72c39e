"""The map of expected ambiguity: how many places fit a picture taken at each of a library's places."""

from __future__ import annotations

import cv2
import numpy as np

from maurice_mcl.library import Library
from maurice_mcl.look_alikes import SelfCheck
from maurice_mcl.selection import spacing
from maurice_mcl.typing import F64, U8

from .canvas import TEXT, Canvas, draw_ground, long_side
from .draw_world import clipped
from .look import DEAD, GROUND, PALE, RGB, WALL, Scale, shade
from .raster import put_text

MOST_PAIRS = 60  # lines between look-alikes; more would be a tangle
DOT = 0.32  # radius, of the distance from a place to the next
DARKEST = 0.25  # of the scale of colors, so that what is written on a dot can be read


def draw_ambiguity(library: Library, found: SelfCheck, scale: Scale) -> U8:
    """Draw (H, W, 3): walls, a dot a place, brighter the more places fit, and lines between look-alikes."""
    canvas = draw_ground(library.arena, scale)
    image = canvas.image.copy()
    for wall in clipped(library.arena.walls, library.arena.bounds):
        start, end = _pixels(canvas, wall.reshape(2, 2), scale)
        cv2.line(image, start, end, WALL, 3, cv2.LINE_AA)
    for entry in found.aliased[:MOST_PAIRS].tolist():
        pair = found.places[found.place_of[[entry, found.look_alike[entry]]]]
        start, end = _pixels(canvas, pair, scale)
        cv2.line(image, start, end, DEAD, 2, cv2.LINE_AA)
    radius = max(round(DOT * scale.length(spacing(found.places)) / canvas.unit_per_px), 3)
    values = found.at_places(found.ambiguity)
    dots = list(zip(_pixels(canvas, found.places, scale), values.tolist(), _colors(values), strict=True))
    for (x, y), value, color in sorted(dots, key=lambda dot: dot[1]):  # the worst on top
        cv2.circle(image, (x, y), radius, color, -1, cv2.LINE_AA)
        label = f"{value:.0f}"
        height = radius * 0.8
        put_text(image, label, x - height * 0.4 * len(label), y + height / 2, height, GROUND)
    text_px = TEXT * long_side(library.arena, scale) / canvas.unit_per_px
    what = "how many places fit a picture taken here; lines: look-alikes"
    put_text(image, what, text_px, 1.6 * text_px, text_px, PALE)
    return image


def _pixels(canvas: Canvas, xy_m: F64, scale: Scale) -> list[tuple[int, int]]:
    at = (scale.screen(xy_m) - (canvas.extent.left, canvas.extent.top)) / canvas.unit_per_px
    return [(round(x), round(y)) for x, y in at.tolist()]


def _colors(values: F64) -> list[RGB]:
    """Give each dot a color, from the place with the fewest that fit to that with the most."""
    share = np.log(values / values.min()) / max(float(np.log(values.max() / values.min())), 1e-9)
    packed = shade(DARKEST + (1 - DARKEST) * share).tolist()
    return [(one >> 24 & 255, one >> 16 & 255, one >> 8 & 255) for one in packed]
