"""One run at a glance."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.belief import belief_view
from ..panels.camera import camera_view, edges_view
from ..panels.events import events_view, words_view
from ..panels.histograms import difference_views, histogram_views
from ..panels.references import best_references_view, circles_view
from ..panels.traces import single_plots
from ..scene import RunView, SceneInfo


def layout(run: RunView, scene: SceneInfo) -> rrb.Horizontal:
    """Lay out one run: the arena and the words left, matching in the middle, pictures and traces right."""
    paths = RunPaths(run.label)
    distances, *others = single_plots(paths, scene)
    left = rrb.Vertical(
        belief_view(paths, scene),
        words_view(paths),
        events_view([run.label]),
        distances,
        row_shares=[2.2, 0.95, 0.95, 0.9],
    )
    middle = rrb.Vertical(
        circles_view(paths, scene),
        rrb.Tabs(*histogram_views(paths, run.channels), active_tab=0),
        rrb.Tabs(*difference_views(paths, run.channels), active_tab=0),
        row_shares=[1.85, 1, 1],
    )
    right = rrb.Vertical(
        rrb.Horizontal(camera_view(), edges_view()),
        best_references_view(paths),
        *others,
        row_shares=[1.3, 0.8] + [2 / len(others)] * len(others),
    )
    return rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1])
