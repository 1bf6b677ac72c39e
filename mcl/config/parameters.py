"""Every choice of a filter as plain values: fields, presets, a rule per key, and layers that are merged.

`docs/configuration.md` lists every field. A layer is a mapping from dotted keys ("sensor.sharpness") to raw
values, with the name of its origin.
"""

from __future__ import annotations

import difflib
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from ..filter.motion import MotionOutliers
from ..filter.proposal import MixtureParameters
from ..filter.recovery import Augmented, DynamicThreshold, Expansion, SensorResetting
from ..filter.resampling import RESAMPLERS, KldParameters
from ..pose_sensor import POSE_SENSORS
from ..radii import NAMES as RADII
from ..radii import RadiiParameters
from ..sensor.descriptors.registry import CHANNELS, FEATURES, weights_of
from ..sensor.distances import DISTANCES
from ..sensor.model import BLENDS, LIKELIHOODS, QUALITIES, SensorParameters
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
    radii: RadiiParameters = field(default_factory=RadiiParameters)


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
# the same with regions that hold the truth as often as they say (docs/lost-signal.md, calibration of belief)
PRESETS = {**PRESETS, "calibrated": {**PRESETS["robust"], "sensor.sharpness": 0.7}}


# One rule per key; messages name the key, the value and its range.

LEAST_RADIUS_M = 0.001

Rule = Callable[[str, Any], Any]  # from key and raw value to the value; raises ValueError in one line


def number(low: float, high: float) -> Rule:
    """Take a number within bounds, both included."""

    def rule(key: str, value: Any) -> float:
        given = _from_text(value, float)
        if isinstance(given, bool) or not isinstance(given, (int, float)) or not low <= given <= high:
            raise ValueError(f"{key}: found {value!r}, expected a number from {low:g} to {high:g}")
        return float(given)

    return rule


def radius(key: str, value: Any) -> float:
    """Accept a radius in meters; 0 means that it is derived from the library."""
    given: float = number(0, 1e4)(key, value)
    if 0 < given < LEAST_RADIUS_M:
        raise ValueError(f"{key}: found {value!r}, expected 0 or a number from {LEAST_RADIUS_M:g} to 10000")
    return given


def whole(low: int, high: int) -> Rule:
    """Take an integer within bounds, both included."""

    def rule(key: str, value: Any) -> int:
        given = _from_text(value, int)
        if isinstance(given, bool) or not isinstance(given, int) or not low <= given <= high:
            raise ValueError(f"{key}: found {value!r}, expected a whole number from {low} to {high}")
        return given

    return rule


def choice(*words: str) -> Rule:
    """Accept one of several words."""

    def rule(key: str, value: Any) -> str:
        if value not in words:
            raise ValueError(f"{key}: found {value!r}, expected one of {', '.join(words)}")
        return str(value)

    return rule


def truth(key: str, value: Any) -> bool:
    """Accept true or false."""
    words = {"true": True, "false": False}
    given = words.get(value, value) if isinstance(value, str) else value
    if not isinstance(given, bool):
        raise ValueError(f"{key}: found {value!r}, expected true or false")
    return given


def channels(inner: Rule) -> Rule:
    """Take a table from channel to something; as text: "color=1,edges=0.5"."""

    def rule(key: str, value: Any) -> Mapping[str, Any]:
        given = _pairs(key, value) if isinstance(value, str) else value
        if not isinstance(given, Mapping):
            raise ValueError(f"{key}: found {value!r}, expected a table of channels")
        for name in given:
            if name not in CHANNELS and name not in POSE_SENSORS:
                there = ", ".join((*CHANNELS, *POSE_SENSORS))
                raise ValueError(f"{key}: no channel called {name!r}; there are {there}")
        return {name: inner(f"{key}.{name}", entry) for name, entry in given.items()}

    return rule


def weights(key: str, value: Any) -> Mapping[str, float]:
    """Take a table of weights with at least one above zero."""
    given: Mapping[str, float] = channels(number(0, 1e6))(key, value)
    if not any(weight > 0 for weight in given.values()):
        raise ValueError(f"{key}: found {value!r}, expected a channel with a weight above 0")
    return given


def table(key: str, value: Any) -> Mapping[str, Any]:
    """Take any table; its contents are checked where it is used."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{key}: found {value!r}, expected a table")
    return dict(value)


def _from_text(value: Any, kind: Callable[[str], Any]) -> Any:
    if not isinstance(value, str):
        return value
    try:
        return kind(value)
    except ValueError:
        return value


def _pairs(key: str, text: str) -> dict[str, str]:
    parts = [part.split("=") for part in text.split(",") if part.strip()]
    if any(len(part) != 2 for part in parts):
        raise ValueError(f'{key}: found {text!r}, expected pairs like "color=1,edges=0.5"')
    return {name.strip(): entry.strip() for name, entry in parts}


SHARE = number(0, 1)
NATS = number(-1e6, 0)

RULES: Mapping[str, Rule] = {
    "particles": whole(1, 10_000_000),
    "sensor.weights": weights,
    "sensor.sharpness": number(0, 10_000),
    "sensor.likelihood": choice(*LIKELIHOODS),
    "sensor.blend": choice(*BLENDS),
    "sensor.quality": choice(*QUALITIES),
    "sensor.distances": channels(choice(*DISTANCES)),
    "sensor.scales": channels(number(1e-9, 1e9)),
    "sensor.widening": number(1, 1e6),
    "references.method": choice("nearest", "interpolated"),
    "references.interpolation.virtual": truth,
    "references.interpolation.places": whole(1, 64),
    "references.interpolation.width": number(0.01, 100),
    "resampling.scheme": choice(*RESAMPLERS),
    "resampling.when": choice("always", "effective", "every"),
    "resampling.below": SHARE,
    "resampling.every": whole(1, 1_000_000),
    "resampling.roughening": number(0, 10),
    "resampling.adaptive": truth,
    "resampling.kld.epsilon": number(1e-4, 1),
    "resampling.kld.delta": number(1e-9, 0.5),
    "resampling.kld.bin_m": number(1e-3, 1e3),
    "resampling.kld.heading_bins": whole(1, 3600),
    "resampling.kld.least": whole(1, 10_000_000),
    "resampling.kld.most": whole(1, 10_000_000),
    "recovery.strategy": choice("none", "always", "threshold", "sensor", "augmented", "expansion", "mixture"),
    "recovery.draw": choice("likelihood", "evenly"),
    "recovery.share": SHARE,
    "recovery.threshold.share": SHARE,
    "recovery.threshold.deviations": number(0, 1000),
    "recovery.threshold.rate": SHARE,
    "recovery.threshold.settle": whole(0, 1_000_000),
    "recovery.threshold.least_sd": number(0, 1e6),
    "recovery.sensor.evidence": NATS,
    "recovery.sensor.most": SHARE,
    "recovery.augmented.slow": SHARE,
    "recovery.augmented.fast": SHARE,
    "recovery.augmented.most": SHARE,
    "recovery.augmented.resets": SHARE,
    "recovery.expansion.evidence": NATS,
    "recovery.mixture.share": number(0, 0.99),
    "recovery.mixture.teleport": SHARE,
    "motion_outliers.share": SHARE,
    "motion_outliers.widen": number(1, 1000),
    "motion": table,
    **{f"radii.{name}": radius for name in RADII},
}

# Names of earlier versions, still found in saved runs, configuration files and environment variables.

RENAMED_KEYS: Mapping[str, str] = {
    "selection.method": "references.method",
    "selection.interpolation.between": "references.interpolation.virtual",
    "selection.interpolation.places": "references.interpolation.places",
    "selection.interpolation.width": "references.interpolation.width",
    "tail.share": "motion_outliers.share",
    "tail.widen": "motion_outliers.widen",
    **{
        key.replace("recovery.", "reseeding.").replace(".mixture.", ".dual."): key
        for key in RULES
        if key.startswith("recovery.")
    },
}
RENAMED_WORDS: Mapping[tuple[str, str], str] = {("recovery.strategy", "dual"): "mixture"}


# Layers: defaults, preset, file, environment, command line; later ones override earlier ones.


@dataclass(frozen=True, slots=True)
class Layer:
    """Values from one place."""

    origin: str  # for people: "default", "preset thesis", "maurice.toml", "MAURICE_PARTICLES", "--particles"
    values: Mapping[str, Any]  # dotted key to raw value


@dataclass(frozen=True, slots=True)
class Setting:
    """One value in effect."""

    key: str
    value: Any
    origin: str


@dataclass(frozen=True, slots=True)
class Configuration:
    """The values in effect, and the origin of each."""

    parameters: FilterParameters
    settings: tuple[Setting, ...]  # in the order of the documentation

    def values(self) -> dict[str, Any]:
        """Return dotted keys to values, to be stored with a recording or a run."""
        return {setting.key: setting.value for setting in self.settings}


def flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn nested tables into dotted keys; tables that are values (weights) stay tables."""
    flat: dict[str, Any] = {}
    for name, value in tree.items():
        key = f"{prefix}{name}"
        if isinstance(value, Mapping) and key not in RULES:
            flat |= flatten(value, f"{key}.")
        else:
            flat[key] = value
    return flat


def configure(layers: Iterable[Layer]) -> Configuration:
    """Merge layers, later ones over earlier ones; names of earlier versions are translated.

    Raises ValueError in one line with the origin, the key, the value and its range.
    """
    found = {key: Setting(key, value, "default") for key, value in defaults().items()}
    for layer in layers:
        for name, value in layer.values.items():
            key = RENAMED_KEYS.get(name, name)
            found[key] = Setting(key, _checked(key, value, layer.origin), layer.origin)
    values = {key: setting.value for key, setting in found.items()}
    if values["resampling.kld.least"] > values["resampling.kld.most"]:
        least, most = values["resampling.kld.least"], values["resampling.kld.most"]
        origin = found["resampling.kld.least"].origin
        raise ValueError(
            f"{origin}: resampling.kld.least: found {least}, expected at most resampling.kld.most, {most}"
        )
    if 0 < values["radii.lost_m"] < values["radii.right_m"]:
        lost, right = values["radii.lost_m"], values["radii.right_m"]
        origin = found["radii.lost_m"].origin
        raise ValueError(
            f"{origin}: radii.lost_m: found {lost:g}, expected at least radii.right_m, {right:g}"
        )
    return Configuration(_built(FilterParameters, values, ""), tuple(found[key] for key in RULES))


def defaults() -> dict[str, Any]:
    """Return the default of every key."""
    return {key: _read(FilterParameters(), key) for key in RULES}


def _checked(key: str, value: Any, origin: str) -> Any:
    if key not in RULES:
        near = difflib.get_close_matches(key, RULES, n=1)
        advice = f"did you mean {near[0]}?" if near else "`maurice-replay config show` lists all"
        raise ValueError(f"{origin}: {key} is not known; {advice}")
    try:
        word = RENAMED_WORDS.get((key, value), value) if isinstance(value, str) else value
        return RULES[key](key, word)
    except ValueError as problem:
        raise ValueError(f"{origin}: {problem}") from None


def _read(values: Any, key: str) -> Any:
    for name in key.split("."):
        values = getattr(values, name)
    return values


def _built(kind: type[Any], values: Mapping[str, Any], prefix: str) -> Any:
    hints = typing.get_type_hints(kind)
    given: dict[str, Any] = {}
    for name in (each.name for each in fields(kind)):
        key, nested = f"{prefix}{name}", hints[name]
        if is_dataclass(nested) and isinstance(nested, type):
            given[name] = _built(nested, values, f"{key}.")
        elif key in values:
            given[name] = values[key]
    return kind(**given)
