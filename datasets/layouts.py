"""Where furniture stands: four layouts of the two rooms, each blocking exactly ten of the 88 library nodes.

Nodes lie at 8 + 18k inches, 11 columns by 8 rows (thesis figure 19: x = 80, y = 8); the dividing wall is at
x = 107 in, its door gap from y = 52 to 90 in, in all layouts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .furnish import Stand

WIDTH_IN, DEPTH_IN, HEIGHT_IN = 204.0, 156.0, 96.0  # 17 x 13 ft (thesis 3.1); the height is invented
DIVIDER_IN, DIVIDER_THICK_IN = 107.0, 4.0
DOOR_IN = (52.0, 90.0)  # y of the gap
GAP_IN = 0.5  # between furniture and an outer wall
FIRST_NODE_IN, NODE_STEP_IN = 8.0, 18.0
COLUMNS, ROWS = 11, 8

Back = Literal["north", "south", "east", "west", "free"]
YAW_RAD: dict[Back, float] = {
    "north": 0.0,
    "west": np.pi / 2,
    "south": np.pi,
    "east": -np.pi / 2,
    "free": 0.0,
}


@dataclass(frozen=True, slots=True)
class Blocking:
    """A piece that stands on library nodes: columns and rows are first and last, inclusive."""

    kind: str
    columns: tuple[int, int]
    rows: tuple[int, int]
    back: Back


@dataclass(frozen=True, slots=True)
class Aside:
    """A shallow piece along the north wall, beyond the last row of nodes: it blocks none."""

    kind: str
    span_in: tuple[float, float]  # x from, to


@dataclass(frozen=True, slots=True)
class Layout:
    """All furniture of one arena."""

    blocking: tuple[Blocking, ...]  # ten nodes together
    asides: tuple[Aside, ...]


LAYOUTS: tuple[Layout, ...] = (
    Layout(
        (
            Blocking("sofa", (1, 3), (0, 0), "south"),
            Blocking("bookcase", (0, 0), (4, 5), "west"),
            Blocking("box", (3, 3), (5, 5), "free"),
            Blocking("table", (8, 9), (3, 3), "free"),
            Blocking("armchair", (10, 10), (7, 7), "north"),
            Blocking("plant", (7, 7), (0, 0), "free"),
        ),
        (Aside("dresser", (38, 76)), Aside("bookcase", (126, 158))),
    ),
    Layout(
        (
            Blocking("sofa", (7, 9), (0, 0), "south"),
            Blocking("bookcase", (10, 10), (4, 5), "east"),
            Blocking("table", (1, 2), (4, 4), "free"),
            Blocking("armchair", (0, 0), (7, 7), "north"),
            Blocking("box", (3, 3), (1, 1), "free"),
            Blocking("plant", (4, 4), (7, 7), "free"),
        ),
        (Aside("dresser", (128, 166)), Aside("bookcase", (30, 62))),
    ),
    Layout(
        (
            Blocking("sofa", (0, 0), (2, 4), "west"),
            Blocking("bookcase", (8, 9), (0, 0), "south"),
            Blocking("table", (3, 3), (4, 5), "free"),
            Blocking("armchair", (10, 10), (3, 3), "east"),
            Blocking("box", (8, 8), (5, 5), "free"),
            Blocking("plant", (0, 0), (7, 7), "free"),
        ),
        (Aside("bookcase", (50, 88)), Aside("dresser", (130, 168))),
    ),
    Layout(
        (
            Blocking("sofa", (10, 10), (2, 4), "east"),
            Blocking("bookcase", (1, 2), (0, 0), "south"),
            Blocking("table", (2, 2), (3, 4), "free"),
            Blocking("armchair", (7, 7), (7, 7), "north"),
            Blocking("box", (8, 8), (1, 1), "free"),
            Blocking("plant", (4, 4), (0, 0), "free"),
        ),
        (Aside("dresser", (20, 54)), Aside("bookcase", (150, 186))),
    ),
)


def node_in(index: int) -> float:
    """Give where a node lies along x or y, in inches."""
    return FIRST_NODE_IN + NODE_STEP_IN * index


def span_of(first: int, last: int, reach_in: float) -> tuple[float, float]:
    """Give the stretch that covers nodes first to last and `reach_in` more at either end."""
    return node_in(first) - reach_in, node_in(last) + reach_in


def stand_for(place: Blocking, rng: np.random.Generator) -> Stand:
    """Give plan and direction of a piece: over its nodes, back to its wall, an inch or two by chance."""
    reach = float(rng.uniform(6.5, 8.5))
    x = span_of(*place.columns, reach)
    y = span_of(*place.rows, reach)
    match place.back:
        case "south":
            y = (0.0, y[1])
        case "north":
            y = (y[0], DEPTH_IN)
        case "west":
            x = (0.0, x[1])
        case "east":
            x = (x[0], WIDTH_IN)
        case "free":
            pass
    x = (max(x[0], GAP_IN), min(x[1], WIDTH_IN - GAP_IN))
    y = (max(y[0], GAP_IN), min(y[1], DEPTH_IN - GAP_IN))
    across, along = x[1] - x[0], y[1] - y[0]
    sideways = place.back in ("east", "west")
    width, depth = (along, across) if sideways else (across, along)
    turn = float(rng.uniform(-0.3, 0.3)) if place.kind == "box" else 0.0
    shrink = 0.85 if place.kind == "box" else 1.0
    return Stand(sum(x) / 2, sum(y) / 2, width * shrink, depth * shrink, YAW_RAD[place.back] + turn)


def stand_aside(place: Aside, rng: np.random.Generator) -> Stand:
    """Stand a shallow piece against the north wall."""
    depth = float(rng.uniform(9.5, 11.5))
    middle = sum(place.span_in) / 2 + float(rng.uniform(-3, 3))
    return Stand(middle, DEPTH_IN - GAP_IN - depth / 2, place.span_in[1] - place.span_in[0], depth)
