"""The shell of the two rooms: walls, divider with its door gap, floors, and what hangs on the walls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from maurice_mcl.typing import F32, F64

from . import pictures, textures
from .layouts import DEPTH_IN, DIVIDER_IN, DIVIDER_THICK_IN, DOOR_IN, HEIGHT_IN, WIDTH_IN
from .palettes import Rgb, dye, wood
from .solids import Paint, Solid, box_of, faces_of, flat, upright
from .world import Box, Face

WEST_END_IN = DIVIDER_IN - DIVIDER_THICK_IN / 2
EAST_END_IN = DIVIDER_IN + DIVIDER_THICK_IN / 2
DOOR_TOP_IN = 78.0
CASING_IN = 2.7  # how far the frame of the door gap covers the wall beside it
BESIDE_DOOR_IN = (DOOR_IN[0] - CASING_IN, DOOR_IN[1] + CASING_IN)  # where the walls begin again


@dataclass(frozen=True, slots=True)
class Wall:
    """One stretch of wall, from left to right as seen from inside its room; inches."""

    left: tuple[float, float]
    right: tuple[float, float]

    @property
    def length_in(self) -> float:
        """How wide it is."""
        return float(np.hypot(self.right[0] - self.left[0], self.right[1] - self.left[1]))

    def at(self, along_in: float, out_in: float = 0.0) -> F64:
        """Give the plan point (2,) so far from its left end, and so far out into the room."""
        left, right = np.array(self.left), np.array(self.right)
        ahead = (right - left) / self.length_in
        return np.asarray(left + ahead * along_in + np.array([ahead[1], -ahead[0]]) * out_in)


def west_walls() -> tuple[Wall, ...]:
    """South, west and north wall of the west room, then the divider on either side of the door."""
    return (
        Wall((WEST_END_IN, 0), (0, 0)),
        Wall((0, 0), (0, DEPTH_IN)),
        Wall((0, DEPTH_IN), (WEST_END_IN, DEPTH_IN)),
        Wall((WEST_END_IN, DEPTH_IN), (WEST_END_IN, BESIDE_DOOR_IN[1])),
        Wall((WEST_END_IN, BESIDE_DOOR_IN[0]), (WEST_END_IN, 0)),
    )


def east_walls() -> tuple[Wall, ...]:
    """South, east and north wall of the east room, then the divider on either side of the door."""
    return (
        Wall((WIDTH_IN, 0), (EAST_END_IN, 0)),
        Wall((WIDTH_IN, DEPTH_IN), (WIDTH_IN, 0)),
        Wall((EAST_END_IN, DEPTH_IN), (WIDTH_IN, DEPTH_IN)),
        Wall((EAST_END_IN, BESIDE_DOOR_IN[1]), (EAST_END_IN, DEPTH_IN)),
        Wall((EAST_END_IN, 0), (EAST_END_IN, BESIDE_DOOR_IN[0])),
    )


def wall_paints(rng: np.random.Generator, base: Rgb, accent: Rgb) -> tuple[Paint, ...]:
    """Choose how the five walls of a room are finished: two plain, the others each in their own way."""
    papered = partial(textures.wallpaper, color=base, other=accent, period=int(rng.integers(24, 56)))
    boards = partial(textures.panelling, color=accent, board=int(rng.integers(14, 28)))
    finishes: list[Paint] = [
        partial(textures.plaster, color=base),
        partial(textures.plaster, color=accent),
        papered,
        boards,
        partial(textures.plaster, color=base),
    ]
    return tuple(finishes[k] for k in rng.permutation(5))


def trim(color: Rgb) -> Paint:
    """A painter of boards: smooth when they are pale, so painted, else with the grain of wood."""
    if min(color) > 0.4:
        return partial(textures.plaster, color=color, stains=0.04)
    return partial(textures.timber, color=color)


def stand_wall(rng: np.random.Generator, wall: Wall, paint: Paint, skirting: Rgb) -> list[Face]:
    """One wall to the ceiling, with a skirting board in front of it."""
    board = trim(skirting)
    return [
        upright(rng, wall.at(0), wall.at(wall.length_in), 0, HEIGHT_IN, paint),
        upright(rng, wall.at(0, 0.5), wall.at(wall.length_in, 0.5), 0, 4.5, board, per_inch=3),
    ]


def hang(
    rng: np.random.Generator,
    wall: Wall,
    middle_in: float,
    width_in: float,
    span_in: tuple[float, float],
    paint: Paint,
) -> Face:
    """Hang something flat on a wall: around a middle from its left end, between two heights."""
    ends = wall.at(middle_in - width_in / 2, 0.3), wall.at(middle_in + width_in / 2, 0.3)
    return upright(rng, ends[0], ends[1], span_in[0], span_in[1], paint, per_inch=5)


def hang_print(rng: np.random.Generator, wall: Wall, middle_in: float) -> Face:
    """A poster or painting, hung low enough for a camera near the floor."""
    paint = pictures.PRINTS[int(rng.integers(len(pictures.PRINTS)))]
    width, height = float(rng.uniform(18, 32)), float(rng.uniform(20, 34))
    bottom = float(rng.uniform(9, 20))
    return hang(rng, wall, middle_in, width, (bottom, bottom + height), paint)


def decorate(rng: np.random.Generator, wall: Wall, skip_in: tuple[float, float] | None = None) -> list[Face]:
    """Hang something every four feet or so: mostly prints, now and then a door or a radiator."""
    count = max(1, round(wall.length_in / 46))
    middles = (np.arange(count) + 0.5) * wall.length_in / count + rng.uniform(-5, 5, count)
    faces = []
    for middle in middles:
        if skip_in is not None and skip_in[0] - 18 < middle < skip_in[1] + 18:
            continue
        kind = float(rng.random())
        if kind < 0.72:
            faces.append(hang_print(rng, wall, float(middle)))
        elif kind < 0.88:
            leaf = partial(pictures.door, color=door_color(rng))
            faces.append(hang(rng, wall, float(middle), 30, (0, 78), leaf))
        else:
            faces.append(hang(rng, wall, float(middle), 32, (4, 27), pictures.radiator))
    socket = float(rng.uniform(8, wall.length_in - 8))
    return [*faces, hang(rng, wall, socket, 3.0, (10, 14.6), outlet)]


def door_color(rng: np.random.Generator) -> Rgb:
    """Draw the color of a door: painted white, or wood."""
    return (0.6, 0.58, 0.53) if rng.random() < 0.5 else wood(rng, 0.2, 0.5)


def outlet(rng: np.random.Generator, size: textures.Size) -> F32:
    """A socket in the wall: a white plate with two dark holes."""
    plate = textures.tint((0.7, 0.69, 0.66), 1 + 0.02 * textures.noise(rng, size, (2, 2)))
    rows, columns = size
    for row in (rows // 4, 3 * rows // 4):
        plate[row - 1 : row + 2, columns // 3 : 2 * columns // 3] = 0.05
    return plate


def window_in(rng: np.random.Generator, wall: Wall, middle_in: float, glow: float) -> list[Face]:
    """A window that starts a foot and a half above the floor, with a curtain on either side."""
    pane_ends = wall.at(middle_in - 21, 0.3), wall.at(middle_in + 21, 0.3)
    cloth = partial(pictures.curtain, color=dye(rng))
    pane = upright(rng, pane_ends[0], pane_ends[1], 20, 68, pictures.window, per_inch=4, glow=glow)
    sides = [
        upright(rng, wall.at(middle_in + a, 1.5), wall.at(middle_in + b, 1.5), 12, 74, cloth, per_inch=4)
        for a, b in ((-27, -18), (18, 27))
    ]
    return [pane, *sides]


def divider(rng: np.random.Generator, jamb: Rgb) -> tuple[list[Face], list[Box]]:
    """The jambs and casing of the door gap, and the solid wall that throws shadows."""
    paint = trim(jamb)
    casings = [
        Solid(DIVIDER_IN, y, 0, DIVIDER_THICK_IN + 1.4, 3.0, DOOR_TOP_IN)
        for y in (BESIDE_DOOR_IN[0] + 1.5, BESIDE_DOOR_IN[1] - 1.5)
    ]
    lintel = Solid(
        DIVIDER_IN,
        sum(DOOR_IN) / 2,
        DOOR_TOP_IN,
        DIVIDER_THICK_IN,
        DOOR_IN[1] - DOOR_IN[0],
        HEIGHT_IN - DOOR_TOP_IN,
    )
    stubs = [
        Solid(DIVIDER_IN, (low + high) / 2, 0, DIVIDER_THICK_IN, high - low, HEIGHT_IN)
        for low, high in ((0.0, DOOR_IN[0]), (DOOR_IN[1], DEPTH_IN))
    ]
    faces = [
        face
        for solid in (*casings, lintel)
        for face in faces_of(rng, solid, paint, underside=solid is lintel, per_inch=3)
    ]
    return faces, [box_of(solid) for solid in (*casings, lintel, *stubs)]


def shell_boxes() -> list[Box]:
    """Thick outer walls, floor and ceiling, so that light stays inside and corners darken."""
    t, mx, my, mz = 4.0, WIDTH_IN / 2, DEPTH_IN / 2, HEIGHT_IN
    solids = [
        Solid(mx, -t / 2, 0, WIDTH_IN, t, mz),
        Solid(mx, DEPTH_IN + t / 2, 0, WIDTH_IN, t, mz),
        Solid(-t / 2, my, 0, t, DEPTH_IN, mz),
        Solid(WIDTH_IN + t / 2, my, 0, t, DEPTH_IN, mz),
        Solid(mx, my, -t, WIDTH_IN, DEPTH_IN, t),
        Solid(mx, my, mz, WIDTH_IN, DEPTH_IN, t),
    ]
    return [box_of(solid) for solid in solids]


def rectangle(x1: float, y1: float, x2: float, y2: float) -> F64:
    """Give the corners (4, 2) of an upright rectangle, counter-clockwise from its lower left."""
    return np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]])


def lay(
    rng: np.random.Generator, rect_in: F64, paint: Paint, height_in: float, per_inch: float = 5.0
) -> Face:
    """Lay a floor or a rug."""
    return flat(rng, rect_in, height_in, paint, per_inch=per_inch)
