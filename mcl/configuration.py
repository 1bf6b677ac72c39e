"""Configuration in layers: defaults, preset, file, environment, command line; the last that speaks wins.

A layer is a mapping from dotted keys ("sensor.sharpness") to raw values, with a word for where it came from.
"""

from __future__ import annotations

import difflib
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from .parameters import FilterParameters
from .rules import RULES


@dataclass(frozen=True, slots=True)
class Layer:
    """Values from one place."""

    origin: str  # for people: "default", "preset thesis", "maurice.toml", "MAURICE_PARTICLES", "--particles"
    values: Mapping[str, Any]  # dotted key to raw value


@dataclass(frozen=True, slots=True)
class Setting:
    """One value in force."""

    key: str
    value: Any
    origin: str


@dataclass(frozen=True, slots=True)
class Configuration:
    """What is in force, and where each value came from."""

    parameters: FilterParameters
    settings: tuple[Setting, ...]  # in the order of the documentation

    def values(self) -> dict[str, Any]:
        """Give dotted keys to values, to be stored beside a recording or a run."""
        return {setting.key: setting.value for setting in self.settings}


def flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn nested tables into dotted keys; tables that are values themselves (weights) stay tables."""
    flat: dict[str, Any] = {}
    for name, value in tree.items():
        key = f"{prefix}{name}"
        if isinstance(value, Mapping) and key not in RULES:
            flat |= flatten(value, f"{key}.")
        else:
            flat[key] = value
    return flat


def configure(layers: Iterable[Layer]) -> Configuration:
    """Put layers together, later ones over earlier ones.

    Raises ValueError in one line, naming origin, key, value and what is allowed.
    """
    found = {key: Setting(key, value, "default") for key, value in defaults().items()}
    for layer in layers:
        for key, value in layer.values.items():
            found[key] = Setting(key, _checked(key, value, layer.origin), layer.origin)
    values = {key: setting.value for key, setting in found.items()}
    if values["resampling.kld.least"] > values["resampling.kld.most"]:
        least, most = values["resampling.kld.least"], values["resampling.kld.most"]
        origin = found["resampling.kld.least"].origin
        raise ValueError(
            f"{origin}: resampling.kld.least: found {least}, expected at most resampling.kld.most, {most}"
        )
    return Configuration(_built(FilterParameters, values, ""), tuple(found[key] for key in RULES))


def defaults() -> dict[str, Any]:
    """Give the default of every key."""
    return {key: _read(FilterParameters(), key) for key in RULES}


def _checked(key: str, value: Any, origin: str) -> Any:
    if key not in RULES:
        near = difflib.get_close_matches(key, RULES, n=1)
        advice = f"did you mean {near[0]}?" if near else "`maurice-replay config show` lists all"
        raise ValueError(f"{origin}: {key} is not known; {advice}")
    try:
        return RULES[key](key, value)
    except ValueError as problem:
        raise ValueError(f"{origin}: {problem}") from None


def _read(values: Any, key: str) -> Any:
    for name in key.split("."):
        values = getattr(values, name)
    return values


def _built(kind: type[Any], values: Mapping[str, Any], prefix: str) -> Any:
    """Build a dataclass from dotted keys, nested ones likewise."""
    hints = typing.get_type_hints(kind)
    given: dict[str, Any] = {}
    for field in fields(kind):
        key = f"{prefix}{field.name}"
        nested = hints[field.name]
        if is_dataclass(nested) and isinstance(nested, type):
            given[field.name] = _built(nested, values, f"{key}.")
        elif key in values:
            given[field.name] = values[key]
    return kind(**given)
