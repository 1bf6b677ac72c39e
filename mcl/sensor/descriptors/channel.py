"""What every channel does, and the CMUcam2's histogram, which many of them use."""

from __future__ import annotations

from typing import Any, Protocol

import cv2
import numpy as np

from ...values.arrays import F32, U8


class Channel(Protocol):
    """Measures a picture as one vector that is compared with a reference's, element by element."""

    @property
    def name(self) -> str:
        """Lower-case name, used on the command line and in files."""
        ...

    @property
    def distance(self) -> str:
        """Name of its default distance, see `sensor.distances`; a user may choose another."""
        ...

    @property
    def unit(self) -> str:
        """The unit of the vector's elements in a word or two, for the titles of charts."""
        ...

    def describe(self, image: U8) -> F32:
        """Return (D,) float32, finite and >= 0, of a picture (H, W, 3) RGB; D is always the same."""
        ...

    def parameters(self) -> dict[str, Any]:
        """Return everything that affects `describe`, as JSON; part of every cache key."""
        ...


BINS = 28
LOW, HIGH, WIDTH = 16, 240, 8
SCALE = 256.0  # value of a bin that holds every pixel ...
CAP = 255.0  # ... capped at the largest value the camera can send


def camera_histogram(image: U8) -> F32:
    """Return the histogram (84,) of a picture (H, W, 3): 28 bins of red, then green, then blue."""
    planes = [_bins_of(image, plane) for plane in range(3)]
    share = np.concatenate(planes) / np.float32(image.shape[0] * image.shape[1])
    return np.asarray(np.minimum(share * np.float32(SCALE), CAP), np.float32)


def _bins_of(image: U8, plane: int) -> F32:
    counts = cv2.calcHist([image], [plane], None, [256], [0.0, 256.0]).ravel()
    bins = counts[LOW:HIGH].reshape(BINS, WIDTH).sum(axis=1)
    bins[-1] += counts[HIGH]
    return np.asarray(bins, np.float32)
