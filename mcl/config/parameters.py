"""Every choice of a filter as plain values, with names for what is looked up, and presets.

`docs/configuration.md` lists every field; a TOML file has the same tables and names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..filter.motion import MotionOutliers
from ..filter.proposal import MixtureParameters
from ..filter.recovery import Augmented, DynamicThreshold, Expansion, SensorResetting
from ..filter.resampling import KldParameters
from ..sensor.descriptors.registry import FEATURES, weights_of
from ..sensor.model import SensorParameters
from ..sensor.references import InterpolationParameters


@dataclass(frozen=True, slots=True)
class ReferenceParameters:
    """Which references a particle is compared with."""

    method: str = "interpolated"  # "nearest" (the thesis's) or "interpolated"
    interpolation: InterpolationParameters = field(default_factory=InterpolationParameters)


@dataclass(frozen=True, slots=True)
class ResamplingParameters:
    """How and when particles are resampled."""

    scheme: str = "systematic"  # RESAMPLERS
    when: str = "always"  # "always", "effective" (below a share of N) or "every" (a number of updates)
    below: float = 0.5  # share of N, for "effective"
    every: int = 1  # updates, for "every"
    roughening: float = 0.0  # 0: none; Gordon, Salmond and Smith use 0.2
    adaptive: bool = False  # number of particles by KLD sampling
    kld: KldParameters = field(default_factory=KldParameters)


@dataclass(frozen=True, slots=True)
class RecoveryParameters:
    """Whether, when and where fresh particles are drawn."""

    strategy: str = "none"  # "none", "always", "threshold", "sensor", "augmented", "expansion" or "mixture"
    draw: str = "likelihood"  # "likelihood" (where the picture says) or "evenly" (over free space)
    share: float = 0.05  # of the particles, for "always"
    threshold: DynamicThreshold = field(default_factory=DynamicThreshold)
    sensor: SensorResetting = field(default_factory=SensorResetting)
    augmented: Augmented = field(default_factory=Augmented)
    expansion: Expansion = field(default_factory=Expansion)
    mixture: MixtureParameters = field(default_factory=MixtureParameters)


@dataclass(frozen=True, slots=True)
class FilterParameters:
    """One filter."""

    sensor: SensorParameters = field(default_factory=lambda: SensorParameters(weights_of("blended")))
    references: ReferenceParameters = field(default_factory=ReferenceParameters)
    resampling: ResamplingParameters = field(default_factory=ResamplingParameters)
    recovery: RecoveryParameters = field(default_factory=RecoveryParameters)
    motion_outliers: MotionOutliers = field(default_factory=MotionOutliers)
    motion: Mapping[str, object] | None = None  # replaces the session header's
    particles: int = 2000


def of_feature(feature: str, particles: int = 2000, sharpness: float = 1.0) -> FilterParameters:
    """Return the default filter with one feature: a key of FEATURES, or the name of a channel."""
    return FilterParameters(sensor=SensorParameters(weights_of(feature), sharpness), particles=particles)


# Presets: complete filters by name, as layers of configuration.

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # the thesis's first filter (its section 3), as far as the thesis specifies it
    "thesis": {
        "particles": 2000,
        "sensor.weights": {"color": 1.0},
        "sensor.distances": {"color": "thesis", "edges": "thesis", "smoothed": "thesis"},
        "sensor.blend": "sum",
        "sensor.likelihood": "power",
        "sensor.sharpness": 1.0,
        "references.method": "nearest",
        "resampling.scheme": "multinomial",
        "resampling.when": "always",
        "recovery.strategy": "none",
    },
    # with the refinements of its section 4: smoothed color and edges blended, recovery under a threshold
    "refined": {
        "sensor.weights": {"smoothed": 0.5, "edges": 0.5},
        "sensor.distances": {"smoothed": "thesis", "edges": "thesis"},
        "sensor.blend": "sum",
        "sensor.likelihood": "power",
        "sensor.sharpness": 8.0,
        "references.method": "nearest",
        "resampling.scheme": "systematic",
        "recovery.strategy": "threshold",
        "recovery.draw": "evenly",
    },
    # recommended for a robot
    "robust": {
        "sensor.weights": dict(FEATURES["best"]),
        "sensor.blend": "calibrated",
        "sensor.likelihood": "exponential",
        "references.method": "interpolated",
        "recovery.strategy": "threshold",
        "motion_outliers.share": 0.02,
    },
}
