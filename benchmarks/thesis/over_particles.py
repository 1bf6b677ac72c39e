"""Figures of many runs against the number of particles: distance before loss, error, time to localize."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import LEVEL, Clusters, Interval, Survival, student
from maurice_datasets.trials.table import LOCALIZED, TIMES, clusters_of, curve_of, grouped
from maurice_mcl.reasons.causes import MOTION, PROPOSAL, RESAMPLING
from maurice_mcl.scoring.metrics import GOAL_M
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_viz.plots.calibration import ACTUAL, BAND, INK, figure
from maurice_viz.text.summary import metric_title

from .material import Material, MissingRuns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# color, marker and line: told apart in gray print too
STYLES = (("#0072B2", "o", "-"), ("#D55E00", "s", "--"), ("#009E73", "^", "-."), ("#CC79A7", "D", ":"))
PARTICLES = "particles"
FAILED = (  # label, the causes that `diagnose` names, marker, color
    ("failed: no particle at the true place", (PROPOSAL, RESAMPLING), "s", "#D55E00"),
    ("failed: movement beyond the motion model", (MOTION,), "^", "#0072B2"),
)
OTHERS = ("x", "#009E73")
THESIS_IN = 9  # mean error, in inches, over drives of 1,000


@dataclass(frozen=True, slots=True)
class LogFit:
    """y = intercept + slope * log10(x), by least squares; the slope with its interval."""

    intercept: float
    slope: Interval

    def at(self, x: F64) -> F64:
        """Return the fitted values (N,) at some x (N,)."""
        return np.asarray(self.intercept + self.slope.value * np.log10(x))


def log_fit(x: F64, y: F64, clusters: Clusters, level: float = LEVEL) -> LogFit:
    """Fit y (N,) against the decimal log of x (N,); the slope's interval is Student's over clusters."""
    x, y = np.log10(np.asarray(x, np.float64)), np.asarray(y, np.float64)
    slope, intercept = np.polyfit(x, y, 1)
    far = x - x.mean()
    influences = far * (y - intercept - slope * x) / np.square(far).sum()
    interval = student(float(slope), influences, float(np.abs(y).max()), clusters, level)
    return LogFit(float(intercept), interval)


def median_interval(curve: Survival) -> tuple[float, float]:
    """Return where the limits of a curve cross a half (Brookmeyer and Crowley 1982); inf: nowhere."""
    crossings = (np.flatnonzero(limit <= 0.5) for limit in (curve.low, curve.high))
    first, last = (float(curve.times[crossing[0]]) if len(crossing) else np.inf for crossing in crossings)
    return first, last


def before_loss(material: Material, *, log: bool) -> Figure:
    """Draw how far every run drove before it was lost, with the goal and a fit over the log of the count.

    Of a run that was not lost only the end of its drive is known. So means and fit are of the distance within
    what every run drove, or the goal where that is less: nothing of it is cut off.
    """
    rows = material.part("position-tracking").filter(pl.col("lost").is_not_null())
    if rows.is_empty():
        raise MissingRuns(material.folder, "holds no runs of position-tracking whose truth is known")
    drawing, axes = figure("", "particles", "driven before it was lost (in)")
    for lost, mark, label in ((True, ".", "lost there"), (False, "^", "not lost: end of the drive")):
        if (some := rows.filter(pl.col("lost") == lost)).is_empty():
            continue
        x, y = _jittered(_column(some, PARTICLES)), _inches(some, "before_loss_m")
        axes.plot(x, y, mark, color=ACTUAL, ms=4, mfc="none", alpha=0.5, label=_runs(some, label))
    every_m = min(float(rows["distance_m"].to_numpy().min()), GOAL_M)
    within = rows.with_columns(pl.col("before_loss_m").clip(upper_bound=every_m))
    label = f"mean within the first {every_m / INCH_M:,.0f} in, 95 % interval"
    _means(axes, within, "before_loss_m", 1 / INCH_M, label, 0, shifted=False)
    _fit(axes, within, "before_loss_m", 0)
    axes.axhline(GOAL_M / INCH_M, color=INK, linestyle=":", label="goal of the thesis, 1,000 in")
    axes.set_ylim(0)
    _finish(axes, log=log)
    return drawing


def error(material: Material, *, fitted: bool = False) -> Figure:
    """Draw the mean error of position tracking against the number of particles; with a fit over its log."""
    rows = material.part("position-tracking").filter(pl.col("error_mean_m").is_not_null())
    drawing, axes = figure("", "particles", "mean error of a run (in)")
    x, y = _jittered(_column(rows, PARTICLES)), _inches(rows, "error_mean_m")
    axes.plot(x, y, ".", color=ACTUAL, alpha=0.35, label=_runs(rows, "each run"))
    _means(axes, rows, "error_mean_m", 1 / INCH_M, "mean, 95 % interval", 0, shifted=False)
    if fitted:
        _fit(axes, rows, "error_mean_m", 1)
        _thesis(axes)
    axes.set_ylim(0)
    _finish(axes)
    return drawing


def error_by_run(material: Material) -> Figure:
    """Draw the mean error of each run, runs ordered by their number of particles."""
    rows = (
        material.part("position-tracking")
        .filter(pl.col("error_mean_m").is_not_null())
        .sort(PARTICLES, "seed")
    )
    drawing, axes = figure("", "run, ordered by number of particles", "mean error of a run (in)")
    y = _inches(rows, "error_mean_m")
    axes.plot(np.arange(1, len(y) + 1), y, ".", color=ACTUAL, label=_runs(rows, "each run"))
    counts = _column(rows, PARTICLES)
    for first in np.flatnonzero(np.diff(counts, prepend=-1)):
        axes.axvline(first + 0.5, color=BAND, linewidth=1)
        axes.annotate(
            f"{counts[first]:,.0f}", (first + 1, 1), xycoords=("data", "axes fraction"), fontsize=7, va="top"
        )
    _thesis(axes)
    axes.set_ylim(0)
    axes.legend(loc="upper right", fontsize=8)
    return drawing


def _thesis(axes: Axes) -> None:
    axes.axhline(
        THESIS_IN, color=INK, linestyle=":", label=f"the thesis: {THESIS_IN} in over 1,000 in driven"
    )


def _fit(axes: Axes, rows: pl.DataFrame, metric: str, digits: int) -> None:
    """Draw a line through a metric of runs, in inches, over the log of the count; its slope in the legend."""
    x = _column(rows, PARTICLES)
    if len(counts := np.unique(x)) < 2:
        return
    fit = log_fit(x, _inches(rows, metric), clusters_of(rows))
    label = f"fit, inches in a decade: {fit.slope.text(1, digits, '+')}"
    axes.plot(counts, fit.at(counts), color=INK, linestyle="--", linewidth=1, label=label)


def final_error(material: Material, features: Sequence[str] = ("color",)) -> Figure:
    """Draw the final error of every global run, marked by what made it fail."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    drawing, axes = figure("", "particles", "position error at the end (in)")
    good = rows.filter(pl.col("failure").is_null())
    axes.plot(
        _jittered(_column(good, PARTICLES)),
        _inches(good, "error_final_m"),
        "o",
        color="#888D96",
        ms=4,
        alpha=0.6,
        label=_runs(good, "right at the end"),
    )
    failed = rows.filter(pl.col("failure").is_not_null())
    other = failed.filter(~pl.col("failure").is_in([kind for _, kinds, *_ in FAILED for kind in kinds]))
    classes = [
        (label, failed.filter(pl.col("failure").is_in(kinds)), marker, color)
        for label, kinds, marker, color in FAILED
    ]
    for label, some, marker, color in (*classes, (f"failed: {_causes(other)}", other, *OTHERS)):
        if not some.is_empty():
            x, y = _jittered(_column(some, PARTICLES)), _inches(some, "error_final_m")
            axes.plot(x, y, marker, color=color, ms=5, alpha=0.7, label=_runs(some, label))
    axes.set_ylim(0)
    _finish(axes)
    return drawing


def _causes(rows: pl.DataFrame) -> str:
    """Return what made runs fail, the commonest first."""
    counts = rows["failure"].value_counts(sort=True).rows()
    return ", ".join(f"{kind.replace('_', ' ')} {count}" for kind, count in counts)


def by_feature(material: Material, metric: str, label: str, features: Sequence[str]) -> Figure:
    """Draw the mean of a metric, in inches, against the number of particles, a line a feature."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    drawing, axes = figure("", "particles", label)
    for number, feature in enumerate(features):
        some = rows.filter(pl.col("feature") == feature)
        if not some.is_empty():
            _means(axes, some, metric, 1 / INCH_M, _runs(some, feature), number)
    axes.set_ylim(0)
    _finish(axes)
    return drawing


def time_to_localize(material: Material) -> Figure:
    """Draw, for some numbers of particles, the share of runs not localized yet (color; Kaplan and Meier)."""
    rows = material.part("global-localization").filter(pl.col("feature") == "color")
    drawing, axes = figure("", "pictures", "share of runs not localized yet")
    counts = sorted(rows[PARTICLES].unique())
    chosen = [counts[k] for k in np.unique(np.linspace(0, len(counts) - 1, 4).round().astype(int))]
    for (color, _, line), count in zip(STYLES, chosen, strict=False):
        some = rows.filter(pl.col(PARTICLES) == count)
        curve, label = curve_of(some), f"{count:,} particles, {len(some)} runs"
        x = np.concatenate([[0], curve.times, [some["pictures_after"].max()]])
        y = np.concatenate([[1], curve.share, curve.share[-1:] if len(curve.share) else [1]])
        axes.step(x, y, where="post", color=color, linestyle=line, label=label)
        if len(curve.times):
            low, high = curve.low, curve.high
            axes.fill_between(curve.times, low, high, step="post", color=color, alpha=0.12, linewidth=0)
    axes.set_ylim(0, 1.02)
    axes.set_xlim(0)
    axes.legend(fontsize=8)
    return drawing


def localized_median(
    material: Material,
    features: Sequence[str],
    metric: str = LOCALIZED,
    label: str = "pictures until localized",
) -> Figure:
    """Draw the median of a time to localize against particles; runs that never localized are censored."""
    rows = material.part("global-localization").filter(pl.col("feature").is_in(list(features)))
    rows = rows.filter(pl.col(TIMES[metric]).is_not_null())
    if rows.is_empty():
        why = f"holds no runs of global-localization with {TIMES[metric]}; make them with this version"
        raise MissingRuns(material.folder, why)
    drawing, axes = figure("", "particles", f"{label}, median")
    factor = metric_title(metric)[1]
    end = float(rows[TIMES[metric]].to_numpy().max()) * factor
    for number, feature in enumerate(features):
        color, marker, line = STYLES[number]
        groups = grouped(rows.filter(pl.col("feature") == feature), [PARTICLES], metric)
        groups = sorted(groups, key=lambda group: float(group.by[PARTICLES]))
        x = np.array([group.by[PARTICLES] for group in groups], float) * (1 + 0.05 * number)
        curves = [group.curve for group in groups if group.curve is not None]
        middle = np.array([min(curve.median * factor, end) for curve in curves])
        limits = np.array([median_interval(curve) for curve in curves]).reshape(-1, 2).T * factor
        low, high = np.minimum(limits, end)
        axes.errorbar(
            x,
            middle,
            [middle - low, high - middle],
            color=color,
            marker=marker,
            linestyle=line,
            capsize=3,
            label=f"{feature}, {groups[0].runs if groups else 0} runs each",
        )
    axes.axhline(end, color=INK, linestyle=":", label="end of the drive: not localized by half of the runs")
    axes.set_ylim(0)
    _finish(axes)
    return drawing


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
    groups = sorted(grouped(rows, [PARTICLES], metric), key=lambda group: float(group.by[PARTICLES]))
    x = np.array([group.by[PARTICLES] for group in groups], float) * (1 + 0.05 * number)
    y, low, high = (
        np.array([[group.figure.value, group.figure.low, group.figure.high] for group in groups]).T * factor
    )
    axes.errorbar(
        x, y, [y - low, high - y], color=color, marker=marker, linestyle=line, capsize=3, label=label
    )


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
    drives = clusters_of(rows).count
    return f"{what}, {len(rows)} runs" + (f" of {drives} drives" if drives != len(rows) else "")
