"""A session or survey by itself: pictures, map, true and measured path; nothing is localized."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_loaders.recording import moved
from maurice_loaders.session_log import SessionLog
from maurice_mcl.arena import Arena
from maurice_mcl.library import Library
from maurice_mcl.session import Frame, Moment, SessionInfo
from maurice_mcl.typing import F64

from . import draw_belief, draw_pictures, draw_world, entities
from .canvas import long_side
from .look import scale_for
from .raster import jpeg

ODOMETRY = "/session/odometry"
EVENTS = "/session/events"
NO_MAP = Arena((0.0, 0.0, 10.0, 10.0), np.zeros((0, 4)))  # for the size of arrows only


def blueprint() -> rrb.Blueprint:
    """Lay out camera, map and events."""
    paths = ["/world/**", f"{entities.TRUTH}/**", f"{ODOMETRY}/**"]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial2DView(origin=entities.CAMERA, name="camera"),
                rrb.Spatial2DView(origin="/", contents=paths, name="map: truth, and odometry by itself"),
            ),
            rrb.TextLogView(origin=EVENTS, name="events"),
            row_shares=[4, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline=entities.STEP, play_state="paused"),
        auto_views=False,
    )


def moments_of(log: SessionLog) -> Iterator[Moment]:
    """Give a session's moments; of a survey its pictures that are not covered, their poses as truth."""
    if log.kind == "session":
        yield from log.moments()
        return
    taken = (picture for picture in log.survey_pictures() if not picture.covered)
    for step, picture in enumerate(taken, start=1):
        name = "" if picture.path is None else str(picture.path)
        yield Moment(Frame(step, float(step), np.zeros((0, 3)), picture.image, name), picture.pose)


def draw_session(rec: rr.RecordingStream, info: SessionInfo, moments: Iterable[Moment]) -> None:
    """Log a drive. The path by odometry begins at the first known pose, and drifts from there."""
    arena = info.arena or NO_MAP
    scale = scale_for(info.display_units, arena)
    if info.arena is not None:
        map_alone = Library(info.name, np.zeros((0, 3)), (), {}, info.arena, info.display_units)
        draw_world.draw_world(rec, map_alone, scale)
    arrow = draw_belief.ARROW * long_side(arena, scale)
    truth, measured = draw_belief.truth_marker(entities.TRUTH), draw_belief.estimate_marker(ODOMETRY)
    for marker in (truth, measured):
        marker.prepare(rec)
    draw_pictures.prepare_jpeg(rec, entities.CAMERA)
    pose = info.start
    for moment in moments:
        rec.set_time(entities.STEP, sequence=moment.frame.step)
        rec.set_time(entities.SESSION, duration=moment.frame.time_s)
        draw_pictures.draw_jpeg(rec, entities.CAMERA, jpeg(moment.frame.image))
        pose = _moved_on(pose, moment)
        if pose is not None and len(moment.frame.motions):
            measured.draw(rec, pose, scale, arrow)
        if moment.truth is not None:
            truth.draw(rec, moment.truth, scale, arrow)
        for text in moment.events:
            rec.log(EVENTS, rr.TextLog(text))


def _moved_on(pose: F64 | None, moment: Moment) -> F64 | None:
    """Move a pose (3,) by what was measured; the first known truth begins it where there is none yet."""
    if pose is None:
        return moment.truth if moment.truth is not None or not len(moment.frame.motions) else np.zeros(3)
    for motion in moment.frame.motions:
        pose = moved(pose, motion)
    return pose
