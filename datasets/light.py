"""Light at points: lamps with soft shadows, open sky of each room, dark corners, each source apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from maurice_mcl.geometry import INCH_M
from maurice_mcl.typing import F32, F64

from .parts import Part, parts_of
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


def carried(points: F64, normals: F64, lamp: Lamp, boxes: tuple[Box, ...]) -> F64:
    """Give how much of each of a lamp's points (P) arrives at points (K, 3) with normals (K, 3): (P, K).

    Squared distance, both angles and what stands between are in it.
    """
    total = np.zeros((len(lamp.points), len(points)))
    for row, source in zip(total, lamp.points, strict=True):
        ray = source - points
        distance = np.maximum(np.linalg.norm(ray, axis=1), 0.15)
        toward = ray / distance[:, None]
        slant = np.clip(np.sum(toward * normals, axis=1), 0, None)
        if lamp.facing is not None:
            slant = slant * np.clip(-(toward @ lamp.facing), 0, None)
        lit = slant > 0
        clear = hit_distance(points[lit].astype(np.float32), toward[lit].astype(np.float32), boxes)
        row[lit] = (slant[lit] / distance[lit] ** 2) * (clear > distance[lit] - 0.01)
    return total


def lamp_light(points: F64, normals: F64, lamp: Lamp, boxes: tuple[Box, ...]) -> F64:
    """Give the light (K, 3) that one lamp throws on points (K, 3) with normals (K, 3), shadows included."""
    return np.asarray(carried(points, normals, lamp, boxes).mean(axis=0)[:, None] * lamp.color)


def irradiance(world: World, points: F64, normals: F64, baking: Baking) -> F64:
    """Give all light (K, 3) at points (K, 3) with normals (K, 3): lamps and the rooms' own."""
    return np.asarray(irradiance_by_part(world, parts_of(world), points, normals, baking).sum(axis=0))


def irradiance_by_part(
    world: World, parts: tuple[Part, ...], points: F64, normals: F64, baking: Baking
) -> F64:
    """Give the light (S, K, 3) of each part at points (K, 3) with normals (K, 3)."""
    light = np.zeros((len(parts), len(points), 3))
    for lamp in world.lamps:
        arrives = carried(points, normals, lamp, world.boxes) / len(lamp.points)
        for k, part in enumerate(parts):
            if part.source == lamp.source:
                light[k] += (part.shares(lamp) @ arrives)[:, None] * lamp.color
    view = openness(points, normals, world.boxes, baking)
    for room in world.room_lights:
        here = (inside(room.room.polygon, points[:, :2]) * view)[:, None] * room.ambient
        for k, part in enumerate(parts):
            if part.source == room.source:
                light[k] += here * part.whole
    return light
