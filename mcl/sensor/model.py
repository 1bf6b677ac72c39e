"""The sensor model: from a picture to the likelihood of every library entry, and so of every particle.

Distance, blend, quality and likelihood are chosen by name, because how a distance becomes a weight matters
more than which feature is measured. Only the last step depends on the particles: the cost of comparing does
not grow with their number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import F32, U8
from ..library import ChannelIndex, Library
from ..records import Comparison, Sighting
from .descriptors.registry import CHANNELS, SCALES
from .distances import DISTANCES
from .likelihood import BLENDS, LIKELIHOODS, QUALITIES
from .references import ReferenceLookup


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """What is compared, how, and how sharply. Names are keys of the registry in each comment."""

    weights: Mapping[str, float]  # channel name to its share in the blend; one channel: {"color": 1.0}
    sharpness: float = 1.0  # multiplies the log-likelihood; 0 makes the sensor blind
    likelihood: str = "exponential"  # LIKELIHOODS
    blend: str = "calibrated"  # BLENDS
    quality: str = "relative"  # QUALITIES
    distances: Mapping[str, str] = field(default_factory=dict)  # channel to DISTANCES; others: the channel's
    scales: Mapping[str, float] = field(
        default_factory=dict
    )  # channel to the distance of one nat; others: SCALES

    def distance_of(self, channel: str) -> str:
        """Return the name of the distance that a channel is compared by."""
        return self.distances.get(channel, CHANNELS[channel].distance)

    def scale_of(self, channel: str) -> float:
        """Return the distance that costs one nat of log-likelihood at weight 1 and sharpness 1."""
        if channel in self.scales:
            return self.scales[channel]
        return SCALES.get((channel, self.distance_of(channel)), 1.0)

    def check_names(self) -> None:
        """Raise KeyError for an unknown name now, instead of at the first picture."""
        for channel in self.weights:
            DISTANCES[self.distance_of(channel)]
        BLENDS[self.blend], QUALITIES[self.quality], LIKELIHOODS[self.likelihood]


@dataclass(frozen=True, slots=True, eq=False)
class SensorModel:
    """Compares a picture with the library and weights particles by the entries they are compared with."""

    library: Library
    references: ReferenceLookup
    parameters: SensorParameters
    # each channel in use, extended by virtual references; empty: the library's own
    index: Mapping[str, ChannelIndex] = field(default_factory=dict)

    @property
    def distances(self) -> dict[str, str]:
        """Return the name of the distance of each channel in use, in order."""
        return {name: self.parameters.distance_of(name) for name in self.parameters.weights}

    def measure(self, image: U8) -> dict[str, F32]:
        """Return what every channel in use measures in a picture (H, W, 3) RGB: channel to (D,)."""
        return {name: CHANNELS[name].describe(image) for name in self.parameters.weights}

    def compare(self, descriptors: Mapping[str, F32]) -> Comparison:
        """Compare with all L entries and the virtual references; nothing here depends on the particles."""
        p, names, entries = self.parameters, tuple(self.parameters.weights), self.library.size
        distances = np.stack([self._distance(name, descriptors[name]) for name in names])
        weights = np.array([p.weights[name] for name in names])
        scales = np.array([p.scale_of(name) for name in names])
        quality = QUALITIES[p.quality]
        blended = BLENDS[p.blend](distances, weights, scales, quality)
        log_likelihood = LIKELIHOODS[p.likelihood](blended, p.sharpness)
        distances = distances[:, :entries]
        channel_cost = np.asarray(distances / scales[:, None], np.float32)
        return Comparison(
            channels=names,
            descriptors=descriptors,
            distances=distances,
            channel_quality=quality(distances),
            quality=blended.quality[:entries],
            channel_cost=channel_cost,
            cost=np.asarray(weights @ channel_cost, np.float32),
            log_likelihood=log_likelihood[:entries],
            virtual=log_likelihood[entries:],
        )

    def at(self, comparison: Comparison, poses: F32) -> Sighting:
        """Return the entry and the log-likelihood of each of the poses (N, 3)."""
        origin = self.library.origin
        log_likelihood = np.append(comparison.log_likelihood, comparison.virtual)
        return Sighting(
            comparison=comparison,
            entries=self.references.entries(poses, origin),
            log_likelihood=self.references.at(log_likelihood, poses, origin),
        )

    def _distance(self, channel: str, sample: F32) -> F32:
        index = self.index or self.library.index
        return DISTANCES[self.parameters.distance_of(channel)](sample, index[channel])
