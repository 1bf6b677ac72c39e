"""From a plan and a seed to a world: everything that a file leaves to the seed is drawn here."""

from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path

import numpy as np

from maurice_mcl.values import F64, INCH_M, Arena, Domain, Region, expected_one_of, stream

from ..tasks import TIERS, SimPurpose, Tier
from .draw import PLAIN_PALETTE, Bareness, Palette, number, paint_of
from .furniture import MAKERS, Footprint, block
from .openings import (
    Opening,
    Windows,
    along,
    check_doors,
    check_rooms,
    check_windows,
    map_walls,
    opening_of,
    wall_of,
)
from .plan import FurniturePlan, LibraryPlan, RoomPlan, WorldError, WorldPlan
from .read_plan import read_plan
from .rearrange import with_twin
from .shell import DrawnStyle, bounds_of, door_faces, draw_look, rectangle, room_faces, solid_boxes
from .solids import flat
from .world import Face, Lamp, Piece, RoomLight, World, clearance, inside, touching

GAP_IN = 0.5  # between furniture and the wall it stands against
PER_INCH = 6.0


def place_all(
    rng: np.random.Generator, layout: tuple[FurniturePlan, ...], plan: WorldPlan
) -> tuple[Piece, ...]:
    """Put up all pieces; WorldError if one stands in a wall or in another."""
    rooms = {room.name: room for room in plan.rooms}
    placed: list[tuple[FurniturePlan, Piece]] = []
    for piece in layout:
        built = make(rng, piece, _stand_of(rng, piece, rooms))
        if not any(within(room, built.plan) for room in plan.rooms):
            why = "reaches into a wall or out of its room; move it"
            raise WorldError(plan.file, f"{piece.key}: the {piece.kind} {why}")
        for other, earlier in placed:
            if touching(built.plan, earlier.plan):
                where = f"stands in the {other.kind} of {other.key}"
                raise WorldError(plan.file, f"{piece.key}: the {piece.kind} {where}; move one")
        placed.append((piece, built))
    return tuple(built for _, built in placed)


def make(rng: np.random.Generator, piece: FurniturePlan, stand: Footprint) -> Piece:
    """Make one piece where it stands."""
    if piece.paint is None or piece.height_in is None:
        return MAKERS[piece.kind](rng, stand)
    sides = paint_of(rng, piece.paint, PLAIN_PALETTE, PER_INCH)
    top = sides if piece.top is None else paint_of(rng, piece.top, PLAIN_PALETTE, PER_INCH)
    return block(rng, stand, number(rng, piece.height_in), sides, top)


def _stand_of(rng: np.random.Generator, piece: FurniturePlan, rooms: dict[str, RoomPlan]) -> Footprint:
    width, depth = (number(rng, size) for size in piece.size_in)
    at = [number(rng, value) for value in piece.at_in]
    yaw = number(rng, piece.front) + math.pi / 2  # the front is local -y
    if piece.against is None or piece.room is None:
        return Footprint(at[0], at[1], width, depth, yaw)
    x1, y1, x2, y2 = rooms[piece.room].rect
    away = GAP_IN + depth / 2
    x, y = {
        "south": (at[0], y1 + away),
        "north": (at[0], y2 - away),
        "west": (x1 + away, at[0]),
        "east": (x2 - away, at[0]),
    }[piece.against]
    return Footprint(x, y, width, depth, yaw)


def within(room: RoomPlan, plan_m: F64) -> bool:
    """Return whether an outline (4, 2) in meters lies wholly in a room."""
    (x1, y1), (x2, y2) = plan_m.min(axis=0) / INCH_M, plan_m.max(axis=0) / INCH_M
    return bool(room.rect[0] <= x1 and room.rect[1] <= y1 and x2 <= room.rect[2] and y2 <= room.rect[3])


def build_world(plan: WorldPlan, seed: int, tier: Tier) -> World:
    """Draw the world of a seed; WorldError if what is drawn cannot stand or no node is free."""
    check_rooms(plan)
    openings = tuple(opening_of(plan, door) for door in plan.doors)
    check_doors(plan, openings)
    rng = stream(Domain.SIMULATOR, seed, 0, SimPurpose.WORLD)
    bare = Bareness(tier.bare, stream(Domain.SIMULATOR, seed, 0, SimPurpose.BARE))
    looks = draw_looks(rng, plan, tier.light, bare)
    windows = {room.name: _draw_windows(rng, plan, room, looks[room.name], openings) for room in plan.rooms}
    drawn = plan.layouts[int(rng.integers(len(plan.layouts)))] if plan.layouts else ()
    layout = (*plan.furniture, *drawn)
    pieces = place_all(rng, layout, plan)
    floors, regions = _lay_floors(rng, plan)
    frames = [door_faces(rng, opening) for opening in openings]
    walls = [
        face
        for room in plan.rooms
        for face in room_faces(rng, plan, room, looks[room.name], windows[room.name], openings, bare)
    ]
    arena = map_of(plan, openings, pieces, regions)
    nodes = grid_nodes(plan.library, arena)
    world = World(
        name=f"{plan.name}, seed {seed}",
        arena=arena,
        shell=(*floors, *walls, *(face for faces, _ in frames for face in faces)),
        solid=(*solid_boxes(plan, openings), *(box for _, boxes in frames for box in boxes)),
        furniture=pieces,
        lamps=tuple(lamp for r in plan.rooms for lamp in _lamps_of(r, looks[r.name], windows[r.name])),
        room_lights=tuple(
            light for r in plan.rooms for light in ambient_of(r, looks[r.name], windows[r.name])
        ),
        nodes=nodes[clearance(arena, nodes) > plan.library.clearance_in * INCH_M],
        headings=plan.library.headings,
        start=None if plan.start is None else np.array(plan.start) * [INCH_M, INCH_M, 1.0],
    )
    keys = [piece.key for piece in layout]
    if plan.twins:
        world, keys = with_twin(plan, world), keys * 2
    check_world(plan, world, keys)
    return world


def map_of(
    plan: WorldPlan, openings: tuple[Opening, ...], pieces: tuple[Piece, ...], floors: tuple[Region, ...]
) -> Arena:
    """Return the map of a world, as the robot gets it."""
    x1, y1, x2, y2 = (float(v) for v in np.array(bounds_of(plan)) * INCH_M)
    return Arena(
        (x1, y1, x2, y2),
        map_walls(plan, openings) * INCH_M,
        tuple(Region(piece.name, piece.plan) for piece in pieces),
        floors,
        tuple(Region(room.name, rectangle(*room.rect) * INCH_M) for room in plan.rooms),
    )


def draw_looks(
    rng: np.random.Generator, plan: WorldPlan, light: float, bare: Bareness
) -> dict[str, DrawnStyle]:
    """Draw how each room looks; with `shuffle_styles` the rooms get each other's styles."""
    names = [room.style for room in plan.rooms]
    if plan.shuffle_styles:
        names = [names[int(k)] for k in rng.permutation(len(names))]
    styles = {style.name: style for style in plan.styles}
    return {
        room.name: draw_look(rng, styles[name], light, bare)
        for room, name in zip(plan.rooms, names, strict=True)
    }


def _draw_windows(
    rng: np.random.Generator, plan: WorldPlan, room: RoomPlan, look: DrawnStyle, openings: tuple[Opening, ...]
) -> Windows:
    drawn = tuple((window, number(rng, window.at_in)) for window in room.windows)
    check_windows(plan, room, drawn, openings)
    return drawn if look.daylight > 0 else ()


def _lamps_of(room: RoomPlan, look: DrawnStyle, windows: Windows) -> list[Lamp]:
    lamps = []
    spread = np.array([[-8, -8, -8], [8, -8, -8], [8, 8, -8], [-8, 8, -8.0]])
    for x, y in room.lamps if look.lamp > 0 else ():
        points = (np.array([x, y, room.height_in]) + spread) * INCH_M
        lamps.append(Lamp(f"{room.name} lamp", points, look.lamp * np.array(look.lamp_color)))
    for window, at in windows:
        wall = wall_of(room, window.wall)
        middle, aside = along(wall, at), window.width_in / 3
        low, high = window.sill_in + 10, window.top_in - 18
        heights = (low, high) if low < high else ((window.sill_in + window.top_in) / 2,)
        points = np.array([np.append(wall.at(middle + a, 1), z) for a in (-aside, 0, aside) for z in heights])
        inward = np.append(wall.at(middle, 1) - wall.at(middle, 0), 0.0)
        color = look.daylight * np.array(look.daylight_color)
        lamps.append(Lamp(f"{room.name} window", points * INCH_M, color, inward))
    return lamps


def ambient_of(room: RoomPlan, look: DrawnStyle, windows: Windows) -> list[RoomLight]:
    """Share a room's bounced light out among its lamps and windows; it is half as colored as they are."""
    sources = [
        (f"{room.name} lamp", look.lamp * len(room.lamps), look.lamp_color),
        (f"{room.name} window", look.daylight * len(windows), look.daylight_color),
    ]
    total = sum(strength for _, strength, _ in sources)
    if total == 0:
        sources, total = [(f"{room.name} lamp", 1.0, (1.0, 1.0, 1.0))], 1.0
    here = Region(room.name, rectangle(*room.rect) * INCH_M)
    return [
        RoomLight(name, here, look.ambient * strength / total * (1 + np.array(color)) / 2)
        for name, strength, color in sources
        if strength > 0
    ]


FLOOR_PER_INCH = 5.0


def _lay_floors(rng: np.random.Generator, plan: WorldPlan) -> tuple[list[Face], tuple[Region, ...]]:
    faces, regions = [], []
    for k, floor in enumerate(plan.floors):
        rect = bounds_of(plan) if floor.rect is None else [number(rng, value) for value in floor.rect]
        corners = rectangle(*rect)
        paint = paint_of(rng, floor.paint, Palette(), FLOOR_PER_INCH)
        faces.append(flat(rng, corners, 0.15 * k, paint, per_inch=FLOOR_PER_INCH))
        regions.append(Region(floor.name, corners * INCH_M))
    return faces, tuple(regions)


def grid_nodes(library: LibraryPlan, arena: Arena) -> F64:
    """Return all places (K, 2) of the library's grid in rooms and clear of walls, from the south-west."""
    axes = []
    for axis in (0, 1):
        first, step = library.anchor_in[axis] * INCH_M, library.spacing_in * INCH_M
        low, high = ((arena.bounds[axis + end] - first) / step for end in (0, 2))
        axes.append(first + step * np.arange(np.ceil(low - 1e-9), np.floor(high + 1e-9) + 1))
    nodes = np.stack(np.meshgrid(axes[0], axes[1]), axis=-1).reshape(-1, 2)
    bare = Arena(arena.bounds, arena.walls)
    return nodes[(clearance(bare, nodes) > library.clearance_in * INCH_M) & _in_rooms(arena, nodes)]


def _in_rooms(arena: Arena, points: F64) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    flags = np.zeros(len(points), bool)
    for room in arena.rooms:
        flags |= inside(room.polygon, points)
    return flags


def check_world(plan: WorldPlan, world: World, keys: list[str]) -> None:
    """Raise WorldError for a world without free nodes, or with something solid where the robot starts."""
    if not len(world.nodes):
        why = f"no node of the grid is free in {world.name}; use a smaller spacing or clearance"
        raise WorldError(plan.file, f"library: {why}")
    if world.start is None:
        return
    at = world.start[None, :2]
    if not _in_rooms(world.arena, at)[0]:
        raise WorldError(plan.file, "start.pose: lies in no room; move it into one")
    need = plan.library.clearance_in * INCH_M
    bare = Arena(world.arena.bounds, world.arena.walls)
    if clearance(bare, at)[0] < need:
        raise WorldError(plan.file, "start.pose: has a wall through it or nearer than the clearance; move it")
    for region, key in zip(world.arena.obstacles, keys, strict=True):
        if clearance(Arena(bare.bounds, np.zeros((0, 4)), (region,)), at)[0] < need:
            why = f"has {key} ({region.name}) on it or too near; move one of them"
            raise WorldError(plan.file, f"start.pose: {why}")


# Worlds by name or from a TOML file.


def shipped_worlds() -> dict[str, Path]:
    """Return the worlds that ship, by name."""
    folder = Path(str(files("maurice_datasets.worlds")))
    return {file.stem: file for file in sorted(folder.glob("*.toml"))}


def load_plan(name_or_path: str | Path) -> WorldPlan:
    """Read a shipped world by its name, or a TOML file by its path; WorldError names what is wrong."""
    known = shipped_worlds()
    if str(name_or_path) in known:
        return read_plan(known[str(name_or_path)])
    path = Path(name_or_path)
    if not path.is_file():
        expected = expected_one_of(str(name_or_path), known)
        raise WorldError(path, f"found no world and no TOML file of that name; {expected}")
    return read_plan(path)


def load_world(name_or_path: str | Path, seed: int = 0, tier: str = "nominal") -> World:
    """Return a simulated world: a shipped one by name, or one from a TOML file, as a seed draws it in a tier.

    Lengths in meters, angles in radians. Raises WorldError if name, file or tier is wrong.

        >>> import maurice_datasets as md
        >>> world = md.load_world("two-rooms", seed=0)
        >>> [round(side, 2) for side in world.arena.bounds]
        [0.0, 0.0, 5.18, 3.96]
    """
    return build_world(load_plan(name_or_path), seed, TIERS[check_tier(name_or_path, tier)])


def check_tier(name_or_path: str | Path, tier: str) -> str:
    """Return the name of a tier; WorldError if there is none of that name."""
    if tier not in TIERS:
        raise WorldError(Path(name_or_path), f"found no tier {tier!r}; {expected_one_of(tier, TIERS)}")
    return tier
