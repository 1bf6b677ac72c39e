"""Evidence: how well the cloud, as it was before a picture, explains that picture. Needs no truth."""

from __future__ import annotations

import numpy as np

from .belief import Belief
from .typing import F32, F64, I32


def log_mean_likelihood(cost: F32, predicted: Belief, entries: I32) -> F64:
    """Give log of the weighted mean of exp(-cost) over particles, for costs (..., L): (...,) nats.

    `entries` (N,) are the particles' nearest entries; those outside (-1) explain nothing. -inf when all are.
    """
    inside = entries >= 0
    held = np.bincount(entries[inside], predicted.weights[inside], cost.shape[-1])
    nats = -cost.astype(np.float64)
    top = nats.max(axis=-1, keepdims=True)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(nats - top) @ held) + top[..., 0])
