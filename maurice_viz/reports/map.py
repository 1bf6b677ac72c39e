"""Floor plans, and the map with the true, the estimated and the odometry path; templates write the SVG."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from maurice_mcl.values import F64, Arena

from ..drawing.canvas import MOST_TICKS, cells_in, known_part, png, shown_bounds, ticks
from ..panels.world import clipped
from ..running.saved_steps import Collected, Track
from ..style import Scale
from .charts import DASHES, Axes, DrawnChart

JUMP_OF_MOTION = 3.0  # a step this many times as long as the measured motion is a jump
MAX_POINTS = 3000
FINER = 1.5  # pixels of an occupancy map in one of the drawing: it may be enlarged
LETTER_PX = 7.2  # average width
TICK_PX = 40.0, 20.0  # least distance of ticks along x and y
KNOWN_FLOORS = ("wood", "carpet")


@dataclass(frozen=True, slots=True, eq=False)
class DrawnFloor:
    """A floor as a template writes it, in px."""

    long_side: ClassVar[float]  # of the map in the drawing, in px
    margins: ClassVar[tuple[float, float, float, float]]  # left, right, top and bottom, in px

    arena: Arena
    scale: Scale

    @property
    def axes(self) -> Axes:
        """The map's box, in meters."""
        x_min, y_min, x_max, y_max = shown_bounds(self.arena)
        sides_m = x_max - x_min, y_max - y_min
        width, height = (side_m * self.long_side / max(*sides_m, 1e-9) for side_m in sides_m)
        left, _, top, _ = self.margins
        return Axes((x_min, x_max), (y_min, y_max), left, top, width, height)

    @property
    def width(self) -> float:
        """Of the drawing, in px."""
        return self.axes.right + self.margins[1]

    @property
    def height(self) -> float:
        """Of the drawing, in px."""
        return self.axes.bottom + self.margins[3]

    @property
    def walls(self) -> list[list[list[float]]]:
        """Both ends of each wall, cut at the map's edge."""
        walls = clipped(self.arena.walls, self.arena.bounds)
        return [self.axes.at(wall.reshape(2, 2)).tolist() for wall in walls]

    @property
    def cells(self) -> list[tuple[str, bytes]]:
        """What is free and what is occupied of an occupancy map, each with a PNG that is white there."""
        if self.arena.occupancy is None:
            return []
        size = max(round(FINER * self.axes.width), 1), max(round(FINER * self.axes.height), 1)
        free, occupied = cells_in(known_part(self.arena.occupancy), size)
        return [
            (kind, png(where.astype(np.uint8) * 255))
            for kind, where in (("free", free), ("occupied", occupied))
        ]

    def ticks(self, axis: int) -> list[tuple[float, str]]:
        """Return position and label of each tick along x (0) or y (1)."""
        axes = self.axes
        start, length = (axes.left, axes.width) if axis == 0 else (axes.bottom, -axes.height)
        low, high = (self.scale.length(shown_bounds(self.arena)[k]) for k in (axis, axis + 2))
        most = min(MOST_TICKS, abs(length) / TICK_PX[axis])
        values = ticks(low, high, self.scale.units.grid, most)
        return [(start + (value - low) / (high - low or 1.0) * length, f"{value:g}") for value in values]


@dataclass(frozen=True, slots=True)
class MapPath:
    """One path on the map: its CSS class, its name in the key, its dashes, and if its ends are marked."""

    kind: str
    text: str
    poses: F64  # (U, 3), NaN where not known
    dashes: str = ""
    has_ends: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class DrawnMap(DrawnFloor):
    """The map of a report, with the paths of its runs."""

    long_side: ClassVar[float] = 620.0
    margins: ClassVar[tuple[float, float, float, float]] = (46.0, 16.0, 18.0, 34.0)

    tracks: Sequence[Track]
    numbered: Sequence[tuple[int, int]]  # step and number of each event with a picture
    jump_m: float  # a path is broken where a step is longer

    @property
    def has_truth(self) -> bool:
        """Whether the true path is known anywhere."""
        return any(path.kind == "truth" for path in self.paths)

    @property
    def floor_kinds(self) -> dict[str, str]:
        """The CSS class that colors each floor, by its name."""
        names = dict.fromkeys(floor.name for floor in self.arena.floors)
        others = [name for name in names if name.lower() not in KNOWN_FLOORS]
        return {name: f"floor{others.index(name) % 3}" if name in others else name.lower() for name in names}

    @property
    def names(self) -> Iterator[tuple[float, float, str]]:
        """Center and name of the obstacles whose names fit; the others have a tooltip."""
        for region in self.arena.obstacles:
            corners = self.axes.at(region.polygon)
            low, high = corners.min(axis=0), corners.max(axis=0)
            if LETTER_PX * len(region.name) < 1.25 * (high[0] - low[0]) and high[1] - low[1] > 14:
                x, y = ((low + high) / 2).tolist()
                yield x, y, region.name

    @property
    def paths(self) -> list[MapPath]:
        """The paths that are known, the ones below first."""
        first, single = self.tracks[0], len(self.tracks) == 1
        odometry = "odometry alone, uncorrected, up to the map's edge"
        paths = [
            MapPath("odometry", odometry, first.table.odometry, "1.5 4", has_ends=False),
            MapPath("truth", "truth", first.table.truths),
        ]
        for run, track in enumerate(self.tracks):
            kind, text = ("estimate", "estimate") if single else (f"run{run}", track.label)
            paths.append(MapPath(kind, text, track.table.poses, DASHES[run % len(DASHES)]))
        return [path for path in paths if np.isfinite(path.poses).any()]

    def parts(self, path: MapPath) -> Iterator[str]:
        """Yield the points of each unbroken part of a path."""
        for part in unbroken(path.poses[:, :2], self.tracks[0].table.odometry_m, self.jump_m):
            if len(part) > 1:
                yield self.axes.points(thin_path(part))

    def ends(self, path: MapPath) -> list[list[float]]:
        """Return the first and the last known place in px."""
        known = path.poses[np.isfinite(path.poses[:, 0])]
        return self.axes.at(known[[0, -1], :2]).tolist() if path.has_ends else []

    @property
    def badges(self) -> Iterator[tuple[float, float, float, float, int]]:
        """The robot (or its estimate) at each numbered event, a free place beside it, and the number."""
        truth, estimate = self.tracks[0].table.truths, self.tracks[0].table.poses
        places = self.axes.at(np.where(np.isfinite(truth), truth, estimate)[:, :2])
        rows = {int(step): row for row, step in enumerate(self.tracks[0].table.steps)}
        centers: list[tuple[float, float]] = []
        for step, number in self.numbered:
            x, y = places[rows[step]].tolist()
            centers.append(_free_place(x, y, centers))
            yield x, y, *centers[-1], number

    @property
    def jump(self) -> str:
        """The distance above which a path is broken."""
        return self.scale.say(self.jump_m)

    @property
    def label(self) -> str:
        """What the map shows, for readers who do not see it."""
        size = " by ".join(self.scale.say(side) for side in self.arena.size_m)
        runs = ", ".join(track.label for track in self.tracks)
        return f"Map of {size} with the estimated path of {runs}{' and the true path' * self.has_truth}"


def unbroken(places: F64, moved_m: F64, jump_m: float) -> list[F64]:
    """Cut a path (U, 2) where a step jumps, and leave out what is not known."""
    distance = np.hypot(*np.diff(places, axis=0).T) if len(places) > 1 else np.zeros(0)
    jumps = ~(distance <= np.maximum(jump_m, JUMP_OF_MOTION * moved_m[1:]))  # also where it is not known
    parts = np.split(places, np.flatnonzero(jumps) + 1)
    return [part for part in parts if np.isfinite(part).all()]


def thin_path(places: F64) -> F64:
    """Leave out steps of a very long path (U, 2), evenly; the ends stay."""
    if len(places) <= MAX_POINTS:
        return places
    return np.asarray(places[np.linspace(0, len(places) - 1, MAX_POINTS).round().astype(int)])


def _free_place(x: float, y: float, taken: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Find a place about a point that no other number covers."""
    for radius in (20.0, 38.0, 56.0):
        for angle in np.arange(8) * np.pi / 4 - np.pi / 4:
            at = (x + radius * float(np.cos(angle)), y + radius * float(np.sin(angle)))
            if all(np.hypot(at[0] - a, at[1] - b) > 19 for a, b in taken):
                return at
    return x + 20, y


# What the page's script needs to show one step in the map and all traces at once: numbers, by step.

DIGITS = 4  # significant ones, of a value in a chart


def linked(
    drawn_map: DrawnMap, charts: Sequence[DrawnChart], collected: Collected, scale: Scale, step: int
) -> Mapping[str, Any]:
    """Return what the script reads; `step` is the one that is shown at first.

    Poses are x, y and heading in display units and degrees, null where not known. A chart has a list of
    values for each run.
    """
    steps = collected.tracks[0].table.steps.tolist()
    paths = [path for path in drawn_map.paths if path.kind != "odometry"]
    return {
        "first": steps.index(step) if step in steps else 0,
        "steps": steps,
        "times": np.round(collected.tracks[0].table.times_s, 1).tolist(),
        "unit": scale.units.name,
        "digits": scale.units.digits,
        "map": _axes(drawn_map.axes, scale.units.per_m),
        "poses": [_poses(path.poses, scale) for path in paths],
        "charts": [
            {
                "name": drawn.chart.title.lower(),
                "unit": drawn.chart.unit,
                "told": drawn.chart.is_told,
                "axes": _axes(drawn.axes),
                "values": [[_digits(value) for value in line.y.tolist()] for line in drawn.lines],
            }
            for drawn in charts
        ],
    }


def _axes(axes: Axes, factor: float = 1.0) -> list[float]:
    """Return the values at left, right, bottom and top, then left, top, width and height in px."""
    values = [factor * value for value in (*axes.x, *axes.y)]
    return [*values, axes.left, axes.top, axes.width, axes.height]


def _poses(poses: F64, scale: Scale) -> list[list[float] | None]:
    places = np.round(scale.units.per_m * poses[:, :2], scale.units.digits + 1)
    headings = np.round(np.degrees(poses[:, 2]))
    rows = np.column_stack([places, headings]).tolist()
    return [row if np.isfinite(row).all() else None for row in rows]


def _digits(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
