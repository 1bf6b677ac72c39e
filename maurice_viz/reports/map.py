"""The map with the ways of truth, estimate and odometry, as inline SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.analysis.metrics import LOST_M
from maurice_mcl.arrays import F64
from maurice_mcl.map import Arena, Region

from ..app.tracks import Track
from ..drawing.canvas import ticks as ruler
from ..panels.world import clipped
from ..style import Scale
from .charts import DASHES, badge
from .markup import Markup, number, tag

LONGEST = 620.0  # of the map's longer side in the drawing
LEFT, RIGHT, TOP, BOTTOM = 46.0, 16.0, 18.0, 34.0
JUMP_OF_MOTION = 3.0  # a step this many times as long as what the robot measured is no drive but a jump
MOST_POINTS = 3000
NAME_PX = 7.2  # width of a letter, about
KNOWN_FLOORS = ("wood", "carpet")


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """From the map's metres to the drawing's coordinates, y pointing down."""

    arena: Arena
    scale: Scale

    @property
    def px_per_m(self) -> float:
        """Drawn length of a metre."""
        return LONGEST / max(max(self.arena.size_m), 1e-9)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the whole drawing."""
        width, height = (side * self.px_per_m for side in self.arena.size_m)
        return width + LEFT + RIGHT, height + TOP + BOTTOM

    def at(self, xy_m: F64) -> F64:
        """Place points (K, 2)."""
        x_min, _, _, y_max = self.arena.bounds
        across = (xy_m[:, 0] - x_min) * self.px_per_m + LEFT
        down = (y_max - xy_m[:, 1]) * self.px_per_m + TOP
        return np.column_stack([across, down])

    def points(self, xy_m: F64) -> str:
        """Write places (K, 2) as SVG does."""
        return " ".join(f"{number(x)},{number(y)}" for x, y in self.at(xy_m).tolist())


def draw_plan(plan: Plan, tracks: Sequence[Track], numbered: Sequence[tuple[int, int]]) -> Markup:
    """Draw the map; `numbered` has step and number of each event with a picture."""
    width, height = plan.size
    inside = [*_ways(plan, tracks)]
    x, y, right, base = _box(plan)
    svg = tag(
        "svg",
        tag("clipPath", tag("rect", x=x, y=y, width=right - x, height=base - y), id="inside"),
        _ground(plan),
        tag("g", inside, clip_path="url(#inside)"),
        _numbers(plan, tracks[0], numbered),
        viewBox=f"0 0 {number(width)} {number(height)}",
        role="img",
        aria_label=_said(plan, tracks),
        style=f"max-width:{number(1.25 * width)}px",
    )
    return tag("figure", svg, tag("figcaption", _caption(plan, tracks, bool(numbered))), class_="plan")


def has(track: Track, name: str) -> bool:
    """Tell whether a run's truth or odometry is known anywhere."""
    return bool(np.isfinite(track.path(name)).any())


def _said(plan: Plan, tracks: Sequence[Track]) -> str:
    size = " by ".join(plan.scale.say(side) for side in plan.arena.size_m)
    runs = ", ".join(track.label for track in tracks)
    return f"Map of {size} with the estimated way of {runs}" + (
        " and the true way" if has(tracks[0], "truth") else ""
    )


def _caption(plan: Plan, tracks: Sequence[Track], numbered: bool) -> Iterator[str]:
    yield tag("strong", f"The way ({plan.scale.units.name}).")
    if has(tracks[0], "truth"):
        yield _key("truth", "truth")
    single = len(tracks) == 1
    for number_, track in enumerate(tracks):
        kind = "estimate" if single else f"run{number_}"
        yield _key(kind, "estimate" if single else track.label, None if single else DASHES[number_])
    if has(tracks[0], "odometry"):
        yield _key("odometry", "odometry alone, uncorrected, up to the map's edge", "1.5 4")
    for name, kind in _floor_kinds(plan.arena).items():
        patch = tag("rect", width=16, height=12, class_=kind)
        yield tag(
            "span", tag("svg", patch, viewBox="0 0 16 12", aria_hidden="true"), f" {name}", class_="key"
        )
    yield " Way from the ring to the square. Lines are broken where something jumped"
    yield f" more than {plan.scale.say(LOST_M)} and more than three times what the robot measured."
    if numbered:
        yield " Numbers are those of the pictures below."


def _key(kind: str, text: str, dashes: str | None = None) -> Markup:
    line = tag("line", x1=0, x2=26, y1=6, y2=6, class_="line", stroke_dasharray=dashes)
    sample = tag("svg", line, viewBox="0 0 26 12", width=26, height=12, aria_hidden="true", class_=kind)
    return tag("span", sample, f" {text}", class_="key")


def _box(plan: Plan) -> tuple[float, float, float, float]:
    (left, base), (right, top) = plan.at(np.reshape(plan.arena.bounds, (2, 2)).astype(float)).tolist()
    return left, top, right, base


def _ground(plan: Plan) -> Iterator[Markup]:
    arena = plan.arena
    left, top, right, base = _box(plan)
    yield tag("rect", x=left, y=top, width=right - left, height=base - top, class_="free")
    kinds = _floor_kinds(arena)
    for floor in arena.floors:
        points = plan.points(floor.polygon)
        yield tag("polygon", tag("title", floor.name), points=points, class_=kinds[floor.name])
    for obstacle in arena.obstacles:
        yield tag(
            "polygon", tag("title", obstacle.name), points=plan.points(obstacle.polygon), class_="solid"
        )
    for wall in clipped(arena.walls, arena.bounds):
        (x1, y1), (x2, y2) = plan.at(wall.reshape(2, 2)).tolist()
        yield tag("line", x1=x1, x2=x2, y1=y1, y2=y2, class_="wall")
    yield from _names(plan, arena.obstacles)
    yield from _ruler(plan)


def _floor_kinds(arena: Arena) -> dict[str, str]:
    """Give the class that colors each floor, by its name."""
    names = dict.fromkeys(floor.name for floor in arena.floors)
    others = [name for name in names if name.lower() not in KNOWN_FLOORS]
    return {name: f"floor{others.index(name) % 3}" if name in others else name.lower() for name in names}


def _names(plan: Plan, regions: Sequence[Region]) -> Iterator[Markup]:
    """Write names where they fit; a tooltip says the others."""
    for region in regions:
        corners = plan.at(region.polygon)
        low, high = corners.min(axis=0), corners.max(axis=0)
        if NAME_PX * len(region.name) < 1.25 * (high[0] - low[0]) and high[1] - low[1] > 14:
            x, y = ((low + high) / 2).tolist()
            yield tag("text", region.name, x=x, y=y + 4, text_anchor="middle", class_="name")


def _ruler(plan: Plan) -> Iterator[Markup]:
    x_min, y_min, x_max, y_max = (plan.scale.length(bound) for bound in plan.arena.bounds)
    left, top, right, base = _box(plan)
    per_unit = plan.px_per_m / plan.scale.units.per_m
    unit, step = plan.scale.units.name, plan.scale.units.grid
    for value in ruler(x_min, x_max, step):
        x = left + (value - x_min) * per_unit
        yield tag("line", x1=x, x2=x, y1=base, y2=base + 5, class_="axis")
        yield tag("text", f"{value:g}", x=x, y=base + 18, text_anchor="middle")
    for value in ruler(y_min, y_max, step):
        y = base - (value - y_min) * per_unit
        yield tag("line", x1=left - 5, x2=left, y1=y, y2=y, class_="axis")
        yield tag("text", f"{value:g}", x=left - 8, y=y + 4.5, text_anchor="end")
    yield tag("text", f"x ({unit})", x=right, y=base + 32, text_anchor="end", class_="name")
    yield tag("text", f"y ({unit})", x=2, y=top - 2, class_="name")


def _ways(plan: Plan, tracks: Sequence[Track]) -> Iterator[Markup]:
    first, single = tracks[0], len(tracks) == 1
    moved = first.column("odometry_m")
    yield from _way(plan, first.path("odometry"), moved, "odometry", "1.5 4")
    yield from _way(plan, first.path("truth"), moved, "truth", None, ends=True)
    for run, track in enumerate(tracks):
        kind = "estimate" if single else f"run{run}"
        yield from _way(plan, track.path("estimate"), moved, kind, None if single else DASHES[run], ends=True)


def _way(
    plan: Plan, poses: F64, moved_m: F64, kind: str, dashes: str | None, ends: bool = False
) -> Iterator[Markup]:
    """Draw one way (S, 3), broken at jumps and where it is not known."""
    known = np.isfinite(poses[:, 0])
    if not known.any():
        return
    lines = [
        tag("polyline", points=plan.points(thin(part)), class_="line", stroke_dasharray=dashes)
        for part in unbroken(poses[:, :2], moved_m)
        if len(part) > 1
    ]
    if ends:
        (x1, y1), (x2, y2) = plan.at(poses[known][[0, -1], :2]).tolist()
        lines.append(tag("circle", cx=x1, cy=y1, r=6, class_="ring"))
        lines.append(tag("rect", x=x2 - 4, y=y2 - 4, width=8, height=8, class_="dot"))
    yield tag("g", lines, class_=kind)


def unbroken(places: F64, moved_m: F64) -> list[F64]:
    """Cut a way (S, 2) where a step jumps, and leave out what is not known."""
    far = np.hypot(*np.diff(places, axis=0).T) if len(places) > 1 else np.zeros(0)
    jumps = ~(far <= np.maximum(LOST_M, JUMP_OF_MOTION * moved_m[1:]))  # also where it is not known
    parts = np.split(places, np.flatnonzero(jumps) + 1)
    return [part for part in parts if np.isfinite(part).all()]


def thin(places: F64) -> F64:
    """Leave out steps of a very long way (S, 2), evenly; the ends stay."""
    if len(places) <= MOST_POINTS:
        return places
    return np.asarray(places[np.linspace(0, len(places) - 1, MOST_POINTS).round().astype(int)])


def _numbers(plan: Plan, track: Track, numbered: Sequence[tuple[int, int]]) -> Iterator[Markup]:
    """Put each event's number beside where the robot was, or was thought to be."""
    truth, estimate = track.path("truth"), track.path("estimate")
    places = np.where(np.isfinite(truth), truth, estimate)[:, :2]
    rows = {int(step): row for row, step in enumerate(track.column("step"))}
    taken: list[tuple[float, float]] = []
    for step, label in numbered:
        x, y = plan.at(places[[rows[step]]])[0].tolist()
        at = _free_place(x, y, taken)
        taken.append(at)
        yield tag("line", x1=x, y1=y, x2=at[0], y2=at[1], class_="axis")
        yield badge(*at, label)


def _free_place(x: float, y: float, taken: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Find a place about a point that no other number covers."""
    for radius in (20.0, 38.0, 56.0):
        for angle in np.arange(8) * np.pi / 4 - np.pi / 4:
            at = (x + radius * float(np.cos(angle)), y + radius * float(np.sin(angle)))
            if all(np.hypot(at[0] - a, at[1] - b) > 19 for a, b in taken):
                return at
    return x + 20, y
