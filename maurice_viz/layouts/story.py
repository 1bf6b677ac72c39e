"""The first screen: what happened, where, what was seen, when, and how far off each run was; several runs.

Made for a screen of 1280 x 800, in pixels; a larger one stretches every part alike. Views have no titles.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from ..entities import COMPARE_UNIT, ERROR_UNIT
from ..panels import traces as lines
from ..panels.camera import picture_here_view, seen_views
from ..panels.events import NAMES_SHARE, SHARED, lanes_px, lanes_view, own_path
from ..panels.laser.scan import here_view, scan_views
from ..panels.population import headings_view
from ..panels.sensors import sensor_words_view
from ..panels.story import (
    ERRORS_PX,
    HEADLINE_PX,
    HEIGHT_PX,
    OWN_LANES,
    ErrorAxis,
    error_axis,
    error_unit_view,
    errors_plot,
    heights_px,
    map_share,
    story_map,
    tour_view,
    verdict_view,
)
from ..panels.views import untitled
from ..scene import RunView, Scene

BETWEEN_PX = 1440  # width at which lanes and plot begin together; at 1280 and 1600 within 4 pixels
PICTURES, WORDS = 5, 3  # shares of the height beside the map
MOST_IN_A_ROW = 3  # pictures beside the map
AXIS_PX, DIGIT_PX = 10, 7  # left of a plot: around the labels of its axis, and each of their digits
DIGITS = 3  # of a label where the largest error is not known yet


def over_events(body: rrb.Container, runs: Sequence[RunView], noticed: bool = False) -> rrb.Vertical:
    """Return a screen over the lanes of events, full width; `noticed`: with what the first run noticed."""
    path, count = (own_path(runs[0].paths), OWN_LANES) if noticed else (SHARED, 1 + len(runs))
    height = lanes_px(count)
    return rrb.Vertical(body, lanes_view(path), row_shares=[HEIGHT_PX - height, height])


def story(runs: Sequence[RunView], scene: Scene) -> rrb.Vertical:
    """Lay out the verdict, one map beside what was seen, the lanes of the runs over their errors."""
    is_one = len(runs) == 1
    lanes, middle, wide = (*heights_px(len(runs)), map_share(len(runs), scene))
    body = rrb.Horizontal(
        story_map(runs, scene), _beside_the_map(runs, scene), column_shares=[wide, 1 - wide]
    )
    screen = rrb.Vertical(
        verdict_view(),
        body,
        lanes_view(own_path(runs[0].paths) if is_one else SHARED),
        errors_row(runs, scene, ERRORS_PX),
        row_shares=[HEADLINE_PX, middle, lanes, ERRORS_PX],
    )
    return untitled(screen)


def errors_row(
    runs: Sequence[RunView], scene: Scene, height_px: float, fitted: bool = False
) -> rrb.Horizontal:
    """Lay out the plot of errors below lanes, with its unit: it begins where they do.

    `fitted` to errors that do not count as lost.
    """
    axis = _axis_px(error_axis(runs, scene, height_px, fitted)) / BETWEEN_PX
    shares = [NAMES_SHARE - axis, 1 - NAMES_SHARE + axis]
    unit = error_unit_view(COMPARE_UNIT if fitted else ERROR_UNIT)
    return rrb.Horizontal(unit, errors_plot(runs, scene, height_px, fitted), column_shares=shares)


def _beside_the_map(runs: Sequence[RunView], scene: Scene) -> rrb.Container:
    """Lay out what the robot sees and what is seen where each run is, in rows of three, and the words."""
    paths = runs[0].paths
    lasers = [run for run in runs if scene.laser_of(run) is not None]
    pictured = [run for run in runs if scene.compares_pictures(run)]
    if pictured or not lasers:
        words = [] if runs[0].channels else runs[0].sensors
        views: list[rrb.View] = [sensor_words_view(paths, name) for name in words]
        views += seen_views(runs) if scene.has_pictures else [headings_view(paths)]
        views += map(picture_here_view, pictured)
    else:
        views = [*scan_views(lasers)]
    views += map(here_view, lasers)
    rows = [views[first : first + MOST_IN_A_ROW] for first in range(0, len(views), MOST_IN_A_ROW)]
    if len(rows) == 1 or len(rows[-1]) == MOST_IN_A_ROW:
        shares = [PICTURES] * len(rows) + [WORDS]
        return rrb.Vertical(*(rrb.Horizontal(*row) for row in rows), tour_view(), row_shares=shares)
    rest = MOST_IN_A_ROW - len(rows[-1])
    last = rrb.Horizontal(*rows[-1], tour_view(), column_shares=[1] * len(rows[-1]) + [rest])
    return rrb.Vertical(*(rrb.Horizontal(*row) for row in rows[:-1]), last)


def _axis_px(axis: ErrorAxis | None) -> float:
    """Return the width of the labels of the error axis, which the viewer does not let us set."""
    return AXIS_PX + DIGIT_PX * (DIGITS if axis is None else len(f"{axis.last_label:g}"))


# One number per update over the session.


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
