"""Figures of many runs against the number of particles: distance before loss, error, times to localize."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import log_fit
from maurice_datasets.trials.table import curve_of, grouped
from maurice_datasets.trials.tally import IMPOVERISHED, MOVED_OTHERWISE, OTHER
from maurice_mcl.analysis.metrics import GOAL_M
from maurice_mcl.geometry import INCH_M

from .calibration import ACTUAL, BAND, INK, figure
from .material import Material

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# color, marker and line: told apart in gray print too
STYLES = (("#0072B2", "o", "-"), ("#D55E00", "s", "--"), ("#009E73", "^", "-."), ("#CC79A7", "D", ":"))
PARTICLES = "particles"
MARKS = {IMPOVERISHED: ("s", "#D55E00"), MOVED_OTHERWISE: ("^", "#0072B2"), OTHER: ("x", "#009E73")}
CLASSES = {
    IMPOVERISHED: "failed: no particle near the truth",
    MOVED_OTHERWISE: "failed: odometry wrong",
    OTHER: "failed: other",
}


def before_loss(material: Material, *, log: bool) -> Figure:
    """Draw how far every run drove before it was lost, with the goal and a fit over the log of the count."""
    rows = material.part("position-tracking")
    made, axes = figure("", "particles", "driven before it was lost (in)")
    x, y = _column(rows, PARTICLES), _column(rows, "before_loss_m") / INCH_M
    axes.plot(_jittered(x), y, ".", color=ACTUAL, alpha=0.35, label=_runs(rows, "each run"))
    _means(axes, rows, "before_loss_m", 1 / INCH_M, "mean, 95 % interval", 0, shifted=False)
    fit = log_fit(x, y, _column(rows, "seed"))
    slope, counts = fit.slope, np.unique(x)
    told = f"fit: {slope.value:+.0f} in a decade ({slope.low:+.0f} to {slope.high:+.0f})"
    axes.plot(counts, fit.at(counts), color=INK, linestyle="--", linewidth=1, label=told)
    axes.axhline(GOAL_M / INCH_M, color=INK, linestyle=":", label="goal of the thesis, 1,000 in")
    axes.set_ylim(0)
    _finish(axes, log=log)
    return made


def error(material: Material, metric: str = "error_m", label: str = "mean error of a run (in)") -> Figure:
    """Draw an error against the number of particles, of runs of the position tracking part."""
    rows = material.part("position-tracking")
    made, axes = figure("", "particles", label)
    _points(axes, rows, metric)
    _means(axes, rows, metric, 1 / INCH_M, "mean, 95 % interval", 0, shifted=False)
    axes.set_ylim(0)
    _finish(axes)
    return made


def error_a_distance(material: Material) -> Figure:
    """Draw error over distance driven, with a fit over the log of the count."""
    rows = material.part("position-tracking").filter(pl.col("distance_m") > 0)
    rows = rows.with_columns((pl.col("error_m") / pl.col("distance_m")).alias("a_distance"))
    made, axes = figure("", "particles", "mean error over distance driven (in per 1,000 in)")
    x, y = _column(rows, PARTICLES), _column(rows, "a_distance") * 1000
    axes.plot(_jittered(x), y, ".", color=ACTUAL, alpha=0.35, label=_runs(rows, "each run"))
    fit, counts = log_fit(x, y, _column(rows, "seed")), np.unique(x)
    told = f"fit: {fit.slope.value:+.1f} a decade ({fit.slope.low:+.1f} to {fit.slope.high:+.1f})"
    axes.plot(counts, fit.at(counts), color=INK, linestyle="--", label=told)
    axes.axhline(9, color=INK, linestyle=":", label="the thesis: 9 in per 1,000 in")
    axes.set_ylim(0)
    _finish(axes)
    return made


def error_by_run(material: Material) -> Figure:
    """Draw the error of each run per 1,000 in, runs ordered by their number of particles."""
    rows = material.part("position-tracking").filter(pl.col("distance_m") > 0).sort(PARTICLES, "seed")
    made, axes = figure("", "run, ordered by number of particles", "error per 1,000 in driven (in)")
    y = 1000 * _column(rows, "error_m") / _column(rows, "distance_m")
    axes.plot(np.arange(1, len(y) + 1), y, ".", color=ACTUAL, label=_runs(rows, "each run"))
    counts = _column(rows, PARTICLES)
    for first in np.flatnonzero(np.diff(counts, prepend=-1)):
        axes.axvline(first + 0.5, color=BAND, linewidth=1)
        axes.annotate(
            f"{counts[first]:,.0f}", (first + 1, 1), xycoords=("data", "axes fraction"), fontsize=7, va="top"
        )
    axes.axhline(9, color=INK, linestyle=":", label="the thesis: 9 in")
    axes.set_ylim(0)
    axes.legend(loc="upper right", fontsize=8)
    return made


def final_error(material: Material, features: Sequence[str] = ("color",)) -> Figure:
    """Draw the final error of every global run, marked by what made it fail."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    made, axes = figure("", "particles", "position error at the end (in)")
    good = rows.filter(pl.col("failure").is_null())
    axes.plot(
        _jittered(_column(good, PARTICLES)),
        _inches(good, "final_error_m"),
        "o",
        color="#888D96",
        ms=4,
        alpha=0.6,
        label=_runs(good, "right at the end"),
    )
    for failure, (marker, color) in MARKS.items():
        some = rows.filter(pl.col("failure") == failure)
        if not some.is_empty():
            axes.plot(
                _jittered(_column(some, PARTICLES)),
                _inches(some, "final_error_m"),
                marker,
                color=color,
                ms=5,
                alpha=0.7,
                label=_runs(some, CLASSES[failure]),
            )
    axes.set_ylim(0)
    _finish(axes)
    return made


def by_feature(material: Material, metric: str, label: str, features: Sequence[str]) -> Figure:
    """Draw the mean of a metric, in inches, against the number of particles, a line a feature."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    made, axes = figure("", "particles", label)
    for number, feature in enumerate(features):
        some = rows.filter(pl.col("feature") == feature)
        if not some.is_empty():
            _means(axes, some, metric, 1 / INCH_M, _runs(some, feature), number)
    axes.set_ylim(0)
    _finish(axes)
    return made


def time_to_localize(material: Material, features: Sequence[str] = ("color", "blended")) -> Figure:
    """Draw, for each number of particles, the share of runs that are not localized yet (Kaplan and Meier)."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    made, axes = figure("", "pictures", "share of runs not localized yet")
    counts = sorted(rows[PARTICLES].unique())
    chosen = [counts[k] for k in np.unique(np.linspace(0, len(counts) - 1, 4).round().astype(int))]
    for number, count in enumerate(chosen):
        for feature in features:
            some = rows.filter((pl.col(PARTICLES) == count) & (pl.col("feature") == feature))
            if some.is_empty():
                continue
            curve = curve_of(some)
            color, _, _ = STYLES[number]
            line = "-" if feature == features[0] else "--"
            x = np.concatenate([[0], curve.times, [some["pictures_after"].max()]])
            y = np.concatenate([[1], curve.share, curve.share[-1:] if len(curve.share) else [1]])
            axes.step(
                x,
                y,
                where="post",
                color=color,
                linestyle=line,
                label=f"{feature}, {count:,} particles, {len(some)} runs",
            )
            if len(curve.times):
                axes.fill_between(
                    curve.times, curve.low, curve.high, step="post", color=color, alpha=0.12, linewidth=0
                )
    axes.set_ylim(0, 1.02)
    axes.set_xlim(0)
    axes.legend(fontsize=8)
    return made


def localized_median(material: Material, features: Sequence[str]) -> Figure:
    """Draw the median number of pictures until localized against particles, censored runs counted as such."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    made, axes = figure("", "particles", "pictures until localized, median")
    end = float(rows["pictures_after"].to_numpy().max())
    for number, feature in enumerate(features):
        color, marker, line = STYLES[number]
        groups = grouped(rows.filter(pl.col("feature") == feature), [PARTICLES], "pictures_to_localize")
        groups = sorted(groups, key=lambda one: float(one.by[PARTICLES]))
        x = np.array([one.by[PARTICLES] for one in groups], float) * (1 + 0.05 * number)
        curves = [one.curve for one in groups if one.curve is not None]
        middle = np.array([min(one.median, end) for one in curves])
        low, high = np.array([np.minimum(one.median_interval, end) for one in curves]).T
        told = f"{feature}, {groups[0].runs if groups else 0} runs each"
        axes.errorbar(
            x,
            middle,
            [middle - low, high - middle],
            color=color,
            marker=marker,
            linestyle=line,
            capsize=3,
            label=told,
        )
    axes.axhline(end, color=INK, linestyle=":", label="end of the drive: not localized by half of the runs")
    axes.set_ylim(0)
    _finish(axes)
    return made


def _means(
    axes: Axes,
    rows: pl.DataFrame,
    metric: str,
    factor: float,
    label: str,
    number: int,
    *,
    shifted: bool = True,
) -> None:
    color, marker, line = STYLES[number] if shifted else (INK, "o", "-")
    groups = sorted(grouped(rows, [PARTICLES], metric), key=lambda one: float(one.by[PARTICLES]))
    x = np.array([one.by[PARTICLES] for one in groups], float) * (1 + 0.05 * number)
    y, low, high = (
        np.array([[one.figure.value, one.figure.low, one.figure.high] for one in groups]).T * factor
    )
    axes.errorbar(
        x, y, [y - low, high - y], color=color, marker=marker, linestyle=line, capsize=3, label=label
    )


def _points(axes: Axes, rows: pl.DataFrame, metric: str) -> None:
    x, y = _column(rows, PARTICLES), _inches(rows, metric)
    axes.plot(_jittered(x), y, ".", color=ACTUAL, alpha=0.35, label=_runs(rows, "each run"))


def _finish(axes: Axes, *, log: bool = True) -> None:
    if log:
        axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    axes.legend(fontsize=8)


def _column(rows: pl.DataFrame, name: str) -> Any:
    return rows[name].cast(pl.Float64).to_numpy()


def _inches(rows: pl.DataFrame, name: str) -> Any:
    return _column(rows, name) / INCH_M


def _jittered(x: Any) -> Any:
    """Move points apart by up to 6 percent, so that runs of one count can be seen."""
    return x * (1 + 0.06 * np.random.default_rng(0).uniform(-1, 1, len(x)))


def _runs(rows: pl.DataFrame, what: str) -> str:
    return f"{what}, {len(rows)} runs"
