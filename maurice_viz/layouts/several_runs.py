"""Layouts of several runs: two to four of them side by side, and one number per update over the session.

Columns are narrow with three or four runs, so titles are short, and the histograms of a run are only in
its tab of the layout `overview`.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..drawing.keys import NARROW_FROM, extent_with, narrow_circle_key
from ..entities import RunPaths
from ..panels import comparison as shared
from ..panels import traces as lines
from ..panels.events import events_view, words_view
from ..panels.histograms import SHORT_LEGEND, histogram_views
from ..panels.references import best_references_view, circles_view, narrow_circles_view
from ..panels.views import plot_of_runs
from ..scene import RunView, SceneInfo


def compare(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Horizontal:
    """Lay out the runs in order: half of them left of what they share, the others right of it."""
    side, shared = (_wide, _wide_shared) if len(runs) < NARROW_FROM else (_narrow, _narrow_shared)
    columns = [side(run, number, len(runs), scene) for number, run in enumerate(runs)]
    half = len(runs) // 2
    shares = [1.0] * half + [1.1] + [1.0] * (len(runs) - half)
    return rrb.Horizontal(*columns[:half], shared(runs, scene), *columns[half:], column_shares=shares)


def _wide(run: RunView, number: int, count: int, scene: SceneInfo) -> rrb.Vertical:
    paths = RunPaths(run.label)
    return rrb.Vertical(
        rrb.Tabs(shared.run_belief_view(run, number, count, scene), circles_view(paths, scene)),
        best_references_view(paths),
        rrb.Tabs(*histogram_views(paths, run.channels, SHORT_LEGEND), active_tab=0),
        words_view(paths, f"{run.label}: What this step did"),
        row_shares=[2.5, 0.95, 1.2, 1.15],
    )


def _narrow(run: RunView, number: int, count: int, scene: SceneInfo) -> rrb.Vertical:
    paths = RunPaths(run.label)
    circles = narrow_circles_view(
        paths, scene, extent_with(narrow_circle_key(count), scene.arena, scene.scale)
    )
    return rrb.Vertical(
        shared.run_belief_view(run, number, count, scene),
        rrb.Tabs(circles, best_references_view(paths, "Five best"), active_tab=0),
        words_view(paths, "This step"),
        row_shares=[1.15, 1.05, 0.8],
    )


def _wide_shared(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Vertical:
    cameras = rrb.Horizontal(*shared.camera_views(runs))
    plots = _wide_plots(runs, scene)
    everything = shared.all_runs_view(runs, scene)
    return rrb.Vertical(
        everything, cameras, *plots, shared.comparison_words(), row_shares=[2.5, 1.3, 1.2, 1.2, 1.4]
    )


def _narrow_shared(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Vertical:
    pictures = rrb.Tabs(*shared.camera_views(runs), active_tab=0)
    plots = _narrow_plots(runs, scene)
    shares = [2.2, 1.1] + [1.0] * len(plots) + [2.1]
    return rrb.Vertical(
        shared.all_runs_view(runs, scene), pictures, *plots, shared.comparison_words(), row_shares=shares
    )


def _wide_plots(runs: Sequence[RunView], scene: SceneInfo) -> list[rrb.Tabs]:
    """Plot the runs themselves, then how they differ from the first."""
    labels, distances = [run.label for run in runs], shared.distance_plots(runs, scene)
    if not scene.has_truth:
        shares = plot_of_runs(lines.CONFIDENCE, "Confidence (share)", labels, 1.1)
        return [rrb.Tabs(one) for one in (_spread(labels, scene), *(distances or [shares]))]
    position, heading = shared.difference_plots(runs, scene)
    differences = [position, *distances, heading]
    return [
        rrb.Tabs(*lines.error_plots(labels, scene), _spread(labels, scene), active_tab=0),
        rrb.Tabs(*differences, active_tab=0),
    ]


def _narrow_plots(runs: Sequence[RunView], scene: SceneInfo) -> list[rrb.TimeSeriesView]:
    labels = [run.label for run in runs]
    if not scene.has_truth:
        return [_spread(labels, scene), *shared.distance_plots(runs, scene)]
    error, _ = lines.error_plots(labels, scene)
    return [error, shared.difference_plots(runs, scene)[0], *shared.distance_plots(runs, scene)]


def _spread(labels: Sequence[str], scene: SceneInfo) -> rrb.TimeSeriesView:
    return plot_of_runs(lines.SPREAD, f"Spread ({scene.scale.units.name})", labels)


def traces(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Container:
    """Plot one quantity per panel, one line per run."""
    labels = [run.label for run in runs]
    who = lines.who_is_who(labels)  # stands in the first title
    columns = []
    if scene.has_truth:
        columns.append(rrb.Vertical(*lines.error_plots(labels, scene, who), *lines.truth_plots(labels)))
    cloud = lines.cloud_plots(labels, scene, "" if scene.has_truth else who)
    columns.append(rrb.Vertical(*cloud, *lines.survival_plots(labels)))
    return rrb.Horizontal(*columns, _last(runs))


def _last(runs: Sequence[RunView]) -> rrb.Vertical:
    """Plot evidence, one panel per run, over the key of its lines and the events."""
    titles = {run.label: f"{run.label}: " if len(runs) > 1 else "" for run in runs}
    evidence = [lines.evidence_plot(RunPaths(run.label), titles[run.label]) for run in runs]
    by_channels = {run.channels: run for run in reversed(runs)}  # the same channels have the same key
    first_ones = [run for run in runs if by_channels[run.channels] is run]
    if len(first_ones) > 1:
        keys = [lines.evidence_key(RunPaths(run.label), titles[run.label]) for run in first_ones]
        key: rrb.Tabs | rrb.Spatial2DView = rrb.Tabs(*keys, active_tab=0)
    else:
        key = lines.evidence_key(RunPaths(runs[0].label))
    shares = [2.4 / len(runs)] * len(runs) + [lines.key_share(runs[0]), 0.45 + 0.42 * len(runs)]
    return rrb.Vertical(*evidence, key, events_view(list(titles)), row_shares=shares)


def recorded_traces(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Container:
    """Plot one quantity per panel of another localizer's clouds, whose evidence is not known."""
    labels = [run.label for run in runs]
    columns = [lines.error_plots(labels, scene)] if scene.has_truth else []
    columns.append(lines.cloud_plots(labels, scene))
    side_by_side = rrb.Horizontal(*(rrb.Vertical(*column) for column in columns))
    return rrb.Vertical(side_by_side, events_view(labels), row_shares=[4, 1])
