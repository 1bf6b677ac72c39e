"""The tab `trials`: curves of many runs beside the run behind one of their points."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..drawing.canvas import Extent
from ..drawing.run_chart import SIZE
from ..entities import TRIALS_CHART, TRIALS_TEXT, RunPaths
from ..panels.belief import belief_view
from ..panels.camera import camera_view
from ..panels.references import best_match_view
from ..panels.story import errors_plot
from ..panels.views import plane_view
from ..scene import RunView, SceneInfo


def trials(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Container:
    """Lay out the curves over the text left; the map, what was seen and the errors of the run right."""
    run = runs[0]
    paths = RunPaths(run.label)
    chart = plane_view(
        "Runs: each a point (the mouse names it), large: the one shown",
        f"{TRIALS_CHART}/**",
        Extent(0.0, float(SIZE[0]), 0.0, float(SIZE[1])),
    )
    text = rrb.TextDocumentView(name="The run shown, and the worst", origin=TRIALS_TEXT)
    left = rrb.Vertical(chart, text, row_shares=[1.7, 1])
    seen = rrb.Vertical(camera_view("The robot sees"), best_match_view(paths, scene, "The best match"))
    story = rrb.Horizontal(belief_view(paths, scene), seen, column_shares=[2.2, 1])
    right = rrb.Vertical(story, errors_plot(runs, scene), row_shares=[2.6, 1])
    return rrb.Horizontal(left, right, column_shares=[1, 1.15])
