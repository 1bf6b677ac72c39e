"""The results table: every task and tier of docs/evaluation.md on unseen arenas, with intervals.

The runs are the plan `results` (plans/results.toml): arena seeds 1000 to 1009, a drive seed of its own for
every drive; nothing was fitted on any of them, and one configuration serves all tiers. Errors are inches:
mean over drives, with Student's 95 percent interval; rates have Wilson's (docs/trials.md).
Beside every error stands its ratio to the nearest-node oracle's on the same drives, which always knows the
nearest reference.

Run: make results (hours for 300 drives a tier; it goes on where it stopped), or
python -m benchmarks.studies.results DIR for a folder of trials of that plan.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import polars as pl

from maurice_datasets.trials.rows import read_rows
from maurice_datasets.trials.statistics import Clusters, Interval, mean, share
from maurice_datasets.trials.table import clusters_of, curve_of
from maurice_loaders.errors import InputError
from maurice_mcl.values.geometry import INCH_M

TITLES = (
    "filter, particles",
    "task",
    "tier",
    "drives",
    "error (in)",
    "of the oracle's",
    "heading, mean, median (deg)",
)
RATES = "lost %", "right at the end %", "pictures to localize, %", "wrong and confident %"
TIERS = ("nominal", "dim", "hard")
PAIRS = (
    ("thesis, blended", "thesis"),
    ("blended", "color"),
    ("blended", "edges"),
    ("thesis, plain L1", "thesis"),
    ("refined", "thesis"),
    ("color", "thesis"),
    ("color", "color, surveyed references only"),
    ("best, 1,000", "blended"),
    ("best, 1,000", "best, 1,000, surveyed references only"),
    ("best, 1,000, motion constants +30 %", "best, 1,000"),
    ("robust, 1,000", "best, 1,000"),
    ("precise, 1,000", "robust, 1,000"),
    ("precise, 1,000", "landmarks, 1,000"),
)


def main() -> None:
    try:
        rows = read_rows(Path(sys.argv[1])).filter(pl.col("error").is_null())
    except InputError as problem:
        sys.exit(str(problem))
    print(f"| {' | '.join((*TITLES, *RATES))} |\n|{'---|' * (len(TITLES) + len(RATES))}")
    for _, some in rows.group_by("part", "session", "variant", maintain_order=True):
        print(row(some))
    print("\nerror of the first less the second on the same drives (in)\n")
    print("| | nominal | dim | hard |\n|---|---|---|---|")
    tracking = rows.filter(pl.col("part").str.ends_with("-tracking"))
    for first, second in PAIRS:
        cells = [apart(tracking.filter(pl.col("tier") == tier), first, second) for tier in TIERS]
        if any(cells):
            print(f"| {first} against {second} | {' | '.join(cells)} |")


def row(rows: pl.DataFrame) -> str:
    """Return one line of the table."""
    entry, clusters = rows.row(0, named=True), clusters_of(rows)
    error = mean(rows["error_mean_m"].to_numpy() / INCH_M, clusters)
    oracle = rows["oracle_m"].to_numpy().mean() / INCH_M
    localized = rows["pictures_to_localize"].is_not_null()
    localizing = (
        "-" if entry["task"] == "tracking" else f"{curve_of(rows).median:g}, {_rate(localized, clusters)}"
    )
    light = f", lights {entry['lights']}" if entry["lights"] else ""
    of_oracle = Interval(*(value / oracle for value in (error.value, error.low, error.high)), error.count)
    cells = (
        f"{entry['label']}{light}",
        entry["task"] if entry["session"].startswith(entry["task"]) else entry["session"],
        entry["tier"],
        str(len(rows)),
        _said(error, 1),
        _said(of_oracle, 2),
        _heading(rows),
        _rate(rows["lost"], clusters),
        _rate(rows["right_at_end"], clusters),
        localizing,
        f"{100 * rows['wrong_confident'].to_numpy().mean():.1f}",
    )
    return f"| {' | '.join(cells)} |"


def apart(rows: pl.DataFrame, first: str, second: str) -> str:
    """Return by how much the first filter's error differs from the second's, drive by drive."""
    a, b = (rows.filter(pl.col("label") == label) for label in (first, second))
    both = a.join(b, on="seed", suffix="_second").sort("seed")
    if both.is_empty():
        return ""
    values = (both["error_mean_m"] - both["error_mean_m_second"]).to_numpy() / INCH_M
    return _said(mean(values, clusters_of(both)), 1, "+")


def _heading(rows: pl.DataFrame) -> str:
    """Return the mean over drives of a drive's mean, and of its median where older rows do not lack it."""
    median = rows["heading_error_median_rad"].mean() if "heading_error_median_rad" in rows.columns else None
    values = rows["heading_error_mean_rad"].mean(), median
    return ", ".join(f"{np.degrees(value):.1f}" for value in values if value is not None)


def _said(found: Interval, digits: int, sign: str = "") -> str:
    numbers = (found.value, found.low, found.high)
    value, low, high = (f"{number:{sign}.{digits}f}" for number in numbers)
    return f"{value} [{low}, {high}]"


def _rate(flags: pl.Series, clusters: Clusters) -> str:
    interval = share(flags.fill_null(False).to_numpy(), clusters)
    return f"{100 * interval.value:.0f} [{100 * interval.low:.0f}, {100 * interval.high:.0f}]"


if __name__ == "__main__":
    main()
