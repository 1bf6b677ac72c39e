"""The screen of a drive by itself: the path left, pictures and measurements right."""

from __future__ import annotations

import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from .. import entities
from ..panels.camera import camera_view, edges_view
from ..panels.drive import EVENTS, HISTOGRAM, TEXT, TRACE, DriveView, path_view
from ..panels.views import FPS, bars_view, plot, window


def drive_blueprint(drive: DriveView) -> rrb.Blueprint:
    """Lay out a drive: the path left, pictures and measurements right, as far as it has them."""
    left, right = _left(drive), _right(drive)
    if right is None:
        body: rrb.Container = left
    elif drive.arena is None:  # nothing but words is left
        body = rrb.Vertical(right, left, row_shares=[3, 1])
    else:
        body = rrb.Horizontal(left, right, column_shares=[1.15, 1])
    return window(body, fps=FPS)


def _left(drive: DriveView) -> rrb.Vertical:
    parts: list[rrb.View] = [rrb.TextDocumentView(name="This drive", origin=TEXT)]
    shares = [1.0]
    if drive.arena is not None and (len(drive.paths.true) or drive.paths.moves or drive.info.arena):
        parts, shares = [path_view(drive), *parts], [2.4, *shares]
    if drive.paths.events:
        columns = rrb.TextLogColumns(
            timeline_columns=[TimelineColumn(entities.STEP)],
            text_log_columns=[TextLogColumn(TextLogColumnKind.Body)],
        )
        parts.append(rrb.TextLogView(name="Events of the log", origin=EVENTS, columns=columns))
        shares.append(0.6)
    return rrb.Vertical(*parts, row_shares=shares)


def _right(drive: DriveView) -> rrb.Vertical | None:
    parts: list[rrb.View | rrb.Container] = []
    shares: list[float] = []
    if drive.pictures:
        charts = [
            bars_view(f"{channel.capitalize()}: R, G, B", [f"{HISTOGRAM}/{channel}"])
            for channel in drive.channels
        ]
        parts += [rrb.Horizontal(camera_view(), edges_view()), rrb.Tabs(*charts, active_tab=0)]
        shares += [1.5, 1.0]
    plots = _motion_plots(drive)
    parts, shares = [*parts, *plots], [*shares, *(0.8 for _ in plots)]
    return rrb.Vertical(*parts, row_shares=shares) if parts else None


def _motion_plots(drive: DriveView) -> list[rrb.TimeSeriesView]:
    """Plot each movement by odometry and by truth: a wrong sign or unit is visible at once."""
    unit = drive.scale.units.name
    kinds = {"odometry": drive.paths.moves, "truth": len(drive.paths.true)}
    known = [kind for kind, has in kinds.items() if has]
    plots = []
    if known:
        for quantity, title in (("forward", f"Forward ({unit})"), ("turn", "Turned left (deg)")):
            plots.append(plot(title, [f"{TRACE}/{quantity}/{kind}" for kind in known]))
    if len(known) == len(kinds):
        plots.append(plot(f"Odometry off truth ({unit})", [f"{TRACE}/apart"]))
    if drive.pictures and len(plots) < len(kinds) + 1:
        plots.append(plot("Brightness (0 to 255)", [f"{TRACE}/brightness"]))
    return plots
