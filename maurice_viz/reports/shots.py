"""Which events of a run are listed, which steps get a picture, and the pictures: camera image and map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from maurice_mcl.scoring.events import KINDS, RunEvent
from maurice_mcl.values import F64, U8, Arena, Moment, StepRecord

from ..drawing.canvas import Canvas, draw_ground, jpeg, long_side
from ..drawing.scan import draw_scan
from ..panels.belief import ARROW_SHARE
from ..panels.world import clipped
from ..running.saved_steps import Collected
from ..style import GROUND, RGB, TRUTH, WALL, Scale, weight_colors

MAX_PICTURES = 12
MOST_LISTED = 20  # a kind with more events in a run is counted, not listed
RULE = (
    f"At most {MAX_PICTURES} steps have a picture: the step with the largest position error (without truth: "
    "with the widest cloud), the last step, and then in rounds the next event of each of these kinds: "
    f"{', '.join(name for name, kind in KINDS.items() if not kind.is_routine)}."
)


@dataclass(frozen=True, slots=True)
class ReportedEvent:
    """An event, and the runs in which it happened."""

    event: RunEvent
    labels: tuple[str, ...]

    def reason(self, runs: int) -> str:
        """Return the event in a line, with its runs if it is not one of all `runs`."""
        who = "" if len(self.labels) == runs else f" ({', '.join(self.labels)})"
        return f"{self.event.kind}{who}: {self.event.text}"


@dataclass(frozen=True, slots=True)
class PicturedStep:
    """A step with a picture: its number on the page, and why it has one."""

    number: int
    step: int
    reasons: tuple[str, ...]


def events_of(collected: Collected) -> list[ReportedEvent]:
    """Return the events of all runs in order of steps; the same event of several runs is one."""
    same: dict[tuple[int, str, str], list[tuple[RunEvent, str]]] = {}
    for track in collected.tracks:
        for event in track.events:
            same.setdefault((event.step, event.kind, event.text), []).append((event, track.label))
    order = list(KINDS)
    keys = sorted(same, key=lambda key: (key[0], order.index(key[1])))
    return [ReportedEvent(same[key][-1][0], tuple(label for _, label in same[key])) for key in keys]


def listed(events: Sequence[ReportedEvent]) -> list[ReportedEvent]:
    """Leave out what is routine, and the kinds with more than `MOST_LISTED` events."""
    notable = [item for item in events if not item.event.is_routine]
    counts = steps_by_kind(notable)
    return [item for item in notable if len(counts[item.event.kind]) <= MOST_LISTED]


def steps_by_kind(events: Sequence[ReportedEvent]) -> dict[str, list[int]]:
    """Return the steps at which each kind happened, in the order of KINDS."""
    steps: dict[str, list[int]] = {kind: [] for kind in KINDS}
    for item in events:
        steps[item.event.kind].append(item.event.step)
    return {kind: of_kind for kind, of_kind in steps.items() if of_kind}


def choose(collected: Collected, events: Sequence[ReportedEvent]) -> list[PicturedStep]:
    """Choose the steps that get a picture, by `RULE`, in order of steps."""
    notable = [item for item in events if not item.event.is_routine]
    worst, last = worst_step(collected), int(collected.tracks[0].table.steps[-1])
    picked: dict[int, list[str]] = {worst: [], last: []}
    for step in _in_rounds(notable):
        if len(picked) >= MAX_PICTURES:
            break
        picked.setdefault(step, [])
    for item in notable:
        if item.event.step in picked:
            picked[item.event.step].append(item.reason(len(collected.tracks)))
    has_truth = any(track.table.known.any() for track in collected.tracks)
    picked[worst].append("largest position error" if has_truth else "widest cloud")
    picked[last].append("last step")
    return [PicturedStep(k, step, tuple(picked[step])) for k, step in enumerate(sorted(picked), start=1)]


def _in_rounds(notable: Sequence[ReportedEvent]) -> list[int]:
    """Return steps: the first event of every kind, then the second of every kind, and so on."""
    by_kind = list(steps_by_kind(notable).values())
    longest = max(map(len, by_kind), default=0)
    return [steps[k] for k in range(longest) for steps in by_kind if k < len(steps)]


def worst_step(collected: Collected) -> int:
    """Return the step with the largest position error of any run; without truth that of the widest cloud."""
    tables = [track.table for track in collected.tracks]
    for values in (
        np.stack([table.error_m for table in tables]),
        np.stack([table.spread_m for table in tables]),
    ):
        if np.isfinite(values).any():
            return int(tables[0].steps[np.nanmax(values, axis=0, initial=-1.0).argmax()])
    return int(tables[0].steps[0])


def step_ranges(steps: Sequence[int]) -> str:
    """Return steps as short text: "3-7, 9"."""
    numbers = np.unique(np.array(steps, int))
    parts = [part.tolist() for part in np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)]
    return ", ".join(
        f"{part[0]}-{part[-1]}" if len(part) > 2 else ", ".join(map(str, part)) for part in parts
    )


# Pictures of a step: the camera image, and the map with cloud, truth and estimate.

MAP_PX = 720  # longer side of a map on the page
CAMERA_PX = 320  # maximum width of a camera image on the page
QUALITY = 82
SUBPIXEL_BITS = 4  # with which OpenCV draws between pixels


@dataclass(frozen=True, slots=True)
class Shot:
    """The JPEGs of one step; `camera`, or what the laser sees, is None where it is not available."""

    camera: bytes | None
    maps: Mapping[str, bytes]  # by the run's label


@dataclass(slots=True)
class Photographer:
    """Draws shots; the ground of the map is drawn once."""

    arena: Arena
    scale: Scale
    sees: str  # what frames hold: "camera", "laser", or nothing to show
    colors: Mapping[str, RGB]  # of the estimate, by the run's label
    _ground: Canvas | None = None

    def shoot(self, moment: Moment, records: Mapping[str, StepRecord]) -> Shot:
        """Draw one step."""
        frame, camera = moment.frame, None
        if self.sees == "camera":
            camera = jpeg(_narrowed(frame.image), QUALITY)
        elif self.sees == "laser" and frame.scan is not None:
            drawn = np.frombuffer(draw_scan(frame.scan, self.scale), np.uint8)
            camera = jpeg(np.asarray(cv2.imdecode(drawn, cv2.IMREAD_COLOR_RGB), np.uint8), QUALITY)
        maps = {label: self._map(moment, record, self.colors[label]) for label, record in records.items()}
        return Shot(camera, maps)

    def _map(self, moment: Moment, record: StepRecord, color: RGB) -> bytes:
        ground = self._ground or _with_walls(draw_ground(self.arena, self.scale), self.arena, self.scale)
        self._ground = ground
        image = ground.image.copy()
        order = record.weighted.log_weights.argsort(kind="stable")  # heavy ones are drawn over light ones
        places = _pixels(ground, record.weighted.world_poses[order], self.scale)
        colors = weight_colors(record.weighted.log_weights[order])
        for (x, y), rgba in zip(places.tolist(), colors.tolist(), strict=True):
            cv2.circle(image, (x, y), 5 << SUBPIXEL_BITS, (rgba >> 24, rgba >> 16 & 255, rgba >> 8 & 255), -1,
                       cv2.LINE_AA, SUBPIXEL_BITS)  # fmt: skip
        arrow = ARROW_SHARE * long_side(self.arena, self.scale) / ground.unit_per_px
        if moment.truth is not None:
            _pose(ground, image, moment.truth, self.scale, TRUTH, 15, arrow)
        _pose(ground, image, record.estimate.pose, self.scale, color, 11, arrow)
        rows, columns = image.shape[:2]
        shrunk = min(1.0, MAP_PX / max(rows, columns))
        size = (max(1, round(columns * shrunk)), max(1, round(rows * shrunk)))
        return jpeg(np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8), QUALITY)


def shots(
    photographer: Photographer,
    updates: Iterator[tuple[Moment, Mapping[str, StepRecord]]],
    steps: Sequence[int],
) -> dict[int, Shot]:
    """Go through the updates up to the last of `steps`, and draw the pictures of these steps by step."""
    numbers, drawn = set(steps), dict[int, Shot]()
    for moment, records in updates:
        if moment.frame.step in numbers:
            drawn[moment.frame.step] = photographer.shoot(moment, records)
        if len(drawn) == len(numbers):
            break
    return drawn


def _narrowed(image: U8) -> U8:
    rows, columns = image.shape[:2]
    if columns <= CAMERA_PX:
        return image
    size = (CAMERA_PX, max(1, round(rows * CAMERA_PX / columns)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _with_walls(ground: Canvas, arena: Arena, scale: Scale) -> Canvas:
    for wall in clipped(arena.walls, arena.bounds):
        start, end = _pixels(ground, wall.reshape(2, 2), scale).tolist()
        cv2.line(ground.image, tuple(start), tuple(end), WALL, 4, cv2.LINE_AA, SUBPIXEL_BITS)
    return ground


def _pixels(canvas: Canvas, xy_m: F64, scale: Scale) -> NDArray[np.int64]:
    """Return points (K, 2) in sixteenths of a pixel, as OpenCV takes them; far outside, they are clipped."""
    px = (scale.screen(xy_m) - (canvas.extent.left, canvas.extent.top)) / canvas.unit_per_px
    return np.asarray(np.clip(px * (1 << SUBPIXEL_BITS), -(2**20), 2**20).round(), np.int64)


def _pose(
    canvas: Canvas, image: U8, pose: F64, scale: Scale, color: RGB, radius: int, arrow_px: float
) -> None:
    (x, y), *_ = _pixels(canvas, pose[None, :2], scale).tolist()
    way = np.array([np.cos(pose[2]), -np.sin(pose[2])]) * (arrow_px + radius) * (1 << SUBPIXEL_BITS)
    tip = (round(x + way[0]), round(y + way[1]))
    for ink, wider in ((GROUND, 3), (color, 0)):
        cv2.line(image, (x, y), tip, ink, 6 + 2 * wider, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.circle(image, (x, y), (radius + wider) << SUBPIXEL_BITS, ink, -1, cv2.LINE_AA, SUBPIXEL_BITS)
