"""Heat maps of two-dimensional histograms: dark where there is nothing, the full color at the most."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from maurice_mcl.sensor.descriptors import chromaticity
from maurice_mcl.values import F32, U8

from ..style import BAR, EMPTY, PICTURE, REFERENCE
from .indexed import IndexedColors

GRIDS = {"chromaticity": (chromaticity.BINS, chromaticity.BINS)}  # rows and columns of 2D histograms
LEAST_HEIGHT = 1e-6  # of a scale: one of no height could not be drawn
SHADES = 24  # of a color, from nothing to the most

CHART = IndexedColors()  # of all charts
EMPTY_INK = CHART.flat(EMPTY)
HEATS = tuple(CHART.ramp(EMPTY, color, SHADES) for color in (PICTURE, REFERENCE, BAR))


def grid_of(channel: str, size: int) -> tuple[int, int] | None:
    """Return rows and columns of a two-dimensional histogram; None for any other descriptor."""
    grid = GRIDS.get(channel)
    return grid if grid is not None and grid[0] * grid[1] == size else None


def heat_of(values: F32, most: float, ink: int) -> U8:
    """Return (rows, columns), row 0 at the bottom: the root of the share of the most, as brightness.

    The root, because most bins of a histogram are far below the highest. `ink` is one of `HEATS`.
    """
    share = np.sqrt(np.clip(values / max(most, LEAST_HEIGHT), 0, 1))[::-1]
    return np.asarray(ink + (share * (SHADES - 1)).round(), np.uint8)


def place_heat(image: U8, maps: Sequence[U8]) -> None:
    """Put heat maps side by side on an image, as large as they fit, in place."""
    height, width = image.shape
    side = min(height - 2, (width - 4 * (len(maps) - 1)) // len(maps))
    left = (width - len(maps) * side - 4 * (len(maps) - 1)) // 2
    top = (height - side) // 2
    for k, heat_map in enumerate(maps):
        at = left + k * (side + 4)
        image[top : top + side, at : at + side] = _square(heat_map, side)


def _square(heat: U8, side: int) -> U8:
    return np.asarray(cv2.resize(heat, (side, side), interpolation=cv2.INTER_NEAREST), np.uint8)
