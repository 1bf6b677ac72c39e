"""Rules of the settings that name channels: their weights, distances and scales."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ..sensor.descriptors.registry import CHANNELS
from ..values import POSE_SENSORS, Rule, number


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


def _table(key: str, value: Any) -> Mapping[str, Any]:
    given = _pairs(key, value) if isinstance(value, str) else value
    if not isinstance(given, Mapping):
        raise ValueError(f"{key}: found {value!r}, expected a table of channels")
    return given


def _pairs(key: str, text: str) -> dict[str, str]:
    parts = [part.split("=") for part in text.split(",") if part.strip()]
    if any(len(part) != 2 for part in parts):
        raise ValueError(f'{key}: found {text!r}, expected pairs like "color=1,edges=0.5"')
    return {name.strip(): entry.strip() for name, entry in parts}
