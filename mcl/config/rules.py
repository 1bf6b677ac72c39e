"""One rule per key of a configuration, and the names that keys had before.

A rule takes a raw value, as text or typed, and returns the value; messages name the key, the value and its
range.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from ..filter.recovery import STRATEGIES
from ..filter.resampling import POLICIES, RESAMPLERS
from ..map import OBSTACLES
from ..pose_sensor import POSE_SENSORS
from ..radii import NAMES as RADII
from ..sensor.descriptors.registry import CHANNELS
from ..sensor.distances import DISTANCES
from ..sensor.model import BLENDS, LIKELIHOODS, QUALITIES

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
        given = _table(key, value)
        for name in given:
            check_channel(key, name)
        return {name: inner(f"{key}.{name}", entry) for name, entry in given.items()}

    return rule


def weights(key: str, value: Any) -> Mapping[str, float]:
    """Take a table of weights with at least one above zero; `configure` checks the names."""
    given = _table(key, value)
    numbers = {str(name): number(0, 1e6)(f"{key}.{name}", weight) for name, weight in given.items()}
    if not any(weight > 0 for weight in numbers.values()):
        raise ValueError(f"{key}: found {value!r}, expected a channel with a weight above 0")
    return numbers


def check_channel(key: str, name: str, sensors: Collection[str] = ()) -> None:
    """Raise ValueError for a name of no channel, and of no pose sensor: ours, or one of `sensors`."""
    known = tuple(dict.fromkeys((*CHANNELS, *POSE_SENSORS, *sensors)))
    if name not in known:
        raise ValueError(f"{key}: no channel called {name!r}; there are {', '.join(known)}")


def texts(key: str, value: Any) -> tuple[str, ...]:
    """Take a list of texts; as text: "beacon,my_module:Sonar"."""
    given = [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value
    if not isinstance(given, (list, tuple)) or not all(isinstance(entry, str) and entry for entry in given):
        raise ValueError(f"{key}: found {value!r}, expected a list of texts")
    return tuple(dict.fromkeys(given))


def _table(key: str, value: Any) -> Mapping[str, Any]:
    given = _pairs(key, value) if isinstance(value, str) else value
    if not isinstance(given, Mapping):
        raise ValueError(f"{key}: found {value!r}, expected a table of channels")
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
    "sensor.outlier_cost": number(0, 1e6),
    "sensor.outside": texts,
    "references.method": choice("nearest", "interpolated"),
    "references.interpolation.virtual": truth,
    "references.interpolation.places": whole(1, 64),
    "references.interpolation.width": number(0.01, 100),
    "resampling.scheme": choice(*RESAMPLERS),
    "resampling.when": choice(*POLICIES),
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
    "recovery.strategy": choice(*STRATEGIES),
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
    "guided_motion.share": number(0, 0.99),
    "map.obstacles": choice(*OBSTACLES),
    "motion": table,
    **{f"radii.{name}": radius for name in RADII},
}
