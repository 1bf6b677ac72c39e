"""Wide tails: now and then a movement is much further off than the motion model's noise.

The thesis's failures began with turns at a threshold more than three standard deviations off (3.6), which a
Gaussian filter holds for impossible. A mixture of two Gaussians keeps a few particles there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .typing import F32


@dataclass(frozen=True, slots=True)
class TailParameters:
    """How often, and how far."""

    share: float = 0.0  # of particles and movements whose noise is widened, 0 to 1
    widen: float = 4.0  # times the noise


def widened(noise: F32, tail: TailParameters, rng: np.random.Generator) -> F32:
    """Give standard normals (N, 3) of which some rows, chosen by chance, are so many times as large."""
    if tail.share <= 0:
        return noise
    wide = rng.random(len(noise)) < tail.share
    return np.asarray(noise * np.where(wide, tail.widen, 1.0)[:, None], np.float32)
