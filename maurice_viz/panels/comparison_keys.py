"""Keys of comparisons: what the marks mean, in as many rows as fit above a map view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.arrays import U8

from ..drawing.canvas import MARGIN, Extent, long_side, map_extent
from ..drawing.raster import plain, put_text, text_size
from ..scene import SceneInfo
from ..style import CIRCLE, COLOR_WORDS, ESTIMATE, GROUND, LUT, PALE, RANK, RGB, RUN_COLORS, TRUTH

WIDTH_PX = 1280
DISK_PX = 0.42  # radius of a disk, as a share of the height of capitals
RAMP_PX = 5.0  # length of the color scale, in heights of capitals
ROW_PX = 2.2  # height of a row, in heights of capitals
LEFT_PX = 60
WIDE_TEXT_PX, NARROW_TEXT_PX = 26.0, 31.0  # of capitals, where there are two runs and where there are more
NARROW_FROM = 3  # runs
SMALLER_MAP = 1.12  # the shared map is drawn smaller than the others, its key should not be


@dataclass(frozen=True, slots=True)
class Item:
    """One word of a key, with a disk of a color or the scale of the weights in front of it."""

    text: str
    color: RGB | None = None  # None: the color scale


def text_px(runs: int) -> float:
    """Give the height of capitals: columns are narrower where there are more runs."""
    return NARROW_TEXT_PX if runs >= NARROW_FROM else WIDE_TEXT_PX


def runs_key(labels: Sequence[str], has_truth: bool) -> U8:
    """Draw the key of the map that all runs share: a color a run, and the truth."""
    items = [
        Item(_legible(label, k), color)
        for k, (label, color) in enumerate(zip(labels, RUN_COLORS, strict=False))
    ]
    return _wrapped(items + _truth(has_truth), SMALLER_MAP * text_px(len(labels)))


def _legible(label: str, number: int) -> str:
    """Name a color where a label is in a script that cannot be drawn; panels of words have both."""
    return COLOR_WORDS[number] if plain(label).count("?") > label.count("?") else label


def belief_key(runs: int, has_truth: bool) -> U8:
    """Draw the key of one run's map: truth, estimate, and the color scale of the weights."""
    weight = Item("weight, 1/8 to 8 x average")
    return _wrapped([*_truth(has_truth), Item("estimate", ESTIMATE), weight], text_px(runs))


def circle_key(runs: int) -> U8:
    """Draw the key of one run's match circles, where columns are too narrow for the usual one."""
    items = [Item("likelihood (area)", CIRCLE), Item("best five", RANK), Item("particles", TRUTH)]
    return _wrapped(items, text_px(runs))


def _truth(has_truth: bool) -> list[Item]:
    return [Item("truth", TRUTH)] if has_truth else []


def key_extent(key: U8, shown: SceneInfo) -> Extent:
    """Give the rectangle of a key: as wide as the map view, its last row where the view's margin is."""
    extent = map_extent(shown.arena, shown.scale)
    height = extent.width * key.shape[0] / key.shape[1]
    bottom = extent.top + 0.85 * MARGIN["top"] * long_side(shown.arena, shown.scale)
    return Extent(extent.left, extent.right, bottom - height, bottom)


def extent_with(key: U8, shown: SceneInfo) -> Extent:
    """Give the rectangle of a map view with a key above the map."""
    extent = map_extent(shown.arena, shown.scale)
    top = min(extent.top, key_extent(key, shown).top)
    return Extent(extent.left, extent.right, top, extent.bottom)


def _wrapped(items: Sequence[Item], text: float) -> U8:
    """Set items one after the other, in a new row where one would not fit."""
    at, row, places = LEFT_PX, 0, []
    for item in items:
        width = _width(item, text)
        if at + width > WIDTH_PX and at > LEFT_PX:
            at, row = LEFT_PX, row + 1
        places.append((item, at, row))
        at += width
    key = np.full((round((row + 1) * ROW_PX * text), WIDTH_PX, 3), GROUND, np.uint8)
    for item, left, in_row in places:
        _put(key, item, left, (in_row + 0.5) * ROW_PX * text, text)
    return key


def _width(item: Item, text: float) -> int:
    mark = RAMP_PX if item.color is None else 2 * DISK_PX
    return round((mark + 2.0) * text) + text_size(item.text, text)[0]


def _put(key: U8, item: Item, left: int, middle: float, text: float) -> None:
    if item.color is None:
        width = round(RAMP_PX * text)
        colors = LUT[np.linspace(0, len(LUT) - 1, width).astype(int)]
        ramp = np.stack([colors >> 24, colors >> 16 & 255, colors >> 8 & 255], axis=1)
        key[round(middle - text / 2) : round(middle + text / 2), left : left + width] = ramp
    else:
        width = round(2 * DISK_PX * text)
        cv2.circle(key, (left + width // 2, round(middle)), width // 2, item.color, -1, cv2.LINE_AA)
    put_text(key, item.text, left + width + 0.6 * text, middle + text / 2, text, PALE)
