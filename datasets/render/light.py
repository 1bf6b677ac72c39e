"""Light: lamps with soft shadows, the sky of each room, dark corners, baked once for every part of a world.

A coarse grid of points on every face asks which lamps it sees past the boxes. Light is linear in its sources,
so a lamp that goes out takes its light and its shadows with it, at the cost of one sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.values import F32, F64, I32, INCH_M, Bool

from ..worlds.world import Box, Face, Lamp, World, inside
from .camera import LitFace, LitScene, halvings, scene_of

# The parts whose light can change separately: every lamp, and both sides of every window.


@dataclass(frozen=True, slots=True)
class LightPart:
    """A source of light, or one side of a window, so that daylight can come from the other."""

    source: str
    side: int = 0  # of a window: 1 left and -1 right, as seen from inside; 0: all of a lamp

    @property
    def whole(self) -> float:
        """Share of what its source gives evenly, like the light of a room, that this part gives."""
        return 0.5 if self.side else 1.0

    def shares(self, lamp: Lamp) -> F64:
        """Return the share of each point (P,) of a lamp of this source that belongs to this part."""
        if not self.side or lamp.facing is None:
            return np.full(len(lamp.points), self.whole)
        left = np.array([lamp.facing[1], -lamp.facing[0]])  # looking at the window, against its light
        along = (lamp.points[:, :2] - lamp.points[:, :2].mean(axis=0)) @ left
        return np.asarray(0.5 + self.side * 0.5 * along / max(float(np.abs(along).max()), 1e-9))


def windows_of(world: World) -> frozenset[str]:
    """Return the sources that are windows: their lamps light one side only."""
    return frozenset(lamp.source for lamp in world.lamps if lamp.facing is not None)


def parts_of(world: World) -> tuple[LightPart, ...]:
    """Return all parts, in the order of the world's sources; of a window first its left side."""
    windows = windows_of(world)
    return tuple(
        LightPart(source, side)
        for source in world.sources
        for side in ((1, -1) if source in windows else (0,))
    )


@dataclass(frozen=True, slots=True)
class Baking:
    """How finely light is computed."""

    spacing_m: float = 3.5 * INCH_M  # between points on a face; soft shadows need no finer
    directions: int = 24  # rays a point that look for dark corners
    reach_m: float = 30 * INCH_M  # things nearer than this take away light of the room
    lift_m: float = 0.1 * INCH_M  # points start this far before their face
    least: float = 0.04  # share of the room's light that seeps in everywhere
    chunk: int = 1500  # points in a batch, so that few boxes are near them
    probe: int = 5  # every so many points of a chunk ask first whether a lamp is seen at all


def hit_distance(start: F32, toward: F32, boxes: tuple[Box, ...]) -> F32:
    """Return how far each ray (R, 3), (R, 3) goes before it meets a box (R,), else inf.

    The slab method (Kay and Kajiya 1986) in each box's own frame; a ray that starts inside a box has gone 0.
    """
    nearest = np.full(len(start), np.inf, dtype=np.float32)
    safe = np.where(np.abs(toward) < 1e-7, np.float32(1e-7), toward)
    for box in boxes:
        cos, sin = np.float32(np.cos(box.yaw_rad)), np.float32(np.sin(box.yaw_rad))
        away = start - np.asarray(box.center, dtype=np.float32)
        enter = np.zeros(len(start), dtype=np.float32)
        leave = np.full(len(start), np.inf, dtype=np.float32)
        for axis in range(3):
            if axis == 2 or box.yaw_rad == 0:
                at, step = away[:, axis], safe[:, axis]
            elif axis == 0:
                at, step = cos * away[:, 0] + sin * away[:, 1], cos * safe[:, 0] + sin * safe[:, 1]
            else:
                at, step = cos * away[:, 1] - sin * away[:, 0], cos * safe[:, 1] - sin * safe[:, 0]
            inverse = 1 / np.where(np.abs(step) < 1e-7, np.float32(1e-7), step)
            middle, reach = -at * inverse, np.abs(box.half[axis] * inverse)
            enter, leave = np.maximum(enter, middle - reach), np.minimum(leave, middle + reach)
        nearest = np.where(enter < leave, np.minimum(nearest, enter), nearest)
    return nearest


def _hemisphere(count: int) -> F64:
    k = np.arange(count) + 0.5
    radius, angle = np.sqrt(k / count), k * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - k / count)], axis=1)


def face_points(face: Face, baking: Baking) -> tuple[F64, tuple[int, int]]:
    """Lay a grid of points (K, 3) just before a face; also its rows and columns."""
    rows = max(2, round(float(np.linalg.norm(face.down)) / baking.spacing_m))
    columns = max(2, round(float(np.linalg.norm(face.across)) / baking.spacing_m))
    t, s = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    points = face.corner + s.reshape(-1, 1) * face.across + t.reshape(-1, 1) * face.down
    return points + face.normal * baking.lift_m, (rows, columns)


def openness(points: F64, normals: F64, boxes: tuple[Box, ...], baking: Baking) -> F64:
    """Return how open the view from each point (K, 3) along its normal (K, 3) is: (K,) from `least` to 1."""
    side = np.where(np.abs(normals[:, 2:]) > 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    first = np.cross(side, normals)
    second = np.cross(normals, first)
    total = np.zeros(len(points))
    for a, b, c in _hemisphere(baking.directions):
        toward = a * first + b * second + c * normals
        far = hit_distance(points.astype(np.float32), toward.astype(np.float32), boxes)
        total += np.clip(far / baking.reach_m, 0, 1)
    return np.asarray(np.maximum(total / baking.directions, baking.least))


def carried(points: F64, normals: F64, lamp: Lamp, boxes: tuple[Box, ...], probe: int = 1) -> F64:
    """Return how much of each of a lamp's points (P) arrives at points (K, 3) with normals (K, 3): (P, K).

    With `probe` above 1 only every so many points ask first for the lamp's first and last point.
    """
    total = np.zeros((len(lamp.points), len(points)))
    ends = lamp.points[[0, -1]]
    if probe > 1 and not any(arriving(points[::probe], normals[::probe], lamp, p, boxes).any() for p in ends):
        return total
    for row, source in zip(total, lamp.points, strict=True):
        row[:] = arriving(points, normals, lamp, source, boxes)
    return total


def arriving(points: F64, normals: F64, lamp: Lamp, source: F64, boxes: tuple[Box, ...]) -> F64:
    """Return how much of one point (3,) of a lamp arrives at points (K, 3): (K,)."""
    ray = source - points
    distance = np.maximum(np.linalg.norm(ray, axis=1), 0.15)
    toward = ray / distance[:, None]
    slant = np.clip(np.sum(toward * normals, axis=1), 0, None)
    if lamp.facing is not None:
        slant = slant * np.clip(-(toward @ lamp.facing), 0, None)
    result, lit = np.zeros(len(points)), np.flatnonzero(slant > 0)
    if len(lit):
        between = boxes_within(boxes, np.vstack([points[lit], source]))
        seen = lit[reached(points[lit], toward[lit], distance[lit] - 0.01, between)]
        result[seen] = slant[seen] / distance[seen] ** 2
    return result


def reached(start: F64, toward: F64, distance: F64, boxes: tuple[Box, ...]) -> I32:
    """Number the rays (R, 3), (R, 3) that go `distance` (R,) without meeting a box; largest boxes first."""
    alive = np.arange(len(start), dtype=np.int32)
    origin, way = start.T.astype(np.float32), toward.T.astype(np.float32)
    far = distance.astype(np.float32)
    for box in boxes:
        clear = ~blocked(origin, way, far, box)
        if not clear.all():
            alive, origin, way, far = alive[clear], origin[:, clear], way[:, clear], far[clear]
        if not len(alive):
            break
    return alive


def blocked(origin: F32, way: F32, far: F32, box: Box) -> Bool:
    """Return which rays (3, R), (3, R) meet one box within `far` (R,)."""
    away = origin - np.array(box.center, dtype=np.float32)[:, None]
    if box.yaw_rad:
        cos, sin = np.float32(np.cos(box.yaw_rad)), np.float32(np.sin(box.yaw_rad))
        into = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]], dtype=np.float32)
        away, way = into @ away, into @ way
    inverse = 1 / np.where(np.abs(way) < 1e-7, np.float32(1e-7), way)
    middle, reach = -away * inverse, np.abs(np.array(box.half, dtype=np.float32)[:, None] * inverse)
    enter = np.maximum((middle - reach).max(axis=0), 0)
    return np.asarray((enter < (middle + reach).min(axis=0)) & (enter <= far))


@lru_cache(maxsize=4)
def _extents(boxes: tuple[Box, ...]) -> tuple[F64, F64]:
    center, half = np.array([box.center for box in boxes]), np.array([box.half for box in boxes])
    turn = np.array([(abs(np.cos(box.yaw_rad)), abs(np.sin(box.yaw_rad))) for box in boxes])
    x = turn[:, 0] * half[:, 0] + turn[:, 1] * half[:, 1]
    y = turn[:, 1] * half[:, 0] + turn[:, 0] * half[:, 1]
    reach = np.stack([x, y, half[:, 2]], axis=1)
    return center - reach, center + reach


def boxes_within(boxes: tuple[Box, ...], points: F64, margin_m: float = 0.0) -> tuple[Box, ...]:
    """Return the boxes that touch the upright box around points (K, 3), the largest first."""
    if not boxes:
        return ()
    low, high = _extents(boxes)
    first, last = points.min(axis=0) - margin_m, points.max(axis=0) + margin_m
    touching = np.flatnonzero(((low <= last) & (high >= first)).all(axis=1))
    size = np.sort(high[touching] - low[touching], axis=1)
    return tuple(boxes[k] for k in touching[np.argsort(-size[:, 1] * size[:, 2], kind="stable")])


def irradiance_by_part(
    world: World, parts: tuple[LightPart, ...], points: F64, normals: F64, baking: Baking
) -> F64:
    """Return the light (S, K, 3) of each part at points (K, 3) with normals (K, 3)."""
    light = np.zeros((len(parts), len(points), 3))
    probe = baking.probe if len(points) > baking.chunk // 4 else 1
    for lamp in world.lamps:
        arrives = carried(points, normals, lamp, world.boxes, probe) / len(lamp.points)
        for k, part in enumerate(parts):
            if part.source == lamp.source:
                light[k] += (part.shares(lamp) @ arrives)[:, None] * lamp.color
    near = boxes_within(world.boxes, points, baking.reach_m)
    view = openness(points, normals, near, baking)
    for room in world.room_lights:
        here = (inside(room.room.polygon, points[:, :2]) * view)[:, None] * room.ambient
        for k, part in enumerate(parts):
            if part.source == room.source:
                light[k] += here * part.whole
    return light


def seen_past(point: F64, targets: F64, boxes: tuple[Box, ...]) -> Bool:
    """Return which targets (P, 3) can be seen from a point (3,) past boxes, by the slab method."""
    if not boxes:
        return np.ones(len(targets), dtype=bool)
    cos, sin = np.array([(np.cos(box.yaw_rad), np.sin(box.yaw_rad)) for box in boxes]).T
    half = np.array([box.half for box in boxes])
    away = point - np.array([box.center for box in boxes])  # (B, 3)
    step = np.broadcast_to((targets - point)[:, None], (len(targets), len(boxes), 3))
    at, by = into(away, cos, sin), into(step, cos, sin)
    by = np.where(np.abs(by) < 1e-9, 1e-9, by)
    enter = ((-at - np.sign(by) * half) / by).max(axis=-1)
    leave = ((-at + np.sign(by) * half) / by).min(axis=-1)
    blocked = (enter < leave) & (leave > 0) & (enter < 0.995)
    return np.asarray(~blocked.any(axis=1))


def into(vectors: F64, cos: F64, sin: F64) -> F64:
    """Turn vectors (..., B, 3) into the frames of B boxes."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class PartLight:
    """What one part gives, kept only where it gives anything."""

    where: I32  # (n,) points
    light: F32  # (n, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Lighting:
    """The light that each part throws on each face."""

    faces: tuple[Face, ...]
    parts: tuple[LightPart, ...]  # S of them
    by_part: tuple[PartLight, ...]  # S; glow included
    shapes: tuple[tuple[int, int], ...]  # rows and columns of each face's grid, one after the other
    total: F32  # (K, 3) of all parts together

    def under(self, weights: F64) -> F32:
        """Add up the light (K, 3) of all parts under weights (S, 3)."""
        result = self.total.copy()
        for part, weight in zip(self.by_part, weights, strict=True):
            if (weight != 1).any():  # most parts of most pictures are as they were at the survey
                result[part.where] += part.light * (weight - 1).astype(np.float32)
        return np.asarray(np.maximum(result, 0))  # a difference of rounded numbers

    def grids(self) -> list[F32]:
        """Return the light (rows, columns, 3) of all parts together on each face."""
        ends = np.cumsum([rows * columns for rows, columns in self.shapes])[:-1]
        pieces = zip(np.split(self.total, ends), self.shapes, strict=True)
        return [grid.reshape(*shape, 3) for grid, shape in pieces]


@lru_cache(maxsize=2)
def lighting_of(world: World, baking: Baking | None = None) -> Lighting:
    """Bake a world; kept for the two last ones."""
    baking = baking or Baking()
    parts = parts_of(world)
    grids = [face_points(face, baking) for face in world.faces]
    points = np.concatenate([points for points, _ in grids])
    normals = np.repeat([face.normal for face in world.faces], [len(p) for p, _ in grids], axis=0)
    chunks = [slice(a, a + baking.chunk) for a in range(0, len(points), baking.chunk)]
    light = [irradiance_by_part(world, parts, points[c], normals[c], baking) for c in chunks]
    shapes = tuple(shape for _, shape in grids)
    smooth = smoothed(np.concatenate(light, axis=1).astype(np.float32), shapes)
    glowing = with_glow(world, parts, shapes, smooth)
    total = glowing.sum(axis=0)
    if world.twins:
        glowing, total = as_twins(world, parts, shapes, glowing, total)
    by_part = tuple(_only_where_lit(light) for light in glowing)
    return Lighting(world.faces, parts, by_part, shapes, total)


def as_twins(
    world: World, parts: tuple[LightPart, ...], shapes: tuple[tuple[int, int], ...], light: F32, total: F32
) -> tuple[F32, F32]:
    """Give the turned half of a world the first half's light (S, K, 3) and total (K, 3), to the last bit."""
    shell, rest = len(world.shell) // 2, sum(len(piece.faces) for piece in world.furniture) // 2
    ends = np.cumsum([0, *(rows * columns for rows, columns in shapes)])
    other = [parts.index(replace(part, source=world.twin_of(part.source))) for part in parts]
    light, total, twin_light = light.copy(), total.copy(), light[other]
    for first, count in ((0, shell), (2 * shell, rest)):
        here = slice(ends[first], ends[first + count])
        there = slice(ends[first + count], ends[first + 2 * count])
        light[:, there], total[there] = twin_light[:, here], total[here]
    return light, total


def _only_where_lit(light: F32) -> PartLight:
    where = np.flatnonzero(light.any(axis=1)).astype(np.int32)
    return PartLight(where, light[where])


def smoothed(light: F32, shapes: tuple[tuple[int, int], ...]) -> F32:
    """Blur the grids of all faces in light (S, K, 3) a little, each by itself."""
    result, first = np.empty_like(light), 0
    for rows, columns in shapes:
        here = slice(first, first + rows * columns)
        for before, after in zip(light[:, here], result[:, here], strict=True):
            grid = before.reshape(rows, columns, 3)
            soft = cv2.GaussianBlur(grid, (3, 3), 0.7, borderType=cv2.BORDER_REPLICATE)
            after[:] = soft.reshape(-1, 3)
        first = here.stop
    return result


def with_glow(
    world: World, parts: tuple[LightPart, ...], shapes: tuple[tuple[int, int], ...], light: F32
) -> F32:
    """Add the glow of shades and window panes (S, K, 3); it belongs to the lamp that is nearest."""
    result, first = light.copy(), 0
    for face, (rows, columns) in zip(world.faces, shapes, strict=True):
        if face.glow:
            source = nearest_source(world, face)
            for k, part in enumerate(parts):
                if part.source == source:
                    result[k, first : first + rows * columns] += np.float32(face.glow * part.whole)
        first += rows * columns
    return result


def nearest_source(world: World, face: Face) -> str:
    """Return the source of the lamp nearest to the middle of a face; without lamps the first source."""
    middle = face.corner + (face.across + face.down) / 2
    far = {lamp.source: float(np.linalg.norm(lamp.points - middle, axis=1).min()) for lamp in world.lamps}
    return min(far, key=far.__getitem__, default=(*world.sources, "")[0])


def bake(world: World) -> LitScene:
    """Light every face of a world as the survey has it."""
    lighting = lighting_of(world)
    return scene_of(tuple(lit(face, grid) for face, grid in zip(world.faces, lighting.grids(), strict=True)))


def lit(face: Face, light: F32) -> LitFace:
    """Multiply a face by its light (rows, columns, 3), enlarged to the texture."""
    rows, columns = face.albedo.shape[:2]
    full = cv2.resize(light, (columns, rows), interpolation=cv2.INTER_LINEAR)
    radiance = face.albedo * full
    return LitFace(face.corner, face.across, face.down, halvings(radiance.astype(np.float32)))


def unlit(lighting: Lighting) -> LitScene:
    """Prepare faces whose light changes, under the light of all parts; `relit` gives them another."""
    firsts = np.cumsum([0, *(rows * columns for rows, columns in lighting.shapes)])
    faces = (
        LitFace(face.corner, face.across, face.down, halvings(face.albedo), (int(first), *shape))
        for face, first, shape in zip(lighting.faces, firsts, lighting.shapes, strict=False)
    )
    return scene_of(tuple(faces), lighting.total)


def relit(scene: LitScene, light: F32) -> LitScene:
    """Put other light (K, 3) on the faces of an `unlit` scene."""
    return replace(scene, light=light)
