"""The belief: a weighted cloud of poses, as a value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .typing import F32, F64


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """N weighted particles. Nothing here is ever changed in place.

    Poses are float32 relative to `origin` (float32 steps are 3 cm at 500 km, so the origin is kept apart
    in float64). Weights are stored as logs and sum to one: `exp(log_weights).sum() == 1`.
    """

    poses: F32  # (N, 3) x_m, y_m relative to the origin, heading_rad in [-pi, pi)
    log_weights: F64  # (N,) normalized
    origin: F64  # (2,) x_m, y_m in the map's frame

    @property
    def size(self) -> int:
        """The number of particles N."""
        return len(self.poses)

    @property
    def weights(self) -> F64:
        """Normalized weights (N,), each >= 0, summing to one."""
        return np.exp(self.log_weights)

    @property
    def world_poses(self) -> F64:
        """Poses (N, 3) in the map's frame, float64."""
        world = self.poses.astype(np.float64)
        world[:, :2] += self.origin
        return world


def uniform_log_weights(n: int) -> F64:
    """Give n equal normalized log-weights; n may be 0."""
    return np.full(n, -np.log(max(n, 1)))


def normalize(log_weights: F64) -> tuple[F64, float]:
    """Give normalized log-weights and the log of what they summed to (log-sum-exp in float64).

    Returns (log_weights unchanged, -inf) when all are -inf, which the caller must treat as an event.
    """
    top = float(log_weights.max())
    if not np.isfinite(top):
        return log_weights, -np.inf
    total = top + float(np.log(np.exp(log_weights - top).sum()))
    return log_weights - total, total


def effective_sample_size(log_weights: F64) -> float:
    """Give 1 / sum(w^2) (Kong, Liu and Wong 1994), between 1 and N, for normalized log-weights (N,)."""
    return float(1.0 / np.exp(2 * log_weights).sum())
