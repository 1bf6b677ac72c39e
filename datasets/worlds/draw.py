"""Drawing what a plan leaves to the seed: numbers, words, colors and paints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from maurice_mcl.arrays import F32

from .plan import Number, NumberRange, PaintPlan, Word
from .solids import Paint
from .surfaces.paints import TEXTURES, image_paint
from .surfaces.palettes import Rgb, color_of
from .surfaces.textures import Size, plaster


def number(rng: np.random.Generator, value: Number) -> float:
    """Draw a number where it is a span."""
    return float(rng.uniform(value.low, value.high)) if isinstance(value, NumberRange) else value


def word(rng: np.random.Generator, value: Word) -> str:
    """Draw a word where there is a choice."""
    return value if isinstance(value, str) else value.options[int(rng.integers(len(value.options)))]


@dataclass(frozen=True, slots=True)
class Bareness:
    """What a bare world leaves out: drawn apart, so that all else is as in a furnished one."""

    share: float
    rng: np.random.Generator

    def leaves_out(self) -> bool:
        """Draw whether the next texture or thing on a wall is left out."""
        return float(self.rng.random()) < self.share


@dataclass(frozen=True, slots=True)
class Palette:
    """Colors that a room has names for; all others are known everywhere."""

    named: Mapping[str, Rgb] = field(default_factory=dict)

    def color(self, rng: np.random.Generator, value: Word) -> Rgb:
        """Draw a color."""
        name = word(rng, value)
        return self.named[name] if name in self.named else color_of(rng, name)


PLAIN_PALETTE = Palette()


def paint_of(
    rng: np.random.Generator, plan: PaintPlan, palette: Palette, per_inch: float, *, plain: bool = False
) -> Paint:
    """Draw colors and pattern of a paint once; `plain` leaves the pattern of a texture out."""
    if plan.image is not None:
        return image_paint(plan.image)
    texture = TEXTURES[word(rng, plan.texture)]
    color = palette.color(rng, plan.color or texture.color)
    other = palette.color(rng, plan.other or texture.other)
    size_in = number(rng, texture.size_in if plan.size_in is None else plan.size_in)
    if plain and texture.patterned:
        return partial(plaster, color=color)
    pattern_px = max(2, round(size_in * per_inch))

    def paint(rng: np.random.Generator, size: Size) -> F32:
        return texture.make(rng, size, color, other, pattern_px)

    return paint
