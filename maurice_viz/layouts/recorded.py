"""Another localizer's recorded clouds: nothing was compared here, so there is nothing of references."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.events import events_view
from ..panels.traces import CONFIDENCE, EFFECTIVE, HEADING_ERROR, POSITION_ERROR, SPREAD
from ..scene import RunView, SceneInfo
from .plots import compared, single_traces
from .views import arena_view, camera_view, closeup_view, river_view, rose_view, text_view


def overview(runs: Sequence[RunView], shown: SceneInfo) -> rrb.Horizontal:
    """Lay out one run: the arena and the words left, the cloud from near in the middle, traces right."""
    (run,) = runs
    paths = RunPaths(run.label)
    left = rrb.Vertical(
        arena_view(paths, shown), text_view(paths), events_view([run.label]), row_shares=[2.2, 0.95, 0.95]
    )
    middle = rrb.Vertical(
        closeup_view(paths, shown, "Cloud from near"), river_view(paths), row_shares=[1.85, 1]
    )
    seen = rrb.Horizontal(*([camera_view()] if shown.has_pictures else []), rose_view(paths))
    plots = single_traces(paths, shown)
    right = rrb.Vertical(seen, *plots, row_shares=[1.3] + [2.8 / len(plots)] * len(plots))
    return rrb.Horizontal(left, middle, right, column_shares=[1.2, 1, 1])


def traces(runs: Sequence[RunView], shown: SceneInfo) -> rrb.Container:
    """Plot one quantity a panel."""
    labels, unit = [run.label for run in runs], shown.scale.units.name
    of_truth = [
        compared(POSITION_ERROR, f"Position error ({unit})", labels),
        compared(HEADING_ERROR, "Heading error (deg)", labels),
    ]
    of_cloud = [
        compared(SPREAD, f"Spread of the cloud ({unit})", labels),
        compared(CONFIDENCE, "Confidence (share of weight near the estimate)", labels, top=1.1),
        compared(EFFECTIVE, "Effective sample size (share of particles)", labels, top=1.1),
    ]
    columns = [of_truth, of_cloud] if shown.has_truth else [of_cloud]
    side_by_side = rrb.Horizontal(*(rrb.Vertical(*column) for column in columns))
    return rrb.Vertical(side_by_side, events_view(labels), row_shares=[4, 1])
