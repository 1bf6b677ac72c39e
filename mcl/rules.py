"""What each configurable value may be: one rule a key, and messages that name key, value and range."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from .blending import BLENDS, QUALITIES
from .channels import CHANNELS
from .distances import DISTANCES
from .likelihoods import LIKELIHOODS
from .resampling import RESAMPLERS

Rule = Callable[[str, Any], Any]  # key and raw value to the value; raises ValueError in one line


def number(low: float, high: float) -> Rule:
    """Take a number within bounds, both included."""

    def rule(key: str, value: Any) -> float:
        given = _from_text(value, float)
        if isinstance(given, bool) or not isinstance(given, (int, float)) or not math.isfinite(given):
            raise ValueError(f"{key}: found {value!r}, expected a number from {low:g} to {high:g}")
        if not low <= given <= high:
            raise ValueError(f"{key}: found {value!r}, expected a number from {low:g} to {high:g}")
        return float(given)

    return rule


def whole(low: int, high: int) -> Rule:
    """Take a whole number within bounds, both included."""

    def rule(key: str, value: Any) -> int:
        given = _from_text(value, int)
        if isinstance(given, bool) or not isinstance(given, int) or not low <= given <= high:
            raise ValueError(f"{key}: found {value!r}, expected a whole number from {low} to {high}")
        return given

    return rule


def choice(*words: str) -> Rule:
    """Take one of some words."""

    def rule(key: str, value: Any) -> str:
        if value not in words:
            raise ValueError(f"{key}: found {value!r}, expected one of {', '.join(words)}")
        return str(value)

    return rule


def truth(key: str, value: Any) -> bool:
    """Take true or false."""
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
            if name not in CHANNELS:
                raise ValueError(f"{key}: no channel called {name!r}; there are {', '.join(CHANNELS)}")
        return {name: inner(f"{key}.{name}", entry) for name, entry in given.items()}

    return rule


def weights(key: str, value: Any) -> Mapping[str, float]:
    """Take a table of weights with at least one above zero."""
    given: Mapping[str, float] = channels(number(0, 1e6))(key, value)
    if not any(weight > 0 for weight in given.values()):
        raise ValueError(f"{key}: found {value!r}, expected a channel with a weight above 0")
    return given


def table(key: str, value: Any) -> Mapping[str, Any]:
    """Take any table; what it means is checked where it is used."""
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
    "selection.method": choice("nearest", "interpolated"),
    "selection.interpolation.between": truth,
    "selection.interpolation.places": whole(1, 64),
    "selection.interpolation.width": number(0.01, 100),
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
    "reseeding.strategy": choice("none", "always", "threshold", "sensor", "augmented", "expansion", "dual"),
    "reseeding.draw": choice("likelihood", "evenly"),
    "reseeding.share": SHARE,
    "reseeding.threshold.share": SHARE,
    "reseeding.threshold.deviations": number(0, 1000),
    "reseeding.threshold.rate": SHARE,
    "reseeding.threshold.settle": whole(0, 1_000_000),
    "reseeding.threshold.least_sd": number(0, 1e6),
    "reseeding.sensor.evidence": NATS,
    "reseeding.sensor.most": SHARE,
    "reseeding.augmented.slow": SHARE,
    "reseeding.augmented.fast": SHARE,
    "reseeding.augmented.most": SHARE,
    "reseeding.augmented.resets": SHARE,
    "reseeding.expansion.evidence": NATS,
    "reseeding.dual.share": number(0, 0.99),
    "reseeding.dual.teleport": SHARE,
    "tail.share": SHARE,
    "tail.widen": number(1, 1000),
    "motion": table,
}
