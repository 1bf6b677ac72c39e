"""Which rooms a door joins, and what is left of walls beside it: plan geometry in inches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_loaders.errors import LogError
from maurice_mcl.typing import F64

from .hangings import Interval, Wall
from .plan import DoorPlan, Plan, Rect, RoomPlan, Word

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
        """What it takes up on the plan."""
        (a, b), (c, d) = self.gap, self.span
        return (a, c, b, d) if self.axis == 0 else (c, a, d, b)

    @property
    def margin_in(self) -> float:
        """How far its frame covers the walls beside it."""
        return 0.0 if self.frame is None else CASING_IN

    def point(self, along: float, across: float) -> tuple[float, float]:
        """Give a plan point from how far along the axis and across it."""
        return (along, across) if self.axis == 0 else (across, along)


def overlap(a: Rect, b: Rect, axis: int) -> Interval:
    """Give what two rectangles share along an axis; the end comes before the start where they share none."""
    return max(a[axis], b[axis]), min(a[axis + 2], b[axis + 2])


def check_rooms(plan: Plan) -> None:
    """Refuse rooms that overlap or have no wall between."""
    for k, a in enumerate(plan.rooms):
        for b in plan.rooms[:k]:
            if all(high - low > -THIN_IN for low, high in (overlap(a.rect, b.rect, i) for i in (0, 1))):
                raise LogError(
                    plan.file,
                    f"{a.key}.rect: {a.name!r} overlaps or touches {b.name!r} ({b.key}); "
                    "leave room for the wall between them",
                )


def opening_of(plan: Plan, door: DoorPlan) -> Opening:
    """Find the two rooms that a door joins and the wall it goes through; LogError where it joins none."""
    joined = sorted(
        (
            r
            for r in plan.rooms
            if all(high >= low for low, high in (overlap(door.rect, r.rect, i) for i in (0, 1)))
        ),
        key=lambda room: room.rect[:2],
    )
    for k, first in enumerate(joined):
        for second in joined[k + 1 :]:
            found = _between(door, first, second)
            if found is not None and len(joined) == 2:
                return found
    names = " and ".join(repr(room.name) for room in joined) or "no room"
    raise LogError(
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
    """Give the four corners of a room: south-east, south-west, north-west, north-east."""
    x1, y1, x2, y2 = rect
    return (x2, y1), (x1, y1), (x1, y2), (x2, y2)


def wall_of(room: RoomPlan, name: str) -> Wall:
    """Give a whole wall of a room as seen from inside."""
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
    """Give the openings in one wall of a room, with where they are along it, from left to right."""
    axis, side = {"west": (0, 1), "east": (0, 0), "south": (1, 1), "north": (1, 0)}[name]
    wall = wall_of(room, name)
    found = []
    for opening in openings:
        if opening.axis == axis and opening.rooms[side] == room.name:
            a, b = sorted(along(wall, end) for end in opening.span)
            found.append((opening, (a, b)))
    return sorted(found, key=lambda item: item[1])


def rest_of(wall: Wall, taken: list[Interval]) -> list[Interval]:
    """Give the stretches of a wall between what is taken out of it."""
    edges = [0.0, *(edge for interval in taken for edge in interval), wall.length_in]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 0.01]


def stretch(wall: Wall, interval: Interval) -> Wall:
    """Cut a stretch out of a wall."""
    left, right = wall.at(interval[0]), wall.at(interval[1])
    return Wall((float(left[0]), float(left[1])), (float(right[0]), float(right[1])))


def map_walls(plan: Plan, openings: tuple[Opening, ...]) -> F64:
    """Give the walls of the map (W, 4) in inches: outlines of rooms without doors, and the doors' jambs."""
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
