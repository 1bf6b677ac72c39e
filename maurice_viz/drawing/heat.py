"""Heat maps of two-dimensional histograms: dark where there is nothing, the full color at the most."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.sensor.descriptors import chromaticity
from maurice_mcl.values.arrays import F32, U8

from ..style import BAR, EMPTY, GROUND, PALE, PICTURE, REFERENCE
from .bars import LEAST_HEIGHT
from .canvas import text_size
from .indexed import IndexedColors, write

GRIDS = {"chromaticity": (chromaticity.BINS, chromaticity.BINS)}  # rows and columns of 2D histograms
AXES_WORDS = "up: red share, right: green share, 0.13 to 0.55"
HEAT_PX = 176  # side of a heat map in a panel of its own
TITLE_PX, TITLE_TEXT_PX, GAP_PX = 26, 11.0, 14
SHADES = 24  # of a color, from nothing to the most

CHART = IndexedColors()  # of all charts
EMPTY_INK = CHART.flat(EMPTY)
HEATS = tuple(CHART.ramp(EMPTY, color, SHADES) for color in (PICTURE, REFERENCE, BAR))
_TITLE_INK = CHART.ramp(GROUND, PALE)


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


def titled_heat(maps: Sequence[U8], titles: tuple[str, ...], below: str) -> U8:
    """Draw heat maps side by side (H, W), each under its title, over a line about their axes."""
    ground, first = _titled(titles, below)
    image = ground.copy()
    for k, heat_map in enumerate(maps):
        left = first + k * (HEAT_PX + GAP_PX)
        image[TITLE_PX : TITLE_PX + HEAT_PX, left : left + HEAT_PX] = _square(heat_map, HEAT_PX)
    return image


@lru_cache(maxsize=8)
def _titled(titles: tuple[str, ...], below: str) -> tuple[U8, int]:
    """Draw all but the maps (H, W); return it, and where the first map begins."""
    needed = text_size(below, TITLE_TEXT_PX)[0]
    together = len(titles) * (HEAT_PX + GAP_PX) - GAP_PX
    width = max(together, needed) + 2 * GAP_PX
    first = (width - together) // 2
    image = np.full((2 * TITLE_PX + HEAT_PX, width), _TITLE_INK, np.uint8)
    for k, title in enumerate(titles):
        write(image, title, first + k * (HEAT_PX + GAP_PX), TITLE_PX - 8, TITLE_TEXT_PX, _TITLE_INK)
    write(image, below, (width - needed) / 2, len(image) - 8, TITLE_TEXT_PX, _TITLE_INK)
    return image, first


def _square(heat: U8, side: int) -> U8:
    return np.asarray(cv2.resize(heat, (side, side), interpolation=cv2.INTER_NEAREST), np.uint8)
