"""Colors that rooms are made of: paints, dyes, woods. Linear reflectance, red, green, blue."""

from __future__ import annotations

import numpy as np

Rgb = tuple[float, float, float]

DYES: tuple[Rgb, ...] = (
    (0.030, 0.055, 0.140),  # navy
    (0.260, 0.050, 0.040),  # brick
    (0.110, 0.150, 0.055),  # moss
    (0.420, 0.270, 0.055),  # mustard
    (0.170, 0.170, 0.180),  # gray
    (0.420, 0.350, 0.250),  # beige
    (0.030, 0.140, 0.150),  # petrol
    (0.150, 0.030, 0.060),  # wine
    (0.330, 0.120, 0.040),  # rust
    (0.120, 0.250, 0.380),  # sky
)

ACCENTS: tuple[Rgb, ...] = (
    (0.42, 0.17, 0.11),  # terracotta
    (0.20, 0.28, 0.15),  # moss
    (0.13, 0.27, 0.31),  # teal
    (0.48, 0.34, 0.14),  # ocher
    (0.28, 0.17, 0.26),  # plum
    (0.17, 0.21, 0.34),  # slate blue
)

SCENES: tuple[tuple[Rgb, Rgb, Rgb, Rgb], ...] = (  # high sky, low sky, far hills, near hills
    ((0.16, 0.32, 0.62), (0.60, 0.70, 0.80), (0.16, 0.24, 0.30), (0.06, 0.14, 0.04)),  # a clear day
    ((0.20, 0.10, 0.24), (0.80, 0.36, 0.10), (0.20, 0.08, 0.12), (0.04, 0.02, 0.03)),  # sunset
    ((0.45, 0.55, 0.60), (0.75, 0.78, 0.76), (0.05, 0.22, 0.30), (0.40, 0.32, 0.18)),  # sea and sand
    ((0.01, 0.02, 0.07), (0.06, 0.10, 0.22), (0.02, 0.04, 0.09), (0.01, 0.015, 0.02)),  # night
    ((0.55, 0.50, 0.40), (0.80, 0.70, 0.50), (0.42, 0.24, 0.10), (0.26, 0.10, 0.03)),  # autumn
)


def near(rng: np.random.Generator, color: Rgb, spread: float = 0.18) -> Rgb:
    """Vary a color: brighter or darker by chance, each channel a little apart."""
    shades = (
        np.asarray(color)
        * rng.uniform(1 - spread, 1 + spread)
        * rng.uniform(1 - spread / 2, 1 + spread / 2, 3)
    )
    red, green, blue = np.clip(shades, 0.01, 0.85)
    return float(red), float(green), float(blue)


def dye(rng: np.random.Generator) -> Rgb:
    """Draw a color of cloth."""
    return near(rng, DYES[int(rng.integers(len(DYES)))])


def accent(rng: np.random.Generator) -> Rgb:
    """Draw the color of a wall that stands out."""
    return near(rng, ACCENTS[int(rng.integers(len(ACCENTS)))])


def pale(rng: np.random.Generator, low: float = 0.42, high: float = 0.66) -> Rgb:
    """Draw a wall color: cream, gray, faint green or blue."""
    tone = float(rng.uniform(low, high))
    return near(rng, (tone, tone, tone), 0.2)


def wood(rng: np.random.Generator, low: float = 0.12, high: float = 0.5) -> Rgb:
    """Draw a wood from walnut to pine."""
    depth = float(rng.uniform(low, high))
    return (depth, depth * 0.6, depth * 0.32)


def ink(rng: np.random.Generator) -> Rgb:
    """Draw a color of print: stronger than cloth."""
    levels = np.array([rng.uniform(0.45, 0.75), rng.uniform(0.10, 0.55), rng.uniform(0.04, 0.14)])
    red, green, blue = rng.permutation(levels) * rng.uniform(0.5, 1.0)
    return float(red), float(green), float(blue)
