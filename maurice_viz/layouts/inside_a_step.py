"""One update from the inside: walk through it on the timeline `phase`."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.events import events_view
from ..scene import RunView, SceneInfo
from .plots import evidence_key, evidence_plot, key_share, lineage_plot
from .views import (
    camera_view,
    circles_view,
    closeup_view,
    film_view,
    likelihood_tabs,
    river_view,
    rose_view,
    text_view,
)

CLOSEUP = "Cloud from near: moves blue, ancestors yellow, died red, new pink"


def layout(run: RunView, shown: SceneInfo) -> rrb.Container:
    """The cloud large; what it was weighed by, which way it looks and whom it comes from beside it."""
    paths = RunPaths(run.label)
    cloud = rrb.Vertical(
        closeup_view(paths, shown, CLOSEUP),
        text_view(paths),
        events_view([run.label]),
        row_shares=[2.65, 1.0, 0.95],
    )
    middle = rrb.Vertical(
        rrb.Tabs(*likelihood_tabs(paths, run.channels, shown), circles_view(paths, shown), active_tab=0),
        rrb.Horizontal(rose_view(paths), camera_view()),
        lineage_plot(paths),
        row_shares=[2, 1.25, 1],
    )
    right = rrb.Vertical(
        film_view(paths, shown),
        river_view(paths),
        evidence_plot(paths),
        evidence_key(paths),
        row_shares=[1.12, 0.85, 1.1, key_share(run)],
    )
    return rrb.Horizontal(cloud, middle, right, column_shares=[1.25, 1, 1.1])
