"""From distances to likelihoods: fusion of channels, then the weight that a fused distance gives a pose.

Both are chosen by name. Fusion takes distances (C, L), weights (C,) and scales (C,), and returns a fused
distance (L,) and its quality (L,) in [0, 1], 1 for a perfect match. A likelihood takes that and a sharpness
and returns log-likelihoods (L,), always finite: the floor under a weight is `LEAST_QUALITY`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import F32, F64

# Fusion: several channels to one distance.

# A smaller spread over the library, as a share of the distance, is rounding.
LEAST_SPREAD = 1e-5
# Some entry is always the worst, with quality 0, however good it is: it must not rule a pose out forever.
LEAST_QUALITY = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Blended:
    """The fused distance and quality of L references."""

    distance: F32  # (L,) >= 0
    quality: F32  # (L,) in [0, 1]


Blend = Callable[[F32, F64, F64, Callable[[F32], F32]], Blended]


def relative_quality(distances: F32) -> F32:
    """Return 1 - D/D_max (..., L): 1 is a perfect match, 0 this picture's worst entry; all 1 if all are 0."""
    worst = distances.max(axis=-1, keepdims=True)
    share = np.divide(distances, worst, out=np.zeros_like(distances), where=worst > 0)
    return np.asarray(1 - share, np.float32)


def absolute_quality(distances: F32) -> F32:
    """Return 1 - D (..., L), at least 0 (the thesis's other reading, 4.2); comparable between pictures."""
    return np.asarray(np.clip(1 - distances, 0, 1), np.float32)


QUALITIES: Mapping[str, Callable[[F32], F32]] = {"relative": relative_quality, "absolute": absolute_quality}


def calibrated(
    distances: F32, weights: F64, scales: F64, quality: Callable[[F32], F32] = relative_quality
) -> Blended:
    """Return the sum of weight * D / scale: log-likelihoods added, as if channels erred independently.

    Scales are fitted to drives, so the sum is in nats and comparable between pictures.
    """
    total = np.asarray((weights / scales) @ distances, np.float32)
    return Blended(total, relative_quality(total))


def weighted_sum(
    distances: F32, weights: F64, scales: F64, quality: Callable[[F32], F32] = relative_quality
) -> Blended:
    """Return the weighted sum of channels scaled to the same spread over the library (thesis 4.2.5).

    A channel that does not distinguish entries (no spread but rounding) is left out.
    """
    spread = distances.std(axis=1, dtype=np.float64)
    tells = spread > LEAST_SPREAD * distances.max(axis=1)
    scale = np.divide(weights, spread, out=np.zeros_like(weights), where=tells)
    total = np.asarray(scale @ distances, np.float32)
    if len(distances) == 1:  # one channel keeps its own unit, which an absolute quality needs
        return Blended(total, quality(distances)[0])
    return Blended(total, relative_quality(total))


def weighted_product(
    distances: F32, weights: F64, scales: F64, quality: Callable[[F32], F32] = relative_quality
) -> Blended:
    """Return the product of qualities to the power of their weights: all channels must agree (thesis 4.2.5).

    Qualities below 0.001 count as 0.001. The distance is minus the logarithm of the product.
    """
    logs = np.log(np.maximum(quality(distances), np.float32(LEAST_QUALITY)))
    total = np.asarray(weights @ logs, np.float32)
    return Blended(-total, np.exp(total))


BLENDS: Mapping[str, Blend] = {
    "calibrated": calibrated,
    "sum": weighted_sum,
    "product": weighted_product,
}


# Likelihood: from the fused distance to a log-likelihood.

Likelihood = Callable[[Blended, float], F32]


def power(blended: Blended, sharpness: float) -> F32:
    """Return quality to the power of the sharpness; the thesis uses 1 (3.3). Below 0.001 counts as 0.001."""
    floored = np.maximum(blended.quality, np.float32(LEAST_QUALITY))
    return np.asarray(np.float32(sharpness) * np.log(floored), np.float32)


def exponential(blended: Blended, sharpness: float) -> F32:
    """Return exp(-sharpness * distance): with calibrated distances and sharpness 1, as fitted to drives."""
    return np.asarray(np.float32(-sharpness) * blended.distance, np.float32)


LIKELIHOODS: Mapping[str, Likelihood] = {"exponential": exponential, "power": power}
