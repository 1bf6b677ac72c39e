"""One update explained at full size, on a screen of 1600 x 1000."""

from __future__ import annotations

import rerun.blueprint as rrb

from maurice_mcl.analysis.explanation import StepExplanation

from ..entities import RunPaths
from ..panels.camera import camera_view, edges_view
from ..panels.explanation import figures_view
from ..panels.explanation_screen import (
    explained_map_view,
    explained_notes,
    explained_words,
    reference_views,
)
from ..panels.views import window
from ..scene import SceneInfo


def explanation_blueprint(paths: RunPaths, step: StepExplanation, scene: SceneInfo) -> rrb.Blueprint:
    """Lay out map, camera and words left; a column a reference right, over the table of their figures."""
    left = rrb.Vertical(
        explained_map_view(paths, scene),
        rrb.Horizontal(camera_view(), edges_view()),
        explained_words(paths),
        row_shares=[1.7, 0.85, 2.3],
    )
    columns = [
        rrb.Vertical(*reference_views(paths, one, step), row_shares=[0.9, 0.9, 1.2, 1.2])
        for one in step.shown
    ]
    below = rrb.Horizontal(
        figures_view(paths), explained_notes(paths), column_shares=[0.7 * len(step.shown), 1]
    )
    right = rrb.Vertical(rrb.Horizontal(*columns), below, row_shares=[24, 8.5 + len(step.channels)])
    return window(rrb.Horizontal(left, right, column_shares=[1, 2.1]))
