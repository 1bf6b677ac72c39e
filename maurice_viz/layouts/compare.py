"""Two to four runs side by side on one screen, over the lane of who is closer and their errors.

A run has a column: its cloud before and after each phase, over its best match and the histograms of both
pictures. What the robot sees stands left of them, over the map of where the matches were taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..panels.camera import seen_views
from ..panels.comparison import drawing as shared
from ..panels.comparison import matches
from ..panels.events import CLOSER, SHARED, lanes_px, lanes_view
from ..panels.laser.scan import here_view, scan_views
from ..panels.population import headings_view
from ..panels.story import HEIGHT_PX
from ..panels.views import untitled
from ..scene import RunView, Scene
from .story import errors_row

HEADLINE_PX, WORDS_PX, LINE_PX, ERRORS_PX = 78, 80, 17, 104
WHY_SHARES = [0.54, 0.46]  # of the width, for why, and for the whole drive
FEW = 2  # runs that have wide columns
SEEN_SHARE = {2: 0.2, 3: 0.18, 4: 0.18}  # of the width, for what all runs share


def compare(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out who is closer or what a phase did; a column a run; words over the lanes and the errors."""
    path, count = (CLOSER, 2) if scene.has_truth else (SHARED, 1 + len(runs))
    lanes, words = lanes_px(count), WORDS_PX + LINE_PX * max(len(runs) - FEW, 0)
    middle = HEIGHT_PX - HEADLINE_PX - words - lanes - ERRORS_PX
    share = SEEN_SHARE.get(len(runs), 0.18)
    columns = [_column(run, runs, scene) for run in runs]
    body = rrb.Horizontal(
        _seen(runs, scene), *columns, column_shares=[share, *([(1 - share) / len(runs)] * len(runs))]
    )
    screen = rrb.Vertical(
        shared.step_words_view(),
        body,
        rrb.Horizontal(shared.why_view(), shared.drive_words_view(), column_shares=WHY_SHARES),
        lanes_view(path),
        errors_row(runs, scene, ERRORS_PX, fitted=True),
        row_shares=[HEADLINE_PX, middle, words, lanes, ERRORS_PX],
    )
    return untitled(screen)


def _seen(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out what the robot sees over the map; robots of different drives are in their runs' columns."""
    lasers = [run for run in runs if scene.laser_of(run) is not None]
    if any(run.own_drive for run in runs):
        return rrb.Vertical(matches.matches_map(runs, scene))
    views: list[rrb.View] = []
    if lasers and not any(run.channels for run in runs):
        views += scan_views(lasers)
    elif scene.has_pictures:
        views += seen_views(runs)
    return rrb.Vertical(*views, matches.matches_map(runs, scene))


def _column(run: RunView, runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out the cloud before and after over what the run takes the picture for."""
    below: list[rrb.View] = []
    if any(other.own_drive for other in runs):
        below += seen_views([run])[-1:] if scene.has_pictures else scan_views([run])
    if run.channels:
        below += [matches.match_view(run, runs), matches.histograms_view(run, runs, scene)]
    elif scene.laser_of(run) is not None:
        below.append(here_view(run))
    else:
        below.append(headings_view(run.paths))
    return rrb.Vertical(rrb.Horizontal(*shared.side_views(run, scene)), rrb.Horizontal(*below))
