"""Color layout: colors on a coarse raster, normalized by brightness (after Kasutani and Yamada 2001)."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...values.arrays import F32, U8
from .chromaticity import BLACK

COLUMNS, ROWS = 6, 4
LEAST = 2.0  # minimum levels above black of a cell


class ColorLayout:
    """Shares of red and green in 24 parts of the picture. About 0.1 ms for 176 x 144."""

    name = "color_layout"
    distance = "l1"
    unit = "share of light"

    def describe(self, image: U8) -> F32:
        """Return r and g (48,) of each cell's mean color, row by row."""
        small = cv2.resize(image.astype(np.float32), (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
        light = np.maximum(small - np.float32(BLACK), np.float32(LEAST))
        return np.asarray((light / light.sum(axis=2, keepdims=True))[..., :2].ravel(), np.float32)

    def parameters(self) -> dict[str, Any]:
        """Raster and black level."""
        return {"feature": "normalized color layout", "columns": COLUMNS, "rows": ROWS, "black": BLACK}
