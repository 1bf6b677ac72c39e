"""Blurred color: the color histogram of a blurred picture. The other reading of "smoothing" (thesis 4.1)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...values.arrays import F32, U8
from .channel import camera_histogram

BLUR_PX = 2.0  # sd of the Gaussian: removes the sensor's noise, which widens every peak


class Blurred:
    """Color without the sensor's noise, and without small details. About 0.3 ms."""

    name = "blurred"
    distance = "hellinger"
    unit = "256 x share"

    def describe(self, image: U8) -> F32:
        """Return the camera histogram (84,) of a picture (H, W, 3) RGB after a Gaussian blur."""
        return camera_histogram(np.asarray(cv2.GaussianBlur(image, (0, 0), BLUR_PX), np.uint8))

    def parameters(self) -> dict[str, Any]:
        """The blur."""
        return {"feature": "camera histogram of a blurred picture", "blur_px": BLUR_PX}
