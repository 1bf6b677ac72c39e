"""Gain-normalized color: each plane divided by its own mean, then its histogram.

The gray-world assumption (Buchsbaum 1980; Finlayson, Schiele and Crowley 1998): gain and white balance
cancel.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...values.arrays import F32, U8
from .channel import BINS, SCALE
from .chromaticity import BLACK
from .smoothed import smooth

MOST = 4.0  # times the mean; brighter pixels count in the last bin
BLUR_PX = 1.0


class GainColor:
    """Invariant to gain and white balance, but blind to a room's overall color. About 0.6 ms."""

    name = "gain_color"
    distance = "hellinger"
    unit = "256 x share"

    def describe(self, image: U8) -> F32:
        """Return 28 bins a plane (84,) over 0 to 4 times its mean, in the unit 256 x share of pixels."""
        light = np.maximum(cv2.GaussianBlur(image, (0, 0), BLUR_PX).astype(np.float32) - np.float32(BLACK), 0)
        means = np.maximum(light.mean(axis=(0, 1)), 1)
        scaled = np.asarray(np.minimum(light / means, MOST - 1e-3), np.float32)
        planes = [cv2.calcHist([scaled], [k], None, [BINS], [0.0, MOST]).ravel() for k in range(3)]
        share = np.concatenate(planes) * (SCALE / (light.shape[0] * light.shape[1]))
        return smooth(np.asarray(share, np.float32))

    def parameters(self) -> dict[str, Any]:
        """Bins, range, black level and blur."""
        return {
            "feature": "gray-world normalized histogram",
            "bins": BINS,
            "most": MOST,
            "black": BLACK,
            "blur_px": BLUR_PX,
        }
