"""Estimates: one pose for a weighted cloud, how much of the cloud agrees, and its evidence.

They are computed for R clouds of N particles at once, row by row: for a few hundred particles numpy's calls
cost more than its passes, and many runs share them. A row's numbers do not depend on the other rows; the
estimate of one cloud is that of a single row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cmp_to_key, lru_cache
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ..values.arrays import F32, F64, I32, I64, ONE_THREAD_ELEMENTS, Bool, dot
from ..values.geometry import INCH_M, circular_mean, wrap
from ..values.library import USUAL, Radii
from ..values.records import Belief, EntryLikelihood, Estimate

CELLS_A_CLUSTER = 4  # in its radius: the mode is first sought on a raster of such cells ...
MOST_CELLS_A_SIDE = 400  # ... or of larger ones, where the cloud is spread over more than a hundred radii
SETTLED_M = 0.001  # a mean that shifts by less has converged
MOST_SHIFTS = 30  # an evenly spread cloud has no mode to converge to
CIRCLE_M = 6 * INCH_M  # radius of a circle one foot in diameter: the thesis's measure of success (3.6.2)
TIE = 1e-9  # relative: shares of weight that differ by less are equal, as processors round differently

Modes: TypeAlias = tuple[Estimate, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Clouds:
    """R clouds of N particles, column by column: many times faster than pose by pose."""

    columns: F64  # (4, R, N): x and y relative to the origin, sine and cosine of the heading
    heading_rad: F32  # (R, N)
    weights: F64  # (R, N), each row sums to one
    origin: F64  # (2,)

    @classmethod
    def of(cls, poses: F32, weights: F64, origin: F64) -> Clouds:
        """Take poses (3, R, N) and weights (R, N)."""
        columns, heading_rad = np.empty((4, *weights.shape)), poses[2]
        columns[:2], columns[2], columns[3] = poses[:2], np.sin(heading_rad), np.cos(heading_rad)
        return cls(columns, heading_rad, weights, origin)

    @classmethod
    def of_belief(cls, belief: Belief) -> Clouds:
        """Take a single cloud: R is 1."""
        return cls.of(belief.poses.T[:, None], belief.weights[None], belief.origin)

    @property
    def xy(self) -> F64:
        """The positions (2, R, N) relative to the origin."""
        return self.columns[:2]

    def some(self, runs: Bool) -> Clouds:
        """Return some of the clouds, by a flag (R,) for each."""
        return Clouds(self.columns[:, runs], self.heading_rad[runs], self.weights[runs], self.origin)


def are_wide(clouds: Clouds, reach_m: float) -> Bool:
    """Return which (R,) clouds are spread over more than a hundred radii: each needs cells of its own."""
    most_m = reach_m / CELLS_A_CLUSTER * MOST_CELLS_A_SIDE
    wide: Bool = np.ptp(clouds.xy, axis=2).max(axis=0) > most_m
    return wide


def batch_estimates(clouds: Clouds, radii: Radii) -> dict[str, F64]:
    """Return the columns (R, ...) of a run's table that are `estimates`; no cloud may be wide."""
    cluster = clouds.weights * _heaviest(clouds, clouds.weights, radii.cluster_m)
    scored = _summaries(clouds, cluster, radii)
    centers = scored["poses"][:, :2] - clouds.origin
    near = _near(clouds.xy, centers.T, CIRCLE_M)
    mean_poses, mean_sd_m, _ = _means(clouds, clouds.weights, clouds.weights.sum(axis=1))
    return scored | {
        "circle": _dots(clouds.weights, near),
        "mean_poses": mean_poses,
        "mean_sd_m": mean_sd_m,
    }


def estimates(belief: Belief, radii: Radii = USUAL) -> tuple[Estimate, Estimate]:
    """Return `heaviest_cluster` and `weighted_mean`, for less than both."""
    clouds = Clouds.of_belief(belief)
    cluster = clouds.weights * _heaviest(clouds, clouds.weights, radii.cluster_m)
    heaviest, mean = _estimates(clouds, np.concatenate([cluster, clouds.weights]), radii)
    return heaviest, mean


def weighted_mean(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the mean of the entire cloud. With several modes it lies between them."""
    clouds = Clouds.of_belief(belief)
    return _estimates(clouds, clouds.weights, radii)[0]


def heaviest_cluster(belief: Belief, radii: Radii = USUAL) -> Estimate:
    """Return the heaviest cluster, by mean shift with a flat kernel of `cluster_m`: the scored estimate.

    Of equals the lowest y wins, then x, by cells of a quarter of that.
    """
    return estimates(belief, radii)[0]


def modes(belief: Belief, radii: Radii = USUAL, *, most: int = 5, least: float = 0.01) -> Modes:
    """Return at most `most` clusters with at least the share `least` of the weight, heaviest first.

    Each holds the particles within `cluster_m` of its mode that are in no earlier cluster.
    """
    least *= 1 - TIE
    clouds = Clouds.of_belief(belief)
    rest, clusters = clouds.weights, list[Estimate]()
    while len(clusters) < most and float(rest.sum()) >= least:
        cluster = rest * _heaviest(clouds, rest, radii.cluster_m)
        if float(cluster.sum()) < least:
            break
        clusters += _estimates(clouds, cluster, radii)
        rest = np.asarray(np.where(cluster > 0, 0, rest))
    return tuple(sorted(clusters, key=cmp_to_key(_heavier_first)))


def _heavier_first(a: Estimate, b: Estimate) -> int:
    """Compare for sorting; equals keep their order."""
    return 0 if math.isclose(a.mass, b.mass, rel_tol=TIE) else 1 if a.mass < b.mass else -1


def first_heaviest(weights: NDArray[Any]) -> int:
    """Return the flat index of the largest weight (any shape), the first of equals within rounding."""
    return int((weights >= weights.max() * (1 - TIE)).argmax())


def covariance(belief: Belief) -> F64:
    """Return the weighted covariance (3, 3) of x_m, y_m and heading_rad about their (circular) means."""
    weights = belief.weights
    x, y = belief.poses[:, :2].T.astype(np.float64)
    middle, _ = circular_mean(belief.poses[:, 2], weights)
    turn = wrap(belief.poses[:, 2].astype(np.float64) - middle)
    off = np.stack([x - dot(weights, x), y - dot(weights, y), turn])
    return np.array([[dot(a * weights, b) for b in off] for a in off])


def share_within(belief: Belief, pose: F64, radius_m: float) -> float:
    """Return the share of weight within a radius (inclusive) of a pose's position in the map's frame."""
    xy = belief.poses[:, :2].T[:, None].astype(np.float64)
    center = np.asarray(pose[:2] - belief.origin, np.float64)
    return dot(belief.weights, _near(xy, center[:, None], radius_m)[0])


# Of each cloud the particles near its heaviest mode: a start on a raster, then mean shift.


def _heaviest(clouds: Clouds, weights: F64, reach_m: float) -> Bool:
    """Return which (R, N) particles lie within reach of the mode that most weight (R, N) lies about."""
    start, shift = (_starts, _shift) if len(weights) > 1 else (_start_single, _shift_single)
    centers = shift(start(clouds.xy, weights, reach_m), clouds.xy, weights, reach_m)
    return _near(clouds.xy, centers, reach_m)


def _starts(xy: F64, weights: F64, reach_m: float) -> F64:
    """Return the particle's position (2, R) where each mean shift starts: most weight lies within reach.

    All clouds (2, R, N) have cells of one size. The rasters lie below one another in one picture.
    """
    offsets = xy - xy.min(axis=2, keepdims=True)  # to the right, and down
    side_m = max(reach_m / CELLS_A_CLUSTER, float(offsets.max()) / MOST_CELLS_A_SIDE)
    kernel = disc(reach_m / side_m)
    cell, row = (offsets / side_m).astype(np.int64)
    columns, rows = cell.max(axis=1) + 1, row.max(axis=1) + 1
    heights = rows + len(kernel) // 2  # below each raster are empty rows, as far as the disc reaches
    ends, width = heights.cumsum(), int(columns.max())
    firsts = ends - heights
    row += firsts[:, None]
    row *= width
    cell += row
    raster = np.bincount(cell.ravel(), weights.ravel(), ends[-1] * width).reshape(-1, width)
    within = np.asarray(cv2.filter2D(raster, -1, kernel, borderType=cv2.BORDER_CONSTANT), np.float64)
    fullest = _fullest(within, firsts, rows, columns)
    offsets -= (side_m * (fullest + 0.5))[:, :, None]
    right, down = np.square(offsets, out=offsets)
    right += down
    right[weights <= 0] = np.inf
    nearest = (right <= right.min(axis=1, keepdims=True) * (1 + TIE)).argmax(axis=1)
    return xy[:, np.arange(len(nearest)), nearest]


def _start_single(xy: F64, weights: F64, reach_m: float) -> F64:
    """Return `_starts` of a single cloud, to the last bit, by fewer calls."""
    offsets = xy[:, 0] - xy.min(axis=2)
    wide_m, high_m = offsets.max(axis=1).tolist()
    side_m = max(reach_m / CELLS_A_CLUSTER, max(wide_m, high_m) / MOST_CELLS_A_SIDE)
    column, row = (offsets / side_m).astype(np.int64)
    width, height = int(wide_m / side_m) + 1, int(high_m / side_m) + 1
    row *= width
    row += column
    raster = np.bincount(row, weights[0], width * height).reshape(height, width)
    within = cv2.filter2D(raster, -1, disc(reach_m / side_m), borderType=cv2.BORDER_CONSTANT)
    down, right = divmod(first_heaviest(within), width)
    offsets -= [[side_m * (right + 0.5)], [side_m * (down + 0.5)]]
    squared, other = np.square(offsets, out=offsets)
    squared += other
    np.copyto(squared, np.inf, where=weights[0] <= 0)
    return xy[:, :, (squared <= squared.min() * (1 + TIE)).argmax()]


def _fullest(within: F64, firsts: I64, rows: I64, columns: I64) -> I64:
    """Return column and row (2, R) of the first fullest cell of each raster, within the raster."""
    width = within.shape[1]
    heights = np.diff(np.append(firsts, len(within)))
    ends = np.stack([columns, 0 * columns], axis=1).ravel()  # none of the empty rows below
    lengths = np.stack([rows, heights - rows], axis=1).ravel()
    within[np.arange(width) >= np.repeat(ends, lengths)[:, None]] = -1
    fullest = np.maximum.reduceat(within.max(axis=1), firsts) * (1 - TIE)
    hits = np.flatnonzero(within >= np.repeat(fullest, heights)[:, None])
    first = hits[np.searchsorted(hits, firsts * width)]
    return np.stack([first % width, first // width - firsts])


@lru_cache(16)
def disc(radius: float) -> F64:
    """Return the cells (S, S) whose centers lie within a radius, in cells, of the middle one: 1, others 0."""
    reach = np.arange(-int(radius), int(radius) + 1)
    return np.asarray(reach**2 + reach[:, None] ** 2 <= radius**2, np.float64)


def _shift(centers: F64, xy: F64, weights: F64, reach_m: float) -> F64:
    """Shift every center (2, R) to the mean of the particles in reach until it converges: flat mean shift."""
    now, moving = centers, np.arange(len(weights))  # clouds whose center has not converged
    for _ in range(MOST_SHIFTS):
        near = weights * _near(xy, now, reach_m)
        last, now = now, _dots(near, xy) / near.sum(axis=1)
        right, down = now - last
        still = np.hypot(right, down) >= SETTLED_M
        count = np.count_nonzero(still)
        if not count:
            break
        if count < len(still):
            centers[:, moving] = now
            moving, now, xy, weights = moving[still], now[:, still], xy[:, still], weights[still]
    centers[:, moving] = now
    return centers


def _shift_single(center: F64, xy: F64, weights: F64, reach_m: float) -> F64:
    """Return `_shift` of a single cloud, to the last bit, by fewer calls: it is most of an estimate."""
    places, now = xy[:, 0], center
    for _ in range(MOST_SHIFTS):
        right, down = offsets = places - now
        np.square(offsets, out=offsets)
        right += down
        near = weights[0] * (right <= reach_m**2)
        last, now = now, (_dots(near, places) / near.sum())[:, None]
        if math.hypot(*(now - last)[:, 0].tolist()) < SETTLED_M:
            break
    return now


def _near(xy: F64, centers: F64, radius_m: float) -> Bool:
    """Return which (R, N) of the positions (2, R, N) lie within a radius of their row's center, (2, R)."""
    offsets = xy - centers[:, :, None]
    right, down = np.square(offsets, out=offsets)
    right += down
    near: Bool = right <= radius_m**2
    return near


# The pose and the spread of a part of each cloud.


def _estimates(clouds: Clouds, parts: F64, radii: Radii) -> list[Estimate]:
    """Summarize each of some parts (n, N) of a single cloud."""
    poses, *others = _summaries(clouds, parts, radii).values()
    numbers = zip(*(column.tolist() for column in others), strict=True)
    return [
        Estimate(pose, (sd_x_m, sd_y_m), heading_sd_rad, mass, confidence, converged, radii)
        for pose, ((sd_x_m, sd_y_m), heading_sd_rad, mass, confidence, converged) in zip(
            poses, numbers, strict=True
        )
    ]


def _summaries(clouds: Clouds, part: F64, radii: Radii) -> dict[str, F64]:
    """Return the fields of `Estimate`, in its order and in columns, of a part (R, N) of every cloud.

    Where there is a single cloud, R is any number of its parts.
    """
    mass = part.sum(axis=1)
    poses, sd_m, away = _means(clouds, part, mass)
    return {
        "poses": poses,
        "sd_m": sd_m,
        "heading_sd_rad": _heading_sd(clouds, part, mass, poses[:, 2]),
        "mass": mass,
        "confidence": _dots(clouds.weights, away <= radii.confidence_m**2),
        "converged": _dots(clouds.weights, away <= radii.cluster_m**2),
    }


def _means(clouds: Clouds, part: F64, mass: F64) -> tuple[F64, F64, F64]:
    """Return mean poses (R, 3), spreads (R, 2), and squared distances (R, N) from there, of a part (R, N)."""
    x, y, sin, cos = _dots(part, clouds.columns)
    heading = [math.atan2(*sums) for sums in zip(sin.tolist(), cos.tolist(), strict=True)]
    x, y = x / mass, y / mass
    offsets = clouds.xy - np.array([x, y])[:, :, None]
    np.square(offsets, out=offsets)
    sd_m = np.sqrt(_dots(part, offsets) / mass)
    poses = np.array([x + clouds.origin[0], y + clouds.origin[1], heading])
    right, down = offsets
    right += down
    return poses.T, sd_m.T, right


def _heading_sd(clouds: Clouds, part: F64, mass: F64, means: F64) -> F64:
    """Return the circular standard deviation (R,) of headings about their means, as `circular_mean` does."""
    half = clouds.heading_rad - means.astype(np.float32)[:, None]
    half /= 2
    np.sin(half, out=half)
    lacks = (2 * _dots(part, np.square(half, out=half)) / mass).tolist()
    return np.array([math.sqrt(-2 * math.log1p(-lack)) if lack < 1 else math.inf for lack in lacks])


def _dots(a: F64, b: F64 | F32 | Bool) -> F64:
    """Return the scalar products (..., R) of rows (R, N) and (..., R, N), each as `dot` computes it."""
    products: F64
    if a.shape[-1] <= ONE_THREAD_ELEMENTS:
        products = np.vecdot(a, b)
    else:
        ends = range(0, a.shape[-1], ONE_THREAD_ELEMENTS)
        products = sum(
            np.vecdot(a[..., k : k + ONE_THREAD_ELEMENTS], b[..., k : k + ONE_THREAD_ELEMENTS]) for k in ends
        )
    return products


# Evidence: how well the predicted cloud explains a picture. Needs no truth.


def entry_weights(weights: F64, entries: I32, count: int, known: F32 | None = None) -> F64:
    """Return the weight (count,) nearest to each entry; of those outside, -1, none.

    What no reference speaks for, by `known` (N,), counts as spread over all entries alike.
    """
    if known is None:
        return np.asarray(np.bincount(entries + 1, weights, count + 1)[1:], np.float64)
    unknown = float(weights @ (1 - known).astype(np.float64))
    return entry_weights(weights * known, entries, count) + unknown / max(count, 1)


def log_mean_likelihood(explained: EntryLikelihood, weights: F64) -> F64:
    """Return log of the mean of exp(-cost) (...,) over the weight (L,) held near entries; -inf for none."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(explained.relative @ weights) + explained.top)
