"""Distinctive things on walls: posters, boards, rows of books, door panels, windows. Drawn, never loaded."""

from __future__ import annotations

import cv2
import numpy as np

from maurice_mcl.values import F32

from .palettes import SCENES, Rgb, dye, ink, near, pale
from .textures import Size, clouds, noise, tint


def finish(rng: np.random.Generator, picture: F32) -> F32:
    """Return a drawing the unevenness of print and a pale margin."""
    rows, columns = picture.shape[:2]
    worn = picture * (1 + 0.06 * clouds(rng, (rows, columns), rows / 2))[..., None]
    margin = max(1, min(rows, columns) // 24)
    worn[:margin], worn[-margin:] = 0.7, 0.7
    worn[:, :margin], worn[:, -margin:] = 0.7, 0.7
    return np.clip(worn, 0.02, 0.95).astype(np.float32)


def landscape(rng: np.random.Generator, size: Size) -> F32:
    """Sky with clouds, a sun or moon, and four ranges of hills, each nearer and darker."""
    rows, columns = size
    high, low, far, near_by = (np.asarray(c) for c in SCENES[int(rng.integers(len(SCENES)))])
    fade = np.linspace(0, 1, rows, dtype=np.float32)[:, None, None] ** 1.5
    sky = (high * (1 - fade) + low * fade) * (1 + 0.12 * clouds(rng, size, columns / 2))[..., None]
    picture = np.ascontiguousarray(sky, dtype=np.float32)
    sun = (int(rng.uniform(0.2, 0.8) * columns), int(rng.uniform(0.12, 0.4) * rows))
    cv2.circle(picture, sun, max(2, rows // 12), (0.85, 0.78, 0.55), -1, cv2.LINE_AA)
    for layer in range(4):
        bumps = noise(rng, (1, columns), (1, columns / 4)) + 0.3 * noise(rng, (1, columns), (1, columns / 18))
        ridge = rows * (0.42 + 0.15 * layer) + rows * 0.07 * bumps[0]
        share = layer / 3
        slope = (far * (1 - share) + near_by * share) * (1 + 0.35 * clouds(rng, size, rows / 6))[..., None]
        below = np.arange(rows)[:, None] > ridge[None, :]
        picture[below] = slope[below]
    return finish(rng, picture)


def shapes(rng: np.random.Generator, size: Size) -> F32:
    """A modern painting: overlapping discs, bars and triangles in five inks on paper."""
    rows, columns = size
    inks = [ink(rng) for _ in range(5)]
    picture = np.ascontiguousarray(np.broadcast_to(np.array(pale(rng), np.float32), (*size, 3)))
    for k in range(10):
        at = rng.integers((0, 0), (columns, rows), size=(3, 2)).astype(np.int32)
        kind, color = int(rng.integers(3)), inks[k % 5]
        if kind == 0:
            radius = int(rng.uniform(0.06, 0.28) * rows)
            cv2.circle(picture, (int(at[0, 0]), int(at[0, 1])), radius, color, -1, cv2.LINE_AA)
        elif kind == 1:
            cv2.rectangle(picture, at[0].tolist(), at[1].tolist(), color, -1)
        else:
            cv2.fillPoly(picture, [at], color, cv2.LINE_AA)
    return finish(rng, picture)


def portrait(rng: np.random.Generator, size: Size) -> F32:
    """A painted head and shoulders before a plain ground, lit from one side."""
    rows, columns = size
    ground = tint(dye(rng), 1 + 0.3 * clouds(rng, size, rows / 2))
    picture = np.ascontiguousarray(ground)
    x, y = int(columns * rng.uniform(0.42, 0.58)), int(rows * 0.42)
    wide, high, tone = columns // 7, rows // 6, float(rng.uniform(0.16, 0.5))
    hair = near(rng, (0.3 * tone, 0.18 * tone, 0.06))
    skin = (tone, 0.64 * tone, 0.46 * tone)
    oval(picture, (x, y + 2 * high), (wide, high), skin)
    oval(picture, (x, rows), (3 * columns // 8, rows // 3), dye(rng))
    oval(picture, (x, y - high // 5), (wide + wide // 3, high + high // 3), hair)
    oval(picture, (x, y + high // 6), (wide, high), skin)
    for side in (-1, 1):
        oval(picture, (x + side * wide // 2, y), (max(1, wide // 6), max(1, high // 12)), hair)
    oval(picture, (x, y + 2 * high // 3), (wide // 3, max(1, high // 12)), (0.3, 0.08, 0.07))
    shade = np.linspace(0.6, 1.3, columns, dtype=np.float32)[:: 1 if rng.random() < 0.5 else -1]
    brush = 1 + 0.12 * noise(rng, size, (2, 6))
    return finish(rng, picture * shade[None, :, None] * brush[..., None])


def oval(picture: F32, middle: tuple[int, int], radii: tuple[int, int], color: Rgb) -> None:
    """Fill an upright ellipse of a picture in place."""
    cv2.ellipse(picture, middle, radii, 0, 0, 360, color, -1, cv2.LINE_AA)


def chart(rng: np.random.Generator, size: Size) -> F32:
    """A wall map: patches of color on a pale sea, with a grid of lines."""
    height = clouds(rng, size, size[0] / 2)
    sea, land = np.array((0.35, 0.5, 0.65), np.float32), np.array(near(rng, (0.42, 0.40, 0.22)), np.float32)
    hills = np.array(near(rng, (0.40, 0.26, 0.14)), np.float32)
    picture = np.where((height > 0.1)[..., None], land, sea)
    picture = np.where((height > 0.9)[..., None], hills, picture)
    step = max(4, size[0] // 6)
    picture[::step] *= 0.6
    picture[:, ::step] *= 0.6
    return finish(rng, picture.astype(np.float32))


def books(rng: np.random.Generator, size: Size) -> F32:
    """One shelf of books of different height, thickness and color before a dark back."""
    rows, columns = size
    picture = np.full((rows, columns, 3), 0.03, dtype=np.float32)
    left = 0
    while left < columns:
        width = int(rng.integers(max(2, columns // 40), max(4, columns // 12)))
        top = int(rows * rng.uniform(0.06, 0.4))
        if rng.random() < 0.9:
            picture[top:, left : left + width] = np.array(dye(rng)) * rng.uniform(0.6, 1.5)
            picture[top + rows // 8 : top + rows // 5, left : left + width] *= np.float32(1.6)
            picture[top:, left : left + 1] *= np.float32(0.4)
        left += width
    return np.clip(picture * (1 + 0.05 * noise(rng, size, (2, 2)))[..., None], 0.02, 0.95)


def door(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """A door leaf: a frame, four sunken panels with light and dark edges, a brass handle."""
    rows, columns = size
    leaf = tint(color, 1 + 0.05 * clouds(rng, size, rows / 3) + 0.03 * noise(rng, size, (40, 2)))
    picture = np.ascontiguousarray(leaf)
    edge = max(1, columns // 60)
    for top, bottom in ((0.08, 0.46), (0.54, 0.92)):
        for left, right in ((0.14, 0.46), (0.56, 0.88)):
            a = (int(left * columns), int(top * rows))
            b = (int(right * columns), int(bottom * rows))
            picture[a[1] : b[1], a[0] : b[0]] *= np.float32(0.86)
            picture[a[1] : a[1] + edge, a[0] : b[0]] *= np.float32(0.5)
            picture[b[1] - edge : b[1], a[0] : b[0]] *= np.float32(1.25)
            picture[a[1] : b[1], a[0] : a[0] + edge] *= np.float32(0.6)
    handle = (int(0.93 * columns), rows // 2)
    cv2.circle(picture, handle, max(2, columns // 24), (0.55, 0.4, 0.1), -1, cv2.LINE_AA)
    picture[:, :edge] *= np.float32(0.4)
    picture[:, -edge:] *= np.float32(0.4)
    return np.clip(picture, 0.02, 0.95)


def window(rng: np.random.Generator, size: Size) -> F32:
    """Panes with an overcast sky above dark trees, a white cross bar."""
    rows, columns = size
    fade = np.linspace(1, 0.75, rows, dtype=np.float32)[:, None, None]
    sky = np.array((0.75, 0.84, 0.95), np.float32) * fade
    picture = np.ascontiguousarray(np.broadcast_to(sky, (rows, columns, 3)))
    trees = rows * (0.72 + 0.1 * noise(rng, (1, columns), (1, columns / 6))[0])
    below = np.arange(rows)[:, None] > trees[None, :]
    foliage = tint((0.07, 0.11, 0.05), 1 + 0.6 * clouds(rng, size, rows / 6, 3))
    picture[below] = foliage[below]
    bar = max(2, columns // 30)
    for middle in (0, columns // 2, columns):
        picture[:, max(0, middle - bar) : middle + bar] = (0.3, 0.29, 0.27)
    for middle in (0, rows // 2, rows):
        picture[max(0, middle - bar) : middle + bar] = (0.3, 0.29, 0.27)
    return picture


def radiator(rng: np.random.Generator, size: Size, color: Rgb = (0.62, 0.6, 0.55)) -> F32:
    """Upright fins with dark gaps."""
    fin = max(4, size[1] // 14)
    across = (np.arange(size[1]) % fin) / fin
    light = np.where(across < 0.2, 0.2, 0.7 + 0.5 * np.sin(np.pi * across))
    return tint(color, (light[None, :] * (1 + 0.03 * noise(rng, size, (8, 8)))).astype(np.float32))


def curtain(rng: np.random.Generator, size: Size, color: Rgb) -> F32:
    """Hanging cloth in folds."""
    folds = 1 + 0.35 * noise(rng, (1, size[1]), (1, max(size[1] / 9, 2)))
    return tint(color, (folds * (1 + 0.05 * noise(rng, size, (1, 1)))).astype(np.float32))


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
