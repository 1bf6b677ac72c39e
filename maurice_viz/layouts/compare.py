"""Two to four runs side by side on one screen, over the lane of who is closer and their errors."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..panels import comparison as shared
from ..panels.camera import seen_views
from ..panels.events import CLOSER, SHARED, lanes_px, lanes_view
from ..panels.laser.scan import here_view, scan_views
from ..panels.references import best_match_view
from ..panels.story import story_map
from ..panels.views import untitled
from ..scene import RunView, Scene
from .story import HEIGHT_PX, errors_row

COMPARED_WORDS_PX, COMPARED_ERRORS_PX = 84, 100
DRIVE_PX, LINE_PX = 102, 17  # of the words on the drive, below the clouds: without runs, and of a line
SCANS_IN_A_ROW = 3
ROW_PX = 70  # of the histograms of a run


def compare(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out who is closer; the clouds close up beside pictures over histograms; lanes over errors."""
    path, count = (CLOSER, 2) if scene.has_truth else (SHARED, 1 + len(runs))
    lanes = lanes_px(count)
    middle = HEIGHT_PX - COMPARED_WORDS_PX - lanes - COMPARED_ERRORS_PX
    words = DRIVE_PX + (2 if scene.has_truth else 1) * LINE_PX * (len(runs) - 1)
    left = rrb.Vertical(
        shared.clouds_view(runs, scene), shared.drive_words_view(), row_shares=[middle - words, words]
    )
    body = rrb.Horizontal(left, _seen(runs, scene, middle), column_shares=[1, 2])
    screen = rrb.Vertical(
        shared.step_words_view(),
        body,
        lanes_view(path),
        errors_row(runs, scene, COMPARED_ERRORS_PX),
        row_shares=[COMPARED_WORDS_PX, middle, lanes, COMPARED_ERRORS_PX],
    )
    return untitled(screen)


def _seen(runs: Sequence[RunView], scene: Scene, height: int) -> rrb.Container | rrb.View:
    """Lay out the pictures over the histograms of each run; without channels scans, or all on the map."""
    compared = [run for run in runs if run.channels]
    lasers = [run for run in runs if scene.laser_of(run) is not None]
    if not compared and lasers:
        scans = [*scan_views(lasers), *map(here_view, lasers)]
        return rrb.Grid(*scans, grid_columns=min(len(scans), SCANS_IN_A_ROW))
    if not compared:
        pictures = seen_views(runs) if scene.has_pictures else []
        return rrb.Horizontal(story_map(runs, scene), *pictures)
    pictures = [*seen_views(runs), *(best_match_view(run) for run in compared)]
    bars = [shared.histograms_view(run) for run in compared]
    shares = [max(height - ROW_PX * len(bars), height / 3), *([ROW_PX] * len(bars))]
    return rrb.Vertical(rrb.Horizontal(*pictures), *bars, row_shares=shares)
