"""Furniture: each piece is a few boxes in its own frame, painted from the generator.

A piece stands with its back to local +y and its front to local -y; sizes are inches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise

import numpy as np

from maurice_mcl.values import F32, INCH_M, rotated

from . import textures
from . import wall_pictures as pictures
from .palettes import Rgb, dye, ink, wood
from .solids import Paint, Solid, box_of, faces_of, footprint, upright
from .world import Face, Piece


@dataclass(frozen=True, slots=True)
class Footprint:
    """The footprint of a piece on the floor: center, size, and the direction of the piece's back."""

    x_in: float
    y_in: float
    width_in: float  # along its back
    depth_in: float  # from back to front
    yaw_rad: float = 0.0  # 0: its back to the north (+y)


Part = tuple[Solid, Paint]


def placed(part: Solid, stand: Footprint) -> Solid:
    """Bring a part from the piece's own frame into the world."""
    x, y = rotated(part.x_in, part.y_in, stand.yaw_rad)
    yaw_rad = part.yaw_rad + stand.yaw_rad
    return replace(part, x_in=stand.x_in + float(x), y_in=stand.y_in + float(y), yaw_rad=yaw_rad)


def assemble(
    rng: np.random.Generator, name: str, stand: Footprint, parts: list[Part], extra: tuple[Face, ...] = ()
) -> Piece:
    """Build the parts of one piece; parts off the floor get an underside."""
    solids = [(placed(solid, stand), paint) for solid, paint in parts]
    each = [faces_of(rng, solid, paint, underside=solid.z_in > 4) for solid, paint in solids]
    whole = footprint(Solid(stand.x_in, stand.y_in, 0, stand.width_in, stand.depth_in, 1, stand.yaw_rad))
    boxes = tuple(box_of(solid) for solid, _ in solids)
    return Piece(name, (*chain.from_iterable(each), *extra), boxes, whole * INCH_M)


def _legs(stand: Footprint, thick_in: float, height_in: float) -> list[Solid]:
    x, y = stand.width_in / 2 - 1.5, stand.depth_in / 2 - 1.5
    corners = [(-1, -1), (1, -1), (-1, 1), (1, 1)]
    return [Solid(sx * x, sy * y, 0, thick_in, thick_in, height_in) for sx, sy in corners]


def front_panel(
    rng: np.random.Generator,
    stand: Footprint,
    span_in: tuple[float, float],
    heights_in: tuple[float, float],
    y_in: float,
    paint: Paint,
) -> Face:
    """Hang a picture on the front of a piece: from local x span, between two heights, at local y."""
    left = placed(Solid(span_in[0], y_in, 0, 1, 1, 1), stand)
    right = placed(Solid(span_in[1], y_in, 0, 1, 1, 1), stand)
    ends = np.array([[left.x_in, left.y_in], [right.x_in, right.y_in]])
    return upright(rng, ends[0], ends[1], heights_in[0], heights_in[1], paint, per_inch=6.0)


def _cloth_of(color: Rgb) -> Paint:
    return partial(textures.cloth, color=color)


def _timber_of(color: Rgb) -> Paint:
    return partial(textures.timber, color=color)


def _wood_color(rng: np.random.Generator) -> Rgb:
    return (0.66, 0.64, 0.58) if rng.random() < 0.2 else wood(rng)


def _clutter(rng: np.random.Generator, stand: Footprint, height_in: float, room_in: float) -> list[Part]:
    parts: list[Part] = []
    count = int(rng.integers(2, 5))
    for k in range(count):
        x = (k + 0.5) / count * 0.8 * stand.width_in - 0.4 * stand.width_in + float(rng.uniform(-1, 1))
        y, yaw = float(rng.uniform(-0.2, 0.2)) * room_in, float(rng.uniform(-0.6, 0.6))
        kind = int(rng.integers(3))
        wide, deep, high = ((7.0, 5.0, 1.5), (3.2, 3.2, 4.0), (6.0, 4.0, 6.0))[kind]
        high *= float(rng.uniform(0.7, 1.5))
        deep = min(deep, 0.6 * room_in)
        parts.append((Solid(x, y, height_in, wide, deep, high, yaw), _cloth_of(dye(rng))))
    return parts


Maker = Callable[[np.random.Generator, Footprint], Piece]


def _sofa(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, color = stand.width_in, stand.depth_in, dye(rng)
    cover = _cloth_of(color)
    parts: list[Part] = [
        (Solid(0, -1, 2.5, w - 8, d - 2, 10), cover),
        (Solid(0, d / 2 - 2.5, 2.5, w, 5, 24), cover),
        (Solid(-w / 2 + 2.5, -0.5, 2.5, 5, d - 1, 15), cover),
        (Solid(w / 2 - 2.5, -0.5, 2.5, 5, d - 1, 15), cover),
        (Solid(0, 0, 0, w - 6, d - 4, 2.5), _timber_of((0.06, 0.05, 0.04))),
    ]
    for k in range(int(rng.integers(2, 4))):
        striped = partial(textures.stripes, color=ink(rng), other=(0.75, 0.72, 0.65), count=5)
        paint = striped if k == 0 else _cloth_of(ink(rng))
        side = (k - 1) * (w / 3.6) + float(rng.uniform(-2, 2))
        parts.append((Solid(side, d / 2 - 7, 12.5, 9, 4, 9.5, float(rng.uniform(-0.2, 0.2))), paint))
    return assemble(rng, "sofa", stand, parts)


def _armchair(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, color = stand.width_in, stand.depth_in, dye(rng)
    cover, leg = _cloth_of(color), _timber_of((0.10, 0.07, 0.05))
    legs: list[Part] = [(solid, leg) for solid in _legs(stand, 1.6, 5)]
    parts: list[Part] = [
        (Solid(0, 0, 5, w - 6, d, 8), cover),
        (Solid(0, d / 2 - 2, 5, w, 4, 24), cover),
        (Solid(-w / 2 + 2, 0, 5, 4, d, 14), cover),
        (Solid(w / 2 - 2, 0, 5, 4, d, 14), cover),
    ]
    return assemble(rng, "armchair", stand, parts + legs)


def _table(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, color = stand.width_in, stand.depth_in, _wood_color(rng)
    height = float(rng.uniform(16, 21))
    paint = _timber_of(color)
    parts: list[Part] = [(solid, paint) for solid in _legs(stand, 2.2, height)]
    parts.append((Solid(0, 0, height, w, d, 1.5), paint))
    parts += _clutter(rng, stand, height + 1.5, d)
    bag, x = _cloth_of(ink(rng)), float(rng.uniform(-0.2, 0.2)) * w
    parts.append((Solid(x, 0, 0, 9, 6, 8, float(rng.uniform(-0.5, 0.5))), bag))
    return assemble(rng, "table", stand, parts)


def _bookcase(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, color = stand.width_in, stand.depth_in, _wood_color(rng)
    height, shelf = float(rng.uniform(46, 62)), 11.5
    rows = int((height - 4) // shelf)
    span, heights = (-w / 2 + 1.2, w / 2 - 1.2), [3 + k * shelf for k in range(rows + 1)]
    shelves = tuple(
        front_panel(rng, stand, span, (low, high - 1.2), -d / 2 - 0.05, pictures.books)
        for low, high in pairwise(heights)
    )
    return assemble(rng, "bookcase", stand, [(Solid(0, 0, 0, w, d, height), _timber_of(color))], shelves)


def _dresser(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, color = stand.width_in, stand.depth_in, _wood_color(rng)
    height, rows = float(rng.uniform(26, 34)), 3
    dark = (color[0] * 0.75, color[1] * 0.75, color[2] * 0.75)
    drawers = tuple(
        front_panel(
            rng,
            stand,
            (-w / 2 + 1.5 + c * w / 2, -0.75 + c * w / 2),
            (2.5 + r * (height - 3) / rows, 1.0 + (r + 1) * (height - 3) / rows),
            -d / 2 - 0.05,
            partial(_drawer, color=dark),
        )
        for r in range(rows)
        for c in range(2)
    )
    body: list[Part] = [(Solid(0, 0, 0, w, d, height), _timber_of(color))]
    return assemble(rng, "dresser", stand, body + _clutter(rng, stand, height, d), drawers)


def _drawer(rng: np.random.Generator, size: textures.Size, color: Rgb) -> F32:
    front = textures.timber(rng, size, color)
    rows, columns = size
    edge = max(1, rows // 16)
    front[:edge] *= np.float32(0.3)
    front[-edge:] *= np.float32(0.3)
    front[:, :edge] *= np.float32(0.3)
    front[:, -edge:] *= np.float32(0.3)
    front[edge : 2 * edge] *= np.float32(1.4)
    knob = slice(rows // 2 - edge, rows // 2 + edge), slice(columns // 2 - 2 * edge, columns // 2 + 2 * edge)
    front[knob] = (0.5, 0.4, 0.2)
    return np.clip(front, 0.02, 0.95)


def _carton(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, height = stand.width_in, stand.depth_in, float(rng.uniform(11, 16))
    parts: list[Part] = [(Solid(0, 0, 0, w, d, height), textures.cardboard)]
    if rng.random() < 0.7:
        small = _cloth_of(ink(rng))
        yaw = float(rng.uniform(-0.6, 0.6))
        parts.append((Solid(0, 0, height, w * 0.6, d * 0.6, float(rng.uniform(6, 10)), yaw), small))
    return assemble(rng, "box", stand, parts)


def _plant(rng: np.random.Generator, stand: Footprint) -> Piece:
    pot = _cloth_of(dye(rng))
    w, height = 0.85 * min(stand.width_in, stand.depth_in), float(rng.uniform(9, 12))
    parts: list[Part] = [
        (Solid(0, 0, 0, 0.72 * w, 0.72 * w, height), pot),
        (Solid(0, 0, height - 0.1, 0.12 * w, 0.12 * w, 6), _timber_of((0.12, 0.08, 0.05))),
        (Solid(0, 0, height + 4, w, w, 13), textures.leaves),
        (Solid(0, 0, height + 6, 1.1 * w, 0.8 * w, 12, 0.8), textures.leaves),
        (Solid(0, 0, height + 15, 0.7 * w, 0.7 * w, 9, 0.4), textures.leaves),
    ]
    return assemble(rng, "plant", stand, parts)


def _desk(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d = stand.width_in, stand.depth_in
    top, steel = (
        _timber_of((0.5, 0.42, 0.33) if rng.random() < 0.6 else wood(rng)),
        _cloth_of((0.2, 0.2, 0.21)),
    )
    black, side = _cloth_of((0.03, 0.03, 0.032)), float(rng.uniform(-0.2, 0.2)) * w
    parts: list[Part] = [
        (Solid(sx * (w / 2 - 1.5), sy * (d / 2 - 1.5), 0, 1.8, 1.8, 28), steel)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    parts += [
        (Solid(0, 0, 28, w, d, 1.2), top),
        (Solid(side, d / 4, 32, 20, 1.6, 12, float(rng.uniform(-0.2, 0.2))), black),
        (Solid(side, d / 4, 29.2, 6, 4, 3), black),
        (Solid(w / 4, -d / 5, 29.2, 9, 11, float(rng.uniform(0.4, 3))), _cloth_of((0.7, 0.69, 0.66))),
        (Solid(-0.33 * w, 0.1 * d, 0, 8, 8, 12), _cloth_of(dye(rng))),  # a bin
        (Solid(side + 3, d / 2 - 1, 0, 0.5, 0.5, 28), black),
    ]
    return assemble(rng, "desk", stand, parts)


def _chair(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d, cover = stand.width_in, stand.depth_in, _cloth_of(dye(rng))
    steel = _cloth_of((0.05, 0.05, 0.055))
    parts: list[Part] = [
        (Solid(0, 0, 1.2, w, 2, 1.5), steel),
        (Solid(0, 0, 1.2, 2, d, 1.5), steel),
        (Solid(0, 0, 2.5, 2.2, 2.2, 13.5), steel),
        (Solid(0, -0.5, 16, w * 0.94, d * 0.9, 3), cover),
        (Solid(0, d / 2 - 1.5, 22, w * 0.86, 2.5, 17), cover),
        (Solid(0, d / 2 - 0.7, 16, 3, 1.2, 12), steel),
    ]
    return assemble(rng, "chair", stand, parts)


def _cabinet(rng: np.random.Generator, stand: Footprint) -> Piece:
    w, d = stand.width_in, stand.depth_in
    height, gray = float(rng.uniform(38, 56)), float(rng.uniform(0.28, 0.5))
    color = (gray, gray, 1.02 * gray)
    doors = tuple(
        front_panel(rng, stand, span, (2.0, height - 1.2), -d / 2 - 0.05, partial(_steel_door, color=color))
        for span in ((-w / 2 + 0.8, -0.15), (0.15, w / 2 - 0.8))
    )
    on_top = (
        Solid(float(rng.uniform(-0.2, 0.2)) * w, 0, height, 0.35 * w, 0.7 * d, 8, 0.1),
        textures.cardboard,
    )
    body: Part = (Solid(0, 0, 0, w, d, height), _cloth_of(color))
    return assemble(rng, "cabinet", stand, [body, on_top], doors)


def _steel_door(rng: np.random.Generator, size: textures.Size, color: Rgb) -> F32:
    rows, columns = size
    leaf = textures.tint(color, 1 + 0.05 * textures.clouds(rng, size, rows / 2))
    leaf[:2] *= np.float32(0.35)
    leaf[:, :2] *= np.float32(0.35)
    leaf[:, -2:] *= np.float32(0.35)
    middle = int(rows * 0.45)
    leaf[middle : middle + rows // 12, columns - columns // 8 : columns - columns // 12] = 0.04
    leaf[rows // 6 : rows // 6 + rows // 20, columns // 4 : columns // 2] = 0.7
    return np.clip(leaf, 0.02, 0.95)


def block(rng: np.random.Generator, stand: Footprint, height_in: float, sides: Paint, top: Paint) -> Piece:
    """Build a plain box, as a world file paints it."""
    solid = Solid(stand.x_in, stand.y_in, 0, stand.width_in, stand.depth_in, height_in, stand.yaw_rad)
    return Piece("block", faces_of(rng, solid, sides, top=top), (box_of(solid),), footprint(solid) * INCH_M)


MAKERS: dict[str, Maker] = {
    "sofa": _sofa,
    "armchair": _armchair,
    "table": _table,
    "bookcase": _bookcase,
    "dresser": _dresser,
    "box": _carton,
    "plant": _plant,
    "desk": _desk,
    "chair": _chair,
    "cabinet": _cabinet,
}
