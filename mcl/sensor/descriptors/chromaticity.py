"""Chromaticity: how red and how green the pixels are, whatever their brightness (Swain and Ballard 1991)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...values import F32, U8

BINS = 16  # a side
RANGE = (0.13, 0.55)  # of r and of g; values outside count at the border
BLACK = 24.0  # level without light, from the thesis's covered-lens histograms (figure 14)
DARKEST = 6.0  # R + G + B above black; a darker pixel has no usable color
BLUR_PX = 1.5  # sd: dark pixels' noise would otherwise color them


def opponents(image: U8) -> tuple[F32, F32, F32]:
    """Return r, g and brightness R + G + B over black, of every other row and column of a blurred picture."""
    smooth = cv2.GaussianBlur(image, (0, 0), BLUR_PX)[::2, ::2]
    # a plane at a time: numpy takes several times as long along an axis of three
    light = np.ascontiguousarray(smooth.transpose(2, 0, 1), np.float32)
    light -= np.float32(BLACK)
    red, green, blue = np.clip(light, 0, None, out=light)
    total = red + green + blue
    usable = np.clip(total, np.float32(DARKEST), None)
    return red / usable, green / usable, total


def _bin(share: F32) -> F32:
    low, high = RANGE
    place = (share - np.float32(low)) * np.float32(BINS / (high - low))
    return np.asarray(np.clip(place, 0, BINS - 1), np.float32)


class Chromaticity:
    """Invariant to the amount of light, not to its color. About 0.3 ms for 176 x 144."""

    name = "chromaticity"
    distance = "hellinger"
    unit = "share"

    def describe(self, image: U8) -> F32:
        """Return a histogram (256,) over r and g that sums to one; pixels count by the root of brightness."""
        red, green, total = opponents(image)
        cell = _bin(red).astype(np.int32) * BINS + _bin(green).astype(np.int32)
        counts = np.bincount(cell.ravel(), np.sqrt(total).ravel(), BINS * BINS)
        return np.asarray(counts / max(float(counts.sum()), 1e-9), np.float32)

    def parameters(self) -> dict[str, Any]:
        """Bins, range, black level and blur."""
        return {
            "feature": "chromaticity histogram",
            "bins": BINS,
            "range": list(RANGE),
            "black": BLACK,
            "darkest": DARKEST,
            "blur_px": BLUR_PX,
        }
