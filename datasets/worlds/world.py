"""A simulated world as plain data: textured faces, solid boxes, lamps, and the map that goes with them.

Renderer, surveyor and robot take a `World` as an argument and know nothing of how it was made. Everything
is in meters; z points up and the floor is z = 0. Colors are linear (not gamma-coded) RGB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.values import F32, F64, Arena, Bool, Region


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A textured parallelogram, seen from one side: where `across` points right and `down` points down."""

    corner: F64  # (3,) top left, as seen from its front
    across: F64  # (3,) from the top left to the top right corner
    down: F64  # (3,) from the top left to the bottom left corner
    albedo: F32  # (H, W, 3) share of light given back, 0 to 1, top row first
    glow: float = 0.0  # radiance of its own in units of `albedo`; above 0 for windows and lamp shades

    @property
    def normal(self) -> F64:
        """Return the unit vector (3,) out of the side that can be seen."""
        out = np.cross(self.down, self.across)
        return out / np.linalg.norm(out)


@dataclass(frozen=True, slots=True)
class Box:
    """A solid box that stands upright; it throws shadows. Its faces are separate."""

    center: tuple[float, float, float]
    half: tuple[float, float, float]  # half the width, depth and height, before turning
    yaw_rad: float = 0.0  # counter-clockwise


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """Something that gives light: a few points that stand for its surface."""

    source: str  # what it is one of, like "west room lamp": lights go out and grow dim by source
    points: F64  # (K, 3)
    color: F64  # (3,) intensity of all points together: radiance of a white face 1 m away
    facing: F64 | None = None  # (3,) unit vector for windows, which light one side only; None: all around


@dataclass(frozen=True, slots=True, eq=False)
class RoomLight:
    """Light of one source that comes from everywhere in one room, after many bounces."""

    source: str  # the lamp or window it began at
    room: Region
    ambient: F64  # (3,) radiance of an open white face


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One piece of furniture; it may be moved after the survey."""

    name: str
    faces: tuple[Face, ...]
    boxes: tuple[Box, ...]
    plan: F64  # (4, 2) outline on the floor, meters


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """A place to drive in: what can be seen, what is solid, its map, and where references are taken."""

    name: str
    arena: Arena
    shell: tuple[Face, ...]  # floors, ceilings, walls and what hangs on them
    solid: tuple[Box, ...]  # walls, floors and ceilings as boxes, to throw shadows
    furniture: tuple[Piece, ...]
    lamps: tuple[Lamp, ...]
    room_lights: tuple[RoomLight, ...]
    nodes: F64  # (K, 2) free nodes of the library's grid
    headings: int  # references a node
    start: F64 | None = None  # (3,) pose that its file names as a place to start from; most name none
    twins: bool = False  # the second half of shell, furniture and lamps is the first, turned by half a turn

    @property
    def faces(self) -> tuple[Face, ...]:
        """Return all that can be seen."""
        return (*self.shell, *(face for piece in self.furniture for face in piece.faces))

    @property
    def boxes(self) -> tuple[Box, ...]:
        """Return all that throws shadows."""
        return (*self.solid, *(box for piece in self.furniture for box in piece.boxes))

    @property
    def sources(self) -> tuple[str, ...]:
        """Return the names of its sources of light, in order, each once."""
        lamps, rooms = [lamp.source for lamp in self.lamps], [room.source for room in self.room_lights]
        return tuple(dict.fromkeys(lamps + rooms))

    def turned(self, points: F64) -> F64:
        """Return points (..., 2 or 3) after half a turn about the middle of the map."""
        result = np.array(points, np.float64)
        result[..., :2] = np.add(self.arena.bounds[:2], self.arena.bounds[2:]) - result[..., :2]
        return result

    def twin_of(self, source: str) -> str:
        """Return the source of the other room, where two rooms are twins."""
        first, second = (room.name for room in self.arena.rooms)
        return second + source[len(first) :] if source.startswith(first) else first + source[len(second) :]


def inside(polygon: F64, points: F64) -> Bool:
    """Return which points (K, 2) lie inside a polygon (P, 2), by counting crossings."""
    x, y = points[:, 0], points[:, 1]
    result = np.zeros(len(points), dtype=bool)
    for (x1, y1), (x2, y2) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y1 != y2:
            crosses = ((y1 > y) != (y2 > y)) & (x < (x2 - x1) * (y - y1) / (y2 - y1) + x1)
            result = result ^ crosses
    return result


def floor_at(arena: Arena, x_m: float, y_m: float) -> str:
    """Return the name of the topmost floor at a point; "" where there is none."""
    for floor in reversed(arena.floors):
        if _holds(floor.polygon, x_m, y_m):
            return floor.name
    return ""


def _holds(polygon: F64, x: float, y: float) -> bool:
    """Return what `inside` returns, of one point: a drive asks for thousands, one at a time."""
    corners, within = polygon.tolist(), False
    for (x1, y1), (x2, y2) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (y1 > y) != (y2 > y) and x < (x2 - x1) * (y - y1) / (y2 - y1) + x1:
            within = not within
    return within


def sides_of(polygon: F64) -> F64:
    """Return the sides (P, 4) of a polygon (P, 2)."""
    return np.concatenate([polygon, np.roll(polygon, -1, axis=0)], axis=1)


def segments_of(arena: Arena) -> F64:
    """Return all walls, and the sides of all obstacles: (S, 4)."""
    return np.concatenate([arena.walls, *(sides_of(obstacle.polygon) for obstacle in arena.obstacles)])


def cast(point: F64, headings_rad: F64, segments: F64) -> F64:
    """Return how far (B,) it is from a point (2,) along headings (B,) to a segment (S, 4), else inf."""
    along = np.stack([np.cos(headings_rad), np.sin(headings_rad)], axis=1)[:, None]  # (B, 1, 2)
    side, away = segments[:, 2:] - segments[:, :2], segments[:, :2] - point
    cross = along[..., 0] * side[:, 1] - along[..., 1] * side[:, 0]  # (B, S)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (away[:, 0] * side[:, 1] - away[:, 1] * side[:, 0]) / cross
        share = (away[:, 0] * along[..., 1] - away[:, 1] * along[..., 0]) / cross
        hit = (far >= 0) & (share >= 0) & (share <= 1)
    return np.asarray(np.where(hit, far, np.inf).min(axis=1, initial=np.inf))


def segment_distance(points: F64, segments: F64) -> F64:
    """Return the distance (K,) of points (K, 2) to the nearest segment (S, 4)."""
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    away = points[:, None] - start
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-12)
    share = np.clip(np.sum(away * along, axis=2) / length2, 0, 1)
    gap = away - share[..., None] * along
    return np.asarray(np.sqrt(np.sum(gap**2, axis=2).min(axis=1)))


def clearance(arena: Arena, points: F64) -> F64:
    """Return the distance (K,) from points (K, 2) to the nearest wall or obstacle; 0 inside obstacles."""
    distance = segment_distance(points, segments_of(arena))
    for obstacle in arena.obstacles:
        distance = np.where(inside(obstacle.polygon, points), 0.0, distance)
    return distance


def touching(a: F64, b: F64) -> bool:
    """Return whether two rectangles (4, 2) share any ground: no side separates them."""
    for outline_, other in ((a, b), (b, a)):
        for k in range(len(outline_)):
            side = outline_[(k + 1) % len(outline_)] - outline_[k]
            out = np.array([side[1], -side[0]])
            if ((other - outline_[k]) @ out >= -1e-9).all():
                return False
    return True
