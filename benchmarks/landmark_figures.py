"""Two figures of docs/landmarks.md: accuracy against cost for every feature, and error against spacing.

Errors are those of trials on unseen drives (plans `channels` and `landmarks-spacing`); the cost is measured
here, on the demo's pictures, every feature in turn, so that a busy machine troubles all alike.

Run: make landmark-figures, or python benchmarks/landmark_figures.py CHANNELS SPACING -o docs/pictures
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

import cv2
import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.figure import Figure

import maurice_loaders as ml
import maurice_mcl as mcl
from maurice_datasets.demos import demo_paths
from maurice_datasets.trials.rows import read_rows
from maurice_datasets.trials.statistics import Interval, mean
from maurice_mcl.geometry import INCH_M

PICTURES, ROUNDS, PARTICLES = 20, 3, 1000
POSE_SENSORS = ("landmarks", "all")


@dataclass(frozen=True, slots=True)
class Point:
    """One feature: its mean error in inches, and what a picture costs."""

    feature: str
    error: Interval
    cost_ms: float


def errors(rows: pl.DataFrame) -> dict[str, Interval]:
    """Return the mean position error in inches by label, with its 95 percent interval."""
    return {
        str(label): mean(some["error_m"].to_numpy() / INCH_M, some["arena"].to_numpy())
        for (label,), some in rows.group_by("label", maintain_order=True)
    }


def costs(features: Sequence[str]) -> dict[str, float]:
    """Return the median milliseconds that a picture costs by feature, with a thousand particles."""
    paths = demo_paths(0)
    library = ml.with_landmarks(ml.open_library(paths.survey))
    moments = list(itertools.islice(ml.open_session(paths.session).moments(), PICTURES))
    localizers = {one: mcl.make_localizer(library, feature=one, particles=PARTICLES) for one in features}
    poses = next(iter(localizers.values())).initialize(None).belief.poses
    took: dict[str, list[float]] = {one: [] for one in features}
    for moment in moments * ROUNDS:
        for name, localizer in localizers.items():
            began = perf_counter()
            localizer.sensor.at(localizer.sensor.see(moment.frame), poses)
            took[name].append(perf_counter() - began)
    return {name: 1000 * float(np.median(times)) for name, times in took.items()}


def against_cost(points: Sequence[Point]) -> Figure:
    """Draw error over cost; landmarks stand out."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    for one in points:
        color = "tab:orange" if one.feature in POSE_SENSORS else "tab:blue"
        low, high = one.error.value - one.error.low, one.error.high - one.error.value
        axes.errorbar(one.cost_ms, one.error.value, [[low], [high]], fmt="o", color=color, capsize=2)
        axes.annotate(
            one.feature, (one.cost_ms, one.error.value), (5, 3), textcoords="offset points", fontsize=8
        )
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel(f"cost of a picture (ms, one thread, {PARTICLES:,} particles, 624 references)")
    axes.set_ylabel("mean position error (in), 95 % intervals")
    for axis, ticks in ((axes.yaxis, (1, 2, 3, 5, 10, 20)), (axes.xaxis, (1, 2, 5, 10, 20, 50))):
        axis.set_major_locator(mpl.ticker.FixedLocator(ticks))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    axes.set_title("Accuracy against cost: tracking on unseen drives, 18 in spacing")
    axes.grid(alpha=0.3)
    return figure


def against_spacing(rows: pl.DataFrame) -> Figure:
    """Draw error over the spacing of the survey, beside a perfect matcher of references."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    rows = rows.with_columns(spacing=pl.col("session").str.extract(r"(\d+)$").cast(pl.Float64))
    for label, some in rows.group_by("label", maintain_order=True):
        _line(axes.errorbar, some, "error_m", str(label[0]))
    first = rows.filter(pl.col("label") == rows["label"][0])
    _line(partial(axes.errorbar, color="gray"), first, "oracle_m", "distance to the nearest reference")
    axes.set(ylim=(0, None), xlabel="distance between places of the survey (in)")
    axes.set_ylabel("mean position error (in), 95 % intervals")
    axes.set_title("Error against spacing: tracking on unseen drives")
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def _line(errorbar: object, rows: pl.DataFrame, column: str, label: str) -> None:
    found = {
        float(key[0]): mean(some[column].to_numpy() / INCH_M, some["arena"].to_numpy())
        for key, some in rows.sort("spacing").group_by("spacing", maintain_order=True)
    }
    values = np.array([one.value for one in found.values()])
    bars = [values - [one.low for one in found.values()], [one.high for one in found.values()] - values]
    errorbar(list(found), values, bars, fmt="o-", capsize=3, label=label)  # type: ignore[operator]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("channels", type=Path, help="folder of `maurice-replay trials channels`")
    parser.add_argument("spacing", type=Path, help="folder of `maurice-replay trials landmarks-spacing`")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/pictures"))
    given = parser.parse_args()
    cv2.setNumThreads(1)
    found = errors(read_rows(given.channels).filter(pl.col("error").is_null()))
    took = costs(list(found))
    points = [Point(name, error, took[name]) for name, error in found.items()]
    print("| feature | error (in) | cost (ms) |\n|---|---|---|")
    for one in sorted(points, key=lambda point: point.error.value):
        interval = f"{one.error.value:.1f} [{one.error.low:.1f}, {one.error.high:.1f}]"
        print(f"| `{one.feature}` | {interval} | {one.cost_ms:.1f} |")
    against_cost(points).savefig(given.output / "accuracy-cost.png", dpi=130)
    spacing = read_rows(given.spacing).filter(pl.col("error").is_null())
    against_spacing(spacing).savefig(given.output / "accuracy-spacing.png", dpi=130)


if __name__ == "__main__":
    main()
