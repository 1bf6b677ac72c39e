"""People who stand in the robot's view for one frame: figures of prisms, how often, where, and how lit.

A figure stands at the origin and looks along +x; all is in meters. A pose only decides where there is room.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.values import F32, F64, Arena, Bool, Domain, crosses, stream

from ..tasks import SimPurpose
from ..worlds.palettes import Rgb, dye, near
from ..worlds.textures import Size, cloth, noise, tint
from ..worlds.world import World, clearance, inside, segments_of
from .camera import LitFace, LitScene, halvings, scene_of
from .light import LightPart, seen_past

TROUSERS: tuple[Rgb, ...] = (
    (0.060, 0.085, 0.150),  # jeans
    (0.110, 0.150, 0.220),  # washed jeans
    (0.030, 0.030, 0.034),  # black
    (0.270, 0.200, 0.120),  # khaki
    (0.090, 0.090, 0.095),  # gray
)
SHOES: tuple[Rgb, ...] = ((0.025, 0.02, 0.018), (0.12, 0.06, 0.03), (0.45, 0.44, 0.42), (0.16, 0.05, 0.05))
SKINS: tuple[Rgb, ...] = ((0.48, 0.29, 0.20), (0.36, 0.20, 0.12), (0.16, 0.08, 0.05))
HAIRS: tuple[Rgb, ...] = ((0.02, 0.015, 0.012), (0.09, 0.045, 0.02), (0.28, 0.18, 0.08))
PER_M = 160.0  # texels a meter


@dataclass(frozen=True, slots=True, eq=False)
class Skin:
    """One face of a figure, and which way its surface is really turned: round, not flat."""

    face: LitFace  # what it reflects
    turned: tuple[F64, F64]  # (3,) unit normals at its left and right edge


@dataclass(frozen=True, slots=True)
class Prism:
    """A leaning column with an oval section."""

    bottom: tuple[float, float, float]  # middle of its lower end
    top: tuple[float, float, float]  # and of its upper end
    thick: float  # from front to back
    wide: float  # from side to side
    sides: int = 6


def skins(prism: Prism, texture: F32) -> list[Skin]:
    """Wrap a texture around the sides of a prism."""
    angles = 2 * np.pi * (np.arange(prism.sides + 1) + 0.5) / prism.sides
    oval = np.stack([prism.thick / 2 * np.cos(angles), prism.wide / 2 * np.sin(angles)], axis=1)
    out = np.stack([prism.wide * np.cos(angles), prism.thick * np.sin(angles), np.zeros_like(angles)], axis=1)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    down = np.array(prism.bottom) - np.array(prism.top)
    edges = np.round(np.linspace(0, texture.shape[1], prism.sides + 1)).astype(int)
    wrapped = []
    for k in range(prism.sides):
        corner = np.array(prism.top) + np.append(oval[k], 0.0)
        strip = halvings(np.ascontiguousarray(texture[:, edges[k] : edges[k + 1]]))
        face = LitFace(corner, np.append(oval[k + 1] - oval[k], 0.0), down, strip)
        wrapped.append(Skin(face, (out[k], out[k + 1])))
    return wrapped


def _size_of(prism: Prism) -> Size:
    tall = float(np.linalg.norm(np.subtract(prism.top, prism.bottom)))
    circumference = 1.6 * (prism.thick + prism.wide)
    return max(8, round(tall * PER_M)), max(8 * prism.sides, round(circumference * PER_M))


def _trouser(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    rows, columns = size
    height, angle = np.linspace(1, 0, rows)[:, None], np.linspace(-np.pi, np.pi, columns)[None, :]
    creased = np.exp(-(((height - 0.46) / 0.08) ** 2)) + 1.4 * np.exp(-(((height - 0.07) / 0.07) ** 2))
    folds = noise(rng, size, (rows / 32, columns / 3)) * creased + noise(rng, size, (rows / 3, columns / 14))
    worn = 0.35 * np.cos(angle / 2) ** 4 * np.exp(-(((height - 0.6) / 0.25) ** 2))
    light = np.clip(0.9 + 0.25 * folds + 0.07 * noise(rng, size, (1, 1)) + worn, 0.3, 2)
    light[:, [columns // 4, 3 * columns // 4]] *= 0.5
    light[-max(rows // 50, 1) :] *= 0.5
    return tint(color, light.astype(np.float32))


def _head(rng: np.random.Generator, size: Size, skin: Rgb, hair: Rgb) -> F32:
    rows, columns = size
    picture = tint(skin, 1 + 0.05 * noise(rng, size, (4, 4)))
    away = np.abs((np.arange(columns) + columns / 12) % columns / columns - 0.5)[None, :] * 2  # 1: the front
    low = np.linspace(0, 1, rows)[:, None]
    covered = (low < 0.28) | ((away < 0.55) & (low < 0.75))
    picture[covered] = tint(hair, 1 + 0.2 * noise(rng, size, (8, 1)))[covered]
    picture[(np.abs(away - 0.87) < 0.05) & (np.abs(low - 0.48) < 0.04)] *= np.float32(0.3)
    picture[(away > 0.92) & (np.abs(low - 0.8) < 0.025)] *= np.float32(0.5)
    return cv2.GaussianBlur(picture, (3, 3), 0.8).astype(np.float32)


def _shoe(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    picture = tint(color, 1 + 0.12 * noise(rng, size, (3, 6)))
    sole = max(2, size[0] // 4)
    picture[-sole:] = np.float32(0.02 if color[0] > 0.3 else 0.06)
    return picture


def _legs(rng: np.random.Generator) -> list[tuple[Prism, F32]]:
    color = near(rng, TROUSERS[int(rng.integers(len(TROUSERS)))], 0.15)
    leather = SHOES[int(rng.integers(len(SHOES)))]
    step, half_gap = float(rng.uniform(-0.13, 0.13)), float(rng.uniform(0.09, 0.13))
    parts = []
    for side in (1, -1):
        ankle = (side * step, side * half_gap)
        leg = Prism((*ankle, 0.05), (0.0, side * 0.085, 0.88), 0.165, 0.155, 8)
        x, y = ankle[0] + 0.055, ankle[1]
        foot = Prism((x, y, 0.0), (x - 0.02, y, 0.055), 0.30, 0.105)
        instep = Prism((x - 0.02, y, 0.05), (x - 0.055, y, 0.10), 0.22, 0.09)
        parts += [(leg, _trouser(rng, _size_of(leg), color)), (foot, _shoe(rng, _size_of(foot), leather))]
        parts.append((instep, tint(leather, 1 + 0.1 * noise(rng, _size_of(instep), (3, 3)))))
    return parts


def _upper_body(rng: np.random.Generator) -> list[tuple[Prism, F32]]:
    color, tone = dye(rng), near(rng, SKINS[int(rng.integers(len(SKINS)))], 0.1)
    hair = HAIRS[int(rng.integers(len(HAIRS)))]
    chest = Prism((0.0, 0.0, 0.80), (0.0, 0.0, 1.40), 0.24, 0.38, 8)
    shoulders = Prism((0.0, 0.0, 1.39), (0.0, 0.0, 1.46), 0.18, 0.30)
    neck = Prism((0.0, 0.0, 1.43), (0.015, 0.0, 1.56), 0.11, 0.11)
    skull = Prism((0.02, 0.0, 1.53), (0.02, 0.0, 1.77), 0.20, 0.155)
    parts = [(part, cloth(rng, _size_of(part), color)) for part in (chest, shoulders)]
    parts.append((neck, tint(tone, 0.8 + 0.05 * noise(rng, _size_of(neck), (4, 4)))))
    parts.append((skull, _head(rng, _size_of(skull), tone, hair)))
    for side in (1, -1):
        swing = float(rng.uniform(-0.12, 0.16))
        arm = Prism((swing, side * 0.25, 0.84), (0.0, side * 0.215, 1.42), 0.105, 0.095)
        hand = Prism((swing + 0.015, side * 0.25, 0.70), (swing, side * 0.25, 0.85), 0.08, 0.045)
        parts.append((arm, cloth(rng, _size_of(arm), color)))
        parts.append((hand, tint(tone, 1 + 0.1 * noise(rng, _size_of(hand), (4, 4)))))
    return parts


def figure(rng: np.random.Generator) -> tuple[Skin, ...]:
    """Draw one person: clothes, step and height."""
    tall = float(rng.uniform(0.9, 1.06))
    parts = (*_legs(rng), *_upper_body(rng))
    return tuple(_sized(skin, tall) for prism, texture in parts for skin in skins(prism, texture))


def _sized(skin: Skin, times: float) -> Skin:
    face = skin.face
    corner, across, down = (part * times for part in (face.corner, face.across, face.down))
    return Skin(replace(face, corner=corner, across=across, down=down), skin.turned)


WARDROBE = 6  # different people a session has; enough that none is met at every turn
NEAREST_M, FARTHEST_M = 0.75, 2.8  # from the robot; nearer, one trouser leg fills the view
BESIDE_RAD = float(np.radians(19))  # at most so far from straight ahead
ROOM_M = 0.24  # around a person's middle
APART_M = 0.5  # between two people
PAIRS = 0.3  # share of occluded frames with two people
TRIES = 48  # places tried; if none is free, no person is in view
ROWS = 4  # points of light on each face of a person, from top to bottom
LAMPS_M = 6.0  # lamps farther than this add nothing that would be seen on a person
FEET_M = 0.17  # size of the dark patch where a person stands


@dataclass(frozen=True, slots=True)
class StandingPerson:
    """One person in one frame."""

    x_m: float
    y_m: float
    heading_rad: float
    who: int  # number in the wardrobe


@lru_cache(maxsize=2)
def wardrobe(seed: int) -> tuple[tuple[Skin, ...], ...]:
    """Draw a session's people."""
    rng = stream(Domain.SIMULATOR, seed, 0, SimPurpose.OCCLUDERS)
    return tuple(figure(rng) for _ in range(WARDROBE))


def stands_at(arena: Arena, pose: F64, seed: int, number: int, share: float) -> tuple[StandingPerson, ...]:
    """Draw the people visible in frame `number` (from 1) as seen from pose (3,); () in most frames."""
    rng = stream(Domain.SIMULATOR, seed, number, SimPurpose.OCCLUDERS)
    if rng.random() >= share:
        return ()
    count = 2 if rng.random() < PAIRS else 1
    far = rng.uniform(NEAREST_M, FARTHEST_M, TRIES)
    angle = pose[2] + rng.uniform(-BESIDE_RAD, BESIDE_RAD, TRIES)
    turned, who = rng.uniform(-np.pi, np.pi, TRIES), rng.permutation(WARDROBE)
    places = pose[:2] + far[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    chosen: list[int] = []
    for k in np.flatnonzero(free(arena, pose[:2], places)):
        if all(np.linalg.norm(places[k] - places[j]) > APART_M for j in chosen):
            chosen.append(int(k))
        if len(chosen) == count:
            break
    return tuple(
        StandingPerson(float(places[k, 0]), float(places[k, 1]), float(turned[k]), int(person))
        for k, person in zip(chosen, who, strict=False)
    )


def free(arena: Arena, eye: F64, places: F64) -> Bool:
    """Return at which places (K, 2) a person has room and can be seen from `eye` (2,) by the map."""
    x_min, y_min, x_max, y_max = arena.bounds
    x, y = places.T
    within = (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)
    seen = ~crosses(np.broadcast_to(eye, places.shape), places, segments_of(arena))
    return np.asarray(within & (clearance(arena, places) > ROOM_M) & seen)


def people(
    world: World, parts: tuple[LightPart, ...], weights: F64, stands: tuple[StandingPerson, ...], seed: int
) -> LitScene:
    """Stand people (at least one) into a world, lit by its parts under weights (S, 3)."""
    lit: list[LitFace] = []
    lights: list[F32] = []
    for stand in stands:
        skins = wardrobe(seed)[stand.who]
        c, s = np.cos(stand.heading_rad), np.sin(stand.heading_rad)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        at = np.array([stand.x_m, stand.y_m, 0.0])
        faces = [skin.face for skin in skins]
        corner = np.stack([face.corner for face in faces]) @ turn.T + at
        across = np.stack([face.across for face in faces]) @ turn.T
        down = np.stack([face.down for face in faces]) @ turn.T
        normals = np.array([skin.turned for skin in skins]) @ turn.T
        first = sum(map(len, lights))
        lights.append(person_light(world, parts, weights, at, (corner, across, down), normals).reshape(-1, 3))
        lit += [
            LitFace(corner[k], across[k], down[k], face.levels, (first + k * ROWS * 2, ROWS, 2))
            for k, face in enumerate(faces)
        ]
    return scene_of(tuple(lit), np.concatenate(lights))


def person_light(
    world: World,
    parts: tuple[LightPart, ...],
    weights: F64,
    at: F64,
    faces: tuple[F64, F64, F64],
    normals: F64,
) -> F32:
    """Return the light (F, ROWS, 2, 3) on a person's faces (F, 3) with normals (F, 2, 3).

    Which lamps reach them is asked at knee and chest only; their own parts throw no shadows on each other.
    """
    corner, across, down = (part[:, None, None] for part in faces)
    t, s = ((np.arange(ROWS) + 0.5) / ROWS)[:, None, None], np.array([0.25, 0.75])[:, None]
    points = corner + s * across + t * down  # (F, ROWS, 2, 3)
    left, right = normals[:, 0, None, None], normals[:, 1, None, None]
    facing = (1 - s) * left + s * right
    facing = np.broadcast_to(facing / np.linalg.norm(facing, axis=-1, keepdims=True), points.shape)
    light = np.zeros(points.shape)
    upper = np.clip((points[..., 2] - 0.4) / 0.6, 0, 1)
    for lamp in world.lamps:
        colors = sum(
            part.shares(lamp)[:, None] * weight
            for part, weight in zip(parts, weights, strict=True)
            if part.source == lamp.source
        )
        if np.linalg.norm(lamp.points[:, :2] - at[:2], axis=1).min() > LAMPS_M or not np.any(colors):
            continue
        knee, chest = (seen_past(at + np.array([0, 0, z]), lamp.points, world.boxes) for z in (0.4, 1.0))
        for k, source in enumerate(lamp.points):
            if not (knee[k] or chest[k]):
                continue
            seen = (1 - upper) * knee[k] + upper * chest[k]
            ray = source - points
            distance = np.maximum(np.linalg.norm(ray, axis=-1), 0.15)
            slant = np.clip(np.sum(ray * facing, axis=-1) / distance, 0, None)
            if lamp.facing is not None:
                slant = slant * np.clip(-(ray @ lamp.facing) / distance, 0, None)
            share = np.broadcast_to(colors, (len(lamp.points), 3))[k] / len(lamp.points)
            light += (seen * slant / distance**2)[..., None] * (share * lamp.color)
    return (light + surrounding(world, parts, weights, at, points, facing)).astype(np.float32)


def surrounding(
    world: World, parts: tuple[LightPart, ...], weights: F64, at: F64, points: F64, facing: F64
) -> F64:
    """Return the light (..., 3) of the room at points (..., 3): less near the floor and on undersides."""
    total = np.zeros(3)
    for room in world.room_lights:
        if inside(room.room.polygon, at[None, :2])[0]:
            for part, weight in zip(parts, weights, strict=True):
                if part.source == room.source:
                    total = total + part.whole * weight * room.ambient
    openness = (0.45 + 0.45 * np.clip(points[..., 2] / 0.7, 0, 1)) * (0.85 + 0.15 * facing[..., 2])
    return np.asarray(openness[..., None] * total)


def standing_shade(scene: LitScene, stands: tuple[StandingPerson, ...]) -> LitScene:
    """Darken the light on the floor where people stand."""
    if scene.light is None:
        return scene
    light = scene.light.copy()
    flat = (scene.corner[:, 2] < 0.05) & (scene.across[:, 2] == 0) & (scene.down[:, 2] == 0)
    for k in np.flatnonzero(flat):
        face = scene.faces[k]
        grid = scene.grid_of(face)
        if grid is not None and face.grid is not None:
            first = face.grid[0]
            light[first : first + grid.shape[0] * grid.shape[1]] = shaded(face, grid, stands).reshape(-1, 3)
    return replace(scene, light=light)


def shaded(face: LitFace, grid: F32, stands: tuple[StandingPerson, ...]) -> F32:
    """Darken one grid (rows, columns, 3)."""
    rows, columns = grid.shape[:2]
    t, s = (np.arange(rows) + 0.5)[:, None, None] / rows, (np.arange(columns) + 0.5)[None, :, None] / columns
    at = face.corner[:2] + s * face.across[:2] + t * face.down[:2]
    left = np.ones((rows, columns, 1))
    for stand in stands:
        away2 = np.sum((at - [stand.x_m, stand.y_m]) ** 2, axis=-1, keepdims=True)
        left *= 1 - 0.65 * np.exp(-away2 / (2 * FEET_M**2))
    return np.asarray(grid * left, dtype=np.float32)
