"""Layouts of several runs: two to four of them on one screen, and one number per update over the session."""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..panels import comparison as shared
from ..panels import traces as lines
from ..panels.camera import seen_views
from ..panels.events import CLOSER, SHARED, lanes_px, lanes_view
from ..panels.laser.scan import here_view, scan_views
from ..panels.references import best_match_view
from ..panels.story import story_map
from ..panels.views import untitled
from ..scene import RunView, Scene
from .story import HEIGHT_PX, errors_row, over_events

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
        errors_row(runs, scene),
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


def traces(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Plot one quantity per panel, one line per run in its color, as the lanes below name them."""
    particles, (spread, confidence) = lines.particle_plots(runs), lines.cloud_plots(runs, scene)
    errors = lines.error_plots(runs, scene) if scene.has_truth else []
    if not any(run.channels for run in runs):  # nothing to compare with
        return _over_key([[*errors, confidence], [spread, *particles]], runs)
    knows = lines.knows_plot(runs)
    if scene.has_truth:
        left = rrb.Vertical(*errors, knows, lines.rank_plot(runs))
        right = rrb.Vertical(spread, confidence, *particles)
    else:
        left, right = rrb.Vertical(knows, spread, confidence), rrb.Vertical(*particles)
    return over_events(rrb.Horizontal(left, right, _last(runs)), runs)


def _last(runs: Sequence[RunView]) -> rrb.Vertical:
    """Plot evidence, one panel per run, over the key."""
    several = len(runs) > 1
    evidence = [lines.evidence_plot(run.paths, run.label if several else "") for run in runs if run.channels]
    shares = [2.4 / max(len(evidence), 1)] * len(evidence) + [lines.key_share(runs[0])]
    return rrb.Vertical(*evidence, lines.evidence_key(runs[0].paths), row_shares=shares)


def recorded_traces(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Plot one quantity per panel of another localizer's clouds, whose evidence is not known."""
    columns = [lines.error_plots(runs, scene)] if scene.has_truth else []
    return _over_key([*columns, lines.cloud_plots(runs, scene)], runs)


def _over_key(columns: Sequence[Sequence[rrb.View]], runs: Sequence[RunView]) -> rrb.Vertical:
    """Lay out columns of plots over the key of their marks, over the lanes."""
    plots = rrb.Horizontal(*(rrb.Vertical(*column) for column in columns))
    return over_events(rrb.Vertical(plots, lines.marks_key(runs[0].paths), row_shares=[9, 1]), runs)
