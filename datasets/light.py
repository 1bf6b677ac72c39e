"""Light baked into textures once: lamps with soft shadows, open sky of each room, dark corners.

A coarse grid of points on every face asks which lamps it sees past the boxes; the result is enlarged to the
texture. After that a picture costs only the warping of faces.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.geometry import INCH_M
from maurice_mcl.typing import F32, F64

from .world import Box, Face, Lamp, World, inside


@dataclass(frozen=True, slots=True)
class Baking:
    """How finely light is computed."""

    spacing_m: float = 3.5 * INCH_M  # between points on a face; soft shadows need no finer
    directions: int = 24  # rays a point that look for dark corners
    reach_m: float = 30 * INCH_M  # things nearer than this take away light of the room
    lift_m: float = 0.1 * INCH_M  # points start this far before their face
    least: float = 0.04  # share of the room's light that seeps in everywhere
    chunk: int = 24_000  # rays at once: bounds memory to about 100 MB


@dataclass(frozen=True, slots=True, eq=False)
class LitFace:
    """A face with the light it gives off, at full size and halved again and again."""

    corner: F64  # (3,) as in Face
    across: F64  # (3,)
    down: F64  # (3,)
    levels: tuple[F32, ...]  # (H, W, 3) linear radiance; each level has half the rows and columns


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What a camera needs to know of a world."""

    faces: tuple[LitFace, ...]
    corner: F64  # (F, 3) of all faces together, as in LitFace
    across: F64  # (F, 3)
    down: F64  # (F, 3)


def scene_of(faces: tuple[LitFace, ...]) -> Scene:
    """Gather lit faces."""
    corner = np.stack([face.corner for face in faces])
    across = np.stack([face.across for face in faces])
    return Scene(faces, corner, across, np.stack([face.down for face in faces]))


def hit_distance(start: F32, toward: F32, boxes: tuple[Box, ...]) -> F32:
    """Give how far each ray (R, 3), (R, 3) goes before it meets a box: (R,), inf where it meets none.

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


def hemisphere(count: int) -> F64:
    """Give `count` unit vectors around +z, as dense as the cosine (a Fibonacci spiral)."""
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
    """Give how open the view from each point (K, 3) along its normal (K, 3) is: (K,) from `least` to 1."""
    side = np.where(np.abs(normals[:, 2:]) > 0.9, [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])
    first = np.cross(side, normals)
    second = np.cross(normals, first)
    total = np.zeros(len(points))
    for a, b, c in hemisphere(baking.directions):
        toward = a * first + b * second + c * normals
        far = hit_distance(points.astype(np.float32), toward.astype(np.float32), boxes)
        total += np.clip(far / baking.reach_m, 0, 1)
    return np.asarray(np.maximum(total / baking.directions, baking.least))


def lamp_light(points: F64, normals: F64, lamp: Lamp, boxes: tuple[Box, ...]) -> F64:
    """Give the light (K, 3) that one lamp throws on points (K, 3) with normals (K, 3), shadows included."""
    total = np.zeros(len(points))
    for source in lamp.points:
        ray = source - points
        distance = np.maximum(np.linalg.norm(ray, axis=1), 0.15)
        toward = ray / distance[:, None]
        slant = np.clip(np.sum(toward * normals, axis=1), 0, None)
        if lamp.facing is not None:
            slant = slant * np.clip(-(toward @ lamp.facing), 0, None)
        lit = slant > 0
        clear = hit_distance(points[lit].astype(np.float32), toward[lit].astype(np.float32), boxes)
        seen = np.zeros(len(points))
        seen[lit] = clear > distance[lit] - 0.01
        total += slant * seen / distance**2
    return total[:, None] / len(lamp.points) * lamp.color


def irradiance(world: World, points: F64, normals: F64, baking: Baking) -> F64:
    """Give all light (K, 3) at points (K, 3) with normals (K, 3): lamps and the rooms' own."""
    light = np.zeros((len(points), 3))
    for lamp in world.lamps:
        light += lamp_light(points, normals, lamp, world.boxes)
    view = openness(points, normals, world.boxes, baking)
    for room in world.room_lights:
        here = inside(room.room.polygon, points[:, :2])
        light += (here * view)[:, None] * room.ambient
    return light


def halvings(texture: F32) -> tuple[F32, ...]:
    """Give a texture and its halves by averaging, down to a few pixels."""
    levels = [texture]
    while min(levels[-1].shape[:2]) >= 8:
        rows, columns = levels[-1].shape[:2]
        half = cv2.resize(levels[-1], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, dtype=np.float32))
    return tuple(levels)


def lit(face: Face, light: F32) -> LitFace:
    """Multiply a face by its light (rows, columns, 3), enlarged to the texture, and add its own glow."""
    rows, columns = face.albedo.shape[:2]
    smooth = cv2.GaussianBlur(light, (3, 3), 0.7, borderType=cv2.BORDER_REPLICATE)
    full = cv2.resize(smooth, (columns, rows), interpolation=cv2.INTER_LINEAR)
    radiance = face.albedo * (full + np.float32(face.glow))
    return LitFace(face.corner, face.across, face.down, halvings(radiance.astype(np.float32)))


def bake(world: World, baking: Baking | None = None) -> Scene:
    """Light every face of a world once."""
    baking = baking or Baking()
    grids = [face_points(face, baking) for face in world.faces]
    counts = [len(points) for points, _ in grids]
    points = np.concatenate([points for points, _ in grids])
    normals = np.repeat([face.normal for face in world.faces], counts, axis=0)
    light = np.concatenate(
        [
            irradiance(world, points[a : a + baking.chunk], normals[a : a + baking.chunk], baking)
            for a in range(0, len(points), baking.chunk)
        ]
    ).astype(np.float32)
    parts = np.split(light, np.cumsum(counts)[:-1])
    return scene_of(
        tuple(
            lit(face, part.reshape(*shape, 3))
            for face, part, (_, shape) in zip(world.faces, parts, grids, strict=True)
        )
    )
