"""Figures for print: drawn without a display, legends below the axes, written completely or not at all."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maurice_loaders.errors import InputError
from maurice_loaders.io.files import expect_absent, write_whole
from maurice_mcl.arrays import F64
from maurice_mcl.calibration.statistics import Spread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito (2008), for white ground
MEASURED, ACTUAL, CORRECTED = "#E69F00", "#0072B2", "#009E73"
BAND, INK = "#D9DCE2", "#33363D"
FLOORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
RGB = ("#D62F2F", "#2E9E47", "#2F62D6")
DPI = 110
MOST_BARS = 60  # more trials are drawn as points
EXTRA = "pip install 'maurice-replay[plots]'"


def expect_matplotlib(target: Path) -> None:
    """Raise InputError with the command that installs it where matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401 - checks whether it is installed
    except ImportError:
        raise InputError(target, f"cannot be drawn: matplotlib is not installed; {EXTRA}") from None


def figure(title: str, x: str, y: str, size: tuple[float, float] = (8.0, 4.6)) -> tuple[Figure, Axes]:
    """Return a figure with one pair of axes, a title and labels with their units."""
    from matplotlib.figure import Figure as New

    made = New(figsize=size, layout="constrained")
    axes = made.subplots()
    dress(axes, title, x, y)
    return made, axes


def dress(axes: Axes, title: str, x: str, y: str) -> None:
    """Set the axes' title, labels and a light grid."""
    axes.set_title(title, loc="left", fontsize=12, color=INK)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True, color="#E6E8EC", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def legend(made: Figure) -> None:
    """Put the legend below everything, where it covers nothing."""
    made.legend(loc="outside lower center", ncols=4, frameon=False)


def save(made: Figure, file: Path, *, force: bool) -> None:
    """Write a figure as PNG. Raises InputError when the file exists (unless `force`)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    expect_absent(file, force=force)
    data = io.BytesIO()
    FigureCanvasAgg(made)
    made.savefig(data, format="png", dpi=DPI, metadata={"Software": None})
    write_whole(file, data.getvalue(), force=force)


def against_normal(axes: Axes, values: F64, spread: Spread, unit: str) -> None:
    """Draw a histogram of errors (n,) and the normal distribution of their mean and sd, in trials a bin."""
    from matplotlib.ticker import MaxNLocator

    mean, sd = spread.mean.value, spread.sd.value
    reach = max(float(np.abs(values - mean).max()), 3 * sd, 1e-9) * 1.05
    count = min(2 * round(np.sqrt(len(values))) + 1, 41)  # odd, so that one is in the middle
    edges = np.linspace(mean - reach, mean + reach, max(count, 9) + 1)
    axes.hist(values, list(edges), color=ACTUAL, alpha=0.75, edgecolor="white", label="trials")
    if sd > 0:
        x = np.linspace(edges[0], edges[-1], 400)
        density = np.exp(-(((x - mean) / sd) ** 2) / 2) / (sd * np.sqrt(2 * np.pi))
        y = density * len(values) * (edges[1] - edges[0])
        axes.plot(x, y, color=INK, linewidth=2, label=f"normal, mean {mean:.3g} {unit}, sd {sd:.3g} {unit}")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
