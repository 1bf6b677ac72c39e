"""Figures of what features and updates cost: the thesis's 70 to 72."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from maurice_viz.plots.calibration import ACTUAL, INK, figure

from .material import Material, ThesisFigure
from .over_particles import STYLES
from .timing import COMPARE, DESCRIBE, UPDATE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROUNDS = "10 to 90 % of the rounds"


def of_color(material: Material, what: str, label: str) -> Figure:
    """Draw what each feature takes, as a multiple of what color takes."""
    rows = _timed(material, what).sort("of_color", descending=True)
    drawing, axes = figure("", label, "feature")
    y = np.arange(len(rows))
    value, low, high = (rows[name].to_numpy() for name in ("of_color", "of_color_low", "of_color_high"))
    axes.hlines(y, min(0.8 * float(low.min()), 0.5), value, color=ACTUAL, linewidth=1, alpha=0.5)
    axes.errorbar(
        value,
        y,
        xerr=[value - low, high - value],
        color=ACTUAL,
        marker="o",
        linestyle="",
        capsize=3,
        label=f"median; {ROUNDS}",
    )
    for at, times, right in zip(y, value, high, strict=True):
        axes.annotate(
            f"{times:.2g} x", (right, at), (6, 0), textcoords="offset points", va="center", fontsize=8
        )
    axes.axvline(1, color=INK, linestyle=":", label="color")
    axes.set_xscale("log")
    axes.set_yticks(y, rows["feature"].to_list())
    axes.set_xlim(min(0.8 * float(low.min()), 0.5), 2 * float(high.max()))
    axes.xaxis.set_major_formatter(lambda times, _: f"{times:g}")
    axes.legend(fontsize=8, loc="upper right")
    return drawing


def update(material: Material) -> Figure:
    """Draw the time of one update against the number of particles, a line a feature, both on log scales."""
    timed = ("median_s", "low_s", "high_s")
    of_drives = _timed(material, UPDATE).group_by("feature", "particles", maintain_order=True)
    rows = of_drives.agg(pl.col(timed).mean(), drives=pl.len())
    drawing, axes = figure("", "particles", "CPU time of one update, picture to belief (ms)")
    for number, feature in enumerate(rows["feature"].unique(maintain_order=True).to_list()):
        some = rows.filter(pl.col("feature") == feature).sort("particles")
        color, marker, line = STYLES[number]
        x = some["particles"].to_numpy()
        y, low, high = (1000 * some[name].to_numpy() for name in timed)
        axes.plot(
            x,
            y,
            color=color,
            marker=marker,
            linestyle=line,
            label=f"{feature}, median of {some['drives'][0]} drives",
        )
        axes.fill_between(
            x, low, high, color=color, alpha=0.15, linewidth=0, label=None if number else f"band: {ROUNDS}"
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value:,g}")
    axes.legend(fontsize=8)
    return drawing


def _timed(material: Material, what: str) -> pl.DataFrame:
    return material.timing.filter(pl.col("what") == what)


FIGURES = (
    ThesisFigure(
        70,
        "Feature extraction, relative to color",
        partial(of_color, what=DESCRIBE, label="CPU time to describe a picture, over color's (ratio)"),
    ),
    ThesisFigure(
        71,
        "Feature comparison, relative to color",
        partial(of_color, what=COMPARE, label="CPU time to compare with the library, over color's (ratio)"),
    ),
    ThesisFigure(72, "Time of one update against the number of particles", update),
)
