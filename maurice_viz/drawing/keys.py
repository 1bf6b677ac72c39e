"""Keys: strips above a map view, or beside a plot, that explain its marks.

Those of several rows are drawn once and kept: every layout asks for them again, for the room that they need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.values import U8, U32, Arena

from .. import style
from ..style import RGB, Scale
from .canvas import MAP_MARGINS, Extent, long_side, map_extent, put_text, text_size

HEIGHT_PX = 52
TEXT_PX = 24.0
GAP_PX = 18
INSET_PX = 24
ROWS_PX = 800  # least width of a key of several rows, which is as wide as its view
# the keys of a run, by name: what is above its maps
WEIGHTS, MATCHES, LIKELIHOOD, EXPLAINED = "weights", "matches", "likelihood", "explained"
CIRCLES, CIRCLE_PX = 5, 22  # circles in a key, and the radius of the largest
LINES_PX = 860  # width of the key of a plot's lines
LINE_ROW_PX, LINE_TEXT_PX, LINE_PX = 44, 20.0, 50

# keys of items
WIDTH_PX = 1280
DISK_PX = 0.42  # radius of a disk, as a share of the height of capitals
RAMP_PX = 5.0  # length of the color scale, in heights of capitals
ROW_HEIGHT = 2.2  # height of a row, in heights of capitals
LEFT_PX = 60
# heights of capitals, of a key WIDTH_PX wide: at least 8 px on a screen of 1280 x 800
BELIEF_PX, LIKELIHOOD_PX = 26.0, 38.0
LARGEST = 2.0  # times that, above a narrow map


def _strip(width: int) -> U8:
    return np.full((HEIGHT_PX, width, 3), style.GROUND, np.uint8)


def _text(text: str) -> U8:
    width, height = text_size(text, TEXT_PX)
    strip = _strip(width + GAP_PX)
    put_text(strip, text, 0, (HEIGHT_PX + height) / 2, TEXT_PX, style.PALE)
    return strip


def _disk(color: RGB, radius: int) -> U8:
    strip = _strip(2 * radius + GAP_PX)
    cv2.circle(strip, (radius, HEIGHT_PX // 2), radius, color, -1, cv2.LINE_AA)
    return strip


def _ring(color: RGB) -> U8:
    strip = _strip(26 + GAP_PX)
    cv2.circle(strip, (13, HEIGHT_PX // 2), 11, color, 3, cv2.LINE_AA)
    return strip


def _rgb(packed_colors: U32) -> U8:
    """Unpack colors (K,) to (K, 3)."""
    shifted = [packed_colors >> 24, packed_colors >> 16 & 255, packed_colors >> 8 & 255]
    return np.stack(shifted, axis=1).astype(np.uint8)


def _joined(*parts: U8) -> U8:
    return np.concatenate([_strip(INSET_PX), *parts], axis=1)


def _rows(*rows: U8) -> U8:
    """Set rows below each other, at least ROWS_PX wide."""
    width = max(ROWS_PX, *(row.shape[1] for row in rows))
    return np.concatenate([np.concatenate([row, _strip(width - row.shape[1])], axis=1) for row in rows])


def explain_key(has_truth: bool, color: RGB = style.RUN_COLORS[0]) -> U8:
    """Draw the key of the map with the references explained: circles, and whose reference an arrow is."""
    truth = [_arrow(style.TRUTH), _text("truth  ")] if has_truth else []
    estimate = [_arrow(color), _text("estimate  ")]
    arrows = [_text("references: "), *truth, *estimate, _arrow(style.RANK), _text("winner  ")]
    arrows += [_ring(color), _text("2 sigma")]
    return _rows(_joined(*_circles()), _joined(*arrows))


def _circles() -> list[U8]:
    """Draw circles of references as large as they are for some match qualities."""
    steps = np.linspace(1, 0, CIRCLES)
    sizes = np.maximum((CIRCLE_PX * steps).round().astype(int), 3).tolist()
    labels = [f"{quality:g}" for quality in steps]
    disks = [_disk(style.CIRCLE, size) for size in sizes]
    parts = [part for disk, label in zip(disks, labels, strict=True) for part in (disk, _text(label))]
    return [_text("references, quality: "), *parts]


@lru_cache
def circle_key() -> U8:
    """Draw the match map's key: circles, ranks and the cloud."""
    best, cloud = [_disk(style.RANK, 13), _text("best five  ")], [_disk(style.CLOUD, 6), _text("particles  ")]
    return _kept(_rows(_joined(*_circles()), _joined(*best, *cloud)))


def _kept(key: U8) -> U8:
    """Return a key as one that several share, and nobody changes."""
    key.flags.writeable = False
    return key


def _arrow(color: RGB) -> U8:
    strip, middle = _strip(44 + GAP_PX), HEIGHT_PX // 2
    cv2.arrowedLine(strip, (2, middle), (44, middle), color, 7, cv2.LINE_AA, tipLength=0.4)
    return strip


def line_key(lines: Sequence[tuple[str, RGB, float]]) -> U8:
    """Draw the key of a plot's lines, by name, color and width, in as many rows as they need."""
    at, row, places = 24, 0, []
    for name, _, _ in lines:
        width_px = LINE_PX + 10 + text_size(name, LINE_TEXT_PX)[0]
        if at > 24 and at + width_px > LINES_PX - 24:
            at, row = 24, row + 1
        places.append((at, row))
        at += width_px + 30
    image = np.full(((row + 1) * LINE_ROW_PX, LINES_PX, 3), style.GROUND, np.uint8)
    for (name, color, width), (left, row) in zip(lines, places, strict=True):
        middle = round((row + 0.5) * LINE_ROW_PX)
        cv2.line(image, (left, middle), (left + LINE_PX, middle), color, round(4 * width), cv2.LINE_AA)
        put_text(image, name, left + LINE_PX + 10, middle + LINE_TEXT_PX / 2, LINE_TEXT_PX, style.PALE)
    return image


class KeyMark(Enum):
    """What stands in front of a word of a key."""

    DISK = "disk"
    RING = "ring"
    SCALE = "scale"  # all colors of a scale


@dataclass(frozen=True, slots=True)
class Item:
    """One word of a key, with its mark in front of it."""

    text: str
    color: RGB = style.PALE
    mark: KeyMark = KeyMark.DISK

    @property
    def wide(self) -> float:
        """Width of the mark, in heights of capitals."""
        widths = {KeyMark.SCALE: RAMP_PX}
        return widths.get(self.mark, 2 * DISK_PX)


def keys_of(has_truth: bool, color: RGB, is_recorded: bool, arena: Arena) -> dict[str, U8]:
    """Draw the keys of one run's maps, by name; another localizer's run has one map."""
    belief = belief_key(has_truth, color, arena)
    if is_recorded:
        return {WEIGHTS: belief}
    likelihood = _wrapped(likelihood_items(has_truth, color), LIKELIHOOD_PX, arena)
    return {WEIGHTS: belief, MATCHES: circle_key(), LIKELIHOOD: likelihood}


def belief_key(has_truth: bool, color: RGB, arena: Arena) -> U8:
    """Draw the key of the map of a run's cloud."""
    items = [*_truth(has_truth), *_estimate(color), Item("weight, 1/8 to 8 x average", mark=KeyMark.SCALE)]
    return _wrapped(items, BELIEF_PX, arena)


def likelihood_items(has_truth: bool, color: RGB) -> list[Item]:
    """Return what a map of the likelihood shows."""
    scale = Item(f"{style.DEEPEST:g} nats below the best, to best", mark=KeyMark.SCALE)
    return [scale, Item("particles", style.CLOUD), *_truth(has_truth), *_estimate(color)]


def _estimate(color: RGB) -> list[Item]:
    return [Item("estimate", color), Item("2 sigma", color, KeyMark.RING)]


def _truth(has_truth: bool) -> list[Item]:
    return [Item("truth", style.TRUTH)] if has_truth else []


def key_extent(key: U8, arena: Arena, scale: Scale) -> Extent:
    """Return the rectangle of a key: as wide as the map view, its last row where the view's margin is."""
    extent = map_extent(arena, scale)
    height = extent.width * key.shape[0] / key.shape[1]
    bottom = extent.top + 0.85 * MAP_MARGINS["top"] * long_side(arena, scale)
    return Extent(extent.left, extent.right, bottom - height, bottom)


def extent_with(key: U8, arena: Arena, scale: Scale) -> Extent:
    """Return the rectangle of a map view with a key above the map."""
    extent = map_extent(arena, scale)
    top = min(extent.top, key_extent(key, arena, scale).top)
    return Extent(extent.left, extent.right, top, extent.bottom)


def _wrapped(items: Sequence[Item], text: float, arena: Arena) -> U8:
    """Set items one after the other, in a new row where one would not fit.

    A key is as wide as its map, which is narrow where the arena is tall: its letters are then larger.
    """
    width_m, depth_m = arena.size_m
    fits = (WIDTH_PX - LEFT_PX) / max(_width(item, 100.0) for item in items) * 100
    larger = text * float(np.clip(depth_m / width_m, 1, LARGEST))
    return _drawn(tuple(items), max(min(larger, fits), text))


@lru_cache
def _drawn(items: tuple[Item, ...], text: float) -> U8:
    at, row, places = LEFT_PX, 0, []
    for item in items:
        width = _width(item, text)
        if at + width > WIDTH_PX and at > LEFT_PX:
            at, row = LEFT_PX, row + 1
        places.append((item, at, row))
        at += width
    key = np.full((round((row + 1) * ROW_HEIGHT * text), WIDTH_PX, 3), style.GROUND, np.uint8)
    for item, left, in_row in places:
        _put(key, item, left, (in_row + 0.5) * ROW_HEIGHT * text, text)
    return _kept(key)


def _width(item: Item, text: float) -> int:
    return round((item.wide + 2.0) * text) + text_size(item.text, text)[0]


def _put(key: U8, item: Item, left: int, middle: float, text: float) -> None:
    width, row = round(item.wide * text), round(middle)
    if item.mark is KeyMark.SCALE:
        colors = style.LUT[np.linspace(0, len(style.LUT) - 1, width).astype(int)]
        key[round(middle - text / 2) : round(middle + text / 2), left : left + width] = _rgb(colors)
    else:
        thick = max(2, width // 7) if item.mark is KeyMark.RING else -1
        cv2.circle(key, (left + width // 2, row), width // 2, item.color, thick, cv2.LINE_AA)
    put_text(key, item.text, left + width + 0.6 * text, middle + text / 2, text, style.PALE)
