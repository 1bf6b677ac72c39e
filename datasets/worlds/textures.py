"""Surfaces, drawn from noise: wood, carpet, plaster, cloth, cardboard, tiles, bricks, linoleum.

Every painter takes a generator, a size in pixels and a base color, and gives linear reflectance (H, W, 3)
in 0.02 to 0.95.
"""

from __future__ import annotations

import cv2
import numpy as np

from maurice_mcl.values import F32, Bool

from .palettes import Rgb

Size = tuple[int, int]  # rows, columns


def noise(rng: np.random.Generator, size: Size, cells: tuple[float, float]) -> F32:
    """Smooth noise (H, W), mean 0, sd about 1; `cells` is how many pixels one blob is high and wide."""
    rows = max(2, round(size[0] / cells[0]) + 2)
    columns = max(2, round(size[1] / cells[1]) + 2)
    coarse = rng.standard_normal((rows, columns)).astype(np.float32)
    return np.asarray(cv2.resize(coarse, (size[1], size[0]), interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def clouds(rng: np.random.Generator, size: Size, largest: float, octaves: int = 4) -> F32:
    """Noise at several scales (H, W), each half as large and 0.6 times as strong as the one before."""
    scales = [largest / 2**k for k in range(octaves) if largest / 2**k >= 1]
    layers = [0.6**k * noise(rng, size, (scale, scale)) for k, scale in enumerate(scales)]
    total = np.sum(layers, axis=0)
    return np.asarray(total / max(float(total.std()), 1e-6), dtype=np.float32)


def tint(color: Rgb, brightness: F32) -> F32:
    """Multiply one color by a brightness map (H, W) around 1, clipped to what a surface can reflect."""
    shades = np.asarray(color, dtype=np.float32) * brightness[..., None]
    return np.asarray(np.clip(shades, 0.02, 0.95), dtype=np.float32)


def plaster(rng: np.random.Generator, size: Size, color: Rgb, stains: float = 0.13) -> F32:
    """Painted plaster: blotches that are large and faint, with a fine grain."""
    return tint(color, 1 + stains * clouds(rng, size, size[0] / 2) + 0.02 * noise(rng, size, (1, 1)))


def wallpaper(rng: np.random.Generator, size: Size, color: Rgb, other: Rgb, period: int) -> F32:
    """Vertical stripes of two colors on paper that has faded unevenly."""
    phase = (np.arange(size[1]) // max(period // 2, 1)) % 2
    base = plaster(rng, size, color, 0.06)
    stripe = np.asarray(other, dtype=np.float32) / np.asarray(color, dtype=np.float32)
    return np.clip(np.where(phase[None, :, None] == 1, base * stripe, base), 0.02, 0.95).astype(np.float32)


def panelling(rng: np.random.Generator, size: Size, color: Rgb, board: int) -> F32:
    """Upright boards with dark joints and a grain of their own."""
    shades = 1 + 0.13 * rng.standard_normal(size[1] // board + 2)
    offset = np.arange(size[1]) + int(rng.integers(board))
    light = shades[offset // board] * np.where(offset % board < max(1, board // 14), 0.45, 1.0)
    grain = 1 + 0.10 * noise(rng, size, (60, 2)) + 0.05 * noise(rng, size, (150, 4))
    return tint(color, (grain * light[None, :]).astype(np.float32))


def planks(rng: np.random.Generator, size: Size, color: Rgb, board: int, length: int) -> F32:
    """A wooden floor: boards along the columns, ends staggered, each board a little different."""
    rows = np.arange(size[0])[:, None] // board
    shift = rng.integers(length, size=size[0] // board + 1)
    along = np.arange(size[1])[None, :] + shift[rows]
    shades = 1 + 0.16 * rng.standard_normal((size[0] // board + 1, size[1] // length + 3))
    light = shades[rows, along // length]
    joint = (np.arange(size[0])[:, None] % board == 0) | (along % length < 1)
    grain = 1 + 0.09 * noise(rng, size, (2, 40)) + 0.05 * noise(rng, size, (5, 120))
    return tint(color, (light * grain * np.where(joint, 0.5, 1.0)).astype(np.float32))


def carpet(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """A worn carpet: tufts a pixel wide, and larger trodden patches."""
    tufts = 0.16 * noise(rng, size, (1, 1)) + 0.10 * noise(rng, size, (3, 3))
    return tint(color, 1 + tufts + 0.10 * clouds(rng, size, 120))


def rug(rng: np.random.Generator, size: Size, color: Rgb, other: Rgb) -> F32:
    """A woven rug: bands of two colors around a middle field."""
    rows, columns = size
    edge = np.minimum.outer(
        np.minimum(np.arange(rows), np.arange(rows)[::-1]),
        np.minimum(np.arange(columns), np.arange(columns)[::-1]),
    )
    band = (edge // max(min(size) // 12, 1)) % 2 == 0
    light = 1 + 0.15 * noise(rng, size, (1, 1)) + 0.08 * clouds(rng, size, 60)
    return np.where(band[..., None], tint(color, light), tint(other, light)).astype(np.float32)


def cloth(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """Upholstery: a fine weave with soft folds."""
    return tint(color, 1 + 0.07 * noise(rng, size, (1, 1)) + 0.12 * clouds(rng, size, size[0] / 2 + 4))


def stripes(rng: np.random.Generator, size: Size, color: Rgb, other: Rgb, count: int) -> F32:
    """Striped cloth, `count` stripes of each color."""
    period = max(2, size[1] // max(count, 1))
    on = (np.arange(size[1]) % period) < period / 2
    weave = 1 + 0.06 * noise(rng, size, (1, 1)) + 0.06 * clouds(rng, size, size[0] / 2 + 4)
    return np.where(on[None, :, None], tint(color, weave), tint(other, weave)).astype(np.float32)


def cardboard(rng: np.random.Generator, size: Size, color: Rgb = (0.42, 0.27, 0.14)) -> F32:
    """A packing box: a strip of tape across, a printed mark, scuffs."""
    board = tint(color, 1 + 0.08 * clouds(rng, size, size[0] / 3 + 2) + 0.04 * noise(rng, size, (2, 30)))
    rows, columns = size
    middle = rows // 2 + int(rng.integers(-rows // 8 - 1, rows // 8 + 1))
    board[middle - max(rows // 20, 1) : middle + max(rows // 20, 1)] *= np.float32(1.35)
    left = int(rng.integers(columns // 8, columns // 2 + 1))
    top = int(rng.integers(rows // 10, rows // 3 + 1))
    board[top : top + rows // 7 + 1, left : left + columns // 4 + 1] *= np.float32(0.35)
    return np.clip(board, 0.02, 0.95)


def timber(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """Furniture wood: one board, the grain along the columns."""
    return tint(color, 1 + 0.12 * noise(rng, size, (2, 50)) + 0.08 * noise(rng, size, (8, 160)))


def leaves(rng: np.random.Generator, size: Size, color: Rgb = (0.10, 0.26, 0.07)) -> F32:
    """Foliage: bright leaves before dark gaps."""
    depth = clouds(rng, size, max(size[0] / 4, 4), 3)
    return tint(color, np.clip(0.85 + 0.75 * depth, 0.12, 2.4))


def joints(size: Size, step: int, wide: int) -> Bool:
    """Return which pixels (H, W) are joints of a square raster."""
    rows, columns = np.arange(size[0])[:, None], np.arange(size[1])[None, :]
    return np.asarray((rows % step < wide) | (columns % step < wide))


def shades(rng: np.random.Generator, size: Size, high: int, wide: int, sd: float) -> F32:
    """Return one brightness per tile (H, W), around 1."""
    rows, columns = np.arange(size[0]) // high, np.arange(size[1]) // wide
    each = 1 + sd * rng.standard_normal((rows[-1] + 1, columns[-1] + 1))
    return np.asarray(each[rows[:, None], columns[None, :]], np.float32)


def tiles(rng: np.random.Generator, size: Size, color: Rgb, step: int) -> F32:
    """Glazed tiles with dark joints, none quite like the next, some of them dirty."""
    light = shades(rng, size, step, step, 0.06) * (1 + 0.08 * clouds(rng, size, 3 * step))
    return tint(color, np.where(joints(size, step, max(1, step // 30)), 0.45 * light, light))


def bricks(rng: np.random.Generator, size: Size, color: Rgb, step: int) -> F32:
    """A brick wall: courses a third as high as a brick is long, pale mortar."""
    high, mortar = max(3, step // 3), max(1, step // 16)
    rows, columns = np.arange(size[0])[:, None], np.arange(size[1])[None, :]
    across = columns + (rows // high % 2) * (step // 2)
    each = 1 + 0.2 * rng.standard_normal((size[0] // high + 1, (size[1] + step) // step + 1))
    light = each[rows // high, across // step] * (1 + 0.12 * noise(rng, size, (2, 2)))
    joint = (rows % high < mortar) | (across % step < mortar)
    return np.where(joint[..., None], tint((0.4, 0.38, 0.35), light), tint(color, light)).astype(np.float32)


def ceiling_tiles(rng: np.random.Generator, size: Size, color: Rgb, step: int) -> F32:
    """A hung ceiling: pale panels with pinholes in a metal raster."""
    holes = np.where(rng.random(size) < 0.06, 0.7, 1.0)
    light = holes * shades(rng, size, step, step, 0.03) * (1 + 0.04 * clouds(rng, size, 2 * step))
    return tint(color, np.where(joints(size, step, max(1, step // 24)), 0.75, light).astype(np.float32))


def carpet_tiles(rng: np.random.Generator, size: Size, color: Rgb, step: int) -> F32:
    """Carpet in squares that are laid this way and that."""
    worn = carpet(rng, size, color) * shades(rng, size, step, step, 0.09)[..., None]
    worn[joints(size, step, 1)] *= np.float32(0.8)
    return np.asarray(np.clip(worn, 0.02, 0.95), np.float32)


def linoleum(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """A sheet floor: fine speckles, paler and darker patches where people walk, scuffs of shoes."""
    speckle = 0.09 * noise(rng, size, (1, 1)) + 0.06 * noise(rng, size, (2, 3))
    floor = tint(color, 1 + speckle + 0.08 * clouds(rng, size, max(size) / 6))
    for _ in range(size[0] * size[1] // 40_000):
        x, y = int(rng.integers(size[1])), int(rng.integers(size[0]))
        end = (x + int(rng.integers(-14, 15)), y + int(rng.integers(-14, 15)))
        cv2.line(floor, (x, y), end, tuple(0.45 * c for c in color), 1, cv2.LINE_AA)
    return floor
