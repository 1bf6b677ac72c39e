"""The sensor model: from a picture to the likelihood of every library entry, and so of every particle.

Distance, quality, blend and likelihood are parts of their own, because how a distance becomes a weight
decides more than which feature is measured. Nothing here depends on the particles but the last step,
an index: the cost of comparing does not grow with their number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .channels import CHANNELS
from .library import ChannelIndex, Library
from .records import Sighting
from .selection import NearestReference
from .typing import F32, F64, U8

# Chosen on fitting drives by log score; docs/results.md has the curve.
DEFAULT_SHARPNESS = 16.0
# Some entry is always the worst, with quality 0, however good it is: it must not rule a pose out for ever.
LEAST_QUALITY = 1e-3
# A spread over the library that is smaller than this share of the distance itself is rounding.
LEAST_SPREAD = 1e-5


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """What is compared, and how sharply."""

    weights: Mapping[str, float]  # channel name to its share in the blend; one channel: {"color": 1.0}
    sharpness: float = DEFAULT_SHARPNESS  # likelihood = quality ** sharpness; 1 is the thesis's


FEATURES: Mapping[str, Mapping[str, float]] = {
    "color": {"color": 1.0},
    "edges": {"edges": 1.0},
    "blended": {"color": 0.5, "edges": 0.5},  # equal shares, as no others are known of the thesis
}


def distance(sample: F32, index: ChannelIndex) -> F32:
    """Give the thesis's distance D (L,) of a sample (D,) from every entry, as the mean over all bins.

    Every bin contributes max(|s - r| - n, 0) / m with noise floor n and relevance m (thesis 3.3; the sum
    that it prints is D times the number of bins). Bins that are empty all over the library count nothing.
    """
    relevant = index.relevance > 0
    inverse = np.zeros_like(index.relevance)
    inverse[relevant] = 1 / index.relevance[relevant]
    apart = np.abs(index.references - sample)
    apart -= index.noise_floor
    np.maximum(apart, 0, out=apart)
    return np.asarray(apart @ (inverse / np.float32(len(sample))), np.float32)


def contributions(sample: F32, reference: F32, index: ChannelIndex) -> F32:
    """Give what each bin (D,) adds to the distance between a sample and one reference, both (D,)."""
    relevant = index.relevance > 0
    apart = np.maximum(np.abs(reference - sample) - index.noise_floor, 0)
    share = np.where(relevant, apart / np.where(relevant, index.relevance, 1), 0)
    return np.asarray(share / len(sample), np.float32)


def quality(distances: F32) -> F32:
    """Give 1 - D/D_max (L,): 1 is a perfect match, 0 the worst entry for this picture; 1 if all are 0."""
    worst = distances.max()
    if worst <= 0:
        return np.ones_like(distances)
    return np.asarray(1 - distances / worst, np.float32)


def blend(distances: F32, weights: F64) -> F32:
    """Bring each channel's distances (C, L) to the same spread over the library, then add them up (L,).

    Each channel is divided by its standard deviation over the library and multiplied by its weight (C,).
    A channel that tells no entry from another (no spread but rounding) has no say.
    """
    spread = distances.std(axis=1, dtype=np.float64)
    tells = spread > LEAST_SPREAD * distances.max(axis=1)
    scale = np.divide(weights, spread, out=np.zeros_like(weights), where=tells)
    return np.asarray(scale @ distances, np.float32)


def log_likelihood(quality: F32, sharpness: float) -> F32:
    """Give log(quality ** sharpness) (L,), with qualities under 0.001 counted as 0.001: always finite."""
    floored = np.maximum(quality, np.float32(LEAST_QUALITY))
    return np.asarray(np.float32(sharpness) * np.log(floored), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class SensorModel:
    """Looks at a picture and weighs particles by the entry that each is compared with."""

    library: Library
    reference: NearestReference
    parameters: SensorParameters

    def measure(self, image: U8) -> dict[str, F32]:
        """Give what every channel in use measures in a picture (H, W, 3) RGB: channel to (D,)."""
        return {name: CHANNELS[name].describe(image) for name in self.parameters.weights}

    def sight(self, descriptors: Mapping[str, F32], poses: F32) -> Sighting:
        """Compare with all L entries; say which of them each of the poses (N, 3) is compared with."""
        names = tuple(self.parameters.weights)
        distances = np.stack([distance(descriptors[name], self.library.index[name]) for name in names])
        weights = np.array([self.parameters.weights[name] for name in names])
        blended = quality(blend(distances, weights))
        return Sighting(
            channels=names,
            descriptors=descriptors,
            distances=distances,
            channel_quality=np.stack([quality(row) for row in distances]),
            quality=blended,
            log_likelihood=log_likelihood(blended, self.parameters.sharpness),
            entries=self.reference.entries(poses, self.library.origin),
        )


def particle_log_likelihood(sighting: Sighting) -> F32:
    """Give the log-likelihood (N,) of every particle: that of its entry; -inf outside free space."""
    # entry -1, outside, is the last of the table
    return np.append(sighting.log_likelihood, np.float32(-np.inf))[sighting.entries]
