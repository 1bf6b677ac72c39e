"""Mixture (dual) MCL: some particles are drawn where the picture says, and weighed by the motion model.

Thrun, Fox, Burgard and Dellaert (2001). All particles are weighed as draws of one mixture (the balance
heuristic of Veach and Guibas 1995): w = likelihood * p / ((1 - share) p + share q), with p the predicted
density and q that of the dual draws. Densities are taken per library entry, over the poses that have it
nearest. With p zero where nobody was, a dual draw could never count: p is mixed with a little of "anywhere".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .belief import Belief, uniform_log_weights
from .draws import Regions, from_likelihood, shares_of
from .resampling import systematic
from .selection import NearestReference
from .typing import F32, F64


@dataclass(frozen=True, slots=True)
class DualParameters:
    """How much of it."""

    share: float = 0.1  # of the particles
    teleport: float = 0.01  # probability that the robot was carried anywhere since the last update


def mix(
    predicted: Belief,
    log_likelihood: F32,
    nearest: NearestReference,
    where: Regions,
    parameters: DualParameters,
    rng: np.random.Generator,
) -> tuple[Belief, F64]:
    """Give N particles of which the last share are dual draws, and log p/mixture (N,) to weigh them by.

    The regular ones are resampled from `predicted`, so that all have the same weight before the picture.
    """
    count = round(parameters.share * predicted.size)
    kept = systematic(predicted.weights, predicted.size - count, rng)
    drawn = from_likelihood(log_likelihood, nearest.grid, where, count, predicted.origin, rng)
    poses = np.concatenate([predicted.poses[kept], drawn])
    p = _predicted_shares(predicted, nearest, where, parameters.teleport)
    q = shares_of(log_likelihood, where)
    share = count / predicted.size
    mixture = (1 - share) * p + share * q
    ratio = np.divide(p, mixture, out=np.zeros_like(p), where=mixture > 0)  # no entry of nowhere is drawn
    with np.errstate(divide="ignore"):
        per_entry = np.log(ratio)
    correction = np.append(per_entry, 0.0)[nearest.entries(poses, predicted.origin)]
    return Belief(poses, uniform_log_weights(len(poses)), predicted.origin), np.asarray(correction)


def _predicted_shares(predicted: Belief, nearest: NearestReference, where: Regions, teleport: float) -> F64:
    """Give the share (L,) of the predicted weight that has each entry nearest, some of it spread evenly."""
    entry = nearest.entries(predicted.poses, predicted.origin)
    inside = entry >= 0
    size = where.sizes()
    held = np.bincount(entry[inside], predicted.weights[inside], len(size))
    return np.asarray((1 - teleport) * held + teleport * size / size.sum())
