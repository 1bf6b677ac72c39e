"""How typed values are read: settings, lengths, options of reading."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from maurice_loaders.files.text import METERS, parse_toml
from maurice_loaders.reading.options import FIELDS, RULES, Reading, read_reading
from maurice_mcl.values import expected_one_of

from ...errors import OptionError


def settings_of(pairs: Iterable[str] | None) -> dict[str, Any]:
    """Read `--set KEY=VALUE` pairs; a value may be TOML, such as a table. OptionError for anything else."""
    settings: dict[str, Any] = {}
    for pair in pairs or ():
        key, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or not key:
            raise OptionError(f"--set takes KEY=VALUE, such as sensor.sharpness=2; found {pair!r}")
        if key in settings:
            raise OptionError(f"--set gives {key} twice; give it once")
        if key == "sensor.outside":
            sensors_of([value])
        settings[key] = value if not value.startswith(("{", "[")) else _toml(pair, value)
    return settings


def sensors_of(names: Iterable[str] | None) -> tuple[str, ...]:
    """Return sensors of other packages as typed; a `module:Class` may be in the current folder."""
    sensors = tuple(names or ())
    if any(":" in name for name in sensors) and "" not in sys.path:
        sys.path.append("")  # as with `python -m`
    return sensors


def _toml(pair: str, value: str) -> Any:
    try:
        return parse_toml(f"value = {value}")["value"]
    except ValueError as problem:
        raise OptionError(f"--set {pair}: {problem}") from None


def read_length(text: str, name: str, least_m: float = 0.0, most_m: float = 1000.0) -> float:
    """Read an option's length, such as 18in, 0.6m, 45cm or 1.5ft, in meters. OptionError for other words."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(in|ft|mm|cm|m)\s*", text)
    length_m = float(match[1]) * METERS[match[2]] if match else 0.0
    if not (match and max(least_m, 1e-9) <= length_m <= most_m):
        limit = f" from {least_m * 100:g} cm" if least_m else " above 0"
        raise OptionError(f"{name} is a length{limit} like 18in, 45cm, 0.6m or 1.5ft, found {text!r}")
    return length_m


# How a recording is read: from a TOML file or as KEY=VALUE; the keys are those of the file.

KEYS = {name.replace("_rad", "_deg"): name for name in FIELDS}  # as typed: angles in degrees
USUAL = Reading()


def reading_of(given: Iterable[str] | None, *, keep_going: bool = False) -> Reading:
    """Return the options that files and KEY=VALUE pairs set; later ones override earlier ones.

    OptionError for a pair that is not valid, InputError for a file.
    """
    options = USUAL
    for word in given or ():
        key, equals, value = word.partition("=")
        if equals and not Path(word).exists():
            options = _with(options, key.strip(), value.strip())
        else:
            read = read_reading(word)
            options = replace(options, **{name: getattr(read, name) for name in read.changed})
    return replace(options, keep_going=keep_going or options.keep_going)


def _with(options: Reading, key: str, value: str) -> Reading:
    name = KEYS.get(key, key if key in FIELDS else None)
    if name is None:
        raise OptionError(f"--reading has no key {key!r}; {expected_one_of(key, KEYS)}")
    try:
        parsed = RULES[name](f"--reading {key}", value)
    except ValueError as problem:
        raise OptionError(str(problem)) from None
    changes: dict[str, Any] = {name: math.radians(parsed) if name != key else parsed}
    return replace(options, **changes)
