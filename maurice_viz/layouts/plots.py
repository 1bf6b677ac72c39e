"""Plots of traces over the session. Colors are named in titles: a legend would cover a small plot."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.traces import (
    ANCESTORS,
    CONFIDENCE,
    EFFECTIVE,
    EVIDENCE,
    HEADING_ERROR,
    POSITION_ERROR,
    SPREAD,
    SURVIVORS,
)
from ..scene import RunView, SceneInfo
from ..style import COLOR_WORDS, GROUND, RUN_COLORS
from .views import Overrides


def single_traces(paths: RunPaths, shown: SceneInfo) -> list[rrb.TimeSeriesView]:
    """Plot one run: distances, heading error where the truth is known, shares."""
    unit = shown.scale.units.name
    both = [paths.trace(CONFIDENCE), paths.trace(EFFECTIVE)]
    shares = plot("Confidence orange, effective sample blue (share)", both, top=1.1)
    if not shown.has_truth:
        return [plot(f"Spread of the cloud ({unit})", [paths.trace(SPREAD)]), shares]
    distances = [paths.trace(POSITION_ERROR), paths.trace(SPREAD)]
    return [
        plot(f"Position error orange, spread blue ({unit})", distances),
        plot("Heading error (deg)", [paths.trace(HEADING_ERROR)]),
        shares,
    ]


def compared_traces(labels: Sequence[str], shown: SceneInfo) -> list[rrb.TimeSeriesView | rrb.Tabs]:
    """Plot runs in one chart a quantity."""
    who = ", ".join(f"{label} {word}" for label, word in zip(labels, COLOR_WORDS, strict=False))
    unit = shown.scale.units.name
    plots = [(SPREAD, f"Spread ({unit})" if shown.has_truth else f"Spread ({unit}): {who}")]
    if shown.has_truth:
        plots = [
            (POSITION_ERROR, f"Position error ({unit}): {who}"),
            (HEADING_ERROR, "Heading error (deg)"),
            *plots,
        ]
    *above, spread = [compared(quantity, name, labels) for quantity, name in plots]
    confidence = compared(CONFIDENCE, "Confidence (share)", labels, top=1.1)
    effective = compared(EFFECTIVE, "ESS (share)", labels, top=1.1)
    if not above:
        return [spread, confidence, effective]
    return [*above, rrb.Tabs(spread, confidence, effective, active_tab=0)]


def compared(quantity: str, name: str, labels: Sequence[str], top: float | None = None) -> rrb.TimeSeriesView:
    """Plot one quantity of several runs, each in its own color."""
    paths = [RunPaths(label).trace(quantity) for label in labels]
    colors: Overrides = {
        path: rr.SeriesLines.from_fields(colors=[color])
        for path, color in zip(paths, RUN_COLORS, strict=False)
    }
    return plot(name, paths, top, colors)


def lineage_plot(paths: RunPaths) -> rrb.TimeSeriesView:
    """Plot how many particles survive, and from how many the cloud descends."""
    lines = [paths.trace(SURVIVORS), paths.trace(ANCESTORS)]
    return plot("Survivors pink, ancestors 10 steps back green (share)", lines, top=1.1)


def evidence_plot(paths: RunPaths, title: str = "") -> rrb.TimeSeriesView:
    """Plot how well the cloud explained each picture: all channels together, and each alone."""
    return plot(f"{title}Evidence of each picture (nats)", [paths.trace(EVIDENCE)])


def key_share(run: RunView) -> float:
    """Give how much of a column the key needs: a row for every four channels."""
    return 0.35 + 0.09 * (len(run.channels) // 4)


def evidence_key(paths: RunPaths, title: str = "") -> rrb.Spatial2DView:
    """Show what the colors of the evidence mean: in the plot a legend would cover lines."""
    name = f"{title}lines of evidence" if title else "Lines of evidence: channels"
    return rrb.Spatial2DView(name=name, origin=paths.line_key, background=GROUND)


def plot(
    name: str,
    contents: list[str],
    top: float | None = None,
    overrides: Overrides | None = None,
) -> rrb.TimeSeriesView:
    """Plot some lines; the scale goes from zero to `top` where that is given, else as far as they need."""
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=[*contents, *(f"{path}/top" for path in contents)],
        overrides=overrides,
        axis_y=None if top is None else rrb.ScalarAxis(range=(0.0, top)),
        plot_legend=rrb.PlotLegend(visible=False),
    )
