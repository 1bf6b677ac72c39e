"""Why the winner wins: the references that matter side by side, at every update."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb

from ..drawing.canvas import map_extent
from ..entities import RunPaths
from ..explanations.paths import columns_of
from ..panels.camera import camera_view, edges_view
from ..panels.explanation import card_view, costs_view, descriptors_view, figures_view, references_map_view
from ..panels.words import words_view
from ..scene import RunView, SceneInfo

LEFT_SHARE = 1.9  # how much higher than the words a square map is
FEW_CHANNELS = 4  # beyond it the table gets more of the screen


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
    """Return how much higher than the words the map is: as its shape needs, within limits."""
    extent = map_extent(scene.arena, scene.scale)
    return float(np.clip(LEFT_SHARE * extent.height / extent.width, 1.0, 2.6))
