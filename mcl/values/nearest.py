"""Which places are nearest, and where tables made of such questions are kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import cv2
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


# of OpenCV, by float32: the nearest is among so many; scipy's tree is no faster, and slow to import
EXACT_TREE, CANDIDATES = 4, 10


def nearest_apart(points: F64) -> F64:
    """Return how far each of N points (N, D) is from the nearest of the others."""
    some = (points - points.mean(axis=0)).astype(np.float32)
    tree = cv2.flann_Index(some, {"algorithm": EXACT_TREE})  # type: ignore[attr-defined]  # of its stubs
    near = tree.knnSearch(some, min(CANDIDATES, len(points)))[0]
    squared = sum(np.square(column[near] - column[:, None]) for column in points.T)
    return np.sqrt(np.partition(squared, 1, axis=1)[:, 1])  # the first is the point itself


def spacing(places: F64) -> float:
    """Return the median distance from a place (P, 2) to its nearest neighbor; 1 m for a single place."""
    return 1.0 if len(places) < 2 else float(np.median(nearest_apart(places)))
