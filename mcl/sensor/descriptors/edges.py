"""Edges: the histogram of the edge image, Sobel's magnitude per color (thesis 4.2.2, figs. 51 to 55).

After a light blur, pixels with almost no gradient stay below 16 and so out of the histogram.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...values.arrays import F32, U8
from .channel import BINS, HIGH, LOW, camera_histogram

BLUR_PX = 1.0  # sd of the Gaussian, at the width for which it was chosen
GAIN = 0.5  # a step of 128 gray levels from one pixel to the next then reads 164


def edge_image(image: U8) -> U8:
    """Return the edge image (H, W, 3) uint8 of a picture (H, W, 3) uint8, each color plane separately."""
    smooth = cv2.GaussianBlur(image, (0, 0), BLUR_PX)
    # a plane at a time, so that memory can be reused
    planes = [_gradient(np.asarray(plane, np.uint8)) for plane in cv2.split(smooth)]
    return np.asarray(cv2.merge(planes), np.uint8)


def _gradient(plane: U8) -> U8:
    across = cv2.Sobel(plane, cv2.CV_32F, 1, 0)
    down = cv2.Sobel(plane, cv2.CV_32F, 0, 1)
    magnitude = cv2.magnitude(across, down, across)
    return np.asarray(cv2.convertScaleAbs(magnitude, alpha=GAIN), np.uint8)


class Edges:
    """How many edges there are, and how strong. Less sensitive to the color of light than color is."""

    name = "edges"
    distance = "hellinger"
    unit = "256 x share"

    def describe(self, image: U8) -> F32:
        """Return the camera histogram (84,) of the edge image of a picture (H, W, 3) RGB."""
        return camera_histogram(edge_image(image))

    def parameters(self) -> dict[str, Any]:
        """Bins, range, blur and gain."""
        return {
            "feature": "histogram of Sobel magnitude",
            "bins": BINS,
            "low": LOW,
            "high": HIGH,
            "blur_px": BLUR_PX,
            "gain": GAIN,
        }
