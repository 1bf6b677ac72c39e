"""Keys: strips that stand above a map view and say what its marks mean."""

from __future__ import annotations

import cv2
import numpy as np

from maurice_mcl.typing import U8

from .draw_likelihood import DEEPEST
from .look import CIRCLE, ESTIMATE, GROUND, LUT, PALE, RANK, RGB, TRUTH
from .raster import put_text, text_size

HEIGHT_PX = 64
TEXT_PX = 24.0
GAP_PX = 18
INSET_PX = 70


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


def circle_key() -> U8:
    """Draw the match map's key: circles, ranks and the cloud."""
    parts = [_strip(INSET_PX), _disk(CIRCLE, 20), _text("area: likelihood of a reference  ")]
    parts += [_disk(RANK, 13), _text("best five  "), _disk(TRUTH, 6), _text("particles")]
    return np.concatenate(parts, axis=1)
