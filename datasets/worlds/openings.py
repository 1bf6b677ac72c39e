"""Doors and windows: which rooms a door joins, and where things may be on a wall."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from maurice_mcl.values import F64

from .hangings import Interval, Wall
from .plan import DoorPlan, PosterPlan, Rect, RoomPlan, WindowPlan, Word, WorldError, WorldPlan

CASING_IN = 2.7  # how far the frame of a door covers the wall beside it
THIN_IN = 3.0  # no wall between rooms is thinner


@dataclass(frozen=True, slots=True)
class Opening:
    """A door gap between two rooms: through the wall along `axis`, from one room's side to the other's."""

    axis: int  # 0: one goes through along x
    rooms: tuple[str, str]  # the one at lower x or y first
    gap: Interval  # from wall to wall, along the axis
    span: Interval  # how wide, across the axis
    top_in: float
    frame: Word | None

    @property
    def rect(self) -> Rect:
        """Return what it takes up on the plan."""
        (a, b), (c, d) = self.gap, self.span
        return (a, c, b, d) if self.axis == 0 else (c, a, d, b)

    @property
    def margin_in(self) -> float:
        """Return how far its frame overlaps the walls beside it."""
        return 0.0 if self.frame is None else CASING_IN

    def point(self, along: float, across: float) -> tuple[float, float]:
        """Return a plan point from how far along the axis and across it."""
        return (along, across) if self.axis == 0 else (across, along)


def overlap(a: Rect, b: Rect, axis: int) -> Interval:
    """Return what two rectangles share along an axis; end before start means nothing."""
    return max(a[axis], b[axis]), min(a[axis + 2], b[axis + 2])


def check_rooms(plan: WorldPlan) -> None:
    """Raise WorldError for rooms that overlap or have no wall between."""
    for k, a in enumerate(plan.rooms):
        for b in plan.rooms[:k]:
            if all(high - low > -THIN_IN for low, high in (overlap(a.rect, b.rect, i) for i in (0, 1))):
                why = f"{a.key}.rect: {a.name!r} overlaps or touches {b.name!r} ({b.key})"
                raise WorldError(plan.file, f"{why}; leave room for the wall between them")


def opening_of(plan: WorldPlan, door: DoorPlan) -> Opening:
    """Find the two rooms that a door joins and the wall it goes through; WorldError if it joins none."""
    shared = {r: [overlap(door.rect, r.rect, axis) for axis in (0, 1)] for r in plan.rooms}
    joined = [r for r, both in shared.items() if all(high >= low for low, high in both)]
    joined.sort(key=lambda room: room.rect[:2])
    if len(joined) == 2 and (opening := _between(door, *joined)) is not None:
        return opening
    names = " and ".join(repr(room.name) for room in joined) or "no room"
    raise WorldError(
        plan.file,
        f"{door.key}.rect: reaches {names}, expected two rooms on either side of one wall; "
        "let it reach from one into the other and nowhere beyond the wall they share",
    )


def _between(door: DoorPlan, first: RoomPlan, second: RoomPlan) -> Opening | None:
    for axis in (0, 1):
        low, high = sorted((first, second), key=lambda room: room.rect[axis])
        gap = (low.rect[axis + 2], high.rect[axis])
        across = 1 - axis
        span = (door.rect[across], door.rect[across + 2])
        shared = overlap(low.rect, high.rect, across)
        if gap[0] < gap[1] and shared[0] <= span[0] and span[1] <= shared[1]:
            top = min(door.top_in, first.height_in, second.height_in)
            return Opening(axis, (low.name, high.name), gap, span, top, door.frame)
    return None


def corners(rect: Rect) -> tuple[tuple[float, float], ...]:
    """Return the four corners of a room: south-east, south-west, north-west, north-east."""
    x1, y1, x2, y2 = rect
    return (x2, y1), (x1, y1), (x1, y2), (x2, y2)


def wall_of(room: RoomPlan, name: str) -> Wall:
    """Return a complete wall of a room as seen from inside."""
    southeast, southwest, northwest, northeast = corners(room.rect)
    return {
        "south": Wall(southeast, southwest),
        "west": Wall(southwest, northwest),
        "north": Wall(northwest, northeast),
        "east": Wall(northeast, southeast),
    }[name]


def along(wall: Wall, at_in: float) -> float:
    """Turn an x (north, south) or y (east, west) on the map into a distance from the wall's left end."""
    axis = 0 if wall.left[1] == wall.right[1] else 1
    return abs(at_in - wall.left[axis])


def doors_in(room: RoomPlan, name: str, openings: tuple[Opening, ...]) -> list[tuple[Opening, Interval]]:
    """Return the openings in one wall of a room, with where they are along it, from left to right."""
    axis, side = {"west": (0, 1), "east": (0, 0), "south": (1, 1), "north": (1, 0)}[name]
    wall = wall_of(room, name)
    doors = []
    for opening in openings:
        if opening.axis == axis and opening.rooms[side] == room.name:
            a, b = sorted(along(wall, end) for end in opening.span)
            doors.append((opening, (a, b)))
    return sorted(doors, key=lambda item: item[1])


def rest_of(wall: Wall, taken: list[Interval]) -> list[Interval]:
    """Return the stretches of a wall between what is taken out of it."""
    edges = [0.0, *(edge for interval in taken for edge in interval), wall.length_in]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 0.01]


def stretch(wall: Wall, interval: Interval) -> Wall:
    """Cut a stretch out of a wall."""
    left, right = wall.at(interval[0]), wall.at(interval[1])
    return Wall((float(left[0]), float(left[1])), (float(right[0]), float(right[1])))


def map_walls(plan: WorldPlan, openings: tuple[Opening, ...]) -> F64:
    """Return the walls of the map (W, 4) in inches: outlines of rooms without doors, and the doors' jambs."""
    lines = []
    for room in plan.rooms:
        for name in ("south", "west", "north", "east"):
            wall = wall_of(room, name)
            for part in rest_of(wall, [where for _, where in doors_in(room, name, openings)]):
                lines.append([*wall.at(part[0]), *wall.at(part[1])])
    for opening in openings:
        for edge in opening.span:
            lines.append([*opening.point(opening.gap[0], edge), *opening.point(opening.gap[1], edge)])
    return np.array(lines)


# Where windows, doors and posters may be: entirely in the wall they name, and not overlapping.

BEYOND_IN = 24.0  # a window with another room so near behind its wall gets no daylight

Windows = tuple[tuple[WindowPlan, float], ...]  # with the x or y drawn for each


def check_doors(plan: WorldPlan, openings: tuple[Opening, ...]) -> None:
    """Raise WorldError for doors that overlap: their frames would."""
    for (first, a), (second, b) in combinations(zip(plan.doors, openings, strict=True), 2):
        if a.rooms == b.rooms and a.axis == b.axis and _share(_framed(a), _framed(b)):
            why = f"stands in {first.key}; leave wall between the two"
            raise WorldError(plan.file, f"{second.key}.rect: {why}")


def check_windows(plan: WorldPlan, room: RoomPlan, windows: Windows, openings: tuple[Opening, ...]) -> None:
    """Raise WorldError for windows beyond their wall, into another room, or over a door or window."""
    for k, (window, at) in enumerate(windows):
        span = _span(at, window.width_in)
        if not _within_wall(room, window.wall, span) or window.top_in > room.height_in:
            _refuse(plan, room, k, "reaches beyond its wall; move it or make it smaller")
        if behind := _room_behind(plan, room, window.wall, span):
            _refuse(plan, room, k, f"looks into {behind.name!r} ({behind.key}); move it to an outer wall")
        for opening in _doors_on(room, window.wall, openings):
            if _share(span, _framed(opening)):
                _refuse(plan, room, k, "is where a door is; move one of them")
        for j, (other, there) in enumerate(windows[:k]):
            if other.wall == window.wall and _share(span, _span(there, other.width_in)):
                _refuse(plan, room, k, f"is where {room.key}.windows[{j}] is; move one of them")


def check_poster(
    plan: WorldPlan, room: RoomPlan, poster: PosterPlan, at_in: float, openings: tuple[Opening, ...]
) -> None:
    """Raise WorldError for posters that reach beyond their wall or hang where a door is."""
    span, top = _span(at_in, poster.size_in[0]), poster.bottom_in + poster.size_in[1]
    if not _within_wall(room, poster.wall, span) or top > room.height_in:
        raise WorldError(plan.file, f"{poster.key}: reaches beyond its wall; move it or make it smaller")
    for opening in _doors_on(room, poster.wall, openings):
        if _share(span, _framed(opening)) and poster.bottom_in < opening.top_in:
            raise WorldError(plan.file, f"{poster.key}: hangs where a door is; move one of them")


def _refuse(plan: WorldPlan, room: RoomPlan, window: int, why: str) -> None:
    raise WorldError(plan.file, f"{room.key}.windows[{window}]: {why}")


def _span(at_in: float, width_in: float) -> Interval:
    return at_in - width_in / 2, at_in + width_in / 2


def _share(a: Interval, b: Interval) -> bool:
    return max(a[0], b[0]) < min(a[1], b[1])


def _framed(opening: Opening) -> Interval:
    return opening.span[0] - opening.margin_in, opening.span[1] + opening.margin_in


def _axis(wall: str) -> int:
    return 0 if wall in ("south", "north") else 1


def _within_wall(room: RoomPlan, wall: str, span: Interval) -> bool:
    axis = _axis(wall)
    return room.rect[axis] <= span[0] and span[1] <= room.rect[axis + 2]


def _doors_on(room: RoomPlan, wall: str, openings: tuple[Opening, ...]) -> list[Opening]:
    return [opening for opening, _ in doors_in(room, wall, openings)]


def _room_behind(plan: WorldPlan, room: RoomPlan, wall: str, span: Interval) -> RoomPlan | None:
    axis = _axis(wall)
    x1, y1, x2, y2 = room.rect
    low, high = {
        "south": (y1 - BEYOND_IN, y1),
        "north": (y2, y2 + BEYOND_IN),
        "west": (x1 - BEYOND_IN, x1),
        "east": (x2, x2 + BEYOND_IN),
    }[wall]
    strip = (span[0], low, span[1], high) if axis == 0 else (low, span[0], high, span[1])
    for other in plan.rooms:
        if other is not room and all(a < b for a, b in (overlap(strip, other.rect, i) for i in (0, 1))):
            return other
    return None
