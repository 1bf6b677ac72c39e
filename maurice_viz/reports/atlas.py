"""The section of a page about trials that shows on the floor plan where runs go wrong, spot by spot."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from maurice_datasets.trials.atlas import FailureAtlas, failure_atlas
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.rows import KEY
from maurice_loaders.errors import InputError
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.map import Arena

from ..drawing.canvas import ticks as round_ticks
from ..text.summary import name_of
from .charts import Axes
from .map import drawn_walls, floor_axes

LONG_SIDE = 420.0  # of a floor plan, in px
LEFT, RIGHT, TOP, BOTTOM = 46.0, 12.0, 14.0, 36.0
MOST_NAMED = 4  # filters in the first line
HIGH = 0.95  # quantile at which the darkest color begins
METRICS = {  # what a spot is colored by: its words, and the column
    "error": "median error",
    "wrong": "share of wrong updates (%)",
    "rank": "median rank of the truth's reference",
    "localize": "median pictures to localize from here",
}


@dataclass(frozen=True, slots=True, eq=False)
class ArenaPlan:
    """One arena's floor, in px."""

    name: str
    axes: Axes
    arena: Arena
    per_m: float  # display units
    unit: str
    spots: list[dict[str, Any]]  # as the page's script reads them, with their box in px

    @property
    def width(self) -> float:
        """Of the drawing, in px."""
        return self.axes.right + RIGHT

    @property
    def height(self) -> float:
        """Of the drawing, in px."""
        return self.axes.bottom + BOTTOM

    @property
    def walls(self) -> list[list[list[float]]]:
        """Both ends of each wall."""
        return drawn_walls(self.axes, self.arena)

    @property
    def obstacles(self) -> list[tuple[str, str]]:
        """Name and corners of each obstacle."""
        return [(region.name, self.axes.points(region.polygon)) for region in self.arena.obstacles]

    def ticks(self, axis: int) -> list[tuple[float, str]]:
        """Position and words of the ticks along x (0) or y (1)."""
        low, high = (self.arena.bounds[k] * self.per_m for k in (axis, axis + 2))
        start, length = (
            (self.axes.left, self.axes.width) if axis == 0 else (self.axes.bottom, -self.axes.height)
        )
        span = high - low or 1.0
        return [(start + (one - low) / span * length, f"{one:g}") for one in round_ticks(low, high, 5)]


def atlas_section(trials: TrialsFolder, rows: pl.DataFrame, spot_m: float | None) -> dict[str, Any] | None:
    """Return what the atlas of some rows shows, as the template reads it; None where no truth is known."""
    width_m = rows["right_m"].median() if spot_m is None else spot_m
    try:
        found = failure_atlas(rows, width_m if isinstance(width_m, float) else math.nan)
    except InputError:
        return None
    recorded = rows["arena"].null_count() == len(rows)
    unit, per_m = ("m", 1.0) if recorded else ("in", 1 / INCH_M)
    plans = _plans(trials, rows, found, unit, per_m)
    return {
        "unit": unit,
        "plans": plans,
        "metrics": {name: f"{text} ({unit})" if name == "error" else text for name, text in METRICS.items()},
        "spots": json.dumps([spot for plan in plans for spot in plan.spots]).replace("<", "\\u003c"),
        "highs": json.dumps(_highs(plans)),
        "runs": found.count,
        "filters": _filters(rows["label"].unique(maintain_order=True).to_list()),
        "spot": f"{found.spot_m * per_m:.3g} {unit}",
        "wrong": f"{100 * found.wrong_confident:.1f}",
        "bins": [_bin(one) for one in found.reliability],
        "commands": json.dumps(_commands(trials, found.runs)).replace("<", "\\u003c"),
    }


def _commands(trials: TrialsFolder, runs: pl.DataFrame) -> dict[str, str]:
    """Return the commands that show the worst runs of the spots, by the runs' names."""
    rows = runs.unique(KEY, maintain_order=True).iter_rows(named=True)
    return {name_of(row): trials.commands_of(row) or "" for row in rows}


def _filters(labels: list[str]) -> str:
    return ", ".join(labels) if len(labels) <= MOST_NAMED else f"{len(labels)} filters"


def _plans(
    trials: TrialsFolder, rows: pl.DataFrame, found: FailureAtlas, unit: str, per_m: float
) -> list[ArenaPlan]:
    plans: list[ArenaPlan] = []
    for (arena,), spots in found.spots.group_by("arena", maintain_order=True):
        some = rows.filter(pl.col("arena").fill_null(0) == arena, pl.col("error").is_null())
        floor = trials.arena_of(some.row(0, named=True))
        axes = floor_axes(floor, LONG_SIDE, LEFT, TOP)
        worst = found.runs.filter(pl.col("arena") == arena)
        shown = [_spot(spot, worst, axes, found.spot_m, per_m) for spot in spots.to_dicts()]
        name = f"Arena {arena}" if unit == "in" else some["session"][0]
        plans.append(ArenaPlan(name, axes, floor, per_m, unit, shown))
    return plans


def _spot(
    spot: dict[str, Any], worst: pl.DataFrame, axes: Axes, spot_m: float, per_m: float
) -> dict[str, Any]:
    """Return a spot as the page has it: its box in px, its figures in display units, its worst runs."""
    low = np.array([[spot["column"], spot["row"]]], np.float64) * spot_m
    corners: F64 = axes.at(np.concatenate([low, low + spot_m]))
    (left, bottom), (right, top) = corners.tolist()
    left, right = max(left, axes.left), min(right, axes.right)
    top, bottom = max(top, axes.top), min(bottom, axes.bottom)
    here = worst.filter((pl.col("column") == spot["column"]) & (pl.col("row") == spot["row"]))
    runs = [
        [name_of(run), run["label"], run["update"], round(run["error_m"] * per_m, 1)]
        for run in here.to_dicts()
    ]
    return {
        "box": [round(value, 1) for value in (left, top, right - left, bottom - top)],
        "at": [round(float(value) * per_m, 1) for value in (low[0] + spot_m / 2)],
        "updates": spot["updates"],
        "count": spot["runs"],
        "starts": spot["starts"] or 0,
        "error": _known(spot["error_m"], per_m),
        "wrong": _known(spot["wrong"], 100),
        "rank": _known(spot["rank"], 1),
        "localize": _known(spot["pictures_to_localize"], 1),
        "never": spot["pictures_to_localize"] == math.inf,
        "runs": runs,
    }


def _known(value: float | None, factor: float) -> float | None:
    return round(value * factor, 1) if value is not None and math.isfinite(value) else None


def _highs(plans: Sequence[ArenaPlan]) -> dict[str, float]:
    """Return the value of each metric from which spots have the darkest color."""
    highs = {}
    for name in METRICS:
        values = [spot[name] for plan in plans for spot in plan.spots if spot[name] is not None]
        highs[name] = max(float(np.quantile(values, HIGH)), 1e-9) if values else 1.0
    return highs


def _bin(one: Any) -> dict[str, Any]:
    return {
        "x": one.confidence,
        "y": one.right.value,
        "low": one.right.low,
        "high": one.right.high,
        "words": f"confidence {one.low:.1f} to {one.high:.1f}: {100 * one.right.value:.0f} % correct "
        f"({100 * one.right.low:.0f} to {100 * one.right.high:.0f}), {one.updates:,} updates",
    }
