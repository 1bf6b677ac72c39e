"""Layouts of several runs: two to four of them side by side, and one number per update over the session.

With three or four runs each has a small map of its own beside the shared one; their histograms are in their
tabs of the layout `overview`.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..drawing.keys import NARROW_FROM
from ..panels import comparison as shared
from ..panels import traces as lines
from ..panels.camera import camera_view, histogram_views
from ..panels.events import words_view
from ..panels.references import best_references_view, circles_view
from ..scene import RunView, Scene
from .story import over_events


def compare(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out two runs left and right of what they share; more as small maps beside the shared one."""
    body = _two if len(runs) < NARROW_FROM else _many
    return over_events(body(runs, scene), runs)


def _two(runs: Sequence[RunView], scene: Scene) -> rrb.Horizontal:
    first, second = (_wide(run, len(runs), scene) for run in runs)
    return rrb.Horizontal(first, _wide_shared(runs, scene), second, column_shares=[1, 1.1, 1])


def _many(runs: Sequence[RunView], scene: Scene) -> rrb.Horizontal:
    together = rrb.Vertical(shared.all_runs_view(runs, scene), shared.comparison_words(), row_shares=[1.7, 1])
    maps = [shared.run_belief_view(run, len(runs), scene) for run in runs]
    pictures = rrb.Horizontal(*shared.camera_views(runs))
    plots = rrb.Vertical(pictures, *_narrow_plots(runs, scene))
    return rrb.Horizontal(together, rrb.Grid(*maps, grid_columns=2), plots, column_shares=[1, 1.5, 0.9])


def recorded_compare(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out several recorded localizers: one shared map, a map each, how they differ."""
    together = rrb.Vertical(shared.all_runs_view(runs, scene), shared.comparison_words(), row_shares=[1.7, 1])
    maps = [shared.run_belief_view(run, len(runs), scene) for run in runs]
    pictures = [camera_view()] if scene.has_pictures else []
    plots = rrb.Vertical(*pictures, *_narrow_plots(runs, scene))
    grid = rrb.Grid(*maps, grid_columns=1 if len(runs) < NARROW_FROM else 2)
    return over_events(rrb.Horizontal(together, grid, plots, column_shares=[1.1, 1.2, 1]), runs)


def _wide(run: RunView, count: int, scene: Scene) -> rrb.Vertical:
    paths = run.paths
    return rrb.Vertical(
        rrb.Tabs(shared.run_belief_view(run, count, scene), circles_view(paths, scene)),
        best_references_view(paths, scene),
        rrb.Tabs(*histogram_views(paths, run.channels), active_tab=0),
        words_view(paths, f"{run.label}: What this step did"),
        row_shares=[2.5, 0.95, 1.2, 1.15],
    )


def _wide_shared(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    cameras = rrb.Horizontal(*shared.camera_views(runs))
    plots = _wide_plots(runs, scene)
    everything = shared.all_runs_view(runs, scene)
    return rrb.Vertical(
        everything, cameras, *plots, shared.comparison_words(), row_shares=[2.55, 1.05, 1.1, 1.1, 1.8]
    )


def _wide_plots(runs: Sequence[RunView], scene: Scene) -> list[rrb.Tabs]:
    """Plot the runs themselves, then how they differ from the first."""
    distances = shared.distance_plots(runs, scene)
    if not scene.has_truth:
        shares = lines.cloud_plots(runs, scene)[1]
        return [rrb.Tabs(plot) for plot in (lines.cloud_plots(runs, scene)[0], *(distances or [shares]))]
    position, heading = shared.difference_plots(runs, scene)
    differences = [position, *distances, heading]
    return [
        rrb.Tabs(*lines.error_plots(runs, scene), lines.cloud_plots(runs, scene)[0], active_tab=0),
        rrb.Tabs(*differences, active_tab=0),
    ]


def _narrow_plots(runs: Sequence[RunView], scene: Scene) -> list[rrb.TimeSeriesView]:
    if not scene.has_truth:
        return [lines.cloud_plots(runs, scene)[0], *shared.distance_plots(runs, scene)]
    error, _ = lines.error_plots(runs, scene)
    return [error, shared.difference_plots(runs, scene)[0], *shared.distance_plots(runs, scene)]


def traces(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Plot one quantity per panel, one line per run in its color, as the lanes below name them."""
    knows, particles = lines.knows_plot(runs), lines.particle_plots(runs)
    spread, confidence = lines.cloud_plots(runs, scene)
    columns = [rrb.Vertical(spread, confidence, *particles)]
    if scene.has_truth:
        columns = [rrb.Vertical(*lines.error_plots(runs, scene), knows, lines.rank_plot(runs)), *columns]
    else:
        columns = [rrb.Vertical(knows, spread, confidence), rrb.Vertical(*particles)]
    return over_events(rrb.Horizontal(*columns, _last(runs)), runs)


def _last(runs: Sequence[RunView]) -> rrb.Vertical:
    """Plot evidence, one panel per run, over the key."""
    several = len(runs) > 1
    evidence = [lines.evidence_plot(run.paths, run.label if several else "") for run in runs if run.channels]
    shares = [2.4 / max(len(evidence), 1)] * len(evidence) + [lines.key_share(runs[0])]
    return rrb.Vertical(*evidence, lines.evidence_key(runs[0].paths), row_shares=shares)


def recorded_traces(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Plot one quantity per panel of another localizer's clouds, whose evidence is not known."""
    columns = [lines.error_plots(runs, scene)] if scene.has_truth else []
    columns.append(lines.cloud_plots(runs, scene))
    return over_events(rrb.Horizontal(*(rrb.Vertical(*column) for column in columns)), runs)
