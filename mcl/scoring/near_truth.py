"""The cloud around the truth: how much of its weight is there, after each part of an update.

That share changes three times in an update: by the motion, by the picture, and by resampling.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..sensor.model import SensorModel
from ..values import F64, Belief, StepRecord, normalize
from .metrics import LOST_RAD


@dataclass(frozen=True, slots=True)
class NearTruth:
    """One update around the true pose; "near" is within the radius "confidence", at a like heading."""

    particles: int
    shares: tuple[float, float, float]  # of the weight near the truth: after motion, picture, and resampling
    nearest_m: float  # from the truth to the nearest particle of any heading


def near_truth(record: StepRecord, truth: F64) -> NearTruth:
    """Measure the cloud of one update around the true pose (3,); a particle in a wall counts for nothing."""
    radius_m, inside = record.estimate.radii.confidence_m, record.sighting.entries >= 0
    nearest_m, near = _around(record.weighted, truth, radius_m)
    before = near
    if record.predicted.poses is not record.weighted.poses:
        before = _around(record.predicted, truth, radius_m)[1]
    after = near if record.belief is record.weighted else _around(record.belief, truth, radius_m)[1]
    near, before = near[inside[near]], before[inside[before]]
    shares = [
        float(belief.weights[some].sum())
        for belief, some in ((record.predicted, before), (record.weighted, near), (record.belief, after))
    ]
    return NearTruth(len(near), (shares[0], shares[1], shares[2]), nearest_m)


LEAST_NEAR = 5  # particles from which a gain is told


def picture_gain(record: StepRecord, truth: F64, radius_m: float) -> float | None:
    """Return how many times as heavy the picture made the particles near the true pose (3,), together.

    Near is within a radius, at a like heading; None for fewer than `LEAST_NEAR` such particles.
    """
    _, near = _around(record.weighted, truth, radius_m)
    before = float(record.predicted.weights[near].sum())
    if len(near) < LEAST_NEAR or before <= 0:
        return None
    return float(record.weighted.weights[near].sum()) / before


def gains_by_channel(
    sensor: SensorModel, record: StepRecord, truth: F64, radius_m: float
) -> dict[str, float]:
    """Return the same for each channel, as if it alone had weighed the particles; {} for too few of them."""
    seen, predicted, gains = record.sighting.comparison, record.predicted, dict[str, float]()
    for channel in seen.channels:
        alone = sensor.only(channel)
        sighting = alone.at(alone.compare(seen.descriptors), predicted.poses)
        log_weights, total = normalize(predicted.log_weights + sighting.log_likelihood)
        weighted = Belief(predicted.poses, log_weights, predicted.origin)
        gain = picture_gain(replace(record, weighted=weighted), truth, radius_m)
        if gain is not None and np.isfinite(total):
            gains[channel] = gain
    return gains


def _around(belief: Belief, truth: F64, radius_m: float) -> tuple[float, NDArray[np.intp]]:
    """Return the distance of the nearest particle from the truth, and the numbers of those near it."""
    x, y = (truth[:2] - belief.origin).tolist()
    poses = belief.poses
    away, along = poses[:, 0] - x, poses[:, 1] - y
    away *= away
    along *= along
    away += along
    near = np.flatnonzero(away <= radius_m**2)
    alike = np.cos(poses[near, 2] - truth[2]) >= np.cos(LOST_RAD)
    return float(np.sqrt(away.min())) if len(away) else np.inf, near[alike]


def has_near(belief: Belief, truth: F64, radius_m: float) -> bool:
    """Return whether a particle is within a radius of the true pose (3,), and of a like heading."""
    poses = belief.poses
    x, y = truth[:2] - belief.origin
    near = np.square(poses[:, 0] - x) + np.square(poses[:, 1] - y) <= radius_m**2
    return bool((np.cos(poses[near, 2] - truth[2]) >= np.cos(LOST_RAD)).any())
