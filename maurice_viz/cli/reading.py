"""`--reading`: how a recording is read, from a TOML file or as KEY=VALUE; the keys are those of the file."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from maurice_loaders.reading import FIELDS, ReadingOptions, option_value, read_reading

from ..errors import OptionError

USUAL = ReadingOptions()
KEYS = {name.replace("_rad", "_deg"): name for name in FIELDS}  # as they are typed, angles in degrees

ReadingOption = Annotated[
    list[str] | None,
    typer.Option(
        "--reading",
        metavar="FILE.toml|KEY=VALUE",
        help="How the recording is read: format, camera, topics, columns, clocks, units, frames, which "
        "pictures. Repeatable; docs/reading.md lists the keys. [default: detected, printed]",
        rich_help_panel="Reading",
    ),
]


def reading_of(given: Iterable[str] | None, *, keep_going: bool = False) -> ReadingOptions:
    """Return the options that files and KEY=VALUE pairs set, the later over the earlier.

    OptionError for a pair that is not valid, InputError for a file.
    """
    options = USUAL
    for word in given or ():
        key, equals, value = word.partition("=")
        if equals and not Path(word).exists():
            options = _with(options, key.strip(), value.strip())
        else:
            read = read_reading(word)
            changed = {name for name in FIELDS if getattr(read, name) != getattr(USUAL, name)}
            options = replace(options, **{name: getattr(read, name) for name in changed})
    return replace(options, keep_going=keep_going or options.keep_going)


def typed(options: ReadingOptions) -> list[str]:
    """Return the options that differ from their defaults as they are typed."""
    words = []
    for key, name in KEYS.items():
        value = getattr(options, name)
        if value != getattr(USUAL, name):
            words += ["--reading", f"{key}={_text(name, value)}"]
    return words


def _text(name: str, value: Any) -> str:
    if isinstance(value, Mapping):
        return ",".join(f"{role}={column}" for role, column in value.items())
    return str(value).lower() if isinstance(value, bool) else option_value(name, value)


def _with(options: ReadingOptions, key: str, value: str) -> ReadingOptions:
    name = KEYS.get(key, key if key in FIELDS else None)
    if name is None:
        near = difflib.get_close_matches(key, KEYS, n=1)
        advice = f"did you mean {near[0]}?" if near else f"there are {', '.join(KEYS)}"
        raise OptionError(f"--reading has no key {key!r}; {advice}")
    try:
        found = _value(name, value)
    except ValueError as problem:
        raise OptionError(f"--reading {key}: expected {problem}, found {value!r}") from None
    changes: dict[str, Any] = {name: math.radians(found) if name != key else found}
    return replace(options, **changes)


def _value(name: str, text: str) -> Any:
    """Return a value as its field holds it. ValueError says what was expected."""
    usual, meaning = getattr(USUAL, name), FIELDS[name]
    if meaning.choices and text not in meaning.choices:
        raise ValueError(f"one of {', '.join(meaning.choices)}")
    if isinstance(usual, Mapping):
        return columns_of(text)
    if usual is None:
        return Path(text) if name == "table" else text
    if isinstance(usual, bool):
        if text not in ("true", "false"):
            raise ValueError("true or false")
        return text == "true"
    return _number(text, usual, meaning.least)


def _number(text: str, usual: float, least: float | None) -> float:
    try:
        number = int(text) if isinstance(usual, int) else float(text)
    except ValueError:
        raise ValueError("a number") from None
    if not math.isfinite(number) or (least is not None and number < least):
        raise ValueError("a finite number" + ("" if least is None else f" from {least:g}"))
    if isinstance(usual, int) and number >= 2**32:
        raise ValueError("a whole number below 2**32")
    if usual == 1 and not number:
        raise ValueError("a number other than 0")
    return number


def columns_of(text: str) -> dict[str, str]:
    """Read `image=file,heading=yaw:deg`. ValueError for anything else."""
    found: dict[str, str] = {}
    for part in text.split(","):
        role, equals, column = part.partition("=")
        if not equals or not role.strip() or not column.strip():
            raise ValueError("ROLE=COLUMN, with commas between them")
        found[role.strip()] = column.strip()
    return found
