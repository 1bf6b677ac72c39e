"""Checks of values that came out of JSON: each gives the value with its type known, or says what is wrong."""

from __future__ import annotations

import math
from typing import Any


class FieldError(ValueError):
    """A value of the wrong type or shape; the message says what was found and expected."""


def show(value: Any) -> str:
    """Show a found value on one line, short."""
    if value is None:
        return "nothing"
    shown = repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


def number(value: Any, what: str) -> float:
    """Give a finite number; true and false are none."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            if math.isfinite(value):
                return float(value)
        except OverflowError:  # whole numbers beyond 1e308
            pass
    raise FieldError(f"found {what} {show(value)}, expected a finite number")


def numbers(value: Any, count: int, what: str) -> list[float]:
    """Give a list of exactly so many finite numbers."""
    if not isinstance(value, list) or len(value) != count:
        raise FieldError(f"found {what} {show(value)}, expected a list of {count} numbers")
    return [number(v, what) for v in value]


def text(value: Any, what: str) -> str:
    """Give a text that is not empty."""
    if not isinstance(value, str) or not value:
        raise FieldError(f"found {what} {show(value)}, expected a text")
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise FieldError(f"found half a character in {what} {show(value)}, expected whole ones")
    return value


def flag(value: Any, what: str) -> bool:
    """Give true or false."""
    if not isinstance(value, bool):
        raise FieldError(f"found {what} {show(value)}, expected true or false")
    return value


def items(value: Any, what: str) -> list[Any]:
    """Give a list of anything."""
    if not isinstance(value, list):
        raise FieldError(f"found {what} {show(value)}, expected a list")
    return value


def mapping(value: Any, what: str) -> dict[str, Any]:
    """Give an object."""
    if not isinstance(value, dict):
        raise FieldError(f"found {what} {show(value)}, expected an object")
    return value
