"""The section of a page about trials that shows on the floor plan where runs go wrong, spot by spot."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import polars as pl

from maurice_datasets.trials.atlas import FailureAtlas, failure_atlas
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.rows import KEY
from maurice_loaders.errors import InputError
from maurice_mcl.values import F64

from ..style import UNITS, Units, scale_for
from ..text.summary import name_of
from .charts import Axes
from .map import DrawnFloor

MOST_FILTERS = 4  # that are named in the first line
DARKEST_QUANTILE = 0.95  # at which the darkest color begins
METRICS = {  # what a spot is colored by: its words, and the column
    "error": "median error",
    "wrong": "share of wrong steps (%)",
    "rank": "median rank of the truth's reference",
    "localize": "median pictures to localize from here",
}


@dataclass(frozen=True, slots=True, eq=False)
class ArenaPlan(DrawnFloor):
    """One arena's floor with its spots."""

    long_side: ClassVar[float] = 420.0
    margins: ClassVar[tuple[float, float, float, float]] = (46.0, 12.0, 14.0, 36.0)

    name: str
    spots: list[dict[str, Any]]  # as the page's script reads them, with their box in px

    @property
    def obstacles(self) -> list[tuple[str, str]]:
        """Name and corners of each obstacle."""
        return [(region.name, self.axes.points(region.polygon)) for region in self.arena.obstacles]


def atlas_section(trials: TrialsFolder, rows: pl.DataFrame, spot_m: float | None) -> dict[str, Any] | None:
    """Return what the atlas of some rows shows, as the template reads it; None where no truth is known."""
    width_m = rows["right_m"].median() if spot_m is None else spot_m
    try:
        atlas = failure_atlas(rows, width_m if isinstance(width_m, float) else math.nan)
    except InputError:
        return None
    recorded = rows["arena"].null_count() == len(rows)
    units = UNITS["m" if recorded else "in"]
    unit, plans = units.name, _plans(trials, rows, atlas, units)
    return {
        "unit": unit,
        "plans": plans,
        "metrics": {name: f"{text} ({unit})" if name == "error" else text for name, text in METRICS.items()},
        "spots": json.dumps([spot for plan in plans for spot in plan.spots]).replace("<", "\\u003c"),
        "highs": json.dumps(_highs(plans)),
        "runs": atlas.count,
        "filters": _filters(rows["label"].unique(maintain_order=True).to_list()),
        "spot": f"{atlas.spot_m * units.per_m:.3g} {unit}",
        "wrong": f"{100 * atlas.wrong_confident:.1f}",
        "bins": [_bin(share) for share in atlas.reliability],
        "commands": json.dumps(_commands(trials, atlas.runs)).replace("<", "\\u003c"),
    }


def _commands(trials: TrialsFolder, runs: pl.DataFrame) -> dict[str, str]:
    """Return the commands that show the worst runs of the spots, by the runs' names."""
    rows = runs.unique(KEY, maintain_order=True).iter_rows(named=True)
    return {name_of(row): trials.commands_of(row) or "" for row in rows}


def _filters(labels: list[str]) -> str:
    return ", ".join(filter(None, labels)) if len(labels) <= MOST_FILTERS else f"{len(labels)} filters"


def _plans(trials: TrialsFolder, rows: pl.DataFrame, atlas: FailureAtlas, units: Units) -> list[ArenaPlan]:
    plans: list[ArenaPlan] = []
    for (number,), spots in atlas.spots.group_by("arena", maintain_order=True):
        runs = rows.filter(pl.col("arena").fill_null(0) == number, pl.col("error").is_null())
        arena = trials.arena_of(runs.row(0, named=True))
        name = f"Arena {number}" if units.name == "in" else runs["session"][0]
        plan = ArenaPlan(arena, scale_for(units.name, arena), name, [])
        worst = atlas.runs.filter(pl.col("arena") == number)
        shown = [_spot(spot, worst, plan.axes, atlas.spot_m, units.per_m) for spot in spots.to_dicts()]
        plans.append(replace(plan, spots=shown))
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
        highs[name] = max(float(np.quantile(values, DARKEST_QUANTILE)), 1e-9) if values else 1.0
    return highs


def _bin(share: Any) -> dict[str, Any]:
    low, high = 100 * share.right.low, 100 * share.right.high
    return {
        "x": share.confidence,
        "y": share.right.value,
        "low": share.right.low,
        "high": share.right.high,
        "words": f"confidence {share.low:.1f} to {share.high:.1f}: {100 * share.right.value:.0f} % correct "
        f"({low:.0f} to {high:.0f}), {share.updates:,} steps",
    }
