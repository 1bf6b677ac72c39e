"""Which places are nearest, and where tables made of such questions are kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .arrays import F64, I32

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Called with a name, what tables depend on (arrays, numbers) and what makes them; returns them, new or kept.
Tables: TypeAlias = tuple[NDArray[Any], ...]
Keep: TypeAlias = Callable[[str, Sequence[Any], Callable[[], Tables]], Tables]


def made_anew(what: str, of: Sequence[Any], make: Callable[[], Tables]) -> Tables:
    """Make tables, and keep nothing."""
    return make()


SAME_PLACE_M = 0.001  # nearer positions are one


def distinct_places(xy: F64) -> tuple[F64, I32]:
    """Return the distinct positions (P, 2) of entries (L, 2), and which of them each entry (L,) is at."""
    rounded = np.round(xy / SAME_PLACE_M).astype(np.int64)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return xy[first], inverse.astype(np.int32).ravel()


def place_tree(places: F64) -> cKDTree:
    """Return a tree that finds the nearest of some places (P, 2)."""
    from scipy.spatial import cKDTree  # takes a third of a replay's time for imports: tables are kept

    return cKDTree(places)


POINTS_AT_ONCE = 256  # that are compared with the same places


def spacing(places: F64) -> float:
    """Return the median distance from a place (P, 2) to its nearest neighbor; 1 m for a single place."""
    if len(places) < 2:
        return 1.0
    apart = np.empty(len(places))
    for rows in _blocks(places, np.arange(len(places))):
        block = places[rows]
        low, high = block.min(axis=0) - places, places - block.max(axis=0)
        beyond = _squared(np.maximum(np.maximum(low, high), 0).T)  # of the block's sides
        within = np.partition(_squared(np.maximum(-low, -high).T), 1)[1]  # of its farthest corner
        near = places[beyond <= within * (1 + 1e-9)]
        squared = _squared(block.T[:, :, None] - near.T[:, None])
        apart[rows] = np.sqrt(np.partition(squared, 1, axis=1)[:, 1])  # the first is the place itself
    return float(np.median(apart))


def _blocks(points: F64, rows: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Split points (N, 2) by their middles, along the longer side, until few are left together."""
    if len(rows) <= POINTS_AT_ONCE:
        yield rows
        return
    some, half = points[rows], len(rows) // 2
    order = some[:, np.ptp(some, axis=0).argmax()].argpartition(half)
    yield from _blocks(points, rows[order[:half]])
    yield from _blocks(points, rows[order[half:]])


def _squared(offsets: F64) -> F64:
    return np.asarray(offsets[0] * offsets[0] + offsets[1] * offsets[1])
