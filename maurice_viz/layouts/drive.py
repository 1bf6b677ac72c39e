"""A drive by itself: its path, its pictures, its odometry."""

from __future__ import annotations

import rerun.blueprint as rrb

from ..panels.camera import camera_view, edges_view
from ..panels.drive import (
    DriveView,
    channel_view,
    drive_words,
    log_events_view,
    motion_plots,
    path_view,
)
from ..panels.views import FPS, window


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
    parts: list[rrb.View | rrb.Container] = [drive_words()]
    shares = [1.0]
    if drive.arena is not None and (len(drive.paths.true) or drive.paths.moves or drive.info.arena):
        parts, shares = [path_view(drive), *parts], [2.4, *shares]
    if drive.paths.events:
        parts, shares = [*parts, log_events_view()], [*shares, 0.6]
    return rrb.Vertical(*parts, row_shares=shares)


def _right(drive: DriveView) -> rrb.Vertical | None:
    parts: list[rrb.View | rrb.Container] = []
    shares: list[float] = []
    if drive.pictures:
        charts = [channel_view(channel) for channel in drive.channels]
        parts += [rrb.Horizontal(camera_view(), edges_view()), rrb.Tabs(*charts, active_tab=0)]
        shares += [1.5, 1.0]
    plots = motion_plots(drive)
    parts, shares = [*parts, *plots], [*shares, *(0.8 for _ in plots)]
    return rrb.Vertical(*parts, row_shares=shares) if parts else None
