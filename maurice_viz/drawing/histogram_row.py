"""Histograms of a picture as bars under those of a reference as a line, all channels of a run in one row.

Red, green and blue have a cell each. Edges are few and faint: their three planes are one cell, whose heights
are square roots. A two-dimensional histogram is two heat maps, the picture's left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.values import F32, U8

from ..style import EMPTY, GROUND, PALE, PICTURE, REFERENCE, RULER
from .heat import SHADES, grid_of, heat_of, place_heat
from .indexed import IndexedColors

MOST_CELLS = 6
KEY_PX, CELLS_PX, HIGH_PX, TITLE_PX = 150, 850, 60, 24  # of a row 1000 wide: its key, cells, and titles above
GAP_PX = 14  # between cells
LINE_PX = 2
LEAST = 1e-6
PLANES = "RGB"
EDGES = "edges"

ROW = IndexedColors()
GROUND_INK, AXIS_INK = ROW.flat(GROUND), ROW.flat(RULER)
BARS_INK, LINE_INK = ROW.flat(PICTURE), ROW.flat(REFERENCE)
HEAT_INK = ROW.ramp(EMPTY, PALE, SHADES)


@dataclass(frozen=True, slots=True)
class Cell:
    """A part of a channel's descriptor with a chart of its own."""

    channel: str
    title: str
    plane: int | None = None  # of red, green, blue; None: all of it


def cells_of(sizes: Mapping[str, int]) -> list[Cell]:
    """Return the cells of channels, by name with the length of their descriptors; at most `MOST_CELLS`."""
    cells: list[Cell] = []
    for channel, size in sizes.items():
        has_planes = size == len(PLANES) * BINS
        if has_planes and not channel.startswith(EDGES):
            cells += [Cell(channel, f"{channel} {name}", plane) for plane, name in enumerate(PLANES)]
        elif has_planes:
            cells.append(Cell(channel, f"{channel}, square root"))
        else:
            cells.append(Cell(channel, channel))
    return cells[:MOST_CELLS]


def cell_px(count: int) -> float:
    """Return the width of each of so many cells, with the gap beside it."""
    return CELLS_PX / max(count, 1)


def draw_row(cells: Sequence[Cell], sample: Mapping[str, F32], reference: Mapping[str, F32]) -> bytes:
    """Draw all cells side by side as a PNG."""
    image = np.full((HIGH_PX, CELLS_PX), GROUND_INK, np.uint8)
    for number, cell in enumerate(cells):
        left, right = round(cell_px(len(cells)) * number), round(cell_px(len(cells)) * (number + 1)) - GAP_PX
        _draw_cell(image[:, left:right], cell, sample[cell.channel], reference[cell.channel])
    return ROW.png(image)


def _draw_cell(image: U8, cell: Cell, sample: F32, reference: F32) -> None:
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
    image[np.arange(height)[:, None] >= bars] = BARS_INK
    image[-1] = AXIS_INK
    points = np.column_stack([np.arange(width), line]).astype(np.int32)
    cv2.polylines(image, [points], False, LINE_INK, LINE_PX)


def _values(cell: Cell, descriptor: F32) -> F32:
    """Return what is drawn of a descriptor (D,) in a cell."""
    planes = descriptor.reshape(-1, BINS) if len(descriptor) == len(PLANES) * BINS else descriptor[None]
    if cell.plane is not None:
        return np.asarray(planes[cell.plane])
    return np.asarray(
        np.sqrt(np.maximum(planes.sum(axis=0), 0)) if len(planes) > 1 else planes[0], np.float32
    )
