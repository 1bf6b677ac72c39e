"""The first Maurice arena: two rooms of very different light, drawn from a seed.

What the thesis says (3.1): about 220 square feet, two rooms, obstacles, wood and carpet, strongly different
light. All else is invented.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from maurice_mcl.arena import Arena, Region
from maurice_mcl.geometry import INCH_M
from maurice_mcl.randomness import Domain, stream
from maurice_mcl.typing import F64

from . import rooms, textures
from .addresses import Purpose
from .furnish import MAKERS
from .layouts import (
    COLUMNS,
    DEPTH_IN,
    DIVIDER_IN,
    DOOR_IN,
    HEIGHT_IN,
    LAYOUTS,
    ROWS,
    WIDTH_IN,
    Layout,
    node_in,
    stand_aside,
    stand_for,
)
from .palettes import Rgb, accent, pale, wood
from .solids import flat
from .world import Face, Lamp, Piece, RoomLight, World, clearance

NODE_CLEARANCE_M = 3 * INCH_M  # a node nearer than this to something solid is blocked

WEST = rooms.rectangle(0, 0, DIVIDER_IN, DEPTH_IN)
EAST = rooms.rectangle(DIVIDER_IN, 0, WIDTH_IN, DEPTH_IN)
BOUNDS_M = (0.0, 0.0, WIDTH_IN * INCH_M, DEPTH_IN * INCH_M)
ROOMS = (Region("west room", WEST * INCH_M), Region("east room", EAST * INCH_M))
WINDOW_WALL, WINDOW_SHARE = 1, 0.68  # on the outer side wall of a room, two thirds along it


@dataclass(frozen=True, slots=True)
class Style:
    """How one room is lit and painted."""

    base: Rgb  # most walls
    accent: Rgb  # the others
    skirting: Rgb
    lamp: Rgb  # intensity of its lamp
    ambient: Rgb  # light after many bounces
    window: bool  # daylight as well


def styles(rng: np.random.Generator) -> tuple[Style, Style]:
    """Draw the looks of a room in daylight and of a room with one weak warm lamp."""
    bright = Style(pale(rng), accent(rng), (0.6, 0.58, 0.54), (1.5, 1.38, 1.18), (0.50, 0.50, 0.50), True)
    dim = Style(pale(rng), accent(rng), (0.22, 0.13, 0.07), (0.40, 0.30, 0.19), (0.085, 0.072, 0.06), False)
    return bright, dim


def furniture(rng: np.random.Generator, layout: Layout) -> tuple[Piece, ...]:
    """Put up all pieces of a layout."""
    stands = [(place.kind, stand_for(place, rng)) for place in layout.blocking]
    stands += [(place.kind, stand_aside(place, rng)) for place in layout.asides]
    return tuple(MAKERS[kind](rng, stand) for kind, stand in stands)


def room_faces(rng: np.random.Generator, walls: tuple[rooms.Wall, ...], style: Style) -> list[Face]:
    """Walls of one room with everything that hangs on them; a window takes the middle of the second wall."""
    faces: list[Face] = []
    paints = rooms.wall_paints(rng, style.base, style.accent)
    for k, (wall, paint) in enumerate(zip(walls, paints, strict=True)):
        faces += rooms.stand_wall(rng, wall, paint, style.skirting)
        if style.window and k == WINDOW_WALL:
            middle = wall.length_in * WINDOW_SHARE
            faces += rooms.window_in(rng, wall, middle, glow=1.6)
            faces += rooms.decorate(rng, wall, skip_in=(middle - 27, middle + 27))
        else:
            faces += rooms.decorate(rng, wall)
    return faces


def room_lamps(name: str, walls: tuple[rooms.Wall, ...], polygon_in: F64, style: Style) -> list[Lamp]:
    """The ceiling lamp of a room, and its window if it has one."""
    x, y = polygon_in.mean(axis=0)
    spread = np.array([[-8, -8, 0], [8, -8, 0], [8, 8, 0], [-8, 8, 0.0]])
    lamps = [Lamp(f"{name} lamp", (np.array([x, y, HEIGHT_IN - 8]) + spread) * INCH_M, np.array(style.lamp))]
    if style.window:
        wall = walls[WINDOW_WALL]
        middle = wall.length_in * WINDOW_SHARE
        points = [np.append(wall.at(middle + a, 1), z) for a in (-14, 0, 14) for z in (30, 50)]
        inward = np.append(wall.at(middle, 1) - wall.at(middle, 0), 0.0)
        lamps.append(Lamp(f"{name} window", np.array(points) * INCH_M, np.array([1.1, 1.22, 1.4]), inward))
    return lamps


def floors(rng: np.random.Generator) -> tuple[list[Face], tuple[Region, ...]]:
    """Lay wood throughout, carpet over most of the east room, a rug in the west; and a ceiling."""
    border = float(rng.uniform(122, 134))
    x, y = float(rng.uniform(22, 40)), float(rng.uniform(84, 100))
    everywhere = rooms.rectangle(0, 0, WIDTH_IN, DEPTH_IN)
    fitted = rooms.rectangle(border, 0, WIDTH_IN, DEPTH_IN)
    loose = rooms.rectangle(x, y, x + 44, y + 34)
    boards = partial(textures.planks, color=wood(rng, 0.24, 0.4), board=24, length=300)
    pile = partial(textures.carpet, color=pale(rng, 0.2, 0.36))
    woven = partial(textures.rug, color=accent(rng), other=pale(rng))
    faces = [
        rooms.lay(rng, everywhere, boards, 0.0, 6.0),
        rooms.lay(rng, fitted, pile, 0.15),
        rooms.lay(rng, loose, woven, 0.15),
        flat(
            rng,
            everywhere,
            HEIGHT_IN,
            partial(textures.plaster, color=(0.62, 0.61, 0.58)),
            facing_up=False,
            per_inch=1,
        ),
    ]
    regions = (
        Region("wood", everywhere * INCH_M),
        Region("carpet", fitted * INCH_M),
        Region("carpet", loose * INCH_M),
    )
    return faces, regions


def walls_m() -> F64:
    """Walls of the map (6, 4) in metres: four outside, two stubs of the divider along its middle."""
    w, d, x = WIDTH_IN, DEPTH_IN, DIVIDER_IN
    return INCH_M * np.array(
        [
            [0, 0, w, 0],
            [w, 0, w, d],
            [w, d, 0, d],
            [0, d, 0, 0],
            [x, 0, x, DOOR_IN[0]],
            [x, DOOR_IN[1], x, d],
        ]
    )


def two_rooms(seed: int) -> World:
    """Draw the arena of a seed: its layout, furniture, textures and light."""
    rng = stream(Domain.SIMULATOR, seed, 0, Purpose.WORLD)
    layout = LAYOUTS[int(rng.integers(len(LAYOUTS)))]
    bright, dim = styles(rng)
    west, east = (bright, dim) if rng.random() < 0.5 else (dim, bright)
    pieces = furniture(rng, layout)
    floor_faces, floor_regions = floors(rng)
    jambs, jamb_boxes = rooms.divider(rng, bright.skirting)
    west_faces = room_faces(rng, rooms.west_walls(), west)
    east_faces = room_faces(rng, rooms.east_walls(), east)
    obstacles = tuple(Region(piece.name, piece.plan) for piece in pieces)
    arena = Arena(BOUNDS_M, walls_m(), obstacles, floor_regions, ROOMS)
    lamps = room_lamps("west room", rooms.west_walls(), WEST, west)
    lamps += room_lamps("east room", rooms.east_walls(), EAST, east)
    return World(
        name=f"two rooms, seed {seed}",
        arena=arena,
        shell=(*floor_faces, *west_faces, *east_faces, *jambs),
        solid=(*rooms.shell_boxes(), *jamb_boxes),
        furniture=pieces,
        lamps=tuple(lamps),
        room_lights=tuple(
            light for room, style in zip(ROOMS, (west, east), strict=True) for light in ambient(room, style)
        ),
        nodes=free_nodes(arena),
        headings=8,
    )


def ambient(room: Region, style: Style) -> list[RoomLight]:
    """Share the light of a room after many bounces out among its lamp and, where it has one, its window."""
    everything = np.array(style.ambient)
    if not style.window:
        return [RoomLight(f"{room.name} lamp", room, everything)]
    return [
        RoomLight(f"{room.name} lamp", room, 0.4 * everything),
        RoomLight(f"{room.name} window", room, 0.6 * everything),
    ]


def grid_nodes() -> F64:
    """All 88 places (88, 2) of the library's grid in metres, row by row from the south-west."""
    return INCH_M * np.array([[node_in(i), node_in(j)] for j in range(ROWS) for i in range(COLUMNS)])


def free_nodes(arena: Arena) -> F64:
    """Those places of the grid (K, 2) where a robot can stand: 78 of 88 in every arena of this file."""
    nodes = grid_nodes()
    return nodes[clearance(arena, nodes) > NODE_CLEARANCE_M]
