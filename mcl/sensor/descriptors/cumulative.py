"""Cumulative color: how many pixels are darker than each level (Stricker and Orengo 1995).

Differences of cumulative histograms add up to the earth mover's distance in one dimension: a small change
of light costs little and a large one much. Very likely the thesis's "summation histogram" (figure 43).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays import F32, U8
from .channel import BINS, camera_histogram


@dataclass(frozen=True, slots=True)
class Cumulative:
    """Color, compared by how far pixels moved, not only how many. About 0.05 ms for 176 x 144."""

    name: str = "cumulative"
    distance: str = "hellinger"
    unit: str = "256 x share"

    def describe(self, image: U8) -> F32:
        """Return running sums (84,) of each plane's camera histogram, in units of 256 x share of pixels."""
        planes = camera_histogram(image).reshape(3, BINS)
        return np.asarray(planes.cumsum(axis=1, dtype=np.float32).ravel(), np.float32)

    def parameters(self) -> dict[str, Any]:
        """Nothing can be chosen but the histogram's own bins."""
        return {"feature": "cumulative camera histogram", "bins": BINS}
