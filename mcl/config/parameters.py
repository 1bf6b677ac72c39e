"""Every choice of a filter as plain values: fields, presets, and layers that are merged.

`docs/configuration.md` lists every field. A layer is a mapping from dotted keys ("sensor.sharpness") to raw
values, with the name of its origin.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from statistics import NormalDist
from types import MappingProxyType
from typing import Annotated, Any

from ..filter.following import GuidedMotionParameters
from ..filter.motion import MotionOutliers, motion_settings
from ..filter.recovery import STRATEGIES, RecoveryParameters
from ..filter.resampling import POLICIES, RESAMPLERS, KldParameters
from ..sensor.descriptors.registry import CHANNELS, FEATURES, give_channels, weights_of
from ..sensor.distances import DISTANCES
from ..sensor.model import SensorParameters
from ..sensor.outside import load_sensor
from ..sensor.references import InterpolationParameters
from ..values import expected_one_of
from ..values.geometry import INCH_M
from ..values.library import RadiiParameters
from ..values.map import OBSTACLES, SOLID
from ..values.own_parts import own_or
from ..values.pose_sensor import POSE_SENSORS
from ..values.setting_rules import SHARE, Rule, choice, number, rules_of, truth, whole

# Rules of the settings that name channels: their weights, distances and scales.


def channels(inner: Rule) -> Rule:
    """Take a table from channel to something; as text: "color=1,edges=0.5"; `configure` checks the names."""

    def rule(key: str, value: Any) -> Mapping[str, Any]:
        table = _table(key, value)
        return {name: inner(f"{key}.{name}", entry) for name, entry in table.items()}

    return rule


def weights(key: str, value: Any) -> Mapping[str, float]:
    """Take a table of weights with at least one above zero; `configure` checks the names."""
    table = _table(key, value)
    numbers = {str(name): number(0, 1e6)(f"{key}.{name}", weight) for name, weight in table.items()}
    if not any(weight > 0 for weight in numbers.values()):
        raise ValueError(f"{key}: found {value!r}, expected a channel with a weight above 0")
    return numbers


def check_channel(key: str, name: str, sensors: Collection[str] = ()) -> None:
    """Raise ValueError for a name of no channel, and of no pose sensor: ours, or one of `sensors`."""
    known = tuple(dict.fromkeys((*CHANNELS, *POSE_SENSORS, *sensors)))
    if name not in known and name not in CHANNELS:
        raise ValueError(f"{key}: no channel called {name!r}; {expected_one_of(name, known)}")


def _table(key: str, value: Any) -> Mapping[str, Any]:
    table = _pairs(key, value) if isinstance(value, str) else value
    if not isinstance(table, Mapping):
        raise ValueError(f"{key}: found {value!r}, expected a table of channels")
    return table


def _pairs(key: str, text: str) -> dict[str, str]:
    parts = [part.split("=") for part in text.split(",") if part.strip()]
    if any(len(part) != 2 for part in parts):
        raise ValueError(f'{key}: found {text!r}, expected pairs like "color=1,edges=0.5"')
    return {name.strip(): entry.strip() for name, entry in parts}


# The parts of a filter.


@dataclass(frozen=True, slots=True)
class ReferenceParameters:
    """Which references a particle is compared with."""

    method: Annotated[str, choice("nearest", "interpolated")] = "interpolated"  # the nearest is the thesis's
    interpolation: InterpolationParameters = field(default_factory=InterpolationParameters)


@dataclass(frozen=True, slots=True)
class ResamplingParameters:
    """How and when particles are resampled."""

    scheme: Annotated[str, own_or("resampler", RESAMPLERS)] = "systematic"
    when: Annotated[str, choice(*POLICIES)] = "always"
    below: Annotated[float, SHARE] = 0.5  # share of N, for "effective"
    every: Annotated[int, whole(1, 1_000_000)] = 1  # updates, for "every"
    roughening: Annotated[float, number(0, 10)] = 0.0  # 0: none; Gordon, Salmond and Smith use 0.2
    adaptive: Annotated[bool, truth] = False  # number of particles by KLD sampling
    kld: KldParameters = field(default_factory=KldParameters)


@dataclass(frozen=True, slots=True)
class MapParameters:
    """What of the map the filter trusts."""

    obstacles: Annotated[str, choice(*OBSTACLES)] = SOLID  # movable since the survey, or not even walls


@dataclass(frozen=True, slots=True)
class StartParameters:
    """How far particles lie about the pose at which they begin; 0: all at it, as in the thesis (3.6.2)."""

    sd_m: Annotated[float, number(0, 1e4)] = 0.0  # standard deviation along x and y
    heading_sd_rad: Annotated[float, number(0, 10)] = 0.0


@dataclass(frozen=True, slots=True)
class FilterParameters:
    """One filter."""

    particles: Annotated[int, whole(1, 10_000_000)] = 2000
    start: StartParameters = field(default_factory=StartParameters)
    sensor: SensorParameters = field(default_factory=lambda: SensorParameters(weights_of("blended")))
    references: ReferenceParameters = field(default_factory=ReferenceParameters)
    resampling: ResamplingParameters = field(default_factory=ResamplingParameters)
    recovery: RecoveryParameters = field(default_factory=RecoveryParameters)
    motion_outliers: MotionOutliers = field(default_factory=MotionOutliers)
    guided_motion: GuidedMotionParameters = field(default_factory=GuidedMotionParameters)
    map: MapParameters = field(default_factory=MapParameters)
    motion: Annotated[Mapping[str, object] | None, motion_settings] = None  # replaces the session header's
    radii: RadiiParameters = field(default_factory=RadiiParameters)


# by key, in the order of the documentation; what has a rule of its own in no field is here
_OTHERS: Mapping[str, Rule] = {
    "sensor.weights": weights,
    "sensor.distances": channels(choice(*DISTANCES)),
    "sensor.scales": channels(number(1e-9, 1e9)),
    "recovery.strategy": own_or("recovery strategy", STRATEGIES),
}
RULES: Mapping[str, Rule] = rules_of(FilterParameters, "", _OTHERS)


def of_feature(feature: str, particles: int = 2000) -> FilterParameters:
    """Return the default filter with one feature: a key of FEATURES, or the name of a channel."""
    return FilterParameters(sensor=SensorParameters(weights_of(feature)), particles=particles)


ALPHAS = ("turn_from_turn", "turn_from_way", "way_from_way", "way_from_turn")  # AMCL's alpha1 to alpha4

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
# the same with landmarks, found in the library's pictures at the first run (docs/landmarks.md)
PRECISE: Mapping[str, Any] = {
    "sensor.weights": dict(FEATURES["all"]),
    "recovery.strategy": "mixture",
    "recovery.mixture.teleport": 0.001,  # a proposal is wrong once in fifty pictures
    "sensor.outlier_cost": 12.0,  # fitted: above what most pictures cost at the truth
    "map.obstacles": "movable",
}
PRESETS = {**PRESETS, "precise": {**PRESETS["robust"], **PRECISE}}
# the thesis's first filter to the letter (docs/filter.md), with Maurice's constants of motion: the library is
# its only map, each motor's encoder errs by itself, a straight drifts by so much however long it is, and
# where the cloud's match quality falls below that picture's threshold particles are drawn evenly
FIGURE_10 = {"wood": (0.0, 0.33), "carpet": (2.67, 1.0)}  # degrees, mean and sd of a straight of a foot; ours
EXACT: Mapping[str, Any] = {
    "map.obstacles": "no_walls",
    "motion": {
        "model": "maurice",
        "straight_sd_m": 0.6356 * INCH_M / 2,  # the mean of four encoders
        "drift": {
            floor: {"bias_rad": math.radians(mean), "sd_rad": math.radians(sd)}
            for floor, (mean, sd) in {"": FIGURE_10["wood"], **FIGURE_10}.items()
        },
    },
    "recovery.strategy": "library",
    "recovery.draw": "evenly",
}
PRESETS = {**PRESETS, "thesis-exact": {**PRESETS["thesis"], **EXACT}}
# for a laser over an occupancy map: the default there (docs/laser.md)
LASER: Mapping[str, Any] = {
    "sensor.weights": {"laser": 1.0},
    "recovery.strategy": "mixture",
    "recovery.mixture.teleport": 0.001,
    "motion_outliers.share": 0.02,
}
# AMCL with Nav2's defaults, as far as they do not depend on the robot (docs/laser.md)
AMCL: Mapping[str, Any] = {
    "sensor.weights": {"laser": 1.0},
    "sensor.laser.model": "likelihood_field",
    "motion": {"model": "odometry", **dict.fromkeys(ALPHAS, 0.2)},
    "resampling.scheme": "multinomial",
    "resampling.adaptive": True,
    "resampling.kld.delta": 1 - NormalDist().cdf(0.99),  # pf_z is the quantile itself in its code
    "resampling.kld.bin_m": 0.5,
    "resampling.kld.heading_bins": 36,
    "resampling.kld.least": 500,
    "resampling.kld.most": 2000,
    "recovery.draw": "evenly",
    "guided_motion.share": 0.0,  # it follows no scan matcher
}
PRESETS = MappingProxyType({**PRESETS, "laser": LASER, "amcl": AMCL})  # nobody overwrites one in secret


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


def configure(layers: Iterable[Layer], sensors: Collection[str] | None = ()) -> Configuration:
    """Merge layers, later ones over earlier ones.

    `sensors` are pose sensors besides ours that may have a weight; None: any, as in a saved run whose sensors
    are not at hand. Those of `sensor.outside` are loaded, and have weight 1 where no weight names them.
    Raises ValueError in one line with the origin, the key, the value and its range; InputError for a sensor
    that cannot be loaded.
    """
    settings = {key: Setting(key, value, "default") for key, value in defaults().items()}
    for layer in layers:
        for key, value in layer.values.items():
            settings[key] = Setting(key, _checked(key, value, layer.origin), layer.origin)
    if sensors is not None:
        outside, weights = settings["sensor.outside"], settings["sensor.weights"]
        names = [load_sensor(spelled).name for spelled in outside.value]
        names += give_channels(settings["sensor.channels"].value)
        for key in ("sensor.weights", "sensor.distances", "sensor.scales"):
            for name in settings[key].value:
                origin = settings[key].origin
                _in_layer(origin, check_channel, key, name, (*sensors, *names) if key == weights.key else ())
        if names:
            added = {name: 1.0 for name in names if name not in weights.value}
            is_alone = bool(settings["sensor.channels"].value) and weights.origin == "default"
            base = {} if is_alone else weights.value
            settings["sensor.weights"] = replace(weights, value={**base, **added})
    values = {key: setting.value for key, setting in settings.items()}
    if values["resampling.kld.least"] > values["resampling.kld.most"]:
        least, most = values["resampling.kld.least"], values["resampling.kld.most"]
        origin = settings["resampling.kld.least"].origin
        raise ValueError(
            f"{origin}: resampling.kld.least: found {least}, expected at most resampling.kld.most, {most}"
        )
    if 0 < values["radii.lost_m"] < values["radii.right_m"]:
        lost, right = values["radii.lost_m"], values["radii.right_m"]
        origin = settings["radii.lost_m"].origin
        raise ValueError(
            f"{origin}: radii.lost_m: found {lost:g}, expected at least radii.right_m, {right:g}"
        )
    return Configuration(_built(FilterParameters, values, ""), tuple(settings[key] for key in RULES))


def defaults() -> dict[str, Any]:
    """Return the default of every key."""
    return {key: _read(FilterParameters(), key) for key in RULES}


def _checked(key: str, value: Any, origin: str) -> Any:
    if key not in RULES:
        advice = expected_one_of(key, RULES)
        advice = advice if advice.startswith("did") else "`maurice-replay config` lists all"
        raise ValueError(f"{origin}: {key} is not known; {advice}")
    return _in_layer(origin, RULES[key], key, value)


def _in_layer(origin: str, rule: Callable[..., Any], *given: Any) -> Any:
    try:
        return rule(*given)
    except ValueError as problem:
        raise ValueError(f"{origin}: {problem}") from None


def _read(values: Any, key: str) -> Any:
    for name in key.split("."):
        values = getattr(values, name)
    return values


def _built(kind: type[Any], values: Mapping[str, Any], prefix: str) -> Any:
    hints = typing.get_type_hints(kind)
    arguments: dict[str, Any] = {}
    for name in (each.name for each in fields(kind)):
        key, nested = f"{prefix}{name}", hints[name]
        if is_dataclass(nested) and isinstance(nested, type):
            arguments[name] = _built(nested, values, f"{key}.")
        elif key in values:
            arguments[name] = values[key]
    return kind(**arguments)
