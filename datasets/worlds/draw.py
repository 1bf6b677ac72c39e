"""Drawing what a plan leaves to the seed: numbers, words, colors, and the paints that world files name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path

import cv2
import numpy as np

from maurice_loaders.errors import InputError, PictureError
from maurice_loaders.files.pictures import decode_picture, picture_file
from maurice_mcl.values import F32

from . import textures
from . import wall_pictures as pictures
from .palettes import Rgb, color_of
from .plan import Number, NumberRange, PaintPlan, Word
from .solids import Paint
from .textures import Size, plaster

MOST_PX = 1024  # of an image's longer side

Make = Callable[[np.random.Generator, Size, Rgb, Rgb, int], F32]  # color, other, pattern in pixels


@dataclass(frozen=True, slots=True)
class Texture:
    """A texture that a world file can name."""

    make: Make
    color: str = "any pale"  # where the file names none
    other: str = "any accent"
    size_in: float = 8.0  # of its pattern, where it has one
    patterned: bool = True  # left out in bare worlds


TEXTURES: dict[str, Texture] = {
    "plaster": Texture(lambda r, s, c, o, n: textures.plaster(r, s, c), patterned=False),
    "wallpaper": Texture(lambda r, s, c, o, n: textures.wallpaper(r, s, c, o, n), size_in=10),
    "panelling": Texture(lambda r, s, c, o, n: textures.panelling(r, s, c, n), "any accent", size_in=5),
    "brick": Texture(lambda r, s, c, o, n: textures.bricks(r, s, c, n), "terracotta", size_in=8),
    "tiles": Texture(lambda r, s, c, o, n: textures.tiles(r, s, c, n), "any pale", size_in=12),
    "panels": Texture(lambda r, s, c, o, n: textures.ceiling_tiles(r, s, c, n), "white", size_in=24),
    "planks": Texture(lambda r, s, c, o, n: textures.planks(r, s, c, n, 12 * n), "any wood", size_in=5),
    "carpet": Texture(lambda r, s, c, o, n: textures.carpet(r, s, c), "any dye"),
    "carpet tiles": Texture(lambda r, s, c, o, n: textures.carpet_tiles(r, s, c, n), "gray", size_in=20),
    "linoleum": Texture(lambda r, s, c, o, n: textures.linoleum(r, s, c), "silver", patterned=False),
    "rug": Texture(lambda r, s, c, o, n: textures.rug(r, s, c, o), "any accent", "any pale"),
    "cloth": Texture(lambda r, s, c, o, n: textures.cloth(r, s, c), "any dye", patterned=False),
    "stripes": Texture(
        lambda r, s, c, o, n: textures.stripes(r, s, c, o, max(1, s[1] // max(n, 2))), "any ink", "cream", 4
    ),
    "timber": Texture(lambda r, s, c, o, n: textures.timber(r, s, c), "any wood", patterned=False),
    "cardboard": Texture(lambda r, s, c, o, n: textures.cardboard(r, s, c), "cardboard"),
    "leaves": Texture(lambda r, s, c, o, n: textures.leaves(r, s, c), "leaf"),
    "landscape": Texture(lambda r, s, c, o, n: pictures.landscape(r, s)),
    "shapes": Texture(lambda r, s, c, o, n: pictures.shapes(r, s)),
    "portrait": Texture(lambda r, s, c, o, n: pictures.portrait(r, s)),
    "chart": Texture(lambda r, s, c, o, n: pictures.chart(r, s)),
    "books": Texture(lambda r, s, c, o, n: pictures.books(r, s)),
    "notices": Texture(lambda r, s, c, o, n: pictures.notices(r, s)),
    "whiteboard": Texture(lambda r, s, c, o, n: pictures.whiteboard(r, s)),
}


@lru_cache(maxsize=32)
def read_image(file: Path) -> F32:
    """Read an image as linear reflectance (H, W, 3) from 0.02 to 0.95; InputError if it is not an image."""
    try:
        image = decode_picture(picture_file(file), deep=True)
    except PictureError as problem:
        raise InputError(file, f"{problem}; an image of a world is a file as PNG or JPEG") from None
    shrink = min(1.0, MOST_PX / max(image.shape))  # a photograph has more than any face can show
    if shrink < 1:
        image = np.asarray(cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA))
    levels = np.asarray(image, np.float32) / 255
    linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    return np.clip(linear, 0.02, 0.95).astype(np.float32)


def image_paint(file: Path) -> Callable[[np.random.Generator, Size], F32]:
    """A painter that puts an image over the complete face."""

    def paint(rng: np.random.Generator, size: Size) -> F32:
        image = cv2.resize(read_image(file), (size[1], size[0]), interpolation=cv2.INTER_AREA)
        return np.asarray(image, np.float32)

    return paint


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
