"""Estimates: one pose for a weighted cloud, how much of the cloud agrees, and its evidence."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cmp_to_key, lru_cache
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ..values.arrays import F32, F64, I32, Bool, dot
from ..values.geometry import INCH_M, circular_mean, circular_mean_of, wrap
from ..values.radii import USUAL, Radii
from ..values.records import Belief, EntryLikelihood, Estimate

CELLS_A_CLUSTER = 4  # in its radius: the mode is first sought on a raster of such cells ...
MOST_CELLS_A_SIDE = 400  # ... or of larger ones, where the cloud is spread over more than a hundred radii
SETTLED_M = 0.001  # a mean that shifts by less has converged
MOST_SHIFTS = 30  # an evenly spread cloud has no mode to converge to
CIRCLE_M = 6 * INCH_M  # radius of a circle one foot in diameter: the thesis's measure of success (3.6.2)
TIE = 1e-9  # relative difference below which shares of weight are equal: processors round differently

Modes: TypeAlias = tuple[Estimate, ...]
Point: TypeAlias = tuple[float, float]  # x_m, y_m relative to the belief's origin


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """A cloud column by column, float64: what every estimate of it reads."""

    x: F64  # (N,) relative to the origin, contiguous: many times faster than (N, 2)
    y: F64
    heading_rad: F32
    sin: F64  # of the headings
    cos: F64

    @classmethod
    def of(cls, belief: Belief) -> _Columns:
        """Take a cloud apart."""
        x, y, heading = belief.poses.T
        return cls(_wide(x), _wide(y), heading, _wide(np.sin(heading)), _wide(np.cos(heading)))


def _wide(column: F32) -> F64:
    return column.astype(np.float64)


def estimates(belief: Belief, radii: Radii = USUAL) -> tuple[Estimate, Estimate]:
    """Return `heaviest_cluster` and `weighted_mean`, for less than both."""
    columns, weights = _Columns.of(belief), belief.weights
    held = weights * _heaviest(columns, weights, radii.cluster_m)
    scored = _stand_for(belief, columns, held, radii)
    return scored, _stand_for(belief, columns, weights, radii)


def weighted_mean(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the mean of the entire cloud. With several modes it lies between them."""
    return _stand_for(belief, _Columns.of(belief), belief.weights, radii)


def heaviest_cluster(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the heaviest cluster, by mean shift with a flat kernel of `cluster_m`: the scored estimate.

    Of equals the lowest y wins, then x, by cells of a quarter of that.
    """
    columns, weights = _Columns.of(belief), belief.weights
    return _stand_for(belief, columns, weights * _heaviest(columns, weights, radii.cluster_m), radii)


def best_particle(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the particle with the most weight, the first of equals; its spread is zero."""
    weights = belief.weights
    held = np.zeros_like(weights)
    best = first_heaviest(weights)
    held[best] = weights[best]
    return _stand_for(belief, _Columns.of(belief), held, radii)


def modes(belief: Belief, radii: Radii = USUAL, *, most: int = 5, least: float = 0.01) -> Modes:
    """Return at most `most` clusters with at least the share `least` of the weight, heaviest first.

    Each holds the particles within `cluster_m` of its mode that are in no earlier cluster.
    """
    least *= 1 - TIE
    columns, left, found = _Columns.of(belief), belief.weights, list[Estimate]()
    while len(found) < most and float(left.sum()) >= least:
        held = left * _heaviest(columns, left, radii.cluster_m)
        if float(held.sum()) < least:
            break
        found.append(_stand_for(belief, columns, held, radii))
        left = np.asarray(np.where(held > 0, 0, left))
    return tuple(sorted(found, key=cmp_to_key(_heavier_first)))


def first_heaviest(weights: NDArray[Any]) -> int:
    """Return the flat index of the largest weight (any shape), the first of equals within rounding."""
    return int((weights >= weights.max() * (1 - TIE)).argmax())


def covariance(belief: Belief) -> F64:
    """Return the weighted covariance (3, 3) of x_m, y_m and heading_rad about their (circular) means."""
    weights = belief.weights
    x, y = _columns(belief)
    middle, _ = circular_mean(belief.poses[:, 2], weights)
    turn = wrap(belief.poses[:, 2].astype(np.float64) - middle)
    off = np.stack([x - dot(weights, x), y - dot(weights, y), turn])
    return np.array([[dot(a * weights, b) for b in off] for a in off])


def share_within(belief: Belief, pose: F64, radius_m: float) -> float:
    """Return the share of weight within a radius (inclusive) of a pose's position in the map's frame."""
    weights = belief.weights
    x, y = _columns(belief)
    center = (float(pose[0] - belief.origin[0]), float(pose[1] - belief.origin[1]))
    return dot(weights, _near(x, y, center, radius_m))


def _heavier_first(a: Estimate, b: Estimate) -> int:
    """Compare for sorting; equals keep their order."""
    return 0 if math.isclose(a.mass, b.mass, rel_tol=TIE) else 1 if a.mass < b.mass else -1


def _columns(belief: Belief) -> tuple[F64, F64]:
    return _wide(belief.poses[:, 0]), _wide(belief.poses[:, 1])


def _heaviest(columns: _Columns, weights: F64, reach_m: float) -> Bool:
    """Return which (N,) particles lie within reach of the mode that most of the weights (N,) lie about."""
    x, y = columns.x, columns.y
    mode = _shift(_amid_most(x, y, weights, reach_m), x, y, weights, reach_m)
    return _near(x, y, mode, reach_m)


def _amid_most(x: F64, y: F64, weights: F64, reach_m: float) -> Point:
    """Return the particle's position where the mean shift starts: most weight lies within reach."""
    left, low = float(x.min()), float(y.min())
    cell_m = reach_m / CELLS_A_CLUSTER
    side = max(cell_m, float(x.max() - left) / MOST_CELLS_A_SIDE, float(y.max() - low) / MOST_CELLS_A_SIDE)
    right, down = x - left, y - low
    cell, row = (right / side).astype(np.int64), (down / side).astype(np.int64)
    columns, rows = int(cell.max()) + 1, int(row.max()) + 1
    row *= columns
    cell += row
    raster = np.bincount(cell, weights, rows * columns).reshape(rows, columns)
    held = cv2.filter2D(raster, -1, disc(reach_m / side), borderType=cv2.BORDER_CONSTANT)
    fullest_row, fullest_column = divmod(first_heaviest(held), columns)
    right -= side * (fullest_column + 0.5)
    down -= side * (fullest_row + 0.5)
    away = np.square(right, out=right)
    away += np.square(down, out=down)
    away[weights <= 0] = np.inf
    nearest = int((away <= away.min() * (1 + TIE)).argmax())
    return float(x[nearest]), float(y[nearest])


@lru_cache(16)
def disc(radius: float) -> F64:
    """Return the cells (K, K) whose centers lie within a radius, in cells, of the middle one: 1, others 0."""
    reach = np.arange(-int(radius), int(radius) + 1)
    return np.asarray(reach**2 + reach[:, None] ** 2 <= radius**2, np.float64)


def _shift(center: Point, x: F64, y: F64, weights: F64, reach_m: float) -> Point:
    """Shift the center to the mean of the particles in reach until it converges (flat mean shift)."""
    for _ in range(MOST_SHIFTS):
        last, center = center, _mean(x, y, weights * _near(x, y, center, reach_m))
        if math.dist(center, last) < SETTLED_M:
            break
    return center


def _mean(x: F64, y: F64, held: F64) -> Point:
    total = float(held.sum())
    return dot(held, x) / total, dot(held, y) / total


def _near(x: F64, y: F64, center: Point, radius_m: float) -> Bool:
    return np.square(x - center[0]) + np.square(y - center[1]) <= radius_m**2


def _stand_for(belief: Belief, columns: _Columns, held: F64, radii: Radii) -> Estimate:
    """Summarize the part `held` (N,) of a cloud, whose weights sum to one."""
    mass, weights = float(held.sum()), belief.weights
    x_m, y_m = dot(held, columns.x) / mass, dot(held, columns.y) / mass
    heading, heading_sd = circular_mean_of(columns.heading_rad, columns.sin, columns.cos, held, mass)
    along_x, along_y = columns.x - x_m, columns.y - y_m
    np.square(along_x, out=along_x)
    np.square(along_y, out=along_y)
    sd_m = (math.sqrt(dot(held, along_x) / mass), math.sqrt(dot(held, along_y) / mass))
    away = np.add(along_x, along_y, out=along_x)
    return Estimate(
        pose=np.array([x_m + belief.origin[0], y_m + belief.origin[1], heading]),
        sd_m=sd_m,
        heading_sd_rad=heading_sd,
        mass=mass,
        confidence=dot(weights, away <= radii.confidence_m**2),
        converged=dot(weights, away <= radii.cluster_m**2),
        radii=radii,
    )


# Evidence: how well the predicted cloud explains a picture. Needs no truth.


def entry_weights(weights: F64, entries: I32, count: int, known: F32 | None = None) -> F64:
    """Return the weight (count,) nearest to each entry; of those outside, -1, none.

    What no reference speaks for, by `known` (N,), counts as spread over all entries alike.
    """
    if known is None:
        return np.asarray(np.bincount(entries + 1, weights, count + 1)[1:], np.float64)
    unknown = float(weights @ (1 - known).astype(np.float64))
    return entry_weights(weights * known, entries, count) + unknown / max(count, 1)


def log_mean_likelihood(explained: EntryLikelihood, held: F64) -> F64:
    """Return log of the mean of exp(-cost) (...,) over the weight (L,) held near entries; -inf for none."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(explained.relative @ held) + explained.top)
