"""One page about trials: what every variant reached, and where on the floor runs go wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl

from maurice_datasets.trials.atlas import FailureAtlas, failure_atlas
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.plan import shipped_plans
from maurice_datasets.trials.rows import KEY, read_plan_of
from maurice_datasets.trials.table import grouped, load_trials
from maurice_loaders.errors import InputError
from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_mcl.values import F64, INCH_M

from ..errors import OptionError
from ..style import UNITS, Units, scale_for
from ..text.summary import name_of
from .charts import Axes, page_of_template
from .map import DrawnFloor


def trials_report(
    trials: str | Path,
    to: str | Path = "trials.html",
    *,
    spot_m: float | None = None,
    where: Sequence[str] = (),
    force: bool = False,
) -> Path:
    """Write one self-contained page about a folder of trials: what every variant reached, with intervals.

    Trials with truth also have an atlas: error, rank of the truth and time to localize on the floor plan, the
    worst runs of every spot with the commands that show them, and how far confidence can be trusted. `where`
    keeps rows with `column=value`. `spot_m` is the width of a spot in meters; None: the distance up to which
    an update is correct. Returns the file. InputError for a folder without trials and for a file that exists,
    unless `force` is given.

        >>> import maurice_viz as mv
        >>> mv.trials_report("trials", to="trials.html")  # doctest: +SKIP
        PosixPath('trials.html')
    """
    file = Path(to)
    if file.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f"found {file.name!r}, expected a name that ends in .html")
    expect_absent(file, force=force)
    write_whole(file, page_of(Path(trials), spot_m, where).encode(), force=force)
    return file


def page_of(folder: Path, spot_m: float | None = None, where: Sequence[str] = ()) -> str:
    """Return the page."""
    plan, rows = read_plan_of(folder), load_trials(folder, where).filter(pl.col("error").is_null())
    return page_of_template(
        "trials.html",
        title=plan["title"],
        parts=_parts(rows, plan),
        results=_results(rows, plan),
        about=_about(rows),
        atlas=atlas_section(TrialsFolder(folder), rows, spot_m),
    )


def _parts(rows: pl.DataFrame, plan: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "title": part["title"],
            "runs": len(rows.filter(pl.col("part") == part["name"])),
            "command": f"maurice-replay trials run {_plan_named(part['name'])} -o trials",
        }
        for part in plan["parts"]
    ]


def _plan_named(part: str) -> str:
    return part if part in shipped_plans() else f"{part}.toml"


def _results(rows: pl.DataFrame, plan: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what every variant of every part reached: rows of a table, part by part."""
    tables = []
    for part in plan["parts"]:
        of_part = rows.filter(pl.col("part") == part["name"])
        if of_part.is_empty():
            continue
        by = ["session", "label"]
        errors, rights = (grouped(of_part, by, metric) for metric in ("error_mean_m", "right_at_end"))
        recorded = of_part["arena"].null_count() == len(of_part)
        unit, factor = ("m", 1.0) if recorded else ("in", 1 / INCH_M)
        heads = ("Session", "Variant", "Runs", f"Position error, mean ({unit})", "Right at the end (%)")
        lines = [
            (*error.by.values(), error.runs, error.figure.text(factor, 2), right.figure.text(100, 0))
            for error, right in zip(errors, rights, strict=True)
        ]
        named = [list(zip(heads, line, strict=True)) for line in lines]
        tables.append({"title": part["title"], "heads": heads, "rows": named})
    return tables


def _about(rows: pl.DataFrame) -> str:
    versions = ", ".join(sorted(set(rows["version"].drop_nulls())))
    arenas = rows["arena"].drop_nulls().n_unique()
    simulated = f" in {arenas} simulated arenas, none of them used for tuning"
    where = f"{len(rows):,} runs{simulated if arenas else ' over recorded sessions'}"
    return f"{where}; maurice-replay {versions}"


# The section that shows on the floor plan where runs go wrong, spot by spot.

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
        "error": _known(spot["error_median_m"], per_m),
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
