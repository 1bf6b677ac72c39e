"""What all furniture is joined from: parts in a piece's own frame, their paints, and where a piece stands.

A piece stands with its back to local +y and its front to local -y; sizes are inches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from maurice_mcl.geometry import INCH_M

from . import textures
from .palettes import Rgb, dye, wood
from .solids import Paint, Solid, box_of, faces_of, footprint, upright
from .world import Face, Piece


@dataclass(frozen=True, slots=True)
class Stand:
    """Where a piece stands: the middle of its plan, its size there, and which way its back points."""

    x_in: float
    y_in: float
    width_in: float  # along its back
    depth_in: float  # from back to front
    yaw_rad: float = 0.0  # 0: its back to the north (+y)


Part = tuple[Solid, Paint]


def placed(part: Solid, stand: Stand) -> Solid:
    """Bring a part from the piece's own frame into the world."""
    cos, sin = np.cos(stand.yaw_rad), np.sin(stand.yaw_rad)
    x = stand.x_in + float(part.x_in * cos - part.y_in * sin)
    y = stand.y_in + float(part.x_in * sin + part.y_in * cos)
    return replace(part, x_in=x, y_in=y, yaw_rad=part.yaw_rad + stand.yaw_rad)


def assemble(
    rng: np.random.Generator, name: str, stand: Stand, parts: list[Part], extra: tuple[Face, ...] = ()
) -> Piece:
    """Put the parts of one piece up; parts off the floor get an underside."""
    solids = [(placed(solid, stand), paint) for solid, paint in parts]
    faces = [
        face for solid, paint in solids for face in faces_of(rng, solid, paint, underside=solid.z_in > 4)
    ]
    whole = footprint(Solid(stand.x_in, stand.y_in, 0, stand.width_in, stand.depth_in, 1, stand.yaw_rad))
    return Piece(name, (*faces, *extra), tuple(box_of(solid) for solid, _ in solids), whole * INCH_M)


def front_panel(
    rng: np.random.Generator,
    stand: Stand,
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


def cloth_of(color: Rgb) -> Paint:
    """A painter of cloth in one color."""
    return partial(textures.cloth, color=color)


def timber_of(color: Rgb) -> Paint:
    """A painter of wood in one color."""
    return partial(textures.timber, color=color)


def wood_color(rng: np.random.Generator) -> Rgb:
    """Draw a furniture wood, now and then painted white."""
    return (0.66, 0.64, 0.58) if rng.random() < 0.2 else wood(rng)


def clutter(rng: np.random.Generator, stand: Stand, height_in: float, room_in: float) -> list[Part]:
    """Two to four things that lie about on a top: books, a mug, a box; `room_in` is how deep the top is."""
    things: list[Part] = []
    count = int(rng.integers(2, 5))
    for k in range(count):
        x = (k + 0.5) / count * 0.8 * stand.width_in - 0.4 * stand.width_in + float(rng.uniform(-1, 1))
        y, yaw = float(rng.uniform(-0.2, 0.2)) * room_in, float(rng.uniform(-0.6, 0.6))
        kind = int(rng.integers(3))
        wide, deep, high = ((7.0, 5.0, 1.5), (3.2, 3.2, 4.0), (6.0, 4.0, 6.0))[kind]
        high *= float(rng.uniform(0.7, 1.5))
        deep = min(deep, 0.6 * room_in)
        things.append((Solid(x, y, height_in, wide, deep, high, yaw), cloth_of(dye(rng))))
    return things
