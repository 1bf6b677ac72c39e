"""Kinds of views that panels are shown in: the map, a picture, bars, lines; and the window."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.api import VisualizerLike
from rerun.encodings import EntityPathLike

from maurice_mcl.values import U8

from ..drawing.canvas import Extent, map_extent
from ..drawing.keys import extent_with
from ..entities import BARE_FLOORS, FLOORS, SEPARATORS, STEP, WALLS
from ..scene import RunView, Scene
from ..style import CLOUD, GROUND

Overrides = dict[EntityPathLike, VisualizerLike | Iterable[VisualizerLike]]

SEPARATED = f"{SEPARATORS}/**"  # which makes layers separate in a view
MAP = (FLOORS, WALLS)
BARE_MAP = (BARE_FLOORS, WALLS)  # without names and ruler: under colors, and small, they are hard to read
FPS = 4.0  # updates a second when the viewer plays
SMALL_AND_PALE = rr.Points2D.from_fields(colors=[CLOUD], radii=rr.components.Radius.ui_points(1.0))


def map_view(
    name: str,
    contents: Sequence[str],
    scene: Scene,
    pale_cloud: str | None = None,
    key: U8 | None = None,
) -> rrb.Spatial2DView:
    """Show some entities on the map; `pale_cloud` is small, in one color, and a `key` of rows has room."""
    overrides: Overrides = {pale_cloud: SMALL_AND_PALE} if pale_cloud else {}
    arena, scale = scene.arena, scene.scale
    extent = map_extent(arena, scale) if key is None else extent_with(key, arena, scale)
    return plane_view(name, contents, extent, overrides)


def plane_view(
    name: str,
    contents: Sequence[str] | str,
    extent: Extent,
    overrides: Overrides | None = None,
    origin: str = "/",
) -> rrb.Spatial2DView:
    """Show some entities in a part of the plane, all of it visible, layer over layer."""
    shown = [contents] if isinstance(contents, str) else contents
    x_range, y_range = (extent.left, extent.right), (extent.top, extent.bottom)
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        name=name,
        origin=origin,
        contents=[*shown, SEPARATED],
        background=GROUND,
        overrides=overrides,
        visual_bounds=bounds,
    )


def picture_view(name: str, path: str) -> rrb.Spatial2DView:
    """Show one picture."""
    return rrb.Spatial2DView(name=name, origin=path, contents=[path], background=GROUND)


def bars_view(name: str, paths: Sequence[str]) -> rrb.BarChartView:
    """Show all bars under some paths in one chart. A legend would cover bars."""
    return rrb.BarChartView(
        name=name,
        origin="/",
        contents=[f"{path}/**" for path in paths],
        plot_legend=rrb.PlotLegend(visible=False),
    )


def plot(
    name: str, contents: Sequence[str], top: float | None = None, overrides: Overrides | None = None
) -> rrb.TimeSeriesView:
    """Plot some lines; the scale is from zero to `top` if given, else as needed."""
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=[f"{path}/**" for path in contents],  # with where its scale ends, and the lines of events
        overrides=overrides,
        axis_y=None if top is None else rrb.ScalarAxis(range=(0.0, top)),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def plot_of_runs(
    quantity: str,
    name: str,
    runs: Sequence[RunView],
    top: float | None = None,
    band: str | None = None,
) -> rrb.TimeSeriesView:
    """Plot one quantity of several runs, each in its own color, over a band of each."""
    quantities = [quantity] if band is None else [quantity, band]
    return plot(name, [run.paths.trace(each) for run in runs for each in quantities], top)


def untitled(screen: rrb.Vertical, but: Sequence[rrb.View] = ()) -> rrb.Vertical:
    """Take the title bars from all views of a screen `but` some, in place; those of tabs stay."""

    def visit(part: rrb.Container | rrb.View) -> None:
        if isinstance(part, rrb.View):
            part.titlebar = None if part in but else False
        else:
            for inner in part.contents:
                visit(inner)

    visit(screen)
    return screen


def labeled(text: str) -> list[VisualizerLike]:
    """Return how a marker of a pose is drawn with a name beside it: disk, arrow and trail."""
    disk = rr.Points2D.from_fields(labels=[text], show_labels=True)
    return [disk, rr.Arrows2D.from_fields(), rr.LineStrips2D.from_fields()]


def window(
    body: rrb.Container,
    *,
    play_state: Literal["paused", "following"] = "paused",
    fps: float | None = None,
) -> rrb.Blueprint:
    """Fill the viewer's window: the time panel is collapsed; all others are hidden.

    No moment is shaded: a blueprint's time selection is the same numbers on every timeline.
    """
    return rrb.Blueprint(
        body,
        rrb.TimePanel(
            state="collapsed",
            timeline=STEP,
            fps=fps,
            play_state=play_state,
            loop_mode="off",
        ),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )
