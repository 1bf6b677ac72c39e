"""Two to four runs side by side: one column a run, and between them what they share.

Columns are narrow where there are three or four runs, so titles are short there and a run's histograms are
left to its own tab of the layout `overview`.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr
import rerun.blueprint as rrb

from .. import entities
from ..entities import (
    APART,
    BELIEF_KEY,
    CIRCLE_KEY,
    HEADING_DIFFERENCE,
    POSITION_DIFFERENCE,
    RESULT,
    RUNS_KEY,
    TEXT,
    RunPaths,
    camera_of,
    cloud_of,
    estimate_of,
    parted_of,
    truth_of,
)
from ..panels import comparison_keys as compare_keys
from ..panels.traces import CONFIDENCE, HEADING_ERROR, POSITION_ERROR, SPREAD
from ..scene import RunView, SceneInfo
from ..style import COLOR_WORDS, GROUND, RUN_COLORS
from .plots import compared, plot
from .views import (
    SHORT_LEGEND,
    SMALL_AND_WHITE,
    Overrides,
    camera_view,
    circles_view,
    drawn_over,
    edges_view,
    histograms,
    sheet_view,
    text_view,
)

MAP = (entities.FLOORS, entities.WALLS, entities.NODES)
LONGEST = 12  # letters of a label in a title of the shared column


def layout(runs: Sequence[RunView], shown: SceneInfo) -> rrb.Horizontal:
    """Lay out runs: half of them left of what they share, the others right of it, in their order."""
    side = _wide if len(runs) < compare_keys.NARROW_FROM else _narrow
    columns = [side(run, number, len(runs), shown) for number, run in enumerate(runs)]
    half = len(runs) // 2
    middle = _shared(runs, shown)
    shares = [1.0] * half + [1.1] + [1.0] * (len(runs) - half)
    return rrb.Horizontal(*columns[:half], middle, *columns[half:], column_shares=shares)


def _wide(run: RunView, number: int, count: int, shown: SceneInfo) -> rrb.Vertical:
    paths, title = RunPaths(run.label), f"{run.label}: "
    return rrb.Vertical(
        rrb.Tabs(_belief_view(run, number, count, shown), circles_view(paths, shown)),
        sheet_view(paths),
        rrb.Tabs(*histograms(paths, run.channels, "", SHORT_LEGEND), active_tab=0),
        text_view(paths, title),
        row_shares=[2.5, 0.95, 1.2, 1.15],
    )


def _narrow(run: RunView, number: int, count: int, shown: SceneInfo) -> rrb.Vertical:
    paths = RunPaths(run.label)
    sheet, text = sheet_view(paths), text_view(paths)
    sheet.name, text.name = "Five best", "This step"
    return rrb.Vertical(
        _belief_view(run, number, count, shown),
        rrb.Tabs(_narrow_circles(paths, count, shown), sheet, active_tab=0),
        text,
        row_shares=[1.15, 1.05, 0.8],
    )


def _shared(runs: Sequence[RunView], shown: SceneInfo) -> rrb.Vertical:
    words = rrb.Tabs(
        rrb.TextDocumentView(name="This step", origin=TEXT),
        rrb.TextDocumentView(name="Whole drive", origin=RESULT),
        active_tab=0,
    )
    everything = _all_view(runs, shown)
    if len(runs) < compare_keys.NARROW_FROM:
        wide = _wide_plots(runs, shown)
        cameras = rrb.Horizontal(*_camera_views(runs))
        return rrb.Vertical(everything, cameras, *wide, words, row_shares=[2.5, 1.3, 1.2, 1.2, 1.4])
    pictures = rrb.Tabs(*_camera_views(runs), active_tab=0)
    narrow = _narrow_plots(runs, shown)
    shares = [2.2, 1.1] + [1.0] * len(narrow) + [2.1]
    return rrb.Vertical(everything, pictures, *narrow, words, row_shares=shares)


def _wide_plots(runs: Sequence[RunView], shown: SceneInfo) -> list[rrb.Tabs]:
    """Plot the runs themselves, then how they differ from the first."""
    labels, unit, first = [run.label for run in runs], shown.scale.units.name, _first(runs)
    spread, apart = compared(SPREAD, f"Spread ({unit})", labels), _apart_plots(runs, shown)
    if not shown.has_truth:
        shares = compared(CONFIDENCE, "Confidence (share)", labels, 1.1)
        return [rrb.Tabs(one) for one in (spread, *(apart or [shares]))]
    position = compared(POSITION_ERROR, f"Position error ({unit})", labels)
    heading = compared(HEADING_ERROR, "Heading error (deg)", labels)
    position_difference = plot(f"Error minus {first}'s ({unit})", [POSITION_DIFFERENCE])
    heading_difference = plot("Heading diff. (deg)", [HEADING_DIFFERENCE])
    return [
        rrb.Tabs(position, heading, spread, active_tab=0),
        rrb.Tabs(position_difference, *apart, heading_difference, active_tab=0),
    ]


def _narrow_plots(runs: Sequence[RunView], shown: SceneInfo) -> list[rrb.TimeSeriesView]:
    labels, unit = [run.label for run in runs], shown.scale.units.name
    if not shown.has_truth:
        return [compared(SPREAD, f"Spread ({unit})", labels), *_apart_plots(runs, shown)]
    return [
        compared(POSITION_ERROR, f"Position error ({unit})", labels),
        plot(f"Error minus {_first(runs)}'s ({unit})", [POSITION_DIFFERENCE]),
        *_apart_plots(runs, shown),
    ]


def _apart_plots(runs: Sequence[RunView], shown: SceneInfo) -> list[rrb.TimeSeriesView]:
    """Plot how far estimates are from the first run's; of other drives nothing is to be seen."""
    if all(run.own_drive for run in runs[1:]):
        return []
    contents = [APART, *(parted_of(run.label) for run in runs[1:])]
    return [plot(f"Apart from {_first(runs)} ({shown.scale.units.name})", contents)]


def _first(runs: Sequence[RunView]) -> str:
    """Name the first run in a title; a long name would be cut off there."""
    label = runs[0].label
    return label if len(label) <= LONGEST else "the first"


def _narrow_circles(paths: RunPaths, count: int, shown: SceneInfo) -> rrb.Spatial2DView:
    contents = [entities.FLOORS, entities.WALLS, CIRCLE_KEY]
    contents += [f"{paths.at('match')}/**", f"- {paths.contact_sheet}", paths.particles]
    extent = compare_keys.extent_with(compare_keys.circle_key(count), shown)
    white: Overrides = {paths.particles: SMALL_AND_WHITE}
    return drawn_over(f"Match circles ({shown.scale.units.name})", contents, extent, white)


def _belief_view(run: RunView, number: int, count: int, shown: SceneInfo) -> rrb.Spatial2DView:
    """Show one run's cloud; the title says by which color it is known elsewhere."""
    contents = [*MAP, BELIEF_KEY, f"{RunPaths(run.label).at('belief')}/**"]
    contents += [f"{truth_of(run.label, run.own_drive)}/**"] if shown.has_truth else []
    name = f"{run.label}, {COLOR_WORDS[number]}: belief ({shown.scale.units.name})"
    key = compare_keys.belief_key(count, shown.has_truth)
    return drawn_over(name, contents, compare_keys.extent_with(key, shown))


def _all_view(runs: Sequence[RunView], shown: SceneInfo) -> rrb.Spatial2DView:
    """Show all clouds on one map, each with its estimate in the run's color."""
    labels = [run.label for run in runs]
    contents = [*MAP, RUNS_KEY]
    overrides: Overrides = {}
    for run, color in zip(runs, RUN_COLORS, strict=False):
        estimate = estimate_of(run.label)
        contents += [cloud_of(run.label), estimate]
        contents += [f"{truth_of(run.label, run.own_drive)}/**"] if shown.has_truth else []
        overrides[estimate] = [
            kind.from_fields(colors=[color]) for kind in (rr.Points2D, rr.Arrows2D, rr.LineStrips2D)
        ]
    key = compare_keys.runs_key(labels, shown.has_truth)
    name = f"All on one map ({shown.scale.units.name})"
    return drawn_over(name, list(dict.fromkeys(contents)), compare_keys.extent_with(key, shown), overrides)


def _camera_views(runs: Sequence[RunView]) -> list[rrb.Spatial2DView]:
    """Show what the robot saw; of different drives, each one's camera in place of the edges."""
    own = [run.label for run in runs if run.own_drive]
    if not own:
        return [camera_view(), edges_view()]
    views = [
        rrb.Spatial2DView(name=f"{label}: camera (px)", origin=camera_of(label), background=GROUND)
        for label in own
    ]
    first = camera_view()
    first.name = f"{runs[0].label}: camera (px)"
    return [first, *views]
