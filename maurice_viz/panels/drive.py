"""A drive or survey by itself: pictures, what the channels measure in them, paths; nothing is localized."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_loaders.reading.recording import PLACEHOLDER, SimplifiedPath
from maurice_mcl.sensor.descriptors.histograms import edge_image
from maurice_mcl.sensor.descriptors.registry import CHANNELS, reduced
from maurice_mcl.values.arrays import F32, F64
from maurice_mcl.values.geometry import compose, compose_motions, inverse, motion_between, rotated
from maurice_mcl.values.library import Library
from maurice_mcl.values.map import Arena
from maurice_mcl.values.session import Moment, SessionInfo

from .. import entities, style
from ..drawing.canvas import Extent, brightened, jpeg, long_side, map_extent
from ..style import BAR, RGB, TRUTH, Order, Scale, font_safe, scale_for
from ..text.phases import motion as said_motion
from .belief import ARROW_SHARE, estimate_marker, truth_marker
from .camera import CAMERA_QUALITY, draw_jpeg, prepare_jpeg
from .panel import MARKDOWN
from .views import MAP, Overrides, labeled, plane_view
from .world import draw_world

EDGES_QUALITY = 75  # for display; the channel measures the picture itself
MOST_POINTS = 4000  # points of a path that are kept; of a longer one every second, fourth, ... point
PATH_MARGIN = 0.08  # around the paths, as a share of the longer side
LEAST_FREE_M = 1.0  # free on each side of them


@dataclass(frozen=True, slots=True, eq=False)
class DrivePaths:
    """The paths of a drive and what it holds, known before it is drawn."""

    moments: int
    events: int
    moves: bool  # whether there is any odometry
    begins: F64 | None  # (3,) where the path by odometry begins on the map; None: neither truth nor odometry
    measured: F64  # (K, 2) in meters on the map, by odometry alone
    true: F64  # (T, 2)

    @property
    def points(self) -> F64:
        """All points of both paths (K + T, 2)."""
        return np.concatenate([self.measured, self.true])

    @property
    def arena(self) -> Arena | None:
        """A bare map around the paths; None where there are none."""
        points = self.points
        if not len(points):
            return None
        low, high = points.min(axis=0), points.max(axis=0)
        free = max(LEAST_FREE_M, PATH_MARGIN * float((high - low).max()))
        (x_min, y_min), (x_max, y_max) = (low - free).tolist(), (high + free).tolist()
        return Arena((x_min, y_min, x_max, y_max), np.zeros((0, 4)))


def drive_paths(known: Iterable[Moment], info: SessionInfo) -> DrivePaths:
    """Read a drive, not its pictures. The path by odometry is placed so that it meets the first true pose."""
    own, measured, true = np.zeros(3), SimplifiedPath(MOST_POINTS), SimplifiedPath(MOST_POINTS)
    begins, count, events, moves = info.start, 0, 0, False
    for moment in known:
        motions, count, events = moment.frame.motions, count + 1, events + len(moment.events)
        moves |= len(motions) > 0
        for motion in motions:
            own = compose(own, motion)
        measured.add(own)
        if moment.truth is not None:
            true.add(moment.truth)
            begins = compose(moment.truth, inverse(own)) if begins is None else begins
    if not moves:
        return DrivePaths(count, events, False, begins, np.zeros((0, 2)), true.poses()[:, :2])
    begins = np.zeros(3) if begins is None else begins
    return DrivePaths(
        count, events, True, begins, _laid(measured.poses()[:, :2], begins), true.poses()[:, :2]
    )


def _laid(points: F64, begins: F64) -> F64:
    """Turn and shift points (K, 2) from the odometry's own frame onto the map."""
    return np.column_stack(rotated(points[:, 0], points[:, 1], float(begins[2]))) + begins[:2]


ODOMETRY = "/session/odometry"
EVENTS = "/session/events"
TEXT = "/session/text"
PATHS = "/world/ways"  # below it truth and odometry, complete and faint
HISTOGRAM = "/session/histogram"  # under it a channel each, under that a plane each
TRACE = "/session/trace"
SHOWN_CHANNELS = ("color", "edges")  # channels whose vectors are drawn, of those there are
EMPTY_MAP = Arena((0.0, 0.0, 10.0, 10.0), np.zeros((0, 4)))  # for the size of arrows only
FAINT_ALPHA = 90  # opacity of the complete paths, of 255
PLANE_COLORS: tuple[RGB, ...] = ((200, 60, 50), (50, 160, 80), (60, 110, 230))
LINE_COLORS: dict[str, RGB] = {
    "forward/odometry": style.ODOMETRY,
    "turn/odometry": style.ODOMETRY,
    "apart": style.ODOMETRY,
    "brightness": BAR,
}
PLOTTED_DIGITS = 6  # of plotted values: else the axis of a steady drive would show rounding errors
DOTTED_TRACES = ("forward/truth", "turn/truth")


@dataclass(frozen=True, slots=True)
class DriveView:
    """A drive to draw, and what is known before its first moment."""

    info: SessionInfo
    paths: DrivePaths
    pictures: bool  # whether there is a camera
    advice: str = ""  # Markdown: what to do next

    @property
    def arena(self) -> Arena | None:
        """The map, or a bare one around the paths."""
        return self.info.arena or self.paths.arena

    @property
    def scale(self) -> Scale:
        """The scale from meters to drawn units."""
        return scale_for(self.info.display_units, self.arena or EMPTY_MAP)

    @property
    def channels(self) -> Sequence[str]:
        """Whose vectors are drawn."""
        return [name for name in SHOWN_CHANNELS if name in CHANNELS] if self.pictures else []


def draw_drive(rec: rr.RecordingStream, drive: DriveView, moments: Iterable[Moment]) -> None:
    """Log a drive: first what does not change, then moment by moment."""
    _prepare(rec, drive)
    pen = _Pen(rec, drive)
    for moment in moments:
        rec.set_time(entities.STEP, sequence=moment.frame.step)
        rec.set_time(entities.SESSION, duration=moment.frame.time_s)
        pen.draw(moment)


def _prepare(rec: rr.RecordingStream, drive: DriveView) -> None:
    paths, scale = drive.paths, drive.scale
    if drive.arena is not None:
        alone = Library(drive.info.name, np.zeros((0, 3)), (), {}, drive.arena, drive.info.display_units)
        draw_world(rec, alone, scale)
    for name, points, color in (("odometry", paths.measured, style.ODOMETRY), ("truth", paths.true, TRUTH)):
        if len(points):
            thin, faint = rr.components.Radius.ui_points(0.75), [(*color, FAINT_ALPHA)]
            line = rr.LineStrips2D([scale.screen(points)], colors=faint, radii=thin, draw_order=Order.PATHS)
            rec.log(f"{PATHS}/{name}", line, static=True)
    for path, color in LINE_COLORS.items():
        rec.log(f"{TRACE}/{path}", rr.SeriesLines(colors=[color], widths=[1.75]), static=True)
    for path in DOTTED_TRACES:  # no line across the gaps that truth may have
        rec.log(f"{TRACE}/{path}", rr.SeriesPoints(colors=[BAR], marker_sizes=[2.5]), static=True)
    rec.log(TEXT, rr.TextDocument.from_fields(media_type=MARKDOWN), static=True)
    for path in (entities.CAMERA, entities.EDGES):
        prepare_jpeg(rec, path)


class _Pen:
    """Draws moments, and remembers where the last one was."""

    def __init__(self, rec: rr.RecordingStream, drive: DriveView) -> None:
        self.rec, self.drive = rec, drive
        arena, scale = drive.arena or EMPTY_MAP, drive.scale
        self._pose = drive.paths.begins  # by odometry, on the map
        self._truth_before: F64 | None = None
        self._measured = estimate_marker(ODOMETRY, arena, scale, style.ODOMETRY)
        self._true = truth_marker(entities.TRUTH, arena, scale)
        for marker in (self._measured, self._true):
            marker.prepare(rec)

    def draw(self, moment: Moment) -> None:
        if moment.frame.picture != PLACEHOLDER:
            draw_jpeg(self.rec, entities.CAMERA, jpeg(moment.frame.image, CAMERA_QUALITY))
            edges = brightened(edge_image(moment.frame.image))
            draw_jpeg(self.rec, entities.EDGES, jpeg(edges, EDGES_QUALITY))
            self._draw_vectors(moment)
            self._trace("brightness", float(moment.frame.image.mean()))
        self._draw_poses(moment)
        self.rec.log(TEXT, rr.TextDocument.from_fields(text=font_safe(self._words(moment))))
        for text in moment.events:
            self.rec.log(EVENTS, rr.TextLog(font_safe(text)))
        self._truth_before = moment.truth

    def _draw_vectors(self, moment: Moment) -> None:
        small = reduced(moment.frame.image)
        for channel in self.drive.channels:
            planes = np.array_split(CHANNELS[channel].describe(small), len(PLANE_COLORS))
            for number, (plane, color) in enumerate(zip(planes, PLANE_COLORS, strict=True)):
                self.rec.log(f"{HISTOGRAM}/{channel}/{number}", _bars(plane, number, color))

    def _draw_poses(self, moment: Moment) -> None:
        scale, motions, truth = self.drive.scale, moment.frame.motions, moment.truth
        if self._pose is not None and self.drive.paths.moves:
            for motion in motions:
                self._pose = compose(self._pose, motion)
            self._measured.draw(self.rec, self._pose)
        if len(motions):
            self._draw_motion("odometry", reduce(compose_motions, motions))
        if truth is None:
            return
        self._true.draw(self.rec, truth)
        if self._truth_before is not None:
            self._draw_motion("truth", motion_between(self._truth_before, truth))
        if self._pose is not None and self.drive.paths.moves:
            self._trace("apart", scale.length(float(np.hypot(*(self._pose - truth)[:2]))))

    def _draw_motion(self, kind: str, motion: F64) -> None:
        self._trace(f"forward/{kind}", self.drive.scale.length(float(motion[0])))
        self._trace(f"turn/{kind}", float(np.degrees(motion[2])))

    def _trace(self, quantity: str, value: float) -> None:
        self.rec.log(f"{TRACE}/{quantity}", rr.Scalars(round(value, PLOTTED_DIGITS)))

    def _words(self, moment: Moment) -> str:
        frame, scale = moment.frame, self.drive.scale
        what = "Picture" if self.drive.pictures else "Moment"
        parts = [f"#### {what} {frame.step}, {frame.time_s:.2f} s"]
        if self.drive.paths.moves:
            parts.append(f"Odometry says {said_motion(frame.motions, scale)}.")
        if moment.truth is not None:
            parts.append(f"True pose: {scale.say_pose(moment.truth)}.")
        parts += [f"Log: {text}." for text in moment.events[:3]]
        if self.drive.pictures and frame.picture:
            parts.append(f"`{frame.picture}`, {frame.image.shape[1]} x {frame.image.shape[0]} px")
        return "\n\n".join([*parts, self.drive.advice])


def _bars(values: F32, plane: int, color: RGB) -> rr.BarChart:
    """Return the bars of one plane (B,), each plane 1 wide: red from 0 to 1, green to 2, blue to 3."""
    bins = len(values)
    at = plane + (np.arange(bins) + 0.5) / bins
    return rr.BarChart(values, abscissa=at.astype(np.float32), widths=np.full(bins, 1 / bins), color=color)


def path_view(drive: DriveView) -> rrb.Spatial2DView:
    """Show the map with both paths, and where the robot is."""
    extent, unit = reach(drive), drive.scale.units.name
    contents = [*MAP, f"{PATHS}/**", f"{entities.TRUTH}/**", f"{ODOMETRY}/**"]
    names: Overrides = {entities.TRUTH: labeled("truth"), ODOMETRY: labeled("odometry alone")}
    return plane_view(f"Path ({unit})", contents, extent, names)


def reach(drive: DriveView) -> Extent:
    """Return what the map view shows: the map, and the paths where they leave it."""
    assert drive.arena is not None
    extent, points = map_extent(drive.arena, drive.scale), drive.scale.screen(drive.paths.points)
    # for the robot's disk and arrow at the end of a path
    room = ARROW_SHARE * long_side(drive.arena, drive.scale)
    low = np.minimum(points.min(axis=0, initial=np.inf) - room, (extent.left, extent.top)).tolist()
    high = np.maximum(points.max(axis=0, initial=-np.inf) + room, (extent.right, extent.bottom)).tolist()
    return Extent(low[0], high[0], low[1], high[1])
