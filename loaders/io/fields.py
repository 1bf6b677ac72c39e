"""Checks of values from files: each returns the value with its type known, or raises an error."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from ..errors import FieldError, InputError

# Checks of values that came out of JSON: each gives the value with its type known, or says what is wrong.

MOST = 1e9  # meters, radians, pixels: more is a slip, and squares of it still fit into float32
MOST_T_S = 4e9  # Unix time until 2096; the time between any two is still one that the viewer can count


def read_json(data: bytes | str) -> Any:
    """Return the value of a JSON text. ValueError for what is none, also where it is nested too deeply."""
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("found JSON that is nested too deeply") from None


def show(value: Any) -> str:
    """Show a found value on one line, short."""
    if value is None:
        return "nothing"
    shown = repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


def number(value: Any, what: str, most: float = MOST) -> float:
    """Return a finite number at most so far from zero; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise FieldError(f"found {what} {show(value)}, expected a finite number")
    if abs(value) > most:
        raise FieldError(f"found {what} {show(value)}, expected {up_to(most)}")
    return float(value)


def whole(value: Any, what: str) -> int:
    """Return a whole number below 2**32."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**32:
        raise FieldError(f"found {what} {show(value)}, expected a whole number from 0")
    return value


def up_to(most: float = MOST) -> str:
    """Return how large a number may be."""
    return f"a number up to {most:g} in size".replace("e+0", "e")


def numbers(value: Any, count: int, what: str) -> list[float]:
    """Return a list of exactly so many numbers, each of them as `number` takes it."""
    if not isinstance(value, list) or len(value) != count:
        raise FieldError(f"found {what} {show(value)}, expected a list of {count} numbers")
    return [number(v, what) for v in value]


def text(value: Any, what: str) -> str:
    """Return a text that is not empty."""
    if not isinstance(value, str) or not value:
        raise FieldError(f"found {what} {show(value)}, expected a text")
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise FieldError(f"found half a character in {what} {show(value)}, expected whole ones")
    return value


def flag(value: Any, what: str) -> bool:
    """Return true or false."""
    if not isinstance(value, bool):
        raise FieldError(f"found {what} {show(value)}, expected true or false")
    return value


def items(value: Any, what: str) -> list[Any]:
    """Return a list of anything."""
    if not isinstance(value, list):
        raise FieldError(f"found {what} {show(value)}, expected a list")
    return value


def mapping(value: Any, what: str) -> dict[str, Any]:
    """Return an object."""
    if not isinstance(value, dict):
        raise FieldError(f"found {what} {show(value)}, expected an object")
    return value


# Cells of CSV tables: a number, or one line that says where it is none.


def number_in(file: Path, line: int, column: str, value: str | None) -> float:
    """Read a finite number of sensible size. Raises InputError naming file, line and column otherwise."""
    try:
        number = float(value or "")
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(file, f"found {show(value)} in column {column!r}, expected a finite number", line)
    if abs(number) > MOST:
        raise InputError(file, f"found {show(value)} in column {column!r}, expected {up_to()}", line)
    return number


# Values as TOML. `tomli-w` writes neither inline tables nor comments behind values, which our files have.


def toml_value(value: Any) -> str:
    """Return one value as TOML, on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{toml_key(name)} = {toml_value(entry)}" for name, entry in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, str):  # TOML's basic strings are escaped as JSON's are, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(toml_value(entry) for entry in value)}]"
    return str(value) if isinstance(value, (date, datetime, time)) else repr(value)


def toml_key(name: str) -> str:
    """Return a key as TOML, quoted where it must be."""
    bare = bool(name) and name.isascii() and all(c.isalnum() or c in "_-" for c in name)
    return name if bare else toml_value(name)
