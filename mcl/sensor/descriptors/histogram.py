"""The CMUcam2's histogram: 28 bins a channel over 16 to 240, in the unit 256 x share of pixels.

Bin b holds the values 16 + 8b to 23 + 8b; the last one also holds 240 (CMUcam2 manual, command GH;
thesis figs. 14, 15 and 21 have these axes). Values outside 16 to 240 are in no bin but do count as pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...arrays import F32, U8

BINS = 28
LOW, HIGH, WIDTH = 16, 240, 8
SCALE = 256.0  # what a bin reads that holds every pixel ...
CAP = 255.0  # ... capped at the largest value the camera can send


def camera_histogram(image: U8) -> F32:
    """Return the histogram (84,) of a picture (H, W, 3): 28 bins of red, then green, then blue."""
    planes = [_bins_of(image, plane) for plane in range(3)]
    share = np.concatenate(planes) / np.float32(image.shape[0] * image.shape[1])
    return np.asarray(np.minimum(share * np.float32(SCALE), CAP), np.float32)


def _bins_of(image: U8, plane: int) -> F32:
    counts = np.asarray(cv2.calcHist([image], [plane], None, [256], [0.0, 256.0]), np.float32).ravel()
    bins = counts[LOW:HIGH].reshape(BINS, WIDTH).sum(axis=1)
    bins[-1] += counts[HIGH]
    return np.asarray(bins, np.float32)
