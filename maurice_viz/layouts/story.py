"""The first screen of every recording: what happened, where, what the robot saw, and when."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb

from ..drawing.keys import NARROW_FROM
from ..panels.belief import belief_view
from ..panels.camera import camera_view
from ..panels.comparison import all_runs_view, camera_views
from ..panels.events import events_view
from ..panels.population import headings_view
from ..panels.references import best_match_view
from ..panels.sensors import sensor_words_view
from ..panels.story import errors_plot, tour_view, verdict_view
from ..scene import RunView, Scene

# shares of the height of a screen of 1600 x 1000, in hundreds of pixels
MIDDLE = 5.03
TEXTS, LINE = 1.42, 0.2  # title and three lines of the verdict; each line more
SEES = 0.42  # of the width beside the map: the camera; the rest is the tour
LANES, LANE = 0.8, 0.38  # title and axis of the events, and each lane
SCREEN = 9.0  # all below the tabs


def over_events(body: rrb.Container, runs: Sequence[RunView], brief: bool = True) -> rrb.Vertical:
    """Return a screen over the lanes of events, full width; `brief` leaves out what each run noticed."""
    lanes = 1 + len(runs) * (1 if brief else 2)
    height = LANES + LANE * lanes
    events = events_view(runs, brief=brief)
    return rrb.Vertical(body, events, row_shares=[SCREEN - height, height])


def story(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out the verdict, one large map beside what was seen, and events over errors, full width."""
    if len(runs) == 1:
        arena, camera = belief_view(runs[0].paths, scene), camera_view("The robot sees")
        matches = [best_match_view(runs[0].paths, scene, "The best match in the library")]
    else:
        arena, camera = all_runs_view(runs, scene), camera_views(runs)[0]
        title = "{}: best match" if len(runs) < NARROW_FROM else "{}"
        matches = [best_match_view(run.paths, scene, title.format(run.label)) for run in runs]
    brief = len(runs) > 1
    lanes = 1 + len(runs) * (1 if brief else 2)
    width, height = scene.arena.size_m
    wide = float(np.clip(width / height * MIDDLE / 16 + 0.06, 0.35, 0.7))
    if len(runs) == 1:
        paths = runs[0].paths
        blind = [*(sensor_words_view(paths, name) for name in runs[0].sensors), headings_view(paths)]
        views = [camera, *matches] if runs[0].channels else blind  # without a camera there is no picture
        seen = rrb.Vertical(rrb.Horizontal(*views), tour_view(), row_shares=[2, 1])
    else:
        now = rrb.Horizontal(camera, tour_view(), column_shares=[SEES, 1 - SEES])
        seen = rrb.Vertical(now, rrb.Horizontal(*matches))
    more = max(len(runs) - 2, 0)  # runs, each of which has a lane, and its part of the verdict
    return rrb.Vertical(
        verdict_view(),
        rrb.Horizontal(arena, seen, column_shares=[wide, 1 - wide]),
        events_view(runs, brief=brief),
        errors_plot(runs, scene),
        row_shares=[TEXTS + LINE * more, MIDDLE - (LANE + LINE) * more, LANES + LANE * lanes, 1.5],
    )
