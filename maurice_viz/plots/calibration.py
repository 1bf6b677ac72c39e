"""The thesis's figures 4 to 11 from calibration trials, and 13 and 14 from covered-lens pictures."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_mcl.fitting.motion import Calibration, Trials
from maurice_mcl.fitting.sensor import COLORS, NoiseFloor, stretched
from maurice_mcl.fitting.statistics import Fitted, Spread
from maurice_mcl.sensor.descriptors.histograms import BINS, LOW, WIDTH
from maurice_mcl.values import F64

from ..style import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Okabe and Ito (2008), for white ground
MEASURED, ACTUAL, CORRECTED = "#E69F00", "#0072B2", "#009E73"
BAND, INK = "#D9DCE2", "#33363D"
FLOORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
FLOOR_MARKS = "os^Dv*"  # told apart in gray print too
RGB = ("#D62F2F", "#2E9E47", "#2F62D6")
HATCHES = ("", "////", "....")  # of red, green and blue, for gray print
DPI = 110
MOST_BARS = 60  # more trials are drawn as points
EXTRA = "pip install 'maurice-replay[plots]'"


def expect_matplotlib(target: Path) -> None:
    """Raise InputError with the command that installs it where matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401 - checks whether it is installed
    except ImportError:
        raise InputError(target, f"cannot be drawn: matplotlib is not installed; {EXTRA}") from None


def figure(title: str, x: str, y: str) -> tuple[Figure, Axes]:
    """Return a figure with one pair of axes, a title and labels with their units."""
    from matplotlib.figure import Figure as New

    drawing = New(figsize=(8.0, 4.6), layout="constrained")
    axes = drawing.subplots()
    dress(axes, title, x, y)
    return drawing, axes


def dress(axes: Axes, title: str, x: str, y: str) -> None:
    """Write a title and labels with their units, over a quiet grid."""
    axes.set_title(title, loc="left", fontsize=12, color=INK)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True, color="#E6E8EC", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


LEFT_OUT = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}  # dates


def save(drawing: Figure, file: Path, *, force: bool) -> None:
    """Write a figure as its suffix says. InputError for another one; where it exists, unless `force`."""
    if file.suffix not in LEFT_OUT:
        raise InputError(file, f"found the ending {file.suffix!r}, expected {', '.join(LEFT_OUT)}")
    expect_absent(file, force=force)
    write_whole(file, figure_bytes(drawing, file.suffix[1:]), force=force)


def figure_bytes(drawing: Figure, kind: str, dpi: int | None = None) -> bytes:
    """Return a figure as a PNG, SVG or PDF, the same on every day."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    data = io.BytesIO()
    FigureCanvasAgg(drawing)
    drawing.savefig(data, format=kind, dpi=dpi or DPI, metadata=LEFT_OUT[f".{kind}"], bbox_inches="tight")
    return data.getvalue()


def against_normal(axes: Axes, values: F64, spread: Spread, unit: str) -> None:
    """Draw a histogram of errors and the normal distribution of their mean and sd, in trials a bin."""
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


Whole = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ShownFit:
    """The trials, their fit and the units of the figures."""

    trials: Trials
    fit: Calibration
    units: Units

    @property
    def turns_deg(self) -> tuple[F64, F64]:
        """Measured and actual turns, one per trial."""
        return np.degrees(self.trials.turns.measured_rad), np.degrees(self.trials.turns.actual_rad)

    @property
    def residual_deg(self) -> F64:
        """The residual of every turn after the gain."""
        measured, actual = self.turns_deg
        return np.asarray(actual - self.fit.turns.gain.value * measured)


def draw_motion(shown: ShownFit, folder: Path, *, force: bool) -> list[Path]:
    """Write figures 4 to 11 into a folder. Raises InputError when one of them exists (unless `force`)."""
    files = [folder / f"{name}.png" for name in FIGURES]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(folder, f"cannot be made: {problem.strerror}; choose another place") from None
    for file in files:
        expect_absent(file, force=force)
    for file, name in zip(files, FIGURES, strict=True):
        save(motion_figure(name, shown), file, force=force)
    return files


def motion_figure(name: str, shown: ShownFit) -> Figure:
    """Draw one of FIGURES, with its legend below it, where it covers nothing."""
    drawing = FIGURES[name](shown)
    columns = 1 if FIGURES[name] is _turn_scatter else 4
    drawing.legend(loc="outside lower center", ncols=columns, frameon=False)
    return drawing


def _turn_trials(shown: ShownFit) -> Figure:
    drawing, axes = figure("Measured and actual turns", "trial", "turn (degrees, counter-clockwise)")
    measured, actual = shown.turns_deg
    _side_by_side(axes, {"measured by the encoders": (measured, MEASURED), "actual": (actual, ACTUAL)})
    return drawing


def _turn_scatter(shown: ShownFit) -> Figure:
    drawing, axes = figure(
        "Measured against actual turns", "actual turn (degrees)", "measured turn (degrees)"
    )
    drawing.set_size_inches(6.4, 6.0)
    measured, actual = shown.turns_deg
    ends = np.array([actual.min(), actual.max()])
    slope = shown.fit.turns.figure_5_slope
    axes.axline((0, 0), slope=1, color="#9AA0AA", linestyle=(0, (4, 4)), label="measured = actual")
    label = f"least squares through the origin: {slope.value:.4f}"
    axes.plot(ends, slope.value * ends, color=INK, linewidth=1.6, label=label)
    axes.scatter(actual, measured, s=28, color=ACTUAL, alpha=0.8, edgecolor="white", label="trials", zorder=3)
    return drawing


def _turns_corrected(shown: ShownFit) -> Figure:
    gain = shown.fit.turns.gain.value
    drawing, axes = figure("Actual and corrected turns", "trial", "turn (degrees, counter-clockwise)")
    measured, actual = shown.turns_deg
    corrected = (gain * measured, CORRECTED)
    _side_by_side(axes, {"actual": (actual, ACTUAL), f"corrected, {gain:.4f} x measured": corrected})
    return drawing


def _turn_residuals(shown: ShownFit) -> Figure:
    drawing, axes = figure("Residual of every turn", "trial", "actual - corrected turn (degrees)")
    _band(axes, _scaled(shown.fit.turns.residual, float(np.degrees(1))), "degrees")
    _stems(axes, np.arange(1, shown.fit.turns.count + 1), shown.residual_deg, ACTUAL, "residual")
    return drawing


def _turn_histogram(shown: ShownFit) -> Figure:
    spread = _scaled(shown.fit.turns.residual, float(np.degrees(1)))
    drawing, axes = figure("Residuals of turns", "actual - corrected turn (degrees)", "trials")
    against_normal(axes, shown.residual_deg, spread, "degrees")
    return drawing


def _straight_trials(shown: ShownFit) -> Figure:
    unit, s = shown.units, shown.trials.straights
    drawing, axes = figure("Measured and actual straights", "trial", f"distance ({unit.name})")
    trial = np.arange(1, len(s.measured_m) + 1)
    _rings(axes, trial, s.measured_m * unit.per_m, "measured")
    for floor, color, mark in _floors(shown):
        on = np.array([name == floor for name in s.floors])
        label = "actual" if floor == "" else f"actual, {floor or 'several floors'}"
        actual = s.actual_m[on] * unit.per_m
        axes.scatter(trial[on], actual, s=26, marker=mark, color=color, label=label, zorder=3)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    return drawing


def _heading_errors(shown: ShownFit) -> Figure:
    drawing, axes = figure(
        "Heading error of every straight", "trial", "heading change (degrees, counter-clockwise)"
    )
    s = shown.trials.straights
    axes.axhline(0, color=INK, linewidth=0.8)
    for floor, color, mark in _floors(shown):
        on = np.array([name == floor for name in s.floors]) & np.isfinite(s.drift_rad)
        if on.any():
            label = "all straights" if floor == "" else floor or "several floors"
            _stems(axes, np.flatnonzero(on) + 1, np.degrees(s.drift_rad[on]), color, label, mark)
    return drawing


def _straight_histogram(shown: ShownFit) -> Figure:
    unit, s = shown.units, shown.trials.straights
    spread = _scaled(shown.fit.straights.error, unit.per_m)
    drawing, axes = figure("Errors of straights", f"actual - measured distance ({unit.name})", "trials")
    errors = (s.actual_m - s.measured_m) * np.sign(s.measured_m) * unit.per_m
    against_normal(axes, np.asarray(errors), spread, unit.name)
    return drawing


FIGURES: dict[str, Callable[[ShownFit], Figure]] = {
    "figure-04-turns": _turn_trials,
    "figure-05-turn-gain": _turn_scatter,
    "figure-06-turns-corrected": _turns_corrected,
    "figure-07-turn-residuals": _turn_residuals,
    "figure-08-turn-residual-histogram": _turn_histogram,
    "figure-09-straights": _straight_trials,
    "figure-10-heading-errors": _heading_errors,
    "figure-11-straight-error-histogram": _straight_histogram,
}


def _side_by_side(axes: Axes, series: dict[str, tuple[F64, str]]) -> None:
    """Draw two values a trial: bars beside each other, or points where they would get too thin."""
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.margins(x=0.01)
    for shift, (label, (values, color)) in zip((-0.2, 0.2), series.items(), strict=True):
        trial = np.arange(1, len(values) + 1)
        if len(values) <= MOST_BARS:
            hatch = "" if shift < 0 else "////"  # for gray print
            axes.bar(
                trial + shift, values, 0.4, color=color, label=label, hatch=hatch, edgecolor="white", lw=0
            )
        elif shift < 0:
            _rings(axes, trial, values, label)
        else:
            axes.scatter(trial, values, s=18, color=color, label=label, zorder=3)


def _rings(axes: Axes, trial: Whole, values: F64, label: str) -> None:
    axes.scatter(trial, values, s=58, facecolors="none", edgecolors=INK, linewidths=0.9, label=label)


def _stems(axes: Axes, trial: Whole, values: F64, color: str, label: str, mark: str = "o") -> None:
    axes.vlines(trial, 0, values, color=color, linewidth=1.2, alpha=0.6)
    axes.scatter(trial, values, s=22, marker=mark, color=color, label=label, zorder=3)


def _band(axes: Axes, spread: Spread, unit: str) -> None:
    mean, sd = spread.mean.value, spread.sd.value
    axes.axhspan(mean - sd, mean + sd, color=BAND, label=f"mean {mean:.2f} ± sd {sd:.2f} {unit}")
    axes.axhline(mean, color=INK, linewidth=1)
    for sign, label in ((1, "three sd"), (-1, None)):
        axes.axhline(mean + sign * 3 * sd, color=INK, linewidth=0.9, linestyle=(0, (4, 4)), label=label)


def _floors(shown: ShownFit) -> list[tuple[str | None, str, str]]:
    """Return the floors of the trials in order, with color and marker; None: several."""
    names = list(dict.fromkeys(shown.trials.straights.floors))
    known = [name for name in names if name is not None]
    looks = {name: (FLOORS[k % 6], FLOOR_MARKS[k % 6]) for k, name in enumerate(known)}
    return [(name, *(("#9AA0AA", "x") if name is None else looks[name])) for name in names]


def _scaled(spread: Spread, factor: float) -> Spread:
    def times(fitted: Fitted) -> Fitted:
        return Fitted(fitted.value * factor, fitted.low * factor, fitted.high * factor)

    return Spread(spread.count, times(spread.mean), times(spread.sd), spread.normal_p, spread.beyond_3_sd)


def draw_noise(floor: NoiseFloor, file: Path, *, force: bool) -> None:
    """Write both figures side by side into one PNG. Raises InputError when it exists (unless `force`)."""
    save(noise_figure(floor), file, force=force)


def noise_figure(floor: NoiseFloor) -> Figure:
    """Draw a covered picture, and beside it the histogram of all of them."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = drawing.subplots(1, 2, width_ratios=(1, 1.35))
    left.imshow(stretched(floor.example), interpolation="nearest")
    low, high = int(floor.example.min()), int(floor.example.max())
    frames = "1 frame" if floor.frames == 1 else f"{floor.frames} frames; lines: sd between frames"
    dress(left, f"Lens covered, values {low} to {high} stretched", "column (pixels)", "row (pixels)")
    left.grid(False)
    dress(right, f"Noise, mean of {frames}", "pixel value", "256 x share of pixels")
    means, sds = floor.mean.reshape(3, BINS), floor.sd.reshape(3, BINS)
    start = LOW + WIDTH * np.arange(BINS)
    for k, (name, color) in enumerate(zip(COLORS, RGB, strict=True)):
        at = start + WIDTH * (0.2 + 0.3 * k)
        bars = sds[k] if np.isfinite(sds[k]).all() else None
        shape = {"hatch": HATCHES[k], "edgecolor": "white", "linewidth": 0}
        right.bar(at, means[k], 0.3 * WIDTH, color=color, label=name, yerr=bars, ecolor=INK, **shape)
    right.set_xticks(np.arange(LOW, LOW + WIDTH * BINS + 1, 4 * WIDTH))
    right.set_ylim(bottom=0)
    drawing.legend(loc="outside lower right", ncols=3, frameon=False)
    return drawing
