"""Runs of one drive side by side."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..entities import RunPaths
from .plots import compared_traces
from .shown import Run, Shown
from .views import (
    SHORT_LEGEND,
    arena_view,
    camera_view,
    circles_view,
    differences,
    edges_view,
    histograms,
    sheet_view,
    text_view,
)


def layout(runs: Sequence[Run], shown: Shown) -> rrb.Horizontal:
    """Lay out runs of one drive: the first left, the others right, what they share between them."""
    first, *others = runs
    middle = rrb.Vertical(
        rrb.Horizontal(camera_view(), edges_view()),
        *compared_traces([run.label for run in runs], shown),
    )
    columns = [_side(first, shown), middle, *(_side(run, shown) for run in others)]
    return rrb.Horizontal(*columns, column_shares=[1.2, 1.0] + [1.2] * len(others))


def _side(run: Run, shown: Shown) -> rrb.Vertical:
    paths = RunPaths(run.label)
    title = f"{run.label}: "
    return rrb.Vertical(
        rrb.Tabs(arena_view(paths, shown, title), circles_view(paths, shown, title)),
        sheet_view(paths, title),
        rrb.Tabs(
            *histograms(paths, run.channels, "", SHORT_LEGEND),
            *differences(paths, run.channels, " D"),
            active_tab=0,
        ),
        text_view(paths, title),
        row_shares=[2.6, 0.95, 1.3, 0.95],
    )
