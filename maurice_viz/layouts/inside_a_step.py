"""One update from the inside: its phases are on the timeline `phase`."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.belief import closeup_view
from ..panels.camera import camera_view, filmstrip_view
from ..panels.events import events_view, words_view
from ..panels.population import ancestry_plot, headings_view, modes_view
from ..panels.references import circles_view, likelihood_views
from ..panels.traces import evidence_key, evidence_plot, key_share
from ..scene import RunView, SceneInfo


def layout(run: RunView, scene: SceneInfo) -> rrb.Container:
    """Lay out one run: the cloud large; likelihoods, headings, ancestors and evidence beside it."""
    paths = RunPaths(run.label)
    cloud = rrb.Vertical(
        closeup_view(paths, scene, ": moves blue, ancestors yellow, died red, new pink"),
        words_view(paths),
        events_view([run.label]),
        row_shares=[2.65, 1.0, 0.95],
    )
    maps = [*likelihood_views(paths, run.channels, scene), circles_view(paths, scene)]
    middle = rrb.Vertical(
        rrb.Tabs(*maps, active_tab=0),
        rrb.Horizontal(headings_view(paths), camera_view()),
        ancestry_plot(paths),
        row_shares=[2, 1.25, 1],
    )
    right = rrb.Vertical(
        filmstrip_view(paths, scene),
        modes_view(paths),
        evidence_plot(paths),
        evidence_key(paths),
        row_shares=[1.12, 0.85, 1.1, key_share(run)],
    )
    return rrb.Horizontal(cloud, middle, right, column_shares=[1.25, 1, 1.1])
