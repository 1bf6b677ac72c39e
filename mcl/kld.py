"""Adaptive size: as many particles as the spread of the belief needs (KLD sampling; Fox 2003).

With k occupied bins, n samples keep the Kullback-Leibler distance between the belief over bins and the
sampled one under epsilon with probability 1 - delta (Wilson and Hilferty's approximation of chi-square).
This bounds the error of sampling bins, nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from .belief import Belief
from .geometry import INCH_M


@dataclass(frozen=True, slots=True)
class KldParameters:
    """How fine, how close, how sure, and within which bounds."""

    epsilon: float = 0.05  # largest distance allowed (nav2's pf_err is 0.05)
    delta: float = 0.01  # chance of being further off (nav2's pf_z is 0.99)
    bin_m: float = 9 * INCH_M  # side of a bin: half of an 18 in grid
    heading_bins: int = 24  # 15 degrees each
    least: int = 100  # particles, whatever the formula says
    most: int = 20_000  # likewise


def kld_size(bins: int, epsilon: float, delta: float) -> int:
    """Give the samples needed for k occupied bins (Fox 2003, equation 7); 1 where k is 1 or less."""
    if bins <= 1:
        return 1
    a = 2 / (9 * (bins - 1))
    z = NormalDist().inv_cdf(1 - delta)
    return math.ceil((bins - 1) / (2 * epsilon) * (1 - a + math.sqrt(a) * z) ** 3)


def occupied_bins(belief: Belief, parameters: KldParameters) -> int:
    """Count the bins of place and heading in which any particle with weight lies."""
    held = belief.log_weights > -np.inf
    place = np.floor(belief.poses[held, :2] / np.float32(parameters.bin_m)).astype(np.int64)
    turn = belief.poses[held, 2] * np.float32(parameters.heading_bins / (2 * math.pi))
    heading = np.floor(turn).astype(np.int64) % parameters.heading_bins
    return len(np.unique(np.column_stack([place, heading]), axis=0))


def adapted_size(belief: Belief, parameters: KldParameters) -> int:
    """Give how many particles the next step should have, within the bounds."""
    wanted = kld_size(occupied_bins(belief, parameters), parameters.epsilon, parameters.delta)
    return min(max(wanted, parameters.least), parameters.most)
