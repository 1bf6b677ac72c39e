"""Surfaces of public buildings: tiles, bricks, linoleum, notice boards, whiteboards. Drawn, never loaded.

Every painter takes a generator and a size in pixels and gives linear reflectance (H, W, 3).
"""

from __future__ import annotations

import cv2
import numpy as np

from maurice_mcl.arrays import F32, Bool

from .palettes import Rgb, ink, near
from .textures import Size, carpet, clouds, noise, tint


def joints(size: Size, step: int, wide: int, shift: int = 0) -> Bool:
    """Return which pixels (H, W) are joints of a square raster; every other row is shifted by `shift`."""
    rows, columns = np.arange(size[0])[:, None], np.arange(size[1])[None, :]
    across = (columns + (rows // step % 2) * shift) % step
    return np.asarray((rows % step < wide) | (across < wide))


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


def paper(rng: np.random.Generator, board: F32, left: int, top: int, size: Size) -> None:
    """Pin a sheet with lines of print on a board, in place; some are colored, some have a picture."""
    rows, columns = size
    tone = near(rng, (0.72, 0.71, 0.68), 0.1) if rng.random() < 0.7 else near(rng, ink(rng), 0.2)
    sheet = board[top : top + rows, left : left + columns]
    sheet[:] = tone
    line = max(2, rows // 12)
    for y in range(line, rows - line, line):
        if rng.random() < 0.8:
            sheet[y : y + max(1, line // 2), columns // 8 : int(columns * rng.uniform(0.5, 0.9))] *= 0.4
    if rng.random() < 0.4:
        sheet[rows // 8 : rows // 2, columns // 6 : 5 * columns // 6] = ink(rng)


def frame(board: F32, color: Rgb, share: int = 28) -> None:
    """Put a frame around a board in place."""
    wide = max(1, min(board.shape[:2]) // share)
    for edge in (board[:wide], board[-wide:], board[:, :wide], board[:, -wide:]):
        edge[:] = color


def notices(rng: np.random.Generator, size: Size) -> F32:
    """A cork board with sheets pinned to it, some over others."""
    rows, columns = size
    board = tint((0.36, 0.22, 0.11), 1 + 0.2 * noise(rng, size, (1, 1)) + 0.08 * clouds(rng, size, 30))
    for _ in range(int(rng.integers(5, 12))):
        high = int(rows * rng.uniform(0.22, 0.4))
        wide = int(high * rng.choice([0.71, 1.41]))
        left = int(rng.integers(0, max(1, columns - wide)))
        top = int(rng.integers(0, max(1, rows - high)))
        paper(rng, board, left, top, (high, wide))
    frame(board, (0.25, 0.2, 0.15))
    return np.clip(board, 0.02, 0.95)


def whiteboard(rng: np.random.Generator, size: Size) -> F32:
    """A whiteboard, badly wiped, with writing and boxes in three pens."""
    rows, columns = size
    board = tint((0.72, 0.73, 0.74), 1 + 0.05 * clouds(rng, size, rows / 2))
    pens = ((0.03, 0.05, 0.25), (0.4, 0.04, 0.04), (0.03, 0.03, 0.03))
    for k in range(int(rng.integers(5, 11))):
        x, y = int(columns * rng.uniform(0.06, 0.7)), int(rows * rng.uniform(0.1, 0.85))
        pen = pens[int(rng.integers(3))]
        if k % 4 == 0:
            corner = (x + int(columns * 0.2), y + int(rows * 0.12))
            cv2.rectangle(board, (x, y), corner, pen, max(1, rows // 90), cv2.LINE_AA)
        steps = np.cumsum(rng.uniform(1, rows / 20, 24))
        wave = y + rows / 40 * rng.standard_normal(24)
        line = np.stack([x + steps, wave], axis=1).astype(np.int32)
        cv2.polylines(board, [line], False, pen, max(1, rows // 120), cv2.LINE_AA)
    frame(board, (0.3, 0.3, 0.31), 40)
    return np.clip(board, 0.02, 0.95)
