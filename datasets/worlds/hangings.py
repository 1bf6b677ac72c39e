"""What hangs on walls: prints, boards, doors, radiators, sockets, windows with their curtains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from maurice_mcl.values import F32, F64

from . import textures
from . import wall_pictures as pictures
from .draw import Bareness
from .palettes import Rgb, dye, wood
from .solids import Paint, upright
from .world import Face

Interval = tuple[float, float]  # along a wall, inches from its left end


@dataclass(frozen=True, slots=True)
class Wall:
    """One stretch of wall, from left to right as seen from inside its room; inches."""

    left: tuple[float, float]
    right: tuple[float, float]

    @property
    def length_in(self) -> float:
        """Return its width in inches."""
        return float(np.hypot(self.right[0] - self.left[0], self.right[1] - self.left[1]))

    def at(self, along_in: float, out_in: float = 0.0) -> F64:
        """Return the plan point (2,) so far from its left end, and so far out into the room."""
        left, right = np.array(self.left), np.array(self.right)
        ahead = (right - left) / self.length_in
        return np.asarray(left + ahead * along_in + np.array([ahead[1], -ahead[0]]) * out_in)


def hang(
    rng: np.random.Generator, wall: Wall, middle_in: float, width_in: float, span_in: Interval, paint: Paint
) -> Face:
    """Hang something flat on a wall: around a middle from its left end, between two heights."""
    ends = wall.at(middle_in - width_in / 2, 0.3), wall.at(middle_in + width_in / 2, 0.3)
    return upright(rng, ends[0], ends[1], span_in[0], span_in[1], paint, per_inch=5)


def shaded(paint: Paint) -> Paint:
    """Add a thin shadow below and to the right of what hangs on a wall."""

    def framed(rng: np.random.Generator, size: textures.Size) -> F32:
        picture = np.array(paint(rng, size), np.float32)
        picture[-max(1, size[0] // 80) :] *= np.float32(0.35)
        picture[:, -max(1, size[1] // 80) :] *= np.float32(0.45)
        return np.clip(picture, 0.02, 0.95)

    return framed


def printed(rng: np.random.Generator, wall: Wall, middle_in: float, painter: Paint) -> Face:
    """Build a poster or painting, hung low enough for a camera near the floor."""
    width, height = float(rng.uniform(18, 32)), float(rng.uniform(20, 34))
    bottom = float(rng.uniform(9, 20))
    return hang(rng, wall, middle_in, width, (bottom, bottom + height), shaded(painter))


def board(rng: np.random.Generator, wall: Wall, middle_in: float, painter: Paint) -> Face:
    """Build a wide board at the height of a desk."""
    width, top = float(rng.uniform(30, 38)), float(rng.uniform(50, 58))
    return hang(rng, wall, middle_in, width, (26, top), shaded(painter))


def _closed_door(rng: np.random.Generator, wall: Wall, middle_in: float) -> Face:
    color = (0.6, 0.58, 0.53) if rng.random() < 0.5 else wood(rng, 0.2, 0.5)
    return hang(rng, wall, middle_in, 30, (0, 78), partial(pictures.door, color=color))


def radiator(rng: np.random.Generator, wall: Wall, middle_in: float) -> Face:
    """Build a radiator near the floor."""
    return hang(rng, wall, middle_in, 32, (4, 27), pictures.radiator)


Hanging = Callable[[np.random.Generator, Wall, float], Face]

HANGINGS: dict[str, Hanging] = {
    "landscape": partial(printed, painter=pictures.landscape),
    "shapes": partial(printed, painter=pictures.shapes),
    "portrait": partial(printed, painter=pictures.portrait),
    "chart": partial(printed, painter=pictures.chart),
    "notices": partial(board, painter=pictures.notices),
    "whiteboard": partial(board, painter=pictures.whiteboard),
    "door": _closed_door,
    "radiator": radiator,
}


def decorate(
    rng: np.random.Generator,
    wall: Wall,
    kinds: tuple[str, ...],
    every_in: float,
    bare: Bareness,
    skip: tuple[Interval, ...] = (),
) -> list[Face]:
    """Hang something every so often, except across the stretches to skip; and one socket."""
    if wall.length_in < 24:
        return []
    faces = []
    count = max(1, round(wall.length_in / every_in)) if every_in > 0 else 0
    slack = min(5.0, max(0.0, wall.length_in / max(count, 1) / 2 - 17))
    for middle in (np.arange(count) + 0.5) * wall.length_in / max(count, 1):
        at = float(middle + rng.uniform(-slack, slack))
        face = HANGINGS[kinds[int(rng.integers(len(kinds)))]](rng, wall, at)
        left_out = bare.leaves_out()
        if not left_out and not any(low - 18 < at < high + 18 for low, high in skip):
            faces.append(face)
    socket = hang(rng, wall, float(rng.uniform(8, wall.length_in - 8)), 3.0, (10, 14.6), _outlet)
    return [*faces, socket]


def _outlet(rng: np.random.Generator, size: textures.Size) -> F32:
    plate = textures.tint((0.7, 0.69, 0.66), 1 + 0.02 * textures.noise(rng, size, (2, 2)))
    rows, columns = size
    for row in (rows // 4, 3 * rows // 4):
        plate[row - 1 : row + 2, columns // 3 : 2 * columns // 3] = 0.05
    return plate


def window_in(
    rng: np.random.Generator, wall: Wall, middle_in: float, width_in: float, span_in: Interval, glow: float
) -> list[Face]:
    """A window with a sill, and a curtain on either side."""
    half = width_in / 2
    ends = wall.at(middle_in - half, 0.3), wall.at(middle_in + half, 0.3)
    pane = upright(rng, ends[0], ends[1], span_in[0], span_in[1], pictures.window, per_inch=4, glow=glow)
    cloth = partial(pictures.curtain, color=dye(rng))
    low, high = max(3.0, span_in[0] - 8), span_in[1] + 6
    sides = [
        upright(rng, wall.at(middle_in + a, 1.5), wall.at(middle_in + b, 1.5), low, high, cloth, per_inch=4)
        for a, b in ((-half - 6, -half + 3), (half - 3, half + 6))
    ]
    sill_ends = wall.at(middle_in - half, 1.2), wall.at(middle_in + half, 1.2)
    white = partial(textures.plaster, color=(0.62, 0.6, 0.56), stains=0.05)
    sill = upright(rng, *sill_ends, span_in[0] - 1.6, span_in[0], white, per_inch=3)
    return [pane, sill, *sides]


def trim(color: Rgb) -> Paint:
    """Return a painter of boards: with the grain of wood when they are brown, else painted smooth."""
    if color[0] < 1.4 * color[2]:
        return partial(textures.plaster, color=color, stains=0.04)
    return partial(textures.timber, color=color)
