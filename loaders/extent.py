"""How much ground a survey may cover: one wild pose would make the map's cells larger than the rooms."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from maurice_mcl.arena import Arena
from maurice_mcl.typing import F64

from .errors import LogError

MOST_SPAN_M = 10_000.0  # from its middle to its border float32 still tells half a millimetre


def check_span(file: Path, poses: F64, arena: Arena | None = None) -> None:
    """Raise LogError, naming the file, when poses (L, 2 or 3) or map are over 10 km wide or deep together."""
    xy = poses[:, :2]
    span_m = _span(xy)
    expected = f"expected at most {MOST_SPAN_M:g} m; are they in metres?"
    if span_m > MOST_SPAN_M:
        off = np.abs(xy - np.median(xy, axis=0)).max(axis=1).argmax()
        at = ", ".join(f"{v:.15g}" for v in xy[off])
        raise LogError(file, f"found poses {span_m:g} m apart, the farthest off at ({at}), {expected}")
    if arena is not None:
        span_m = _span(np.concatenate([xy, _corners(arena)]))
        if span_m > MOST_SPAN_M:
            raise LogError(file, f"found a map that with the poses spans {span_m:g} m, {expected}")


def _span(points: F64) -> float:
    """Give the larger of width and depth of points (K, 2)."""
    return float(np.ptp(points, axis=0).max())


def _corners(arena: Arena) -> F64:
    """Give all points (K, 2) that a map names."""
    regions = (*arena.obstacles, *arena.floors, *arena.rooms)
    borders = np.array(arena.bounds).reshape(2, 2)
    return np.concatenate([borders, arena.walls.reshape(-1, 2), *(region.polygon for region in regions)])
