"""Likelihoods: from a blended distance to how likely the picture is at every reference, chosen by name.

This decides more than which feature is measured. Every function takes a `Blended` and a sharpness and gives
log-likelihoods (L,), always finite.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..arrays import F32
from .fusion import LEAST_QUALITY, Blended

Likelihood = Callable[[Blended, float], F32]


def power(blended: Blended, sharpness: float) -> F32:
    """Quality to the power of the sharpness; 1 is the thesis's own (3.3). Under 0.001 counts as 0.001."""
    floored = np.maximum(blended.quality, np.float32(LEAST_QUALITY))
    return np.asarray(np.float32(sharpness) * np.log(floored), np.float32)


def exponential(blended: Blended, sharpness: float) -> F32:
    """exp(-sharpness * distance): with calibrated distances and sharpness 1, what drives were like."""
    return np.asarray(np.float32(-sharpness) * blended.distance, np.float32)


LIKELIHOODS: Mapping[str, Likelihood] = {"exponential": exponential, "power": power}
