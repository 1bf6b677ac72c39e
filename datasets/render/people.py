"""People made of prisms: shoes, trousers, a top, arms and a head, as a camera near the floor sees them.

A figure stands at the origin and looks along +x. All is in meters.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from maurice_mcl.arrays import F32, F64

from ..worlds.surfaces.palettes import Rgb, dye, near
from ..worlds.surfaces.textures import Size, cloth, noise, tint
from .scene import LitFace, halvings

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
    made = []
    for k in range(prism.sides):
        corner = np.array(prism.top) + np.append(oval[k], 0.0)
        strip = halvings(np.ascontiguousarray(texture[:, edges[k] : edges[k + 1]]))
        face = LitFace(corner, np.append(oval[k + 1] - oval[k], 0.0), down, strip)
        made.append(Skin(face, (out[k], out[k + 1])))
    return made


def size_of(prism: Prism) -> Size:
    """Return rows and columns of the texture that goes around a prism."""
    tall = float(np.linalg.norm(np.subtract(prism.top, prism.bottom)))
    around = 1.6 * (prism.thick + prism.wide)
    return max(8, round(tall * PER_M)), max(8 * prism.sides, round(around * PER_M))


def trouser(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """A trouser leg: creases at the knee and above the shoe, worn thigh and knee, seams, a turned-up hem."""
    rows, columns = size
    height, around = np.linspace(1, 0, rows)[:, None], np.linspace(-np.pi, np.pi, columns)[None, :]
    creased = np.exp(-(((height - 0.46) / 0.08) ** 2)) + 1.4 * np.exp(-(((height - 0.07) / 0.07) ** 2))
    folds = noise(rng, size, (rows / 32, columns / 3)) * creased + noise(rng, size, (rows / 3, columns / 14))
    worn = 0.35 * np.cos(around / 2) ** 4 * np.exp(-(((height - 0.6) / 0.25) ** 2))
    light = np.clip(0.9 + 0.25 * folds + 0.07 * noise(rng, size, (1, 1)) + worn, 0.3, 2)
    light[:, [columns // 4, 3 * columns // 4]] *= 0.5
    light[-max(rows // 50, 1) :] *= 0.5
    return tint(color, light.astype(np.float32))


def head(rng: np.random.Generator, size: Size, skin: Rgb, hair: Rgb) -> F32:
    """Skin before, hair on top and behind; eyes and mouth are a few dark texels."""
    rows, columns = size
    picture = tint(skin, 1 + 0.05 * noise(rng, size, (4, 4)))
    away = np.abs((np.arange(columns) + columns / 12) % columns / columns - 0.5)[None, :] * 2  # 1: the front
    low = np.linspace(0, 1, rows)[:, None]
    covered = (low < 0.28) | ((away < 0.55) & (low < 0.75))
    picture[covered] = tint(hair, 1 + 0.2 * noise(rng, size, (8, 1)))[covered]
    picture[(np.abs(away - 0.87) < 0.05) & (np.abs(low - 0.48) < 0.04)] *= np.float32(0.3)
    picture[(away > 0.92) & (np.abs(low - 0.8) < 0.025)] *= np.float32(0.5)
    return cv2.GaussianBlur(picture, (3, 3), 0.8).astype(np.float32)


def shoe(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """Leather with a sole."""
    picture = tint(color, 1 + 0.12 * noise(rng, size, (3, 6)))
    sole = max(2, size[0] // 4)
    picture[-sole:] = np.float32(0.02 if color[0] > 0.3 else 0.06)
    return picture


def legs(rng: np.random.Generator) -> list[tuple[Prism, F32]]:
    """Both legs with their shoes; one may be a step before the other."""
    color = near(rng, TROUSERS[int(rng.integers(len(TROUSERS)))], 0.15)
    leather = SHOES[int(rng.integers(len(SHOES)))]
    step, apart = float(rng.uniform(-0.13, 0.13)), float(rng.uniform(0.09, 0.13))
    made = []
    for side in (1, -1):
        ankle = (side * step, side * apart)
        leg = Prism((*ankle, 0.05), (0.0, side * 0.085, 0.88), 0.165, 0.155, 8)
        x, y = ankle[0] + 0.055, ankle[1]
        foot = Prism((x, y, 0.0), (x - 0.02, y, 0.055), 0.30, 0.105)
        instep = Prism((x - 0.02, y, 0.05), (x - 0.055, y, 0.10), 0.22, 0.09)
        made += [(leg, trouser(rng, size_of(leg), color)), (foot, shoe(rng, size_of(foot), leather))]
        made.append((instep, tint(leather, 1 + 0.1 * noise(rng, size_of(instep), (3, 3)))))
    return made


def upper_body(rng: np.random.Generator) -> list[tuple[Prism, F32]]:
    """A top with its sleeves, hands, neck and head."""
    color, tone = dye(rng), near(rng, SKINS[int(rng.integers(len(SKINS)))], 0.1)
    hair = HAIRS[int(rng.integers(len(HAIRS)))]
    chest = Prism((0.0, 0.0, 0.80), (0.0, 0.0, 1.40), 0.24, 0.38, 8)
    shoulders = Prism((0.0, 0.0, 1.39), (0.0, 0.0, 1.46), 0.18, 0.30)
    neck = Prism((0.0, 0.0, 1.43), (0.015, 0.0, 1.56), 0.11, 0.11)
    skull = Prism((0.02, 0.0, 1.53), (0.02, 0.0, 1.77), 0.20, 0.155)
    made = [(part, cloth(rng, size_of(part), color)) for part in (chest, shoulders)]
    made.append((neck, tint(tone, 0.8 + 0.05 * noise(rng, size_of(neck), (4, 4)))))
    made.append((skull, head(rng, size_of(skull), tone, hair)))
    for side in (1, -1):
        swing = float(rng.uniform(-0.12, 0.16))
        arm = Prism((swing, side * 0.25, 0.84), (0.0, side * 0.215, 1.42), 0.105, 0.095)
        hand = Prism((swing + 0.015, side * 0.25, 0.70), (swing, side * 0.25, 0.85), 0.08, 0.045)
        made.append((arm, cloth(rng, size_of(arm), color)))
        made.append((hand, tint(tone, 1 + 0.1 * noise(rng, size_of(hand), (4, 4)))))
    return made


def figure(rng: np.random.Generator) -> tuple[Skin, ...]:
    """Draw one person: clothes, step and height."""
    tall = float(rng.uniform(0.9, 1.06))
    parts = (*legs(rng), *upper_body(rng))
    return tuple(sized(skin, tall) for prism, texture in parts for skin in skins(prism, texture))


def sized(skin: Skin, times: float) -> Skin:
    """Make a person larger or smaller."""
    face = skin.face
    return Skin(
        LitFace(face.corner * times, face.across * times, face.down * times, face.levels), skin.turned
    )
