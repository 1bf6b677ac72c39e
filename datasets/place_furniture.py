"""Putting furniture up: where a plan says, inside a room, and never one piece in another."""

from __future__ import annotations

import math

import numpy as np

from maurice_loaders.errors import LogError
from maurice_mcl.geometry import INCH_M
from maurice_mcl.typing import F64

from .draw import PLAIN_PALETTE, number, paint_of
from .furnish import MAKERS, block
from .joinery import Stand
from .plan import FurniturePlan, Plan, RoomPlan
from .world import Piece, touching

GAP_IN = 0.5  # between furniture and the wall it stands against
PER_INCH = 6.0


def pieces_of(rng: np.random.Generator, plan: Plan) -> tuple[FurniturePlan, ...]:
    """Give the pieces that are always there and those of one layout."""
    layout = plan.layouts[int(rng.integers(len(plan.layouts)))] if plan.layouts else ()
    return (*plan.furniture, *layout)


def place_all(rng: np.random.Generator, layout: tuple[FurniturePlan, ...], plan: Plan) -> tuple[Piece, ...]:
    """Put up all pieces; LogError where one stands in a wall or in another."""
    rooms = {room.name: room for room in plan.rooms}
    placed: list[tuple[FurniturePlan, Piece]] = []
    for piece in layout:
        made = make(rng, piece, stand_of(rng, piece, rooms))
        if not any(within(room, made.plan) for room in plan.rooms):
            raise LogError(
                plan.file, f"{piece.key}: the {piece.kind} reaches into a wall or out of its room; move it"
            )
        for other, earlier in placed:
            if touching(made.plan, earlier.plan):
                raise LogError(
                    plan.file,
                    f"{piece.key}: the {piece.kind} stands in the {other.kind} of {other.key}; move one",
                )
        placed.append((piece, made))
    return tuple(made for _, made in placed)


def make(rng: np.random.Generator, piece: FurniturePlan, stand: Stand) -> Piece:
    """Make one piece where it stands."""
    if piece.paint is None or piece.height_in is None:
        return MAKERS[piece.kind](rng, stand)
    sides = paint_of(rng, piece.paint, PLAIN_PALETTE, PER_INCH)
    top = sides if piece.top is None else paint_of(rng, piece.top, PLAIN_PALETTE, PER_INCH)
    return block(rng, stand, number(rng, piece.height_in), sides, top)


def stand_of(rng: np.random.Generator, piece: FurniturePlan, rooms: dict[str, RoomPlan]) -> Stand:
    """Draw place and size of a piece; with `against` its back is at the wall."""
    width, depth = (number(rng, size) for size in piece.size_in)
    at = [number(rng, value) for value in piece.at_in]
    yaw = number(rng, piece.front) + math.pi / 2  # the front is local -y
    if piece.against is None or piece.room is None:
        return Stand(at[0], at[1], width, depth, yaw)
    x1, y1, x2, y2 = rooms[piece.room].rect
    away = GAP_IN + depth / 2
    x, y = {
        "south": (at[0], y1 + away),
        "north": (at[0], y2 - away),
        "west": (x1 + away, at[0]),
        "east": (x2 - away, at[0]),
    }[piece.against]
    return Stand(x, y, width, depth, yaw)


def within(room: RoomPlan, plan_m: F64) -> bool:
    """Tell whether an outline (4, 2) in metres lies wholly in a room."""
    (x1, y1), (x2, y2) = plan_m.min(axis=0) / INCH_M, plan_m.max(axis=0) / INCH_M
    return bool(room.rect[0] <= x1 and room.rect[1] <= y1 and x2 <= room.rect[2] and y2 <= room.rect[3])
