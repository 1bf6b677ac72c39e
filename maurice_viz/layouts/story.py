"""The first screen of every recording: what happened, where, what the robot saw, and when."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun.blueprint as rrb

from ..entities import RunPaths
from ..panels.belief import belief_view
from ..panels.camera import camera_view
from ..panels.comparison import all_runs_view, camera_views
from ..panels.events import events_view
from ..panels.story import best_match_view, errors_plot, tour_view, verdict_view
from ..scene import RunView, SceneInfo

# shares of the height of a screen of 1600 x 1000, in hundreds of pixels
MIDDLE = 4.9
TEXTS = 1.8  # title, and four lines of the verdict, or those of the tour
TELLS = 0.6  # of the width: the verdict; the rest is the tour
LANES, LANE = 0.75, 0.38  # title and axis of the events, and each lane
SCREEN = 9.0  # all below the tabs


def over_events(body: rrb.Container, runs: Sequence[RunView], brief: bool = True) -> rrb.Vertical:
    """Return a screen over the lanes of events, full width; `brief` leaves out what each run noticed."""
    lanes = 1 + len(runs) * (1 if brief else 2)
    height = LANES + LANE * lanes
    events = events_view([run.label for run in runs], brief=brief)
    return rrb.Vertical(body, events, row_shares=[SCREEN - height, height])


def story(runs: Sequence[RunView], scene: SceneInfo) -> rrb.Vertical:
    """Lay out the verdict, one large map beside what was seen, and events over errors, full width."""
    if len(runs) == 1:
        arena, camera = belief_view(RunPaths(runs[0].label), scene), camera_view("The robot sees")
        matches = [best_match_view(runs[0], "The best match in the library")]
    else:
        arena, camera = all_runs_view(runs, scene), camera_views(runs)[0]
        matches = [best_match_view(run, f"{run.label}: best match") for run in runs]
    brief = len(runs) > 1
    lanes = 1 + len(runs) * (1 if brief else 2)
    width, height = scene.arena.size_m
    wide = float(np.clip(width / height * MIDDLE / 16 + 0.06, 0.35, 0.7))
    seen = rrb.Vertical(camera, rrb.Horizontal(*matches))
    return rrb.Vertical(
        rrb.Horizontal(verdict_view(), tour_view(), column_shares=[TELLS, 1 - TELLS]),
        rrb.Horizontal(arena, seen, column_shares=[wide, 1 - wide]),
        events_view([run.label for run in runs], brief=brief),
        errors_plot(runs, scene),
        row_shares=[TEXTS, MIDDLE - LANE * max(len(runs) - 2, 0), LANES + LANE * lanes, 1.5],
    )
