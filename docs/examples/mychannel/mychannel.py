"""Brightness by row: how light the picture is from top to bottom."""

from __future__ import annotations

import cv2
import numpy as np


class MyChannel:
    name = "mychannel"  # a lower-case word: on the command line, in files, in panels
    distance = "l1"  # what suits it best
    unit = "gray levels"  # what its numbers are, for the titles of charts

    def describe(self, image):
        """Measure a picture (H, W, 3) uint8 RGB: (D,) float32, finite, >= 0, D the same for any picture."""
        gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
        return cv2.resize(gray, (1, 16), interpolation=cv2.INTER_AREA).ravel()

    def parameters(self):
        """All that changes what `describe` gives, as JSON: libraries are built again when it changes."""
        return {"feature": "brightness by row", "rows": 16, "version": 1}
