"""Marks that figures share: lines told apart in gray print, histograms by bin, pictures, small print."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from maurice_mcl.fitting.sensor import COLORS
from maurice_mcl.sensor.descriptors.histograms import BINS
from maurice_mcl.values.arrays import F32, F64, U8
from maurice_mcl.values.geometry import INCH_M
from maurice_viz.plots.calibration import INK, RGB, dress

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINES = ("-", "--", ":")  # of red, green and blue
MARKERS = ("o", "s", "^")
BIN_AXIS = "bin, of 8 pixel values each; bin 1 is 16 to 23"
COUNT_AXIS = "256 x share of pixels"
NUMBERS = np.arange(1, BINS + 1)
LETTERS = 15  # of small print in an inch
WIDTH, HEIGHT = 11.0, 4.8  # inches, of several axes; one alone is narrower


def grid_of_axes(
    columns: int, rows: int = 1, *, height: float = HEIGHT, widths: tuple[float, ...] = (), same: bool = False
) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes row by row; `same` gives them one vertical axis."""
    from matplotlib.figure import Figure as New

    drawing = New(figsize=(WIDTH if columns > 1 else 8.0, height), layout="constrained")
    ratios = widths or (1.0,) * columns
    return drawing, list(
        drawing.subplots(rows, columns, width_ratios=ratios, sharey=same, squeeze=False).flat
    )


def by_bin(label: str) -> tuple[Figure, Axes]:
    """Return a figure over the bins of a histogram."""
    drawing, (axes,) = grid_of_axes(1)
    dress(axes, "", BIN_AXIS, label)
    bin_ticks(axes)
    return drawing, axes


def bin_ticks(axes: Axes) -> None:
    """Number every other bin, as the thesis does."""
    axes.set_xticks(NUMBERS[::2])
    axes.set_xlim(0.2, BINS + 0.8)


def draw_colors(axes: Axes, values: F32 | F64, among: F32 | F64 | None = None) -> None:
    """Draw red, green and blue (84,) over the bins, with the range over some others (K, 84)."""
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        channel_values = values.reshape(3, BINS)[k]
        axes.plot(NUMBERS, channel_values, LINES[k], marker=MARKERS[k], ms=4, color=color, label=name)
        if among is not None and len(among) > 1:
            all_of = among.reshape(-1, 3, BINS)[:, k]
            axes.vlines(NUMBERS + 0.16 * (k - 1), all_of.min(axis=0), all_of.max(axis=0), color=color, lw=1)
    axes.legend(fontsize=8)


def remark(drawing: Figure, text: str) -> None:
    """Write small print below everything."""
    drawing.supxlabel(wrapped(drawing, text), fontsize=8, color=INK, x=0.01, ha="left")


def wrapped(drawing: Figure, text: str) -> str:
    """Break small print into lines as wide as the figure."""
    return fill(text, int(drawing.get_figwidth() * LETTERS))


def draw_picture(axes: Axes, image: U8, title: str, below: str) -> None:
    """Draw a picture with a title, and a line below it."""
    axes.imshow(image, interpolation="nearest")
    axes.set_title(title, loc="left", fontsize=9, color=INK)
    axes.set_xlabel(below, fontsize=9)
    axes.set_xticks([])
    axes.set_yticks([])


def say_pose(pose: F64) -> str:
    """Write a pose (3,) with its units."""
    x, y = pose[:2] / INCH_M
    return f"({x:.1f}, {y:.1f}) in, {np.degrees(pose[2]):.0f} deg"
