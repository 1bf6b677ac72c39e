"""Trials in words: metrics with their units, and the run behind a row."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from maurice_datasets.trials.rows import SCHEMA
from maurice_mcl.geometry import INCH_M

UNITS = {"_m": ("in", 1 / INCH_M), "_rad": ("deg", 180 / math.pi), "_s": ("s", 1.0)}


def metric_title(metric: str) -> tuple[str, float]:
    """Return the title of a metric with its unit, and the factor that brings it there."""
    for ending, (unit, factor) in UNITS.items():
        if metric.endswith(ending):
            return f"{metric.removesuffix(ending).replace('_', ' ')} ({unit})", factor
    flag = str(SCHEMA[metric][0]) == "Boolean"
    return f"{metric.replace('_', ' ')}{' (%)' if flag else ''}", 100.0 if flag else 1.0


def name_of(row: Mapping[str, Any]) -> str:
    """Return what names a run within its folder: PART/SESSION/VARIANT/SEED."""
    return f"{row['part']}/{row['session']}/{row['variant']}/{row['seed']}"


def run_text(
    folder: Path, row: Mapping[str, Any], worst: Sequence[Mapping[str, Any]], metric: str, same: bool | None
) -> str:
    """Write, as Markdown, which run is shown, whether it is the row's, and the commands of the worst."""
    title, factor = metric_title(metric)

    def said(one: Mapping[str, Any]) -> str:
        return "unknown" if one[metric] is None else f"{one[metric] * factor:.1f}"

    lines = [f"**{row['part']}**, {row['session']}: **{row['label']}**, seed **{row['seed']}**", ""]
    told = {
        None: "",
        True: " Made again from its row: the same error, to the last bit.",
        False: f" **Made again, its error is not that of its row**, which {row['host']} made with version "
        f"{row['version']} and numpy {row['numpy']}.",
    }[same]
    failure = f"; failed: {row['failure']}" if row["failure"] else ""
    lines += [f"{title}: {said(row)}{failure}.{told}", ""]
    lines += [
        f"The worst of this part; show one with `maurice-replay trials-view {folder.name} --run ...`",
        "",
    ]
    lines += [f"| {title} | run | --run |", "|---|---|---|"]
    for one in worst:
        lines.append(f"| {said(one)} | {one['label']}, seed {one['seed']} | `{shlex.quote(name_of(one))}` |")
    return "\n".join(lines)
