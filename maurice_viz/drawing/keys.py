"""Keys: strips that stand above a map view, or beside a plot, and say what its marks mean."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from maurice_mcl.arrays import U8

from ..style import CIRCLE, DEEPEST, ESTIMATE, GROUND, LUT, PALE, RANK, RGB, TRUTH
from .raster import put_text, text_size

HEIGHT_PX = 64
TEXT_PX = 24.0
GAP_PX = 18
INSET_PX = 70
LINES_PX = 1060  # width of the key of a plot's lines
LINE_ROW_PX, LINE_TEXT_PX, LINE_PX = 44, 20.0, 50


def _strip(width: int) -> U8:
    return np.full((HEIGHT_PX, width, 3), GROUND, np.uint8)


def _text(text: str) -> U8:
    width, height = text_size(text, TEXT_PX)
    strip = _strip(width + GAP_PX)
    put_text(strip, text, 0, (HEIGHT_PX + height) / 2, TEXT_PX, PALE)
    return strip


def _disk(color: RGB, radius: int) -> U8:
    strip = _strip(2 * radius + GAP_PX)
    cv2.circle(strip, (radius, HEIGHT_PX // 2), radius, color, -1, cv2.LINE_AA)
    return strip


def _ramp() -> U8:
    ramp = np.stack([LUT >> 24, LUT >> 16 & 255, LUT >> 8 & 255], axis=1).astype(np.uint8)
    strip = _strip(len(ramp) + GAP_PX)
    strip[18:-18, : len(ramp)] = ramp
    return strip


def weight_key(has_truth: bool) -> U8:
    """Draw the arena's key: truth (if it is known), estimate, and the color scale of the weights."""
    parts = [_strip(INSET_PX)]
    parts += [_disk(TRUTH, 13), _text("truth  ")] if has_truth else []
    parts += [
        _disk(ESTIMATE, 13),
        _text("estimate  "),
        _text("weight: 1/8"),
        _ramp(),
        _text("8 times the average"),
    ]
    return np.concatenate(parts, axis=1)


def likelihood_key(has_truth: bool) -> U8:
    """Draw the likelihood maps' key: the color scale, the cloud, estimate and truth."""
    parts = [_strip(INSET_PX), _text(f"{DEEPEST:g} nats under the best"), _ramp(), _text("best  ")]
    parts += [_disk(TRUTH, 6), _text("particles  "), _disk(ESTIMATE, 13), _text("estimate")]
    parts += [_disk(TRUTH, 13), _text("truth")] if has_truth else []
    return np.concatenate(parts, axis=1)


def explain_key(has_truth: bool) -> U8:
    """Draw the key of the map with the references explained: circles, and whose reference an arrow is."""
    parts = [_strip(INSET_PX), _disk(CIRCLE, 20), _text("area: likelihood  "), _text("nearest reference to:")]
    parts += [_arrow(TRUTH), _text("truth")] if has_truth else []
    parts += [_arrow(ESTIMATE), _text("estimate  "), _arrow(RANK), _text("winner")]
    return np.concatenate(parts, axis=1)


def _arrow(color: RGB) -> U8:
    strip, middle = _strip(44 + GAP_PX), HEIGHT_PX // 2
    cv2.arrowedLine(strip, (2, middle), (44, middle), color, 7, cv2.LINE_AA, tipLength=0.4)
    return strip


def line_key(lines: Sequence[tuple[str, RGB, float]]) -> U8:
    """Draw what lines of a plot mean, by name, color and width, in as many rows as they need."""
    at, row, places = 24, 0, []
    for name, _, _ in lines:
        needed = LINE_PX + 10 + text_size(name, LINE_TEXT_PX)[0]
        if at > 24 and at + needed > LINES_PX:
            at, row = 24, row + 1
        places.append((at, row))
        at += needed + 30
    image = np.full(((row + 1) * LINE_ROW_PX, LINES_PX, 3), GROUND, np.uint8)
    for (name, color, width), (left, row) in zip(lines, places, strict=True):
        middle = round((row + 0.5) * LINE_ROW_PX)
        cv2.line(image, (left, middle), (left + LINE_PX, middle), color, round(4 * width), cv2.LINE_AA)
        put_text(image, name, left + LINE_PX + 10, middle + LINE_TEXT_PX / 2, LINE_TEXT_PX, PALE)
    return image


def circle_key() -> U8:
    """Draw the match map's key: circles, ranks and the cloud."""
    parts = [_strip(INSET_PX), _disk(CIRCLE, 20), _text("area: likelihood of a reference  ")]
    parts += [_disk(RANK, 13), _text("best five  "), _disk(TRUTH, 6), _text("particles")]
    return np.concatenate(parts, axis=1)


def way_key(moves: bool, has_truth: bool) -> U8:
    """Draw the key of a drive by itself: the true way, and the one by odometry alone."""
    parts = [_strip(INSET_PX)]
    parts += [_disk(TRUTH, 13), _text("truth  ")] if has_truth else []
    parts += [_disk(ESTIMATE, 13), _text("odometry alone")] if moves else []
    return np.concatenate(parts, axis=1)
