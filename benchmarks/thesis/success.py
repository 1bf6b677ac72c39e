"""Success as the thesis defines it (3.6) beside ours, for its three tasks: the figure, the claims, the table.

The thesis's: more than 90 % of the particles about one point, and their standard deviation below 10 % of the
arena or, by its other reading, in a circle of one foot; within five minutes, the truth not left afterward.
Ours: localized in four of five updates within five minutes; of tracking, not lost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from maurice_datasets.trials.statistics import Interval, mean, share
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.scoring.metrics import IN_TIME_S
from maurice_mcl.values.arrays import Bool
from maurice_mcl.values.geometry import INCH_M

from .material import Material, MissingRuns, Row, ThesisFigure
from .over_particles import STYLES
from .run_claims import CRITICAL, THESIS, TRACKS, Test, scored
from .traces import panels
from .verdicts import SHARE, Bound, Sample, Samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRACKING, GLOBAL, KIDNAPPED = "position-tracking", "global-localization", "kidnapped"
TASKS = {TRACKING: "position tracking", GLOBAL: "global localization", KIDNAPPED: "kidnapped robot"}
OURS, TENTH, CIRCLE = "ours", "thesis: 90 %, sd below 10 %", "thesis: 90 % in one foot"
SINCE = 10  # updates after a kidnapping
SAMPLES = {
    TRACKING: TRACKS,
    GLOBAL: "exact",
    KIDNAPPED: KIDNAPPED,
}  # the parts on whose runs the claims stand
EXACT = "exact"  # the part that compares the preset `thesis` with `thesis-exact`


def rows_of(material: Material, part: str) -> pl.DataFrame:
    """Return the runs of a task by the thesis's filter with color alone; of the kidnapped, by all presets."""
    rows = material.part(part).filter(pl.col("lost").is_not_null())
    if part == GLOBAL:
        rows = rows.filter(pl.col("feature") == "color")
    if rows.is_empty():
        raise MissingRuns(material.folder, f"holds no runs of {part} whose truth is known")
    return rows


def successful(rows: pl.DataFrame, reading: str) -> Bool:
    """Return which runs (N,) were successful by one reading."""
    if reading == OURS:
        tracks = (pl.col("task") == "tracking").fill_null(False)
        right = pl.when(tracks).then(~pl.col("lost")).otherwise(pl.col("localized_s") <= IN_TIME_S)
    else:
        right = pl.col("succeeded_tenth" if reading == TENTH else "succeeded_circle")
    return np.asarray(rows.select(right.fill_null(False)).to_series().to_numpy(), bool)


def success_test(part: str) -> Test:
    """Return the test that most runs of a task succeed, by the thesis's two readings and by ours.

    With the critical count of particles; tracks are those of the largest sample.
    """

    def test(material: Material) -> Samples:
        rows = scored(material.part(SAMPLES[part]), label=THESIS, particles=CRITICAL)
        rows = rows if part != GLOBAL else scored(rows, task="global")
        readings = (successful(rows, reading) for reading in (TENTH, CIRCLE, OURS))
        return tuple(Sample(SHARE, right.astype(np.float64), clusters_of(rows)) for right in readings)

    return test


def success(material: Material) -> Figure:
    """Draw the share of successful runs by the thesis's two readings and by ours, a panel a task."""
    drawing, places = panels(1, 3, "particles", "successful runs (%)")
    drawing.set_size_inches(11.0, 4.8)
    for axes, (part, title) in zip(places, TASKS.items(), strict=True):
        try:
            rows = rows_of(material, part)
        except MissingRuns:
            axes.text(0.5, 0.5, f"no runs of {part}", ha="center", transform=axes.transAxes)
            axes.set_title(title, fontsize=10)
            continue
        by = "label" if part == KIDNAPPED else "particles"
        groups = rows[by].unique(maintain_order=True).to_list()
        each = [rows.filter(pl.col(by) == group) for group in groups]
        for number, reading in enumerate((TENTH, CIRCLE, OURS)):
            found = [share(successful(some, reading), clusters_of(some)) for some in each]
            x = np.arange(len(groups)) if part == KIDNAPPED else np.array(groups, float)
            apart = 0.12 * (number - 1)  # so that no reading hides another
            _shares(axes, x + apart if part == KIDNAPPED else x * (1 + apart), found, reading, number)
        drives = min(clusters_of(some).count for some in each)
        axes.set_title(f"{title}\n{min(map(len, each))} runs each, of {drives} drives", fontsize=10)
        axes.set_ylim(0, 102)
        if part == KIDNAPPED:  # presets are in no order
            for line in axes.lines:
                line.set_linestyle("")
            axes.set_xticks(np.arange(len(groups)), groups)
            axes.set_xlabel("preset; since the kidnapping")
        else:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    handles, labels = places[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, title="95 % intervals")
    return drawing


def _shares(axes: Axes, x: np.ndarray, found: list[Interval], label: str, number: int) -> None:
    color, marker, line = STYLES[number]
    order = np.argsort(x)
    y, low, high = 100 * np.array([[one.value, one.low, one.high] for one in found]).T[:, order]
    reach = np.nan_to_num(np.maximum([y - low, high - y], 0))
    axes.errorbar(x[order], y, reach, color=color, marker=marker, linestyle=line, capsize=3, label=label)


def exact_table(material: Material) -> str:
    """Return what the filter to the letter does beside the preset `thesis`, as a Markdown table."""
    lines = ["| filter | task | error, in | lost, % | right at the end, % | success as in 3.6, % |"]
    lines += ["|---|---|---|---|---|---|"]
    rows = material.part(EXACT).filter(pl.col("lost").is_not_null())
    for label in rows["label"].unique(maintain_order=True).to_list():
        for session in rows["session"].unique(maintain_order=True).to_list():
            some = rows.filter((pl.col("label") == label) & (pl.col("session") == session))
            clusters = clusters_of(some)
            rates = [
                share(some[column].fill_null(False).to_numpy(), clusters).text(100, 0)
                for column in ("lost", "right_at_end", "succeeded_tenth")
            ]
            error = mean(some["error_mean_m"].to_numpy() / INCH_M, clusters).text(1, 1)
            lines.append(f"| `{label}` | {session}, {len(some)} runs | {error} | {' | '.join(rates)} |")
    return "\n".join([*lines, "", _even_draws(material, rows)])


def _even_draws(material: Material, rows: pl.DataFrame) -> str:
    """Say at how many updates the filter to the letter draws evenly: not lost, and kidnapped."""
    exact = rows.filter(pl.col("label") == "thesis-exact")
    tracks = exact.filter((pl.col("task") == "tracking") & ~pl.col("lost"))
    carried = exact.filter(pl.col("kidnapped_at_update").is_not_null())
    acted = [_acted(material, row) for row in carried.iter_rows(named=True)]
    samples = [((tracks["reseeded"] / tracks["updates"]).to_numpy(), clusters_of(tracks))]
    samples += [(np.array(shares), clusters_of(carried)) for shares in zip(*acted, strict=True)]
    percent = Bound("", "%", digits=0)
    usual, before, after = (percent.shown(Sample(SHARE, *sample)).strip() for sample in samples)
    return (
        f"`thesis-exact` draws evenly at {usual} of the updates of {len(tracks)} tracks that were never lost,"
        f" at {before} of those before a kidnapping, and at {after} of the {SINCE} after it "
        f"({len(carried)} drives)."
    )


def _acted(material: Material, row: Row) -> tuple[float, float]:
    """Return at which share of the updates before a kidnapping, and of the first after it, a run drew."""
    first = int(row["kidnapped_at_update"]) - 1
    drew = np.array([record.injected is not None for _, record in material.run_of(row)], float)
    return float(drew[:first].mean()), float(drew[first : first + SINCE].mean())


FIGURES = (ThesisFigure(101, "Success as the thesis defines it, beside ours", success),)
