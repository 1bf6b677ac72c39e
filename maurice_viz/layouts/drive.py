"""A drive by itself: where it went, what was seen, what the wheels measured."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from maurice_mcl.sensor.descriptors import CHANNELS

from .. import entities
from ..drawing.canvas import long_side, map_extent
from ..panels.belief import ARROW
from ..panels.drive import EVENTS, HISTOGRAM, ODOMETRY, TEXT, TRACE, WAYS, DriveView
from ..style import GROUND
from .plots import plot
from .registry import FPS
from .views import MAP, camera_view, edges_view


def blueprint(drive: DriveView) -> rrb.Blueprint:
    """Lay out what there is of a drive: the way left, pictures and what was measured right."""
    left, right = _left(drive), _right(drive)
    if right is None:
        body: rrb.Container = left
    elif drive.arena is None:  # nothing but words is left
        body = rrb.Vertical(right, left, row_shares=[3, 1])
    else:
        body = rrb.Horizontal(left, right, column_shares=[1.15, 1])
    return rrb.Blueprint(
        body,
        rrb.TimePanel(state="collapsed", timeline=entities.STEP, fps=FPS, play_state="paused"),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _left(drive: DriveView) -> rrb.Vertical:
    text = rrb.TextDocumentView(name="This drive", origin=TEXT)
    parts: list[rrb.View | rrb.Container] = [text]
    shares = [1.0]
    if drive.arena is not None and (len(drive.ways.true) or drive.ways.moves or drive.info.arena):
        parts, shares = [_map(drive), *parts], [2.4, *shares]
    if drive.ways.events:
        parts, shares = [*parts, _events()], [*shares, 0.6]
    return rrb.Vertical(*parts, row_shares=shares)


def _right(drive: DriveView) -> rrb.Vertical | None:
    parts: list[rrb.View | rrb.Container] = []
    shares: list[float] = []
    if drive.pictures:
        charts = [_chart(channel) for channel in drive.channels]
        parts += [rrb.Horizontal(camera_view(), edges_view()), rrb.Tabs(*charts, active_tab=0)]
        shares += [1.5, 1.0]
    plots = _plots(drive)
    parts, shares = [*parts, *plots], [*shares, *(0.8 for _ in plots)]
    return rrb.Vertical(*parts, row_shares=shares) if parts else None


def _events() -> rrb.TextLogView:
    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn(entities.STEP)],
        text_log_columns=[TextLogColumn(TextLogColumnKind.Body)],
    )
    return rrb.TextLogView(name="Events of the log", origin=EVENTS, columns=columns)


def _map(drive: DriveView) -> rrb.Spatial2DView:
    scale, x_range, y_range = drive.scale, *reach(drive)
    contents = [*MAP, entities.WEIGHT_KEY, f"{WAYS}/**", f"{entities.TRUTH}/**", f"{ODOMETRY}/**"]
    return rrb.Spatial2DView(
        name=f"Way ({scale.units.name}): the whole of it faint, where the robot is now bright",
        origin="/",
        contents=contents,
        background=GROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=x_range, y_range=y_range),
    )


def reach(drive: DriveView) -> tuple[tuple[float, float], tuple[float, float]]:
    """Give what the map view shows: the map, and the ways where they leave it. x first, drawn units."""
    assert drive.arena is not None
    extent, ways = map_extent(drive.arena, drive.scale), drive.scale.screen(drive.ways.points)
    room = ARROW * long_side(drive.arena, drive.scale)  # for the robot's disk and arrow at the end of a way
    low = np.minimum(ways.min(axis=0, initial=np.inf) - room, (extent.left, extent.top)).tolist()
    high = np.maximum(ways.max(axis=0, initial=-np.inf) + room, (extent.right, extent.bottom)).tolist()
    return (low[0], high[0]), (low[1], high[1])


def _chart(channel: str) -> rrb.BarChartView:
    return rrb.BarChartView(
        name=f"{channel.capitalize()} ({CHANNELS[channel].unit}): red, green, blue from 0, 1, 2",
        origin="/",
        contents=[f"{HISTOGRAM}/{channel}/**"],
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _plots(drive: DriveView) -> list[rrb.TimeSeriesView]:
    """Plot what odometry and truth say of each movement: a wrong sign or unit shows at once."""
    unit, each = drive.scale.units.name, "picture" if drive.pictures else "moment"
    kinds = [
        ("odometry", "odometry orange", drive.ways.moves),
        ("truth", "truth blue dots", len(drive.ways.true)),
    ]
    known = [(kind, words) for kind, words, has in kinds if has]
    who = ", ".join(words for _, words in known)
    plots = []
    if known:
        for quantity, what, of in (("forward", "Forward", unit), ("turn", "Turned left", "deg")):
            lines = [f"{TRACE}/{quantity}/{kind}" for kind, _ in known]
            plots.append(plot(f"{what} since the last {each} ({of}): {who}", lines))
    if len(known) == len(kinds):
        plots.append(plot(f"Odometry apart from the truth ({unit})", [f"{TRACE}/apart"]))
    if drive.pictures and len(plots) < len(kinds) + 1:
        plots.append(plot("Brightness of the picture (mean of 0 to 255)", [f"{TRACE}/brightness"]))
    return plots
