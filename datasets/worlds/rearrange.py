"""Moving furniture for real after the survey: the map's obstacles follow, the references do not.

And rooms that are twins: a world whose second room is the first, turned by half a turn.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.values import F64, INCH_M, Arena, Domain, Region, rotated, stream

from ..tasks import SimPurpose
from .plan import WorldError, WorldPlan
from .world import Box, Face, Lamp, Piece, World, inside, segment_distance, sides_of, touching

LEAST_M = 24 * INCH_M  # every piece is moved at least so far
DOOR_M = 10 * INCH_M  # no piece comes nearer to a door
TRIES = 4000  # places tried for one piece before it is given up


def move_things(world: World, count: int, seed: int) -> World:
    """Move `count` pieces of furniture to other free places, each at least 24 in away, any way round.

    They stand in rooms, clear of doors and each other. InputError for too few pieces or no free place.
    """
    if count > len(world.furniture):
        why = f"found {len(world.furniture)} pieces of furniture"
        raise InputError(Path(world.name), f"{why}, fewer than the {count} to move; move fewer")
    rng = stream(Domain.SIMULATOR, seed, 0, SimPurpose.MOVED)
    pieces = list(world.furniture)
    for k in rng.permutation(len(pieces))[:count]:
        others = [piece.plan for j, piece in enumerate(pieces) if j != k]
        pieces[k] = moved(world, pieces[k], others, rng)
    obstacles = tuple(Region(piece.name, piece.plan) for piece in pieces)
    arena = replace(world.arena, obstacles=obstacles)
    return replace(world, arena=arena, furniture=tuple(pieces), twins=False)


def moved(world: World, piece: Piece, others: list[F64], rng: np.random.Generator) -> Piece:
    """Find another place for one piece."""
    x1, y1, x2, y2 = world.arena.bounds
    middle, gaps = piece.plan.mean(axis=0), door_middles(world.arena)
    for _ in range(TRIES):
        place = rng.uniform((x1, y1), (x2, y2))
        turn = float(rng.uniform(-np.pi, np.pi))
        plan = _turned(piece.plan, middle, place, turn)
        far = float(np.linalg.norm(place - middle)) >= LEAST_M
        in_room = far and any(inside(room.polygon, plan).all() for room in world.arena.rooms)
        if in_room and not any(touching(plan, other) for other in (*others, *gaps)):
            return carried(piece, middle, place, turn)
    raise InputError(Path(world.name), f"found no other free place for the {piece.name}; move fewer pieces")


def door_middles(arena: Arena) -> list[F64]:
    """Return the ground (4, 2) around each door gap: jambs, in no room's outline, come in pairs."""
    middles = (arena.walls[:, :2] + arena.walls[:, 2:]) / 2
    outlines = np.concatenate([sides_of(room.polygon) for room in arena.rooms])
    jambs = arena.walls[segment_distance(middles, outlines) >= 1e-6]
    grounds = []
    for first, second in zip(jambs[::2], jambs[1::2], strict=True):
        points = np.concatenate([first, second]).reshape(-1, 2)
        (x1, y1), (x2, y2) = points.min(axis=0) - DOOR_M, points.max(axis=0) + DOOR_M
        grounds.append(np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]]))
    return grounds


def _spun(points: F64, turn: float) -> F64:
    result = np.array(points, dtype=np.float64)
    result[..., 0], result[..., 1] = rotated(points[..., 0], points[..., 1], turn)
    return result


def _turned(plan: F64, middle: F64, place: F64, turn: float) -> F64:
    return np.asarray(_spun(plan - middle, turn) + place)


def carried(piece: Piece, middle: F64, place: F64, turn: float) -> Piece:
    """Bring a piece with all it has from around `middle` to another place, turned."""
    before, after = np.append(middle, 0.0), np.append(place, 0.0)

    def point(at: F64) -> F64:
        return np.asarray(_spun(at - before, turn) + after)

    faces = tuple(
        Face(point(face.corner), _spun(face.across, turn), _spun(face.down, turn), face.albedo, face.glow)
        for face in piece.faces
    )
    boxes = []
    for box in piece.boxes:
        x, y, z = (float(v) for v in point(np.array(box.center)))
        boxes.append(Box((x, y, z), box.half, box.yaw_rad + turn))
    return Piece(piece.name, faces, tuple(boxes), _turned(piece.plan, middle, place, turn))


# Twins: what is nearer to the first room stays, and stands once more on the other side of the middle.

TURNED = np.array([-1.0, -1.0, 1.0])  # a direction after half a turn
NEAR_M = 1e-6


def with_twin(plan: WorldPlan, world: World) -> World:
    """Make the second of two rooms the first, turned by half a turn about the world's middle, with all in it.

    WorldError unless that brings the walls onto themselves, and if furniture stands in the second room.
    """
    if len(world.arena.rooms) != 2 or not _unturned(world, world.arena.walls.reshape(-1, 2, 2).mean(axis=1)):
        why = "expected two rooms and a door that half a turn about their middle brings onto themselves"
        raise WorldError(plan.file, f"twins: {why}; change rect of [[room]] or [[door]]")
    if any(_side(world, piece.plan.mean(axis=0)) <= 0 for piece in world.furniture):
        why = "stands in the second room, which is a copy of the first; leave it out"
        raise WorldError(plan.file, f"twins: some furniture {why}")
    shell = tuple(chain.from_iterable(_of_first(world, face) for face in world.shell))
    pieces, rooms = world.furniture, world.arena.rooms
    lamps = [lamp for lamp in world.lamps if lamp.source.startswith(rooms[0].name)]
    lights = [light for light in world.room_lights if light.room.name == rooms[0].name]
    rugs = [floor for floor in world.arena.floors[1:] if _side(world, floor.polygon.mean(axis=0)) > 0]
    turned = tuple(_turned_piece(world, piece) for piece in pieces)
    rugs += [Region(rug.name, world.turned(rug.polygon)) for rug in rugs]
    obstacles = tuple(Region(piece.name, piece.plan) for piece in (*pieces, *turned))
    floors = (world.arena.floors[0], *rugs)
    nodes = np.array([node for node in world.nodes if inside(rooms[0].polygon, node[None])[0]]).reshape(-1, 2)
    return replace(
        world,
        arena=replace(world.arena, obstacles=obstacles, floors=floors),
        shell=(*shell, *(_turned_face(world, face) for face in shell)),
        furniture=(*pieces, *turned),
        lamps=(*lamps, *(_turned_lamp(world, lamp) for lamp in lamps)),
        room_lights=(
            *lights,
            *(replace(light, source=world.twin_of(light.source), room=rooms[1]) for light in lights),
        ),
        nodes=np.concatenate([nodes, world.turned(nodes)]),
        twins=True,
    )


def _unturned(world: World, points: F64) -> bool:
    """Return whether half a turn about a world's middle brings points (K, 2) onto themselves."""
    apart = np.abs(world.turned(points)[:, None] - points).max(axis=2)
    return bool((apart.min(axis=1) < NEAR_M).all())


def _side(world: World, point: F64) -> float:
    """Return how far a point (2,) lies on the first room's side of the middle; across it where that is 0."""
    first, second = (room.polygon.mean(axis=0) for room in world.arena.rooms)
    ahead = (first - second) / np.linalg.norm(first - second)
    away = point - (first + second) / 2
    along = float(away @ ahead)
    return along if abs(along) > NEAR_M else float(away @ [-ahead[1], ahead[0]])


def _of_first(world: World, face: Face) -> tuple[Face, ...]:
    """Return a face on the first room's side, half of one that lies about the middle, nothing of others."""
    side = _side(world, (face.corner + (face.across + face.down) / 2)[:2])
    if abs(side) <= NEAR_M:
        half = face.albedo.shape[1] // 2
        return (replace(face, across=face.across / 2, albedo=face.albedo[:, :half]),)
    return (face,) if side > 0 else ()


def _turned_face(world: World, face: Face) -> Face:
    across, down = face.across * TURNED, face.down * TURNED
    return replace(face, corner=world.turned(face.corner), across=across, down=down)


def _turned_piece(world: World, piece: Piece) -> Piece:
    faces = tuple(_turned_face(world, face) for face in piece.faces)
    boxes = []
    for box in piece.boxes:
        x, y, z = world.turned(np.array(box.center)).tolist()
        boxes.append(replace(box, center=(x, y, z), yaw_rad=box.yaw_rad + np.pi))
    return Piece(piece.name, faces, tuple(boxes), world.turned(piece.plan))


def _turned_lamp(world: World, lamp: Lamp) -> Lamp:
    facing = None if lamp.facing is None else lamp.facing * TURNED
    return replace(lamp, source=world.twin_of(lamp.source), points=world.turned(lamp.points), facing=facing)
