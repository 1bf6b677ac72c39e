"""Guided motion: movements drawn toward where a sensor alone would put the robot, and weighted for it.

Where motion noise is wide beside what a sensor knows, most particles land where the likelihood is nearly
zero. Here some of them draw their noise from what it is likely to have been, given the pose that the sensor
proposes: the improved proposal of FastSLAM 2.0 (Montemerlo et al. 2003), which is the optimal importance
function of Doucet et al. (2000) for a motion model that is linear in its noise.

The draws are those of a mixture, weighted by the balance heuristic (Veach and Guibas 1995). So the filter
stays exact whatever the proposal says: a proposal decides where particles are spent, and is no evidence. No
weight is multiplied by more than 1 / (1 - share).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..values import F32, F64, number, wrap
from .sensor_proposal import LEAST_VARIANCE

UNIT = np.float32(0.5)  # standard deviations by which noise is changed to see what it does

# the number of a movement, any poses (n, 3) and the noise (n, 3) of each, to poses after it (n, 3)
Move = Callable[[int, F32, F32], F32]


@dataclass(frozen=True, slots=True)
class GuidedMotionParameters:
    """How many particles follow a sensor that proposes poses; without such a sensor none do."""

    share: Annotated[float, number(0, 0.99)] = 0.5  # of the particles, on average


@dataclass(frozen=True, slots=True, eq=False)
class DrawnNoise:
    """Noise as the motion model draws it: N particles, M movements."""

    normals: F64  # (N, 3 M) standard normals
    widths: F64  # (N, 3 M) what they are multiplied with: more than 1 for motion outliers


def guided_motion(
    poses: F32,
    move: Move,
    drawn: DrawnNoise,
    pose: F64,
    covariance: F64,
    share: float,
    rng: np.random.Generator,
) -> tuple[F32, F64]:
    """Move N particles (N, 3); return their poses, and the logs (N,) of predicted over proposal density.

    `pose` (3,), in the frame of the particles, and `covariance` (3, 3) are what a sensor proposes.
    """
    still, by_noise = _linearized(poses, move, drawn)
    off = pose - still
    off[:, 2] = wrap(off[:, 2])
    seen = covariance + LEAST_VARIANCE * np.eye(3)
    predicted = by_noise @ np.swapaxes(by_noise, 1, 2) + seen
    # a draw from the noise's posterior: one from its prior, moved by what it does not explain (Matheron)
    missed = rng.standard_normal((len(off), 3)) @ np.linalg.cholesky(seen).T
    unexplained = off - _applied(by_noise, drawn.normals) - missed
    follow = np.flatnonzero(rng.random(len(off)) < share)
    change = np.linalg.solve(predicted[follow], unexplained[follow, :, None])[:, :, 0]
    normals = drawn.normals.copy()
    normals[follow] += np.einsum("nij,ni->nj", by_noise[follow], change)
    # Bayes: the posterior's density over the prior's, at any noise
    seen_density = _log_normal(off - _applied(by_noise, normals), seen[None])
    gain = seen_density - _log_normal(off, predicted)
    correction = -np.logaddexp(np.log1p(-share), np.log(share) + gain)
    noise = (normals * drawn.widths).astype(np.float32)
    for movement in range(noise.shape[1] // 3):
        poses = move(movement, poses, noise[:, 3 * movement : 3 * movement + 3])
    return poses, correction


def _linearized(poses: F32, move: Move, drawn: DrawnNoise) -> tuple[F64, F64]:
    """Return poses (N, 3) without noise, and their derivatives (N, 3, 3 M) by the normals.

    The particles move once without noise and once with each of the normals changed, all of them together.
    """
    count, columns = drawn.normals.shape
    moved = poses
    for movement in range(columns // 3):
        before, moved = len(moved), np.concatenate([moved, *[moved[:count]] * 3])
        noise = np.zeros((3, len(moved)), np.float32)  # column by column
        for k in range(3):
            noise[k, before + k * count :][:count] = UNIT
        moved = move(movement, moved, noise.T)
    still = moved[:count].astype(np.float64)
    by_noise = np.empty((count, 3, columns))
    for column in range(columns):
        there = moved[(column + 1) * count :][:count] - still
        there[:, 2] = wrap(there[:, 2])
        by_noise[:, :, column] = there / UNIT * drawn.widths[:, column, None]
    return still, by_noise


def _applied(by_noise: F64, normals: F64) -> F64:
    return np.asarray(np.einsum("nij,nj->ni", by_noise, normals))


def _log_normal(off: F64, covariance: F64) -> F64:
    """Return the log-density (N,) of normal distributions (N, 3, 3) at distances (N, 3) from their means.

    Covariances (1, 3, 3) are those of all.
    """
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(covariance, off[:, :, None])[:, :, 0])
    return np.asarray(-0.5 * (squared + np.log(np.linalg.det(covariance))))
