"""One run at a glance."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.events import events_view
from ..scene import RunView, SceneInfo
from .plots import single_traces
from .views import (
    arena_view,
    camera_view,
    circles_view,
    difference_tabs,
    edges_view,
    histogram_tabs,
    sheet_view,
    text_view,
)


def layout(run: RunView, shown: SceneInfo) -> rrb.Horizontal:
    """Lay out one run: the arena and the words left, matching in the middle, pictures and traces right."""
    paths = RunPaths(run.label)
    distances, *others = single_traces(paths, shown)
    left = rrb.Vertical(
        arena_view(paths, shown),
        text_view(paths),
        events_view([run.label]),
        distances,
        row_shares=[2.2, 0.95, 0.95, 0.9],
    )
    middle = rrb.Vertical(
        circles_view(paths, shown),
        histogram_tabs(paths, run.channels),
        difference_tabs(paths, run.channels),
        row_shares=[1.85, 1, 1],
    )
    right = rrb.Vertical(
        rrb.Horizontal(camera_view(), edges_view()),
        sheet_view(paths),
        *others,
        row_shares=[1.3, 0.8] + [2 / len(others)] * len(others),
    )
    return rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1])
