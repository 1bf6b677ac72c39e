"""Cumulative color: how many pixels are darker than each level (Stricker and Orengo 1995).

Very likely the thesis's "summation histogram" (figure 43); differences add up to the earth mover's distance.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...values.arrays import F32, U8
from .channel import BINS, camera_histogram


class Cumulative:
    """Color, compared by how far pixels moved, not only how many. About 0.05 ms for 176 x 144."""

    name = "cumulative"
    distance = "hellinger"
    unit = "256 x share"

    def describe(self, image: U8) -> F32:
        """Return running sums (84,) of each plane's camera histogram, in units of 256 x share of pixels."""
        planes = camera_histogram(image).reshape(3, BINS)
        return np.asarray(planes.cumsum(axis=1, dtype=np.float32).ravel(), np.float32)

    def parameters(self) -> dict[str, Any]:
        """Nothing can be chosen but the histogram's own bins."""
        return {"feature": "cumulative camera histogram", "bins": BINS}
