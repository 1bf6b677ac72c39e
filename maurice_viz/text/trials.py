"""Trials in words: metrics with their units, and the names of runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from maurice_datasets.trials.rows import SCHEMA
from maurice_mcl.values.geometry import INCH_M

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
