"""Figures of what runs did update by update: their mean over drives, with the interval that it has."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import Interval, mean
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_viz.plots.calibration import INK, dress

from .material import Material, MissingRuns, ThesisFigure
from .over_particles import STYLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OFF, DEVIATION, CONFIDENCE = "error_m", "sd_m", "confidence"
LABELS = {
    OFF: "position error (in)",
    DEVIATION: "deviation of the cloud (in)",
    CONFIDENCE: "weight near the estimate (%)",
}
FACTORS = {OFF: 1 / INCH_M, DEVIATION: 1 / INCH_M, CONFIDENCE: 100.0}
UPDATE = "update"
STRATEGY, NONE, AIDED = "recovery.strategy", "none", "threshold"
MARKS = 10  # markers on a curve
BANDS = "bands: means, 95 % intervals"


def panels(rows: int, columns: int, x: str, y: str) -> tuple[Figure, list[Axes]]:
    """Return a figure with several pairs of axes, row by row, that share their labels and scales."""
    from matplotlib.figure import Figure as New

    drawing = New(figsize=(8.0 if columns < 3 else 10.0, 4.6), layout="constrained")
    places = [drawing.add_subplot(rows, columns, number + 1) for number in range(rows * columns)]
    for number, axes in enumerate(places):
        dress(axes, "", x, y if number % columns == 0 else "")
    return drawing, places


def curve(rows: pl.DataFrame, column: str) -> list[Interval]:
    """Return the mean of a column of lists over runs at every update, in its own unit.

    Each with its interval over drives. Runs that ended earlier or whose truth is not known at an
    update are left out there.
    """
    lists, clusters = rows[column].to_list(), clusters_of(rows)
    values = np.full((len(lists), max(map(len, lists))), np.nan)
    for number, values_of in enumerate(lists):
        values[number, : len(values_of)] = values_of
    known = np.isfinite(values)
    return [mean(at[held], clusters[held]) for at, held in zip(values.T, known.T, strict=True)]


def by_feature(material: Material, part: str, features: Sequence[str]) -> Figure:
    """Draw the deviation of the cloud against the update, a line a feature, one panel a session."""
    rows = material.part(part)
    if missing := [name for name in features if name not in rows["feature"].to_list()]:
        raise MissingRuns(material.folder, f"holds no runs of {part} with {', '.join(missing)}")
    sessions = rows["session"].unique(maintain_order=True).to_list()
    made, axes = panels(1, len(sessions), UPDATE, LABELS[DEVIATION])
    for place, session in zip(axes, sessions, strict=True):
        some = rows.filter(pl.col("session") == session)
        for number, feature in enumerate(features):
            _band(place, some.filter(pl.col("feature") == feature), DEVIATION, feature, number)
        if len(sessions) > 1:
            place.set_title(session, fontsize=10)
        _finish(place)
    return made


def uncertainty(material: Material, strategy: str) -> Figure:
    """Draw the deviation of kidnapped runs with one way to draw fresh particles: each run, and the mean.

    The scale is that of both figures, so that they can be laid side by side.
    """
    both = material.part("recovery").filter(pl.col("label").is_in([NONE, AIDED]))
    rows = both.filter(pl.col("label") == strategy)
    if rows.is_empty():
        raise MissingRuns(material.folder, f"holds no runs with {STRATEGY} = {strategy}")
    made, (axes,) = panels(1, 1, UPDATE, LABELS[DEVIATION])
    for number, values in enumerate(rows[DEVIATION].to_list()):
        caption = f"each run, {len(rows)} runs" if number == 0 else None
        axes.plot(_updates(values), np.array(values) / INCH_M, color="#9AA0AA", linewidth=0.7, label=caption)
    _band(axes, rows, DEVIATION, "mean, 95 % interval", 0)
    _mark_kidnapping(axes, rows)
    _finish(axes)
    axes.set_ylim(0, 1.05 * max(max(values) for values in both[DEVIATION].to_list()) / INCH_M)
    return made


def by_strategy(material: Material) -> Figure:
    """Draw, for every way to draw fresh particles, how certain and how wrong runs are after a kidnapping."""
    rows = material.part("recovery").filter(pl.col("kidnapped_at_update").is_not_null())
    labels = rows["label"].unique(maintain_order=True).to_list()[::-1]
    made, axes = panels(1, 2, "", "")
    for place, column, number in ((axes[0], CONFIDENCE, 0), (axes[1], OFF, 1)):
        color, marker, _ = STYLES[number]
        intervals = [after_kidnapping(rows.filter(pl.col("label") == label), column) for label in labels]
        y, value = np.arange(len(labels)), np.array([values_of.value for values_of in intervals])
        reach = np.abs(np.array([[values_of.low, values_of.high] for values_of in intervals]).T - value)
        caption = None if number else f"mean, 95 % interval, {intervals[0].count} runs each"
        place.errorbar(
            value, y, xerr=reach, color=color, marker=marker, linestyle="", capsize=3, label=caption
        )
        place.set_yticks(y, labels if number == 0 else ["" for _ in labels])
        place.set_xlabel(LABELS[column])
        place.set_xlim(0)
        place.set_ylim(-0.6, len(labels) - 0.4)
    axes[0].set_ylabel("fresh particles")
    made.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return made


def after_kidnapping(rows: pl.DataFrame, column: str) -> Interval:
    """Return the mean of a column of lists over the updates since the kidnapping, run by run."""
    since = rows["kidnapped_at_update"].to_list()
    lists = rows[column].to_list()
    values = np.array([np.nanmean(values_of[at - 1 :]) for values_of, at in zip(lists, since, strict=True)])
    return mean(values * FACTORS[column], clusters_of(rows))


def kidnapped(material: Material) -> Figure:
    """Draw error and confidence of kidnapped runs over time, a line a preset."""
    rows = material.part("kidnapped")
    made, axes = panels(2, 1, UPDATE, "")
    made.set_size_inches(8.0, 6.4)
    for place, column in zip(axes, (OFF, CONFIDENCE), strict=True):
        for number, label in enumerate(rows["label"].unique(maintain_order=True).to_list()):
            _band(place, rows.filter(pl.col("label") == label), column, f"preset {label}", number)
        place.set_ylabel(LABELS[column])
        place.set_xlabel(UPDATE if column == CONFIDENCE else "")
        _mark_kidnapping(place, rows)
        _finish(place)
    axes[1].get_legend().remove()  # type: ignore[union-attr]  # _finish drew one
    axes[1].set_ylim(0, 102)
    return made


def _band(axes: Axes, rows: pl.DataFrame, column: str, what: str, number: int) -> None:
    """Draw a mean over runs and the band of its interval; nothing where there are no runs."""
    if rows.is_empty():
        return
    color, marker, line = STYLES[number]
    intervals = curve(rows, column)
    x = _updates(intervals)
    y, low, high = (
        np.array([[values_of.value, values_of.low, values_of.high] for values_of in intervals]).T
        * FACTORS[column]
    )
    axes.plot(
        x,
        y,
        color=color,
        marker=marker,
        linestyle=line,
        markersize=4,
        markevery=(number, max(len(x) // MARKS, 1)),
        label=f"{what}, {len(rows)} runs",
    )
    caption = BANDS if number == 0 and "interval" not in what else None
    axes.fill_between(x, low, high, color=color, alpha=0.15, linewidth=0, label=caption)


def _mark_kidnapping(axes: Axes, rows: pl.DataFrame) -> None:
    at = rows["kidnapped_at_update"].drop_nulls().unique().to_list()
    if len(at) == 1:
        axes.axvline(
            at[0], color=INK, linestyle=(0, (1, 1)), linewidth=1.4, label="first picture after the kidnapping"
        )


def _updates(values: Sequence[Any]) -> F64:
    return np.arange(1, len(values) + 1, dtype=np.float64)


def _finish(axes: Axes) -> None:
    axes.set_xlim(0)
    axes.set_ylim(0)
    axes.legend(fontsize=8)


FIGURES = (
    ThesisFigure(
        50,
        "Deviation of the cloud, with and without smoothing",
        partial(by_feature, part="smoothing", features=("color", "smoothed", "blurred")),
    ),
    ThesisFigure(
        56,
        "Deviation of the cloud, color and edges",
        partial(by_feature, part="blended", features=("color", "edges")),
    ),
    ThesisFigure(
        58,
        "Deviation of the cloud, color and edges blended",
        partial(by_feature, part="blended", features=("color", "edges", "blended", "best")),
    ),
    ThesisFigure(66, "Kidnapped: uncertainty without fresh particles", partial(uncertainty, strategy=NONE)),
    ThesisFigure(
        67, "Kidnapped: uncertainty with sensor-aided sampling", partial(uncertainty, strategy=AIDED)
    ),
    ThesisFigure(68, "Certainty and error after a kidnapping, by sampling strategy", by_strategy),
    ThesisFigure(69, "Kidnapped: error and confidence over time", kidnapped),
)
