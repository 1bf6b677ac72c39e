"""Another localizer's recorded clouds: nothing is known about references."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.belief import belief_view, closeup_view
from ..panels.camera import camera_view
from ..panels.events import events_view, words_view
from ..panels.population import headings_view, modes_view
from ..panels.traces import cloud_plots, error_plots, single_plots
from ..scene import RunView, SceneInfo


def overview(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Horizontal:
    """Lay out one run: the arena and the words left, the close-up in the middle, traces right."""
    (run,) = runs
    paths = RunPaths(run.label)
    left = rrb.Vertical(
        belief_view(paths, scene), words_view(paths), events_view([run.label]), row_shares=[2.2, 0.95, 0.95]
    )
    middle = rrb.Vertical(closeup_view(paths, scene), modes_view(paths), row_shares=[1.85, 1])
    seen = rrb.Horizontal(*([camera_view()] if scene.has_pictures else []), headings_view(paths))
    plots = single_plots(paths, scene)
    right = rrb.Vertical(seen, *plots, row_shares=[1.3] + [2.8 / len(plots)] * len(plots))
    return rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1])


def traces(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Container:
    """Plot one quantity per panel."""
    labels = [run.label for run in runs]
    columns = [error_plots(labels, scene)] if scene.has_truth else []
    columns.append(cloud_plots(labels, scene))
    side_by_side = rrb.Horizontal(*(rrb.Vertical(*column) for column in columns))
    return rrb.Vertical(side_by_side, events_view(labels), row_shares=[4, 1])
