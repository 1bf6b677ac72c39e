"""What the page's script needs to show one step in the map and all traces at once: numbers, by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from maurice_mcl.values import F64

from ..running.saved_steps import Collected
from ..style import Scale
from .charts import Axes, DrawnChart
from .map import DrawnMap

DIGITS = 4  # significant ones, of a value in a chart


def linked(
    drawn_map: DrawnMap, charts: Sequence[DrawnChart], collected: Collected, scale: Scale, step: int
) -> Mapping[str, Any]:
    """Return what the script reads; `step` is the one that is shown at first.

    Poses are x, y and heading in display units and degrees, null where not known. A chart has a list of
    values for each run.
    """
    steps = collected.tracks[0].column("step").astype(int).tolist()
    paths = [path for path in drawn_map.paths if path.kind != "odometry"]
    return {
        "first": steps.index(step) if step in steps else 0,
        "steps": steps,
        "times": np.round(collected.tracks[0].column("time_s"), 1).tolist(),
        "unit": scale.units.name,
        "digits": scale.units.digits,
        "map": _axes(drawn_map.axes, scale.units.per_m),
        "poses": [_poses(path.poses, scale) for path in paths],
        "charts": [
            {
                "name": drawn.chart.title.lower(),
                "unit": drawn.chart.unit,
                "told": drawn.chart.is_told,
                "axes": _axes(drawn.axes),
                "values": [_values(line.y) for line in drawn.lines],
            }
            for drawn in charts
        ],
    }


def _axes(axes: Axes, factor: float = 1.0) -> list[float]:
    """Return the values at left, right, bottom and top, then left, top, width and height in px."""
    values = [factor * value for value in (*axes.x, *axes.y)]
    return [*values, axes.left, axes.top, axes.width, axes.height]


def _poses(poses: F64, scale: Scale) -> list[list[float] | None]:
    places = np.round(scale.units.per_m * poses[:, :2], scale.units.digits + 1)
    headings = np.round(np.degrees(poses[:, 2]))
    rows = np.column_stack([places, headings]).tolist()
    return [row if np.isfinite(row).all() else None for row in rows]


def _values(values: F64) -> list[float | None]:
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()]
