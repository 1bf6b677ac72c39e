"""What the elements of a descriptor are called, so that one can say where two pictures differ.

The elements of a channel stand in planes of equal length (the red bins, the green ones, ...). A run of them
lies within one plane and has a name: "blue 96 to 119". A channel that is not known here has one plane.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from maurice_mcl.channels import chromaticity, color_grid, color_layout, gain_color, hog, tiny
from maurice_mcl.channels.histogram import BINS, HIGH, LOW, WIDTH

COLORS = ("red", "green", "blue")
PARTS = color_grid.COLUMNS * color_grid.ROWS
CELLS = hog.COLUMNS * hog.ROWS

Name = Callable[[int, int, int], str]  # plane, first and last element in it -> a few words


@dataclass(frozen=True, slots=True)
class Planes:
    """How a descriptor is divided."""

    count: int
    name: Name


def planes_of(channel: str, size: int) -> Planes:
    """Give the planes of a channel whose descriptor has so many elements."""
    found = KNOWN.get(channel)
    return found[1] if found and found[0] == size else Planes(1, lambda _, a, b: f"elements {_span(a, b)}")


def _levels(what: str = "") -> Name:
    def name(plane: int, first: int, last: int) -> str:
        low, high = LOW + WIDTH * first, LOW + WIDTH * last + WIDTH - 1
        return f"{COLORS[plane]}{what} {low} to {HIGH if last == BINS - 1 else high}"

    return name


def _chromaticity(red: int, first: int, last: int) -> str:
    low, high = chromaticity.RANGE
    step = (high - low) / chromaticity.BINS

    def span(a: int, b: int) -> str:
        return f"{low + a * step:.2f} to {low + (b + 1) * step:.2f}"

    return f"red share {span(red, red)} with green share {span(first, last)}"


def _raster(rows: int, columns: int, numbers: int) -> Name:
    """Name cells of a raster over the picture, row by row, with so many numbers a cell."""

    def name(row: int, first: int, last: int) -> str:
        at, left, right = f"row {row + 1} of {rows}", first // numbers, last // numbers
        if right - left == columns - 1:
            return f"{at} of the picture"
        return f"{at}, column {_span(left, right)} of {columns} of the picture"

    return name


def _gain_color(plane: int, first: int, last: int) -> str:
    width = gain_color.MOST / BINS
    return f"{COLORS[plane]} {first * width:.1f} to {(last + 1) * width:.1f} times its mean"


def _color_grid(plane: int, first: int, last: int) -> str:
    part, color = divmod(plane, len(COLORS))
    width = (HIGH + 1 - LOW) / color_grid.BINS
    low, high = round(LOW + first * width), round(LOW + (last + 1) * width) - 1
    return f"{COLORS[color]} {low} to {high} in {_place(part, color_grid.COLUMNS)}"


def _hog(cell: int, first: int, last: int) -> str:
    width = 180 // hog.DIRECTIONS
    return f"edges at {first * width} to {(last + 1) * width} deg in {_place(cell, hog.COLUMNS)}"


def _moments(kind: int, first: int, last: int) -> str:
    what = ("mean", "spread", "skew")[kind]
    return f"{what} of {' and '.join(COLORS[first : last + 1])}"


def _place(cell: int, columns: int) -> str:
    row, column = divmod(cell, columns)
    return f"row {row + 1}, column {column + 1} of the picture"


def _span(first: int, last: int) -> str:
    return str(first + 1) if first == last else f"{first + 1} to {last + 1}"


# channel -> the size of its descriptor, and its planes
KNOWN: Mapping[str, tuple[int, Planes]] = {
    **{
        channel: (3 * BINS, Planes(3, _levels()))
        for channel in ("color", "smoothed", "blurred", "cumulative", "edge_color")
    },
    "edges": (3 * BINS, Planes(3, _levels(" edges of strength"))),
    "chromaticity": (chromaticity.BINS**2, Planes(chromaticity.BINS, _chromaticity)),
    "gain_color": (3 * BINS, Planes(3, _gain_color)),
    "tiny": (3 * tiny.COLUMNS * tiny.ROWS, Planes(tiny.ROWS, _raster(tiny.ROWS, tiny.COLUMNS, 3))),
    "color_layout": (
        2 * color_layout.COLUMNS * color_layout.ROWS,
        Planes(color_layout.ROWS, _raster(color_layout.ROWS, color_layout.COLUMNS, 2)),
    ),
    "color_grid": (PARTS * 3 * color_grid.BINS, Planes(PARTS * 3, _color_grid)),
    "hog": (CELLS * hog.DIRECTIONS, Planes(CELLS, _hog)),
    "moments": (9, Planes(3, _moments)),
}
