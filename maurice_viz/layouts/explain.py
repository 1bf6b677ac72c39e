"""Why the winner wins: the references that matter side by side, at every update or for one at full size."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from maurice_mcl.analysis.explanation import StepExplanation

from ..drawing.canvas import map_extent
from ..entities import RunPaths
from ..explanations.paths import columns_of
from ..panels.camera import camera_view, edges_view
from ..panels.events import words_view
from ..panels.explanation import card_view, costs_view, descriptors_view, figures_view, references_map_view
from ..panels.explanation_screen import (
    explained_map_view,
    explained_notes,
    explained_words,
    reference_views,
)
from ..panels.views import window
from ..scene import RunView, SceneInfo

LEFT_SHARE = 1.9  # how much higher than the words a square map is
FEW_CHANNELS = 4  # with more, the table gets more of the screen


def layout(run: RunView, scene: SceneInfo) -> rrb.Horizontal:
    """Lay out one run: the map and the words left; the references, their charts and their figures right."""
    paths, whose = RunPaths(run.label), columns_of(scene.has_truth)
    left = rrb.Vertical(
        references_map_view(paths, scene), words_view(paths), row_shares=[map_share(scene), 1]
    )
    seen = rrb.Vertical(camera_view(), edges_view())
    right = rrb.Vertical(
        rrb.Horizontal(seen, *(card_view(paths, who) for who in whose)),
        descriptors_view(paths, whose),
        costs_view(paths, run.channels),
        figures_view(paths),
        row_shares=[1.2, 0.5, 0.6, 1.32 + 0.19 * max(len(run.channels) - FEW_CHANNELS, 0)],
    )
    return rrb.Horizontal(left, right, column_shares=[1, 1.9])


def map_share(scene: SceneInfo) -> float:
    """Return the height of the map relative to the text: as its shape needs, within limits."""
    extent = map_extent(scene.arena, scene.scale)
    return float(np.clip(LEFT_SHARE * extent.height / extent.width, 1.0, 2.6))


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
