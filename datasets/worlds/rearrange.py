"""Moving furniture for real after the survey: the map's obstacles follow, the references do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from maurice_loaders.errors import InputError
from maurice_mcl.values import F64, INCH_M, Arena, Domain, Region, rotated, stream

from ..tasks import SimPurpose
from .world import Box, Face, Piece, World, clearance, inside, touching

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
    return replace(world, arena=arena, furniture=tuple(pieces))


def moved(world: World, piece: Piece, others: list[F64], rng: np.random.Generator) -> Piece:
    """Find another place for one piece."""
    x1, y1, x2, y2 = world.arena.bounds
    middle, gaps = piece.plan.mean(axis=0), door_middles(world.arena)
    for _ in range(TRIES):
        place = rng.uniform((x1, y1), (x2, y2))
        turn = float(rng.uniform(-np.pi, np.pi))
        plan = _turned(piece.plan, middle, place, turn)
        far = float(np.linalg.norm(place - middle)) >= LEAST_M
        if far and _stands_free(world.arena, plan, others, gaps):
            return carried(piece, middle, place, turn)
    raise InputError(Path(world.name), f"found no other free place for the {piece.name}; move fewer pieces")


def _stands_free(arena: Arena, plan: F64, others: list[F64], gaps: list[F64]) -> bool:
    if not any(inside(room.polygon, plan).all() for room in arena.rooms):
        return False
    return not any(touching(plan, other) for other in (*others, *gaps))


def door_middles(arena: Arena) -> list[F64]:
    """Return the ground (4, 2) around each door gap: jambs, in no room's outline, come in pairs."""
    jambs = [wall for wall in arena.walls if not _on_outline(arena, wall)]
    grounds = []
    for first, second in zip(jambs[::2], jambs[1::2], strict=True):
        points = np.concatenate([first, second]).reshape(-1, 2)
        (x1, y1), (x2, y2) = points.min(axis=0) - DOOR_M, points.max(axis=0) + DOOR_M
        grounds.append(np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]]))
    return grounds


def _on_outline(arena: Arena, wall: F64) -> bool:
    middle = (wall[:2] + wall[2:])[None] / 2
    return any(_edge_distance(room.polygon, middle) < 1e-6 for room in arena.rooms)


def _edge_distance(polygon: F64, points: F64) -> float:
    edges = np.concatenate([polygon, np.roll(polygon, -1, axis=0)], axis=1)
    return float(clearance(Arena((0, 0, 1, 1), edges), points)[0])


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
