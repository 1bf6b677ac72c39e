"""Edge color: the colors of the pixels that lie on an edge (the other reading of thesis 4.2.2, figure 52)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...values.arrays import F32, U8
from .channel import BINS, HIGH, LOW, SCALE
from .edges import edge_image

LEAST_EDGE = 32  # of the edge image, 0 to 255: above the sensor's noise


class EdgeColor:
    """Which colors meet at edges; walls and floors, which fill most pictures, do not count. About 0.6 ms."""

    name = "edge_color"
    distance = "hellinger"
    unit = "256 x share"

    def describe(self, image: U8) -> F32:
        """Return 28 bins a plane (84,) over the edge pixels, in the unit 256 x share of all pixels."""
        on_edge = np.asarray(edge_image(image).max(axis=2) >= LEAST_EDGE, np.uint8)
        ranges = [float(LOW), float(HIGH + 1)]
        planes = [cv2.calcHist([image], [k], on_edge, [BINS], ranges).ravel() for k in range(3)]
        return np.asarray(np.concatenate(planes) * (SCALE / on_edge.size), np.float32)

    def parameters(self) -> dict[str, Any]:
        """The threshold."""
        return {"feature": "color histogram of edge pixels", "least_edge": LEAST_EDGE, "bins": BINS}
