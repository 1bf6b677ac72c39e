"""Estimates: one pose to stand for a weighted cloud, and how much of the cloud stands by it."""

from __future__ import annotations

import numpy as np

from .belief import Belief
from .geometry import INCH_M, circular_mean
from .records import Estimate
from .typing import F32, F64, Bool

CLUSTER_M = 24 * INCH_M  # radius of the mean shift, and of "converged"
CONFIDENCE_M = 12 * INCH_M
FINE_M = 3 * INCH_M  # the cloud is summed up in cells of this size before a mode is sought ...
MOST_CELLS_A_SIDE = 400  # ... or of a larger one, in a larger arena
SEEDS = 4  # heaviest squares of 24 in from which a mode is sought
MOST_SHIFTS = 50


def weighted_mean(belief: Belief, injected: Bool | None = None) -> Estimate:
    """Stand for the whole cloud. Of a cloud with several modes this lies in nowhere."""
    return _stand_for(belief, _counted(belief, injected), np.ones(belief.size, bool))


def heaviest_cluster(belief: Belief, injected: Bool | None = None) -> Estimate:
    """Stand for the heaviest cluster, by mean shift with a flat kernel of 24 in: the scored estimate.

    `injected` (N,) marks freshly injected particles, which are left out.
    """
    weights = _counted(belief, injected)
    xy = belief.poses[:, :2]
    top, _ = _climb(_coarse_mode(xy, weights), xy, weights)
    return _stand_for(belief, weights, _near(xy, top, CLUSTER_M))


def _counted(belief: Belief, injected: Bool | None) -> F64:
    """Weights (N,) summing to one, injected particles at zero unless nothing else has any weight."""
    weights = belief.weights
    if injected is None or not weights[~injected].sum() > 0:
        return weights
    kept = np.where(injected, 0, weights)
    return np.asarray(kept / kept.sum())


def _coarse_mode(xy: F32, weights: F64) -> F64:
    """Find about where the heaviest cluster (2,) is, on the cloud summed up in small cells."""
    cells, mass = _summed_up(xy, weights)
    squares = np.unique(np.floor(cells / CLUSTER_M), axis=0, return_inverse=True)[1].ravel()
    heaviest = np.bincount(squares, mass).argsort()[::-1][:SEEDS]
    climbs = [_climb(_mean(cells[squares == s], mass[squares == s]), cells, mass) for s in heaviest]
    return max(climbs, key=lambda climb: climb[1])[0]


def _summed_up(xy: F32, weights: F64) -> tuple[F64, F64]:
    """Give the centers of mass (K, 2) and the masses (K,) of the small cells that hold any weight."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    side = max(FINE_M, float((high - low).max()) / MOST_CELLS_A_SIDE)
    index = ((xy - low) / np.float32(side)).astype(np.int64)
    flat = index[:, 1] * (MOST_CELLS_A_SIDE + 1) + index[:, 0]
    mass = np.asarray(np.bincount(flat, weights), np.float64)
    held = np.flatnonzero(mass)
    sums = [np.bincount(flat, weights * xy[:, axis])[held] for axis in (0, 1)]
    return np.column_stack(sums) / mass[held, None], mass[held]


def _climb(center: F64, xy: F32 | F64, weights: F64) -> tuple[F64, float]:
    """Shift the center (2,) to the mean around it until no more mass comes in; give it and its mass."""
    mass = 0.0
    for _ in range(MOST_SHIFTS):
        near = _near(xy, center, CLUSTER_M)
        total = float(weights[near].sum())
        if total <= mass * (1 + 1e-9):
            break
        mass, center = total, _mean(xy[near], weights[near])
    return center, mass


def _mean(xy: F32 | F64, weights: F64) -> F64:
    return np.asarray(weights @ xy / weights.sum())


def _near(xy: F32 | F64, center: F64, radius_m: float) -> Bool:
    dx, dy = xy[:, 0] - xy.dtype.type(center[0]), xy[:, 1] - xy.dtype.type(center[1])
    return np.asarray(dx * dx + dy * dy <= radius_m**2)


def _stand_for(belief: Belief, weights: F64, members: Bool) -> Estimate:
    """Sum up the members (N,) of a cloud; shares are of all the weights (N,), which sum to one."""
    poses, held = belief.poses[members].astype(np.float64), weights[members]
    center = _mean(poses[:, :2], held)
    heading, heading_sd = circular_mean(poses[:, 2], held)
    variance = _mean((poses[:, :2] - center) ** 2, held)
    xy = belief.poses[:, :2]
    return Estimate(
        pose=np.array([*(center + belief.origin), heading]),
        sd_m=(float(np.sqrt(variance[0])), float(np.sqrt(variance[1]))),
        heading_sd_rad=heading_sd,
        mass=float(held.sum()),
        confidence=float(weights[_near(xy, center, CONFIDENCE_M)].sum()),
        converged=float(weights[_near(xy, center, CLUSTER_M)].sum()),
    )
