"""Two figures of docs/landmarks.md: accuracy against cost for every feature, and error against spacing.

Errors are those of trials on unseen drives (plans `channels` and `landmarks-spacing`); the cost is measured
here, on the demo's pictures, every feature in turn, so that a busy machine troubles all alike.

Run: make results, or python -m benchmarks.studies.landmark_figures CHANNELS SPACING -o docs/pictures for two
folders of trials; `make results SEEDS=5` is a quick try.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time

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
from maurice_datasets.trials.table import clusters_of
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M

PICTURES, ROUNDS, PARTICLES = 20, 3, 1000
POSE_SENSORS = ("landmarks", "all")
TICKS = (1, 2, 5, 10, 20, 50)
LETTER, UP = 5.0, (0, 12, -12, 24, -24, 36, -36, 48, -48)  # of labels, in points: width, and steps up


@dataclass(frozen=True, slots=True)
class Point:
    """One feature: its mean error in inches, and what a picture costs."""

    feature: str
    error: Interval
    cost_ms: float


def errors(rows: pl.DataFrame) -> dict[str, Interval]:
    """Return the mean position error in inches by label, with its 95 percent interval."""
    return {
        str(label): mean(some["error_mean_m"].to_numpy() / INCH_M, clusters_of(some))
        for (label,), some in rows.group_by("label", maintain_order=True)
    }


def costs(features: Sequence[str], rounds: int = ROUNDS) -> dict[str, float]:
    """Return the median milliseconds of CPU that a picture costs by feature, with a thousand particles.

    That is comparing it, moving the particles (which pose sensors guide), and weighting them, from a cloud
    at the true pose of the picture before.
    """
    paths = demo_paths(0)
    library, session = ml.with_landmarks(ml.open_library(paths.survey)), ml.open_session(paths.session)
    moments = list(itertools.islice(session.moments(), PICTURES + 1))
    localizers = {
        entry: mcl.make_localizer(library, feature=entry, particles=PARTICLES).of_session(session)
        for entry in features
    }
    took: dict[str, list[float]] = {entry: [] for entry in features}
    for before, moment in list(itertools.pairwise(moments)) * rounds:
        for name, localizer in localizers.items():
            belief = localizer.initialize(before.truth).belief
            began = process_time()
            comparison = localizer.sensor.see(moment.frame)
            prediction = localizer.predict(belief, moment.frame)
            proposal = localizer.proposal.propose(prediction, comparison, ())
            localizer.sensor.at(comparison, proposal.belief.poses)
            took[name].append(process_time() - began)
    return {name: 1000 * float(np.median(times)) for name, times in took.items()}


def against_cost(points: Sequence[Point]) -> Figure:
    """Draw error over cost: features of pose sensors stand out, and the line is the best at each cost."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.add_subplot()
    best = _best(points)
    axes.step(
        [entry.cost_ms for entry in best],
        [entry.error.value for entry in best],
        where="post",
        color="gray",
        linewidth=1,
        linestyle="--",
        label="the best at this cost or less",
        zorder=0,
    )
    for color, name, some in (
        ("tab:blue", "histograms and other channels", [p for p in points if p.feature not in POSE_SENSORS]),
        ("tab:orange", "with landmarks", [p for p in points if p.feature in POSE_SENSORS]),
    ):
        values = np.array([[p.error.value, p.error.low, p.error.high] for p in some]).reshape(-1, 3)
        bars = np.stack([values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]])
        costs_ms = [p.cost_ms for p in some]
        axes.errorbar(costs_ms, values[:, 0], bars, fmt="o", color=color, capsize=2, alpha=0.8, label=name)
    cheapest, dearest = (end(entry.cost_ms for entry in points) for end in (min, max))
    axes.set(xscale="log", yscale="log", xlim=(cheapest / 2.5, dearest * 2.5))
    axes.set_xlabel(f"CPU time of a picture (ms, {PARTICLES:,} particles, 624 references)")
    axes.set_ylabel("mean position error (in), 95 % intervals")
    for axis, ticks in ((axes.yaxis, (0.5, *TICKS)), (axes.xaxis, (0.2, 0.5, *TICKS, 100, 200))):
        axis.set_major_locator(mpl.ticker.FixedLocator(ticks))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    axes.set_title("Accuracy against cost: tracking on unseen drives, 18 in between places")
    axes.legend(fontsize=8, loc="lower left")
    axes.grid(alpha=0.3)
    figure.draw_without_rendering()  # so that the places of the marks are known
    marks = (
        axes.transData.transform([[entry.cost_ms, entry.error.value] for entry in points]) * 72 / figure.dpi
    )
    for entry, beside in zip(points, _beside([entry.feature for entry in points], marks), strict=True):
        axes.annotate(
            entry.feature,
            (entry.cost_ms, entry.error.value),
            beside,
            textcoords="offset points",
            fontsize=8,
            va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
            arrowprops={"arrowstyle": "-", "color": "gray", "linewidth": 0.5, "shrinkB": 3},
        )
    return figure


def _best(points: Sequence[Point]) -> list[Point]:
    """Return the points that no cheaper one is better than, by cost."""
    figures = list[Point]()
    for entry in sorted(points, key=lambda point: point.cost_ms):
        if not figures or entry.error.value < figures[-1].error.value:
            figures.append(entry)
    return figures


def _beside(words: Sequence[str], marks: F64) -> list[tuple[float, float]]:
    """Return where each label begins, from its mark (N, 2) in points: the nearest place that is free."""
    taken = [np.array([x - 3, y - 4, x + 3, y + 4]) for x, y in marks]
    places = list[tuple[float, float]]()
    for word, (x, y) in zip(words, marks, strict=True):
        width = LETTER * len(word)
        tried = [(side, up) for up in UP for side in (8.0, -8.0 - width, 30.0, -30.0 - width)]
        boxes = [np.array([x + side, y + up - 5, x + side + width, y + up + 5]) for side, up in tried]
        clear = [not any(_overlap(box, other) for other in taken) for box in boxes]
        chosen = clear.index(True) if any(clear) else 0
        taken.append(boxes[chosen])
        places.append(tried[chosen])
    return places


def _overlap(entry: F64, other: F64) -> bool:
    return bool((entry[:2] < other[2:]).all() and (other[:2] < entry[2:]).all())


def against_spacing(rows: pl.DataFrame) -> Figure:
    """Draw error over the spacing of the survey, beside a perfect matcher of references."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    rows = rows.with_columns(spacing=pl.col("session").str.extract(r"(\d+)$").cast(pl.Float64))
    for label, some in rows.group_by("label", maintain_order=True):
        _line(axes.errorbar, some, "error_mean_m", str(label[0]))
    first = rows.filter(pl.col("label") == rows["label"][0])
    _line(partial(axes.errorbar, color="gray"), first, "oracle_m", "distance to the nearest reference")
    axes.set(ylim=(0, None), xlabel="distance between places of the survey (in)")
    axes.set_ylabel("mean position error (in), 95 % intervals")
    axes.set_title("Error against spacing: tracking on unseen drives")
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def _line(errorbar: object, rows: pl.DataFrame, column: str, label: str) -> None:
    figures = {
        float(key[0]): mean(some[column].to_numpy() / INCH_M, clusters_of(some))
        for key, some in rows.sort("spacing").group_by("spacing", maintain_order=True)
    }
    values = np.array([entry.value for entry in figures.values()])
    ends = np.array([[entry.low, entry.high] for entry in figures.values()]).T
    bars = np.maximum([values - ends[0], ends[1] - values], 0)
    errorbar(list(figures), values, bars, fmt="o-", capsize=3, label=label)  # type: ignore[operator]


def table(points: Sequence[Point]) -> str:
    """Return the channels as a table in Markdown, the best first."""
    lines = ["| feature | mean error (in) | CPU time of a picture (ms) | runs |", "|---|---|---|---|"]
    for entry in sorted(points, key=lambda point: point.error.value):
        interval = f"{entry.error.value:.1f} [{entry.error.low:.1f}, {entry.error.high:.1f}]"
        lines.append(f"| `{entry.feature}` | {interval} | {entry.cost_ms:.1f} | {entry.error.count} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("channels", type=Path, help="folder of trials of plans/channels.toml")
    parser.add_argument("spacing", type=Path, help="folder of trials of plans/landmarks-spacing.toml")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/pictures"))
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="over the pictures whose cost is measured")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    cv2.setNumThreads(1)
    figures = errors(read_rows(given.channels).filter(pl.col("error").is_null()))
    missing = [name for name in POSE_SENSORS if name not in figures]
    if missing:
        sys.exit(f"{given.channels}: found no runs of {' and '.join(missing)}; go on with the trials")
    took = costs(list(figures), given.rounds)
    points = [Point(name, error, took[name]) for name, error in figures.items()]
    print(table(points))
    against_cost(points).savefig(given.output / "accuracy-cost.png", dpi=130)
    spacing = read_rows(given.spacing).filter(pl.col("error").is_null())
    against_spacing(spacing).savefig(given.output / "accuracy-spacing.png", dpi=130)


if __name__ == "__main__":
    main()
