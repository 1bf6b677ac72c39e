"""Light of every part of a world, baked once; a scene is their sum under weights.

A coarse grid of points on every face asks which lamps it sees past the boxes. Light is linear in its sources,
so a lamp that goes out takes its light and its shadows with it, at the cost of one sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.arrays import F32, F64, I32

from ..worlds.world import Face, World
from .light import Baking, LightPart, face_points, irradiance_by_part, parts_of
from .scene import LitFace, LitScene, halvings, scene_of


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
    """Bake a world. Kept for the two last worlds, as survey and session look at the same one."""
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
    by_part = tuple(only_where_lit(light) for light in glowing)
    return Lighting(world.faces, parts, by_part, shapes, glowing.sum(axis=0))


def only_where_lit(light: F32) -> PartLight:
    """Keep of light (K, 3) what is not dark."""
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


def bake(world: World, baking: Baking | None = None) -> LitScene:
    """Light every face of a world as the survey has it; each picture then costs only the warping of faces."""
    lighting = lighting_of(world, baking)
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
    return LitScene(scene.faces, scene.corner, scene.across, scene.down, light)
