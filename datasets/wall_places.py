"""Where windows, doors and posters may be: whole, in the wall they name, and not in each other."""

from __future__ import annotations

from itertools import combinations

from maurice_loaders.errors import LogError

from .hangings import Interval
from .openings import Opening, doors_in, overlap
from .plan import Plan, PosterPlan, RoomPlan, WindowPlan

BEYOND_IN = 24.0  # a window with another room so near behind its wall gets no daylight

Windows = tuple[tuple[WindowPlan, float], ...]  # with the x or y drawn for each


def check_doors(plan: Plan, openings: tuple[Opening, ...]) -> None:
    """Refuse doors in doors: what would stand in each other is their frames."""
    for (first, a), (second, b) in combinations(zip(plan.doors, openings, strict=True), 2):
        if a.rooms == b.rooms and a.axis == b.axis and _share(_framed(a), _framed(b)):
            raise LogError(plan.file, f"{second.key}.rect: stands in {first.key}; leave wall between the two")


def check_windows(plan: Plan, room: RoomPlan, windows: Windows, openings: tuple[Opening, ...]) -> None:
    """Refuse windows that reach beyond their wall, look into a room, or share wall with a door or another."""
    for k, (window, at) in enumerate(windows):
        span = _around(at, window.width_in)
        if not _within_wall(room, window.wall, span) or window.top_in > room.height_in:
            _refuse(plan, room, k, "reaches beyond its wall; move it or make it smaller")
        if behind := _room_behind(plan, room, window.wall, span):
            _refuse(plan, room, k, f"looks into {behind.name!r} ({behind.key}); move it to an outer wall")
        for opening in _doors_on(room, window.wall, openings):
            if _share(span, _framed(opening)):
                _refuse(plan, room, k, "is where a door is; move one of them")
        for j, (other, there) in enumerate(windows[:k]):
            if other.wall == window.wall and _share(span, _around(there, other.width_in)):
                _refuse(plan, room, k, f"is where {room.key}.windows[{j}] is; move one of them")


def check_poster(
    plan: Plan, room: RoomPlan, poster: PosterPlan, at_in: float, openings: tuple[Opening, ...]
) -> None:
    """Refuse posters that reach beyond their wall or hang where a door is."""
    span, top = _around(at_in, poster.size_in[0]), poster.bottom_in + poster.size_in[1]
    if not _within_wall(room, poster.wall, span) or top > room.height_in:
        raise LogError(plan.file, f"{poster.key}: reaches beyond its wall; move it or make it smaller")
    for opening in _doors_on(room, poster.wall, openings):
        if _share(span, _framed(opening)) and poster.bottom_in < opening.top_in:
            raise LogError(plan.file, f"{poster.key}: hangs where a door is; move one of them")


def _refuse(plan: Plan, room: RoomPlan, window: int, why: str) -> None:
    raise LogError(plan.file, f"{room.key}.windows[{window}]: {why}")


def _around(at_in: float, width_in: float) -> Interval:
    return at_in - width_in / 2, at_in + width_in / 2


def _share(a: Interval, b: Interval) -> bool:
    return max(a[0], b[0]) < min(a[1], b[1])


def _framed(opening: Opening) -> Interval:
    return opening.span[0] - opening.margin_in, opening.span[1] + opening.margin_in


def _axis(wall: str) -> int:
    """Give the axis that a wall runs along."""
    return 0 if wall in ("south", "north") else 1


def _within_wall(room: RoomPlan, wall: str, span: Interval) -> bool:
    axis = _axis(wall)
    return room.rect[axis] <= span[0] and span[1] <= room.rect[axis + 2]


def _doors_on(room: RoomPlan, wall: str, openings: tuple[Opening, ...]) -> list[Opening]:
    return [opening for opening, _ in doors_in(room, wall, openings)]


def _room_behind(plan: Plan, room: RoomPlan, wall: str, span: Interval) -> RoomPlan | None:
    """Give the room right behind a stretch of wall."""
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
