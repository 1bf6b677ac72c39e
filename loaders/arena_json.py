"""A map as a JSON object, and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from maurice_mcl.arena import Arena, Region

from .fields import FieldError, items, mapping, numbers, text


def arena_to_json(arena: Arena) -> dict[str, Any]:
    """Give the header's `map` object: `bounds_m`, `walls_m`, `obstacles`, `floors`, `rooms`."""
    return {
        "bounds_m": [float(v) for v in arena.bounds],
        "walls_m": arena.walls.tolist(),
        "obstacles": _regions_to_json(arena.obstacles),
        "floors": _regions_to_json(arena.floors),
        "rooms": _regions_to_json(arena.rooms),
    }


def arena_from_json(value: Any) -> Arena:
    """Read a `map` object; all but `bounds_m` may be left out. Raises FieldError."""
    found = mapping(value, "map")
    x_min, y_min, x_max, y_max = numbers(found.get("bounds_m"), 4, "map.bounds_m")
    if x_min >= x_max or y_min >= y_max:
        raise FieldError(f"found map.bounds_m {found['bounds_m']}, expected x_min < x_max and y_min < y_max")
    walls = [numbers(w, 4, "map.walls_m") for w in items(found.get("walls_m", []), "map.walls_m")]
    return Arena(
        (x_min, y_min, x_max, y_max),
        np.array(walls, np.float64).reshape(-1, 4),
        _regions_from_json(found, "obstacles"),
        _regions_from_json(found, "floors"),
        _regions_from_json(found, "rooms"),
    )


def _regions_to_json(regions: Sequence[Region]) -> list[dict[str, Any]]:
    return [{"name": r.name, "polygon_m": r.polygon.tolist()} for r in regions]


def _regions_from_json(found: dict[str, Any], key: str) -> tuple[Region, ...]:
    return tuple(_region(value, f"map.{key}") for value in items(found.get(key, []), f"map.{key}"))


def _region(value: Any, what: str) -> Region:
    found = mapping(value, what)
    corners = [numbers(c, 2, f"{what}.polygon_m") for c in items(found.get("polygon_m"), f"{what}.polygon_m")]
    if len(corners) < 3:
        raise FieldError(f"found {len(corners)} corners in {what}.polygon_m, expected at least 3")
    return Region(text(found.get("name"), f"{what}.name"), np.array(corners, np.float64))
