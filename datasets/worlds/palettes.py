"""Colors that rooms are made of: paints, dyes, woods. Linear reflectance, red, green, blue."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Rgb = tuple[float, float, float]

DYES: dict[str, Rgb] = {  # of cloth
    "navy": (0.030, 0.055, 0.140),
    "brick": (0.260, 0.050, 0.040),
    "moss": (0.110, 0.150, 0.055),
    "mustard": (0.420, 0.270, 0.055),
    "gray": (0.170, 0.170, 0.180),
    "beige": (0.420, 0.350, 0.250),
    "petrol": (0.030, 0.140, 0.150),
    "wine": (0.150, 0.030, 0.060),
    "rust": (0.330, 0.120, 0.040),
    "sky": (0.120, 0.250, 0.380),
}

ACCENTS: dict[str, Rgb] = {  # of walls that stand out
    "terracotta": (0.42, 0.17, 0.11),
    "sage": (0.20, 0.28, 0.15),
    "teal": (0.13, 0.27, 0.31),
    "ocher": (0.48, 0.34, 0.14),
    "plum": (0.28, 0.17, 0.26),
    "slate": (0.17, 0.21, 0.34),
}

PLAIN: dict[str, Rgb] = {
    "white": (0.66, 0.64, 0.60),
    "cream": (0.60, 0.54, 0.43),
    "silver": (0.42, 0.42, 0.43),
    "charcoal": (0.06, 0.06, 0.065),
    "oak": (0.36, 0.22, 0.11),
    "walnut": (0.13, 0.078, 0.045),
    "pine": (0.48, 0.32, 0.17),
    "cardboard": (0.42, 0.27, 0.14),
    "leaf": (0.10, 0.26, 0.07),
}

LIGHTS: dict[str, Rgb] = {  # of lamps and windows; green is 1, so that brightness is that of green
    "daylight": (0.90, 1.0, 1.15),
    "cold": (0.95, 1.0, 1.06),
    "neutral": (1.09, 1.0, 0.86),
    "warm": (1.33, 1.0, 0.63),
}

SCENES: tuple[tuple[Rgb, Rgb, Rgb, Rgb], ...] = (  # high sky, low sky, far hills, near hills
    ((0.16, 0.32, 0.62), (0.60, 0.70, 0.80), (0.16, 0.24, 0.30), (0.06, 0.14, 0.04)),  # a clear day
    ((0.20, 0.10, 0.24), (0.80, 0.36, 0.10), (0.20, 0.08, 0.12), (0.04, 0.02, 0.03)),  # sunset
    ((0.45, 0.55, 0.60), (0.75, 0.78, 0.76), (0.05, 0.22, 0.30), (0.40, 0.32, 0.18)),  # sea and sand
    ((0.01, 0.02, 0.07), (0.06, 0.10, 0.22), (0.02, 0.04, 0.09), (0.01, 0.015, 0.02)),  # night
    ((0.55, 0.50, 0.40), (0.80, 0.70, 0.50), (0.42, 0.24, 0.10), (0.26, 0.10, 0.03)),  # autumn
)


def near(rng: np.random.Generator, color: Rgb, spread: float = 0.18) -> Rgb:
    """Vary a color: brighter or darker by chance, each channel a little apart."""
    shades = np.asarray(color) * rng.uniform(1 - spread, 1 + spread)
    red, green, blue = np.clip(shades * rng.uniform(1 - spread / 2, 1 + spread / 2, 3), 0.01, 0.85)
    return float(red), float(green), float(blue)


def dye(rng: np.random.Generator) -> Rgb:
    """Draw a color of cloth."""
    return near(rng, list(DYES.values())[int(rng.integers(len(DYES)))])


def accent(rng: np.random.Generator) -> Rgb:
    """Draw the color of a wall that stands out."""
    return near(rng, list(ACCENTS.values())[int(rng.integers(len(ACCENTS)))])


def pale(rng: np.random.Generator) -> Rgb:
    """Draw a wall color: cream, gray, faint green or blue."""
    tone = float(rng.uniform(0.42, 0.66))
    return near(rng, (tone, tone, tone), 0.2)


def wood(rng: np.random.Generator, low: float = 0.12, high: float = 0.5) -> Rgb:
    """Draw a wood from walnut to pine."""
    depth = float(rng.uniform(low, high))
    return (depth, depth * 0.6, depth * 0.32)


def ink(rng: np.random.Generator) -> Rgb:
    """Draw a color of print: stronger than cloth."""
    levels = np.array([rng.uniform(0.35, 0.60), rng.uniform(0.12, 0.45), rng.uniform(0.05, 0.20)])
    red, green, blue = rng.permutation(levels) * rng.uniform(0.5, 1.0)
    return float(red), float(green), float(blue)


GROUPS: dict[str, Callable[[np.random.Generator], Rgb]] = {  # words that stand for any color of a kind
    "any pale": pale,
    "any accent": accent,
    "any dye": dye,
    "any wood": wood,
    "any ink": ink,
}
COLORS: dict[str, Rgb] = {**DYES, **ACCENTS, **PLAIN}


def from_hex(text: str) -> Rgb | None:
    """Read "#rrggbb" as it looks on a screen into linear reflectance, at most 0.95; None for other words."""
    if len(text) != 7 or text[0] != "#":
        return None
    try:
        levels = np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    except ValueError:
        return None
    linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    red, green, blue = np.clip(linear, 0.02, 0.95)
    return float(red), float(green), float(blue)


def color_of(rng: np.random.Generator, word: str) -> Rgb:
    """Draw the color of a word: of a group, about a named one, or exactly "#rrggbb"; else KeyError."""
    exact = from_hex(word)
    if exact is not None:
        return exact
    return GROUPS[word](rng) if word in GROUPS else near(rng, COLORS[word], 0.12)


def is_color(word: str) -> bool:
    """Return whether a word is the name of a color."""
    return word in COLORS or word in GROUPS or from_hex(word) is not None


def is_light(word: str) -> bool:
    """Return whether a word is the name of a color of light."""
    return word in LIGHTS or from_hex(word) is not None


def light_of(word: str) -> Rgb:
    """Return the color of light that a word stands for, green 1; KeyError if it is none."""
    exact = from_hex(word)
    return LIGHTS[word] if exact is None else (exact[0] / exact[1], 1.0, exact[2] / exact[1])
