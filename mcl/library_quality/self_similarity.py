"""How well a library tells its own places apart: each reference taken as a picture, compared with the others.

The costs are those of the sensor model, in nats. A reference is retrieved right when the most similar one
elsewhere is at a neighboring place and looks nearly the same way; it has a look-alike when a far one is more
similar than its neighbors are. Nothing here grows with the square of the library.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64, I32
from ..geometry import wrap
from ..library import Library
from ..map import spacing
from ..sensor.model import SensorModel
from ..sensor.references import distinct_places

Index = NDArray[np.intp]

NEAR = 1.6  # spacings: a neighbor, diagonal ones included
SAME_WAY_RAD = float(np.radians(46))  # a neighbor's heading may be one of eight further
FAR = 3.0  # spacings: what is further off is another place
LEAST_SPACING_M = 0.25  # from a place to the next one
ONE_PLACE = 0.75  # of the distance to the next place: entries that are nearer are at one place
CURVE = (1.0, 2.0, 3.0, 5.0, 8.0)  # borders, in spacings, of the self-similarity curve

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class SelfSimilarity:
    """What came of comparing a library's L entries with each other, over P distinct places."""

    spacing_m: float  # from an entry to the next one that looks the same way: the median
    places: F64  # (P, 2) the middle of the entries at each place
    place_of: I32  # (L,)
    retrieved: I32  # (L,) the most similar entry at another place; -1 where there is none
    error_m: F64  # (L,) how far away that is; nan for none
    error_rad: F64  # (L,) how much its heading differs
    alias: I32  # (L,) the most similar far entry; -1 for none
    margin: F64  # (L,) nats by which that is less similar than the best neighbor; below 0: aliased; nan
    ambiguity: F64  # (L,) effective number of places that fit as well: exp of the entropy, 1 or more
    similarity: (
        F64  # (6,) median cost in nats at another place nearer than 1, 2, 3, 5, 8 spacings, and beyond
    )

    @property
    def aliased(self) -> I32:
        """Entries whose look-alike is more similar than any neighbor, worst first."""
        found = np.flatnonzero(self.margin < 0)
        return np.asarray(found[np.argsort(self.margin[found], kind="stable")], np.int32)

    @property
    def retrieved_right(self) -> float:
        """The share of entries that a neighbor is retrieved for."""
        known = self.retrieved >= 0
        near = (self.error_m <= NEAR * self.spacing_m) & (self.error_rad <= SAME_WAY_RAD)
        return float(near[known].mean()) if known.any() else 0.0

    def at_places(self, values: F64) -> F64:
        """Return the mean (P,) of some values (L,) at each place."""
        count = np.bincount(self.place_of, minlength=len(self.places))
        total = np.bincount(self.place_of, values, len(self.places))
        return np.asarray(total / np.maximum(count, 1))


def self_similarity_of(
    library: Library, sensor: SensorModel, progress: Progress | None = None
) -> SelfSimilarity:
    """Compare every entry with all that are elsewhere."""
    between = max(spacing(distinct_places(library.poses[:, :2])[0]), LEAST_SPACING_M)
    places, place_of = places_of(library.poses[:, :2], between)
    between = max(between, _spacing(library, place_of))
    found: list[tuple[int, float, float, int, float, float]] = []
    curve: list[F64] = []
    for entry in range(library.size):
        others = np.flatnonzero(place_of != place_of[entry])
        cost = _costs(library, sensor, entry)
        found.append(_one(library, place_of, between, entry, others, cost))
        curve.append(_curve(library, between, entry, others, cost))
        if progress:
            progress(entry + 1, library.size)
    retrieved, error_m, error_rad, alias, margin, ambiguity = (
        np.array(column) for column in zip(*found, strict=True)
    )
    return SelfSimilarity(
        spacing_m=between,
        places=places,
        place_of=place_of,
        retrieved=retrieved.astype(np.int32),
        error_m=error_m,
        error_rad=error_rad,
        alias=alias.astype(np.int32),
        margin=margin,
        ambiguity=ambiguity,
        similarity=_medians(np.array(curve)),
    )


def places_of(xy: F64, size_m: float) -> tuple[F64, I32]:
    """Gather positions (L, 2) around the first of those near each other: middles (P, 2), place of each (L,).

    A survey's nodes, about evenly spaced by the size, stay apart.
    """
    firsts, place_of = np.empty((0, 2)), np.empty(len(xy), np.int32)
    for number, at in enumerate(xy):
        apart = np.hypot(*(firsts - at).T)
        if not len(firsts) or apart.min() > ONE_PLACE * size_m:
            place_of[number] = len(firsts)
            firsts = np.vstack([firsts, at])
        else:
            place_of[number] = apart.argmin()
    count = np.bincount(place_of)
    middles = [np.bincount(place_of, xy[:, k]) / count for k in (0, 1)]
    return np.column_stack(middles), place_of


def _spacing(library: Library, place_of: I32) -> float:
    """Return the median distance to the nearest entry elsewhere with a similar heading; 0 for none."""
    nearest = []
    for entry in range(library.size):
        apart_m, turned = _apart(library, entry, np.flatnonzero(place_of != place_of[entry]))
        if (turned <= SAME_WAY_RAD).any():
            nearest.append(apart_m[turned <= SAME_WAY_RAD].min())
    return float(np.median(nearest)) if nearest else 0.0


def _costs(library: Library, sensor: SensorModel, entry: int) -> F64:
    """Return the cost (L,) of every entry for this one's picture."""
    measured = {name: library.index[name].references[entry] for name in sensor.parameters.weights}
    return np.asarray(sensor.compare(measured).cost, np.float64)


def _one(
    library: Library, place_of: I32, between: float, entry: int, others: Index, cost: F64
) -> tuple[int, float, float, int, float, float]:
    """Return what `SelfSimilarity` holds of one entry."""
    if not len(others):
        return -1, np.nan, np.nan, -1, np.nan, 1.0
    apart_m, turned = _apart(library, entry, others)
    best = int(cost[others].argmin())
    near = (apart_m <= NEAR * between) & (turned <= SAME_WAY_RAD)
    far = apart_m > FAR * between
    alias, margin = -1, np.nan
    if far.any():
        alias = int(others[far][cost[others][far].argmin()])
        margin = float(cost[alias] - cost[others][near].min()) if near.any() else np.nan
    return (
        int(others[best]),
        float(apart_m[best]),
        float(turned[best]),
        alias,
        margin,
        _ambiguity(place_of[others], cost[others]),
    )


def _apart(library: Library, entry: int, others: Index) -> tuple[F64, F64]:
    """Return distances (k,) in meters and angles (k,) in radians from one entry to others."""
    step = library.poses[others] - library.poses[entry]
    return np.hypot(step[:, 0], step[:, 1]), np.abs(wrap(step[:, 2]))


def _ambiguity(place_of: I32, cost: F64) -> float:
    """Return how many places fit: exp of the entropy of the places' shares of the likelihood."""
    share = np.bincount(place_of, np.exp(cost.min() - cost))
    share = share[share > 0] / share.sum()
    return float(np.exp(-(share @ np.log(share))))


def _curve(library: Library, between: float, entry: int, others: Index, cost: F64) -> F64:
    """Return the lowest cost (6,) among entries in each range of distance; nan where there are none."""
    apart_m, _ = _apart(library, entry, others)
    ring = np.searchsorted(np.array(CURVE) * between * (1 + 1e-6), apart_m)
    lowest = np.full(len(CURVE) + 1, np.nan)
    for k in range(len(lowest)):
        if (ring == k).any():
            lowest[k] = cost[others[ring == k]].min()
    return lowest


def _medians(curves: F64) -> F64:
    """Return the median of each column (6,), nan where a column knows nothing."""
    columns = [column[np.isfinite(column)] for column in curves.T]
    return np.array([np.median(column) if len(column) else np.nan for column in columns])
