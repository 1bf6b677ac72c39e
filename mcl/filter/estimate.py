"""Estimates: one pose for a weighted cloud, how much of the cloud agrees, and its evidence."""

import math
from functools import cmp_to_key
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64, I32, Bool, dot
from ..geometry import INCH_M, circular_mean, wrap
from ..radii import USUAL, Radii
from ..records import Belief, Estimate

CELLS_A_CLUSTER = 4  # in its radius: the mode is first sought on a raster of such cells ...
MOST_CELLS_A_SIDE = 400  # ... or of larger ones, where the cloud is spread over more than a hundred radii
SETTLED_M = 0.001  # a mean that shifts by less has converged
MOST_SHIFTS = 30  # an evenly spread cloud has no mode to converge to
CIRCLE_M = 6 * INCH_M  # radius of a circle one foot in diameter: the thesis's measure of success (3.6.2)
TIE = 1e-9  # relative difference below which shares of weight are equal: processors round differently

Modes: TypeAlias = tuple[Estimate, ...]
Point: TypeAlias = tuple[float, float]  # x_m, y_m relative to the belief's origin


def weighted_mean(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the mean of the entire cloud. With several modes it lies between them."""
    weights = belief.weights
    return _stand_for(belief, weights, weights, radii)


def heaviest_cluster(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the heaviest cluster, by mean shift with a flat kernel of `cluster_m`: the scored estimate.

    Of equals the lowest y wins, then x, by cells of a quarter of that.
    """
    weights, reach_m = belief.weights, radii.cluster_m
    x, y = _columns(belief)
    mode = _shift(_amid_most(x, y, weights, reach_m), x, y, weights, reach_m)
    return _stand_for(belief, weights, weights * _near(x, y, mode, reach_m), radii)


def best_particle(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the particle with the most weight, the first of equals; its spread is zero."""
    weights = belief.weights
    held = np.zeros_like(weights)
    best = first_heaviest(weights)
    held[best] = weights[best]
    return _stand_for(belief, weights, held, radii)


def modes(belief: Belief, radii: Radii = USUAL, *, most: int = 5, least: float = 0.01) -> Modes:
    """Return at most `most` clusters with at least the share `least` of the weight, heaviest first.

    Each holds the particles within `cluster_m` of its mode that are in no earlier cluster.
    """
    least *= 1 - TIE
    weights, reach_m = belief.weights, radii.cluster_m
    x, y = _columns(belief)
    left, found = weights, list[Estimate]()
    while len(found) < most and float(left.sum()) >= least:
        mode = _shift(_amid_most(x, y, left, reach_m), x, y, left, reach_m)
        held = left * _near(x, y, mode, reach_m)
        if float(held.sum()) < least:
            break
        found.append(_stand_for(belief, weights, held, radii))
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
    """Return x and y (N,) relative to the origin, each contiguous: many times faster than (N, 2)."""
    return belief.poses[:, 0].astype(np.float64), belief.poses[:, 1].astype(np.float64)


def _amid_most(x: F64, y: F64, weights: F64, reach_m: float) -> Point:
    """Return the particle's position where the mean shift starts: most weight lies within reach."""
    left, low = float(x.min()), float(y.min())
    cell_m = reach_m / CELLS_A_CLUSTER
    side = max(cell_m, float(x.max() - left) / MOST_CELLS_A_SIDE, float(y.max() - low) / MOST_CELLS_A_SIDE)
    column, row = ((x - left) / side).astype(np.int64), ((y - low) / side).astype(np.int64)
    columns, rows = int(column.max()) + 1, int(row.max()) + 1
    raster = np.bincount(row * columns + column, weights, rows * columns).reshape(rows, columns)
    held = cv2.filter2D(raster, -1, _disc(reach_m / side), borderType=cv2.BORDER_CONSTANT)
    fullest_row, fullest_column = divmod(first_heaviest(held), columns)
    away = np.hypot(x - left - side * (fullest_column + 0.5), y - low - side * (fullest_row + 0.5))
    away = np.where(weights > 0, away, np.inf)
    nearest = int((away <= away.min() * (1 + TIE)).argmax())
    return float(x[nearest]), float(y[nearest])


def _disc(radius: float) -> F64:
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


def _stand_for(belief: Belief, weights: F64, held: F64, radii: Radii) -> Estimate:
    """Summarize the part `held` (N,) of a cloud with weights (N,) that sum to one."""
    x, y = _columns(belief)
    center, mass = _mean(x, y, held), float(held.sum())
    heading, heading_sd = circular_mean(belief.poses[:, 2], held)
    along_x, along_y = np.square(x - center[0]), np.square(y - center[1])
    away = along_x + along_y
    return Estimate(
        pose=np.array([center[0] + belief.origin[0], center[1] + belief.origin[1], heading]),
        sd_m=(math.sqrt(dot(held, along_x) / mass), math.sqrt(dot(held, along_y) / mass)),
        heading_sd_rad=heading_sd,
        mass=mass,
        confidence=dot(weights, away <= radii.confidence_m**2),
        converged=dot(weights, away <= radii.cluster_m**2),
        radii=radii,
    )


# Evidence: how well the predicted cloud explains a picture. Needs no truth.


def log_mean_likelihood(cost: F32, weights: F64, entries: I32) -> F64:
    """Return log of the weighted mean of exp(-cost) (...,) over entries (N,) inside; -inf for none."""
    inside = entries >= 0
    held = np.bincount(entries[inside], weights[inside], cost.shape[-1])
    nats = -cost.astype(np.float64)
    top = nats.max(axis=-1, keepdims=True)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(nats - top) @ held) + top[..., 0])
