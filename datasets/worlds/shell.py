"""The shell of a building: walls with their skirting, door frames, ceilings, floors, and what is solid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from maurice_mcl.values import F32, F64

from . import textures
from .draw import Bareness, Palette, number, paint_of
from .hangings import Wall, decorate, hang, shaded, trim, window_in
from .openings import Opening, along, check_poster, doors_in, rest_of, stretch, wall_of
from .palettes import Rgb, light_of
from .plan import LightPlan, PosterPlan, RoomPlan, StylePlan, WindowPlan, WorldPlan
from .solids import Paint, Solid, box_of, faces_of, flat, upright
from .world import Box, Face

SIDES = ("south", "east", "north", "west")
WALL_IN = 3.0  # thickness of the boxes that stand for walls: no wall between rooms is thinner
PER_INCH = 4.0
SKIRTING_IN = 4.5


@dataclass(frozen=True, slots=True)
class DrawnStyle:
    """A style as drawn for one room."""

    style: StylePlan
    palette: Palette
    paints: tuple[Paint, Paint, Paint, Paint]  # south, east, north, west
    skirting: Rgb
    lamp: float  # brightness
    lamp_color: Rgb
    daylight: float
    daylight_color: Rgb
    ambient: float


def draw_look(rng: np.random.Generator, style: StylePlan, light: float, bare: Bareness) -> DrawnStyle:
    """Draw colors, paints and lights of one room; all lights are multiplied by `light`."""
    palette = Palette({name: Palette().color(rng, value) for name, value in style.colors})
    plans = [style.walls[k % len(style.walls)] for k in range(4)]
    order = rng.permutation(4) if style.shuffle_walls else np.arange(4)
    paints = [paint_of(rng, plans[k], palette, PER_INCH, plain=bare.leaves_out()) for k in order]
    lamp, daylight = style.lamp, style.daylight

    def color_of(light: LightPlan) -> Rgb:
        return light_of(light.color if isinstance(light.color, str) else str(rng.choice(light.color.options)))

    return DrawnStyle(
        style,
        palette,
        (paints[0], paints[1], paints[2], paints[3]),
        palette.color(rng, style.skirting),
        light * number(rng, lamp.brightness),
        color_of(lamp),
        light * number(rng, daylight.brightness),
        color_of(daylight),
        light * number(rng, style.ambient),
    )


def room_faces(
    rng: np.random.Generator,
    plan: WorldPlan,
    room: RoomPlan,
    look: DrawnStyle,
    windows: tuple[tuple[WindowPlan, float], ...],
    openings: tuple[Opening, ...],
    bare: Bareness,
) -> list[Face]:
    """Everything one sees of a room without its furniture and floor."""
    faces = [_ceiling(rng, room, look), *_lamp_shades(rng, room, look)]
    for name, paint in zip(SIDES, look.paints, strict=True):
        faces += _wall_faces(rng, room, name, paint, look, openings)
        faces += _on_wall(rng, plan, room, name, look, windows, openings, bare)
    return faces


def _ceiling(rng: np.random.Generator, room: RoomPlan, look: DrawnStyle) -> Face:
    paint = paint_of(rng, look.style.ceiling, look.palette, 1.0)
    return flat(rng, rectangle(*room.rect), room.height_in, paint, facing_up=False, per_inch=1)


def _lamp_shades(rng: np.random.Generator, room: RoomPlan, look: DrawnStyle) -> list[Face]:
    if look.lamp == 0:
        return []
    color = np.asarray(look.lamp_color) / max(look.lamp_color) * 0.9
    paint = partial(textures.plaster, color=(float(color[0]), float(color[1]), float(color[2])), stains=0.02)
    faces = []
    for x, y in room.lamps:
        plan = rectangle(x - 8, y - 8, x + 8, y + 8)
        face = flat(rng, plan, room.height_in - 0.5, paint, facing_up=False, per_inch=0.5)
        faces.append(replace(face, glow=2.0 * look.lamp))
    return faces


def _wall_faces(
    rng: np.random.Generator,
    room: RoomPlan,
    name: str,
    paint: Paint,
    look: DrawnStyle,
    openings: tuple[Opening, ...],
) -> list[Face]:
    wall, doors, board = wall_of(room, name), doors_in(room, name, openings), trim(look.skirting)
    faces = []
    for part in rest_of(wall, [(a - o.margin_in, b + o.margin_in) for o, (a, b) in doors]):
        ends = wall.at(part[0]), wall.at(part[1])
        faces.append(upright(rng, *ends, 0, room.height_in, paint, per_inch=PER_INCH))
        front = wall.at(part[0], 0.5), wall.at(part[1], 0.5)
        faces.append(upright(rng, *front, 0, SKIRTING_IN, skirting(board), per_inch=3))
    for opening, (a, b) in doors:
        if opening.top_in < room.height_in:
            low, high = wall.at(a - opening.margin_in), wall.at(b + opening.margin_in)
            faces.append(upright(rng, low, high, opening.top_in, room.height_in, paint, per_inch=PER_INCH))
    return faces


def skirting(board: Paint) -> Paint:
    """Build a skirting board: a lit upper edge, scuffs and dirt near the floor."""

    def paint(rng: np.random.Generator, size: textures.Size) -> F32:
        face = np.array(board(rng, size), np.float32)
        face[:1] *= np.float32(1.25)
        face[1:2] *= np.float32(0.8)
        dirt = 1 - 0.25 * np.clip(textures.noise(rng, size, (3, 20)), 0, 2)
        face[size[0] // 2 :] *= dirt[size[0] // 2 :, :, None]
        face[-2:] *= np.float32(0.55)
        return np.clip(face, 0.02, 0.95)

    return paint


def _on_wall(
    rng: np.random.Generator,
    plan: WorldPlan,
    room: RoomPlan,
    name: str,
    look: DrawnStyle,
    windows: tuple[tuple[WindowPlan, float], ...],
    openings: tuple[Opening, ...],
    bare: Bareness,
) -> list[Face]:
    wall, faces, spans = wall_of(room, name), [], []
    for window, at in windows:
        if window.wall == name:
            middle, half = along(wall, at), window.width_in / 2
            glow = 1.3 * look.daylight
            faces += window_in(rng, wall, middle, window.width_in, (window.sill_in, window.top_in), glow)
            spans.append((middle - half - 6, middle + half + 6))
    for poster in plan.posters:
        if poster.room == room.name and poster.wall == name:
            at = number(rng, poster.at_in)
            check_poster(plan, room, poster, at, openings)
            middle = along(wall, at)
            faces.append(_poster_face(rng, wall, middle, poster, look))
            spans.append((middle - poster.size_in[0] / 2, middle + poster.size_in[0] / 2))
    style = look.style
    doors = doors_in(room, name, openings)
    for part in rest_of(wall, [(a - o.margin_in, b + o.margin_in) for o, (a, b) in doors]):
        skip = tuple((a - part[0], b - part[0]) for a, b in spans)
        faces += decorate(rng, stretch(wall, part), style.hang, style.hang_every_in, bare, skip)
    return faces


def _poster_face(
    rng: np.random.Generator, wall: Wall, middle_in: float, poster: PosterPlan, look: DrawnStyle
) -> Face:
    paint = paint_of(rng, poster.paint, look.palette, 5.0)
    span = (poster.bottom_in, poster.bottom_in + poster.size_in[1])
    return hang(rng, wall, middle_in, poster.size_in[0], span, shaded(paint))


def door_faces(rng: np.random.Generator, opening: Opening) -> tuple[list[Face], list[Box]]:
    """Build the frame of an opening with a threshold, or the bare ends of the wall, and its solid part."""
    if opening.frame is None:
        return _plain_jambs(rng, opening), []
    paint = trim(Palette().color(rng, opening.frame))
    deep = opening.gap[1] - opening.gap[0] + 1.4
    middle, margin = sum(opening.gap) / 2, opening.margin_in
    wide = opening.span[1] - opening.span[0]
    parts = [
        (middle, opening.span[0] - margin + 1.5, 0.0, deep, 3.0, opening.top_in),
        (middle, opening.span[1] + margin - 1.5, 0.0, deep, 3.0, opening.top_in),
        (middle, sum(opening.span) / 2, opening.top_in, deep, wide + 2 * margin, 3.0),
        (middle, sum(opening.span) / 2, 0.0, deep - 1.4, wide, 0.3),  # the threshold
    ]
    solids = [_turned(opening.axis, part) for part in parts]
    faces = [f for s in solids for f in faces_of(rng, s, paint, underside=s is solids[2], per_inch=3)]
    return faces, [box_of(solid) for solid in solids[:3]]


def _turned(axis: int, part: tuple[float, float, float, float, float, float]) -> Solid:
    a, b, z, deep, wide, high = part
    return Solid(a, b, z, deep, wide, high) if axis == 0 else Solid(b, a, z, wide, deep, high)


def _plain_jambs(rng: np.random.Generator, opening: Opening) -> list[Face]:
    paint = partial(textures.plaster, color=(0.55, 0.54, 0.5))
    faces = []
    for edge, turn in ((opening.span[0], 0), (opening.span[1], 1)):
        ends = [np.array(opening.point(g, edge)) for g in opening.gap]
        left, right = ends[:: -1 if turn != opening.axis else 1]
        faces.append(upright(rng, right, left, 0, opening.top_in, paint))
    faces.append(flat(rng, rectangle(*opening.rect), opening.top_in, paint, facing_up=False, per_inch=2))
    return faces


def solid_boxes(plan: WorldPlan, openings: tuple[Opening, ...]) -> list[Box]:
    """Return walls, floor and ceilings as boxes, so that light stays inside and corners darken."""
    solids: dict[Solid, None] = {}
    for room in plan.rooms:
        for name in SIDES:
            wall, doors = wall_of(room, name), doors_in(room, name, openings)
            for a, b in rest_of(wall, [where for _, where in doors]):
                solids[_behind(room, name, (a, b), (0, room.height_in))] = None
            for opening, where in doors:
                if opening.top_in < room.height_in:
                    solids[_behind(room, name, where, (opening.top_in, room.height_in))] = None
    x1, y1, x2, y2 = bounds_of(plan)
    middle = ((x1 + x2) / 2, (y1 + y2) / 2)
    solids[Solid(*middle, -4, x2 - x1, y2 - y1, 4)] = None
    if len({room.height_in for room in plan.rooms}) == 1:
        solids[Solid(*middle, plan.rooms[0].height_in, x2 - x1, y2 - y1, 4)] = None
    else:
        for room in plan.rooms:
            x1, y1, x2, y2 = room.rect
            solids[Solid((x1 + x2) / 2, (y1 + y2) / 2, room.height_in, x2 - x1, y2 - y1, 4)] = None
    return [box_of(solid) for solid in solids]


def _behind(room: RoomPlan, name: str, where: tuple[float, float], heights: tuple[float, float]) -> Solid:
    """Build the solid wall behind a stretch; as thick as the thinnest wall there may be."""
    wall = wall_of(room, name)
    ends = np.stack([wall.at(where[0]), wall.at(where[1], -WALL_IN)]).round(3)
    (x1, y1), (x2, y2) = ends.min(axis=0), ends.max(axis=0)
    size = float(x2 - x1), float(y2 - y1)
    return Solid(float(x1 + x2) / 2, float(y1 + y2) / 2, heights[0], *size, heights[1] - heights[0])


def bounds_of(plan: WorldPlan) -> tuple[float, float, float, float]:
    """Return the rectangle around all rooms, in inches."""
    rects = np.array([room.rect for room in plan.rooms])
    (x1, y1), (x2, y2) = rects[:, :2].min(axis=0), rects[:, 2:].max(axis=0)
    return float(x1), float(y1), float(x2), float(y2)


def rectangle(x1: float, y1: float, x2: float, y2: float) -> F64:
    """Return the corners (4, 2) of an upright rectangle, counter-clockwise from its lower left."""
    return np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]])
