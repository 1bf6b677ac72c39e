"""Histograms of a picture as bars under those of a reference as a line, in a grid of cells.

Red, green and blue have a cell each, in their colors. Edges are few and faint: their three planes are one
gray cell, whose heights are square roots. A two-dimensional histogram is two heat maps, the picture's left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.values import F32, U8

from ..style import BAR, EMPTY, GROUND, PALE, RED_GREEN_BLUE, RGB, RULER, RUN_COLORS
from .heat import SHADES, grid_of, heat_of, place_heat
from .indexed import IndexedColors

MOST_CELLS, COLUMNS = 4, 2
WIDE_PX, HIGH_PX = 160, 88  # of a cell with what is around its chart, in pixels of the drawing
TITLE_PX, GAP_PX = 24, 10  # above a chart, and right of it
LINE_PX = 2
DIM = 0.6  # of the colors of bars, so that the line over them is seen
LEAST = 1e-6
PLANES = "RGB"
EDGES = "edges"


def _dim(color: Sequence[int]) -> RGB:
    red, green, blue = (round(DIM * part) for part in color[:3])
    return red, green, blue


BARS = (*(_dim(color) for color in RED_GREEN_BLUE), _dim(BAR))  # red, green, blue, all others
CHARTS = IndexedColors()
GROUND_INK, AXIS_INK = CHARTS.flat(GROUND), CHARTS.flat(RULER)
*PLANE_INKS, GRAY_INK = (CHARTS.flat(color) for color in BARS)
LINE_INKS = [CHARTS.flat(color) for color in RUN_COLORS]  # of each run
HEAT_INK = CHARTS.ramp(EMPTY, PALE, SHADES)


@dataclass(frozen=True, slots=True)
class Cell:
    """A part of a channel's descriptor with a chart of its own."""

    channel: str
    title: str
    plane: int | None = None  # of red, green, blue; None: all of it


def cells_of(sizes: Mapping[str, int]) -> list[Cell]:
    """Return the cells of channels, by name with the length of their descriptors; at most `MOST_CELLS`."""
    cells: list[Cell] = []
    colors = [channel for channel, size in sizes.items() if _has_planes(channel, size)]
    for channel, size in sizes.items():
        if _has_planes(channel, size):
            before = "" if colors == [channel] else f"{channel} "
            cells += [Cell(channel, f"{before}{name}", plane) for plane, name in enumerate(PLANES)]
        else:
            cells.append(Cell(channel, channel))
    return cells[:MOST_CELLS]


def _has_planes(channel: str, size: int) -> bool:
    return size == len(PLANES) * BINS and not channel.startswith(EDGES)


def rows_of(cells: Sequence[Cell]) -> int:
    """Return how many rows the grid of the cells has."""
    return max(-(-len(cells) // COLUMNS), 1)


def draw_grid(
    cells: Sequence[Cell], sample: Mapping[str, F32], reference: Mapping[str, F32], run: int
) -> bytes:
    """Draw all cells that are known as a PNG, the reference in the color of a run of this number."""
    image = np.full((rows_of(cells) * HIGH_PX, COLUMNS * WIDE_PX), GROUND_INK, np.uint8)
    ink = LINE_INKS[run % len(LINE_INKS)]
    for number, cell in enumerate(cells):
        if cell.channel in sample and cell.channel in reference:
            top, left = HIGH_PX * (number // COLUMNS) + TITLE_PX, WIDE_PX * (number % COLUMNS)
            part = image[top : top + HIGH_PX - TITLE_PX, left + GAP_PX // 2 : left + WIDE_PX - GAP_PX // 2]
            _draw_cell(part, cell, sample[cell.channel], reference[cell.channel], ink)
    return CHARTS.png(image)


def _draw_cell(image: U8, cell: Cell, sample: F32, reference: F32, line_ink: int) -> None:
    grid = grid_of(cell.channel, len(sample))
    if grid is not None:
        most = float(max(sample.max(), reference.max()))
        place_heat(image, [heat_of(part.reshape(grid), most, HEAT_INK) for part in (sample, reference)])
        return
    values, others = (_values(cell, part) for part in (sample, reference))
    height, width = image.shape
    top = 1.05 * max(float(values.max()), float(others.max()), LEAST)
    element = np.arange(width) * len(values) // width
    bars, line = (np.rint((height - 1) * (1 - part[element] / top)) for part in (values, others))
    image[np.arange(height)[:, None] >= bars] = GRAY_INK if cell.plane is None else PLANE_INKS[cell.plane]
    image[-1] = AXIS_INK
    points = np.column_stack([np.arange(width), line]).astype(np.int32)
    cv2.polylines(image, [points], False, line_ink, LINE_PX)


def _values(cell: Cell, descriptor: F32) -> F32:
    """Return what is drawn of a descriptor (D,) in a cell."""
    planes = descriptor.reshape(-1, BINS) if len(descriptor) == len(PLANES) * BINS else descriptor[None]
    if cell.plane is not None:
        return np.asarray(planes[cell.plane])
    return np.asarray(
        np.sqrt(np.maximum(planes.sum(axis=0), 0)) if len(planes) > 1 else planes[0], np.float32
    )
