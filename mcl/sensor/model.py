"""The sensor model: from a frame to the likelihood of every library entry, and of every particle.

Distance, blend and likelihood are chosen by name. Fusion takes distances (C, L), weights (C,) and
scales (C,), and returns a fused distance (L,) and its quality (L,) in [0, 1], 1 for a perfect match. Only the
last step depends on the particles: the cost of comparing does not grow with their number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, reduce
from typing import Annotated, Any

import numpy as np

from ..values.arrays import F32, F64, I32, U8
from ..values.library import ChannelIndex, Library
from ..values.pose_sensor import EXACT, POSE_SENSORS, PoseSensor, PoseSpread, Sensed, spread_between
from ..values.records import Comparison, Sighting
from ..values.session import Frame
from ..values.setting_rules import choice, number
from .descriptors.registry import CHANNELS, SCALES, channel_names, reduced
from .distances import DISTANCES
from .laser.parameters import LaserParameters
from .outside import sensor_names
from .references import ReferenceLookup

# Fusion: several channels to one distance.

# A smaller spread over the library, as a share of the distance, is rounding.
LEAST_RELATIVE_SPREAD = 1e-5
# Some entry is always the worst, with quality 0, however good it is: it must not rule a pose out forever.
LEAST_QUALITY = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Blended:
    """The fused distance and quality of L references."""

    distance: F32  # (L,) >= 0
    quality: F32  # (L,) in [0, 1]


Blend = Callable[[F32, F64, F64], Blended]


def relative_quality(distances: F32) -> F32:
    """Return 1 - D/D_max (..., L): 1 is a perfect match, 0 this picture's worst entry; all 1 if all are 0."""
    worst = distances.max(axis=-1, keepdims=True)
    share = np.divide(distances, worst, out=np.zeros_like(distances), where=worst > 0)
    return np.asarray(1 - share, np.float32)


def calibrated(distances: F32, weights: F64, scales: F64) -> Blended:
    """Return the sum of weight * D / scale, in nats: as if channels erred independently."""
    total = np.asarray((weights / scales) @ distances, np.float32)
    return Blended(total, relative_quality(total))


def weighted_sum(distances: F32, weights: F64, scales: F64) -> Blended:
    """Return the weighted sum of channels scaled to the same spread over the library (thesis 4.2.3)."""
    spread = distances.std(axis=1, dtype=np.float64)
    tells = spread > LEAST_RELATIVE_SPREAD * distances.max(axis=1)
    scale = np.divide(weights, spread, out=np.zeros_like(weights), where=tells)
    total = np.asarray(scale @ distances, np.float32)
    return Blended(total, relative_quality(distances[0] if len(distances) == 1 else total))


BLENDS: Mapping[str, Blend] = {"calibrated": calibrated, "sum": weighted_sum}


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


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """What is compared, how, and how sharply. Names are keys of the registry in each comment."""

    weights: Mapping[str, float]  # channel or pose sensor to its share; one channel: {"color": 1.0}
    sharpness: Annotated[float, number(0, 10_000)] = 1.0  # multiplies the log-likelihood; 0: a blind sensor
    likelihood: Annotated[str, choice(*LIKELIHOODS)] = "exponential"
    blend: Annotated[str, choice(*BLENDS)] = "calibrated"
    distances: Mapping[str, str] = field(default_factory=dict)  # channel to DISTANCES; others: the channel's
    scales: Mapping[str, float] = field(default_factory=dict)  # channel to distance of a nat; others: SCALES
    # multiplies the scales of SCALES: above 1 where a library has few places
    widening: Annotated[float, number(1, 1e6)] = 1.0
    # nats that a pose costs at most, as a picture may show what no reference does; 0: no bound
    outlier_cost: Annotated[float, number(0, 1e6)] = 0.0
    # sensors of other packages: names of entry points, or module:Class
    outside: Annotated[tuple[str, ...], sensor_names] = ()
    channels: Annotated[tuple[str, ...], channel_names] = ()  # the user's: objects, or module:name
    laser: LaserParameters = field(default_factory=LaserParameters)

    def distance_of(self, channel: str) -> str:
        """Return the name of the distance that a channel is compared by."""
        return self.distances.get(channel, CHANNELS[channel].distance)

    def scale_of(self, channel: str) -> float:
        """Return the distance that costs one nat of log-likelihood at weight 1 and sharpness 1."""
        usual = SCALES.get(channel, {}).get(self.distance_of(channel), 1.0)
        return self.scales.get(channel, usual * self.widening)

    def is_usual(self, channel: str) -> bool:
        """Return whether a channel is compared as usual, by a scale of ours."""
        return channel not in self.scales and self.distance_of(channel) == CHANNELS[channel].distance

    def check_names(self) -> None:
        """Raise KeyError for an unknown name now, instead of at the first picture."""
        for channel in self.weights:
            if channel not in POSE_SENSORS:
                DISTANCES[self.distance_of(channel)]
        BLENDS[self.blend], LIKELIHOODS[self.likelihood]


@dataclass(frozen=True, slots=True, eq=False)
class SensorModel:
    """All sensors of one filter: what a frame says about any pose, in nats.

    Channels compare the picture with the library's references, and particles are weighted by those they are
    compared with. Pose sensors weigh every particle at its own pose. Their log-likelihoods add up.
    """

    library: Library
    references: ReferenceLookup
    parameters: SensorParameters
    # each channel in use, extended by virtual references; empty: the library's own
    index: Mapping[str, ChannelIndex] = field(default_factory=dict)
    sensors: Mapping[str, PoseSensor] = field(default_factory=dict)  # pose sensors in use, by name
    sources: I32 = field(default_factory=lambda: np.zeros((0, 1), np.int32))  # (V, n) of virtual references
    spread: PoseSpread = EXACT  # of the poses that one of the library's references stands for

    @property
    def weights(self) -> dict[str, float]:
        """Return the weight of each channel in use, in order: those of `parameters` without pose sensors."""
        weights, sensors = self.parameters.weights, {*self.sensors, *self.library.sensors, *POSE_SENSORS}
        return {name: weight for name, weight in weights.items() if name not in sensors}

    @property
    def distances(self) -> dict[str, str]:
        """Return the name of the distance of each channel in use, in order."""
        return {name: self.parameters.distance_of(name) for name in self.weights}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all that it uses: channels, then pose sensors."""
        return (*self.weights, *self.sensors)

    def measure(self, image: U8) -> dict[str, F32]:
        """Return what every channel in use measures in a picture (H, W, 3) RGB: channel to (D,)."""
        small = reduced(image)
        return {name: CHANNELS[name].describe(small) for name in self.weights}

    def read(self, frame: Frame) -> dict[str, Any]:
        """Return what every pose sensor reads in a frame; those with nothing to say are left out."""
        readings = {name: sensor.read(frame) for name, sensor in self.sensors.items()}
        return {name: reading for name, reading in readings.items() if reading is not None}

    def see(self, frame: Frame) -> Comparison:
        """Measure, read and compare a frame, by all sensors."""
        return self.compare(self.measure(frame.image), self.read(frame))

    def compare(
        self, descriptors: Mapping[str, F32], readings: Mapping[str, Any] | None = None
    ) -> Comparison:
        """Compare with all L entries and the virtual references; nothing here depends on the particles."""
        comparison, sensed = self._compare_channels(descriptors), list[Sensed]()
        for name, reading in (readings or {}).items():
            if hasattr(self.sensors[name], "verify"):
                comparison = self._verified(comparison, name, reading)
            else:
                sensed.append(self._sense(name, reading))
        if not sensed:
            return comparison
        if not comparison.channels and not any(part.cost.any() for part in sensed):
            return replace(comparison, sensed=tuple(sensed))
        costs = [np.float32(part.weight) * part.cost for part in sensed]
        nats = sum(costs, np.zeros_like(comparison.cost))
        return replace(
            self._with(comparison, nats), sensed=tuple(sensed), of_channels=comparison.log_likelihood
        )

    def _with(self, comparison: Comparison, nats: F32) -> Comparison:
        """Return a comparison in which each reference (L,) costs so much more."""
        cost = comparison.cost + nats
        return replace(
            comparison,
            cost=cost,
            quality=relative_quality(cost),
            log_likelihood=comparison.log_likelihood - np.float32(self.parameters.sharpness) * nats,
        )

    def _verified(self, comparison: Comparison, name: str, reading: Any) -> Comparison:
        """Return channels' comparison as a sensor verifies it; a virtual reference has its sources' mean."""
        sensor: Any = self.sensors[name]
        weight = self.parameters.weights.get(name, 1.0)
        part = Sensed(sensor, reading, weight, sensor.verify(reading, comparison.log_likelihood))
        nats = np.float32(weight) * part.cost
        virtual = comparison.virtual
        if len(virtual):
            virtual = virtual - np.float32(self.parameters.sharpness) * nats[self.sources].mean(axis=1)
        return replace(self._with(comparison, nats), virtual=virtual, verified=(*comparison.verified, part))

    def only(self, channel: str) -> SensorModel:
        """Return the model with one channel in use, and no pose sensor."""
        weights = {channel: self.weights[channel]}
        return replace(self, parameters=replace(self.parameters, weights=weights), sensors={})

    def compare_reference(self, entry: int) -> Comparison:
        """Compare one of the library's own pictures, as its channels measured it, with all L entries."""
        return self.compare({name: self.library.index[name].references[entry] for name in self.weights})

    def _sense(self, name: str, reading: Any) -> Sensed:
        sensor, weight = self.sensors[name], self.parameters.weights.get(name, 1.0)
        if not getattr(sensor, "weighs_references", True):
            return Sensed(sensor, reading, weight, _no_cost(self.library.size))
        poses, origin = self.library.poses.copy(), self.library.origin
        poses[:, :2] -= origin
        cost = -sensor.log_likelihood(reading, poses.astype(np.float32), origin, self.spread)
        return Sensed(sensor, reading, weight, np.maximum(cost, np.float32(0)))

    def _compare_channels(self, descriptors: Mapping[str, F32]) -> Comparison:
        p, weights_of, entries = self.parameters, self.weights, self.library.size
        names, index = tuple(weights_of), self.index or self.library.index
        if not names:
            return _no_channels(entries)
        measured = [DISTANCES[p.distance_of(name)](descriptors[name], index[name]) for name in names]
        distances = np.stack(measured)
        weights = np.array([weights_of[name] for name in names])
        scales = np.array([p.scale_of(name) for name in names])
        blended = BLENDS[p.blend](distances, weights, scales)
        log_likelihood = LIKELIHOODS[p.likelihood](blended, p.sharpness)
        if p.outlier_cost > 0:
            log_likelihood = np.logaddexp(log_likelihood, np.float32(-p.outlier_cost))
        distances = distances[:, :entries]
        channel_cost = np.asarray(distances / scales[:, None], np.float32)
        return Comparison(
            channels=names,
            descriptors=descriptors,
            distances=distances,
            channel_quality=relative_quality(distances),
            quality=blended.quality[:entries],
            channel_cost=channel_cost,
            cost=np.asarray(weights @ channel_cost, np.float32),
            log_likelihood=log_likelihood[:entries],
            virtual=log_likelihood[entries:],
        )

    def at(self, comparison: Comparison, poses: F32) -> Sighting:
        """Return the entry and the log-likelihood of each of the poses (N, 3) relative to the origin.

        Pose sensors need no reference: what does not agree with them has their floor, wherever it is.
        """
        origin = self.library.origin
        entries, log_likelihood, known = self.references.look(comparison.of_references, poses, origin)
        sensed = self.sense_at(comparison, poses)
        if sensed is not None:
            log_likelihood = log_likelihood + np.float32(self.parameters.sharpness) * sensed
        return Sighting(comparison, entries, log_likelihood, sensed, known)

    def sense_at(self, comparison: Comparison, poses: F32, clouds: int = 1) -> F32 | None:
        """Return the nats (N,) of all pose sensors at poses (N, 3); None if none of them said anything.

        The poses are those of one cloud, or of several of the same size, one after another.
        """
        nats = [np.float32(each.weight) * self._nats(each, poses, clouds) for each in comparison.sensed]
        return reduce(np.add, nats) if nats else None

    def _nats(self, sensed: Sensed, poses: F32, clouds: int) -> F32:
        origin, weigh = self.library.origin, sensed.sensor.log_likelihood
        if not getattr(sensed.sensor, "smooths", False):
            return weigh(sensed.reading, poses, origin)
        parts = np.split(poses, clouds) if clouds > 1 else [poses]
        return np.concatenate([weigh(sensed.reading, part, origin, spread_between(part)) for part in parts])


def _no_channels(entries: int) -> Comparison:
    """Return the comparison by no channel at all: every reference is as likely as any other."""
    none, zero = np.zeros((0, entries), np.float32), _no_cost(entries)
    return Comparison((), {}, none, none, zero + 1, none, zero, zero)


@lru_cache(8)
def _no_cost(entries: int) -> F32:
    """Return zeros (L,), which nobody may change."""
    zero = np.zeros(entries, np.float32)
    zero.flags.writeable = False
    return zero
