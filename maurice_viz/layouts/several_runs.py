"""Layouts of several runs: two to four of them on one screen, and one number per update over the session."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..panels import comparison as shared
from ..panels import traces as lines
from ..panels.camera import seen_views
from ..panels.events import CLOSER, SHARED, lanes_px, lanes_view
from ..panels.references import best_match_view
from ..panels.story import story_map
from ..panels.views import untitled
from ..scene import RunView, Scene
from .story import HEIGHT_PX, errors_row, over_events

COMPARED_WORDS_PX, COMPARED_ERRORS_PX = 84, 100
CLOUDS, DRIVE = 64, 36  # shares of the left column: the clouds over the words on the drive
ROW_PX = 70  # of the histograms of a run


def compare(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out who is closer; the clouds close up beside pictures over histograms; lanes over errors."""
    path, count = (CLOSER, 2) if scene.has_truth else (SHARED, 1 + len(runs))
    lanes = lanes_px(count)
    middle = HEIGHT_PX - COMPARED_WORDS_PX - lanes - COMPARED_ERRORS_PX
    left = rrb.Vertical(
        shared.clouds_view(runs, scene), shared.drive_words_view(), row_shares=[CLOUDS, DRIVE]
    )
    body = rrb.Horizontal(left, _seen(runs, scene, middle), column_shares=[1, 2])
    screen = rrb.Vertical(
        shared.step_words_view(),
        body,
        lanes_view(path),
        errors_row(runs, scene),
        row_shares=[COMPARED_WORDS_PX, middle, lanes, COMPARED_ERRORS_PX],
    )
    return untitled(screen)


def _seen(runs: Sequence[RunView], scene: Scene, height: int) -> rrb.Container | rrb.View:
    """Lay out the pictures over the histograms of each run; without channels all runs on the map."""
    compared = [run for run in runs if run.channels]
    if not compared:
        pictures = seen_views(runs) if scene.has_pictures else []
        return rrb.Horizontal(story_map(runs, scene), *pictures)
    pictures = [*seen_views(runs), *(best_match_view(run) for run in compared)]
    bars = [shared.histograms_view(run) for run in compared]
    shares = [max(height - ROW_PX * len(bars), height / 3), *([ROW_PX] * len(bars))]
    return rrb.Vertical(rrb.Horizontal(*pictures), *bars, row_shares=shares)


def traces(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Plot one quantity per panel, one line per run in its color, as the lanes below name them."""
    knows, particles = lines.knows_plot(runs), lines.particle_plots(runs)
    spread, confidence = lines.cloud_plots(runs, scene)
    columns = [rrb.Vertical(spread, confidence, *particles)]
    if scene.has_truth:
        columns = [rrb.Vertical(*lines.error_plots(runs, scene), knows, lines.rank_plot(runs)), *columns]
    else:
        columns = [rrb.Vertical(knows, spread, confidence), rrb.Vertical(*particles)]
    return over_events(rrb.Horizontal(*columns, _last(runs)), runs)


def _last(runs: Sequence[RunView]) -> rrb.Vertical:
    """Plot evidence, one panel per run, over the key."""
    several = len(runs) > 1
    evidence = [lines.evidence_plot(run.paths, run.label if several else "") for run in runs if run.channels]
    shares = [2.4 / max(len(evidence), 1)] * len(evidence) + [lines.key_share(runs[0])]
    return rrb.Vertical(*evidence, lines.evidence_key(runs[0].paths), row_shares=shares)


def recorded_traces(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Plot one quantity per panel of another localizer's clouds, whose evidence is not known."""
    columns = [lines.error_plots(runs, scene)] if scene.has_truth else []
    columns.append(lines.cloud_plots(runs, scene))
    return over_events(rrb.Horizontal(*(rrb.Vertical(*column) for column in columns)), runs)
