"""Rules of settings: what a value may be, given as text or typed; annotations of the fields that hold them.

A rule takes the key and the raw value, and returns the value; messages name the key, the value and its range.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from typing import Any

LEAST_RADIUS_M = 0.001
MANY_WORDS = 12

Rule = Callable[[str, Any], Any]  # from key and raw value to the value; raises ValueError in one line


def expected_one_of(word: Any, known: Iterable[str]) -> str:
    """Say which words there are in place of an unknown one, and which of them it is like.

    Of many words only the one that it is like is named, if there is one.

        >>> expected_one_of("kidnaped", ["tracking", "kidnapped"])
        'expected one of tracking, kidnapped; did you mean kidnapped?'
    """
    words = list(dict.fromkeys(known))
    near = get_close_matches(str(word), words, 1)
    question = [f"did you mean {near[0]}?"] if near else []
    everything = [] if near and len(words) > MANY_WORDS else [f"expected one of {', '.join(words)}"]
    return "; ".join(everything + question)


def number(low: float, high: float) -> Rule:
    """Take a number within bounds, both included."""

    def rule(key: str, value: Any) -> float:
        amount = _from_text(value, float)
        if isinstance(amount, bool) or not isinstance(amount, (int, float)) or not low <= amount <= high:
            raise ValueError(f"{key}: found {value!r}, expected a number from {low:g} to {high:g}")
        return float(amount)

    return rule


def radius(key: str, value: Any) -> float:
    """Accept a radius in meters; 0 means that it is derived from the library."""
    radius_m: float = number(0, 1e4)(key, value)
    if 0 < radius_m < LEAST_RADIUS_M:
        raise ValueError(f"{key}: found {value!r}, expected 0 or a number from {LEAST_RADIUS_M:g} to 10000")
    return radius_m


def whole(low: int, high: int) -> Rule:
    """Take an integer within bounds, both included."""

    def rule(key: str, value: Any) -> int:
        count = _from_text(value, int)
        if isinstance(count, bool) or not isinstance(count, int) or not low <= count <= high:
            raise ValueError(f"{key}: found {value!r}, expected a whole number from {low} to {high}")
        return count

    return rule


def choice(*words: str) -> Rule:
    """Accept one of several words."""

    def rule(key: str, value: Any) -> str:
        if value not in words:
            raise ValueError(f"{key}: found {value!r}, {expected_one_of(value, words)}")
        return str(value)

    return rule


def truth(key: str, value: Any) -> bool:
    """Accept true or false."""
    words = {"true": True, "false": False}
    flag = words.get(value, value) if isinstance(value, str) else value
    if not isinstance(flag, bool):
        raise ValueError(f"{key}: found {value!r}, expected true or false")
    return flag


def texts(key: str, value: Any) -> tuple[str, ...]:
    """Take a list of texts; as text: "beacon,my_module:Sonar"."""
    words = [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value
    if not isinstance(words, (list, tuple)) or not all(isinstance(entry, str) and entry for entry in words):
        raise ValueError(f"{key}: found {value!r}, expected a list of texts")
    return tuple(dict.fromkeys(words))


def text(key: str, value: Any) -> str:
    """Take a text."""
    if not isinstance(value, str):
        raise ValueError(f"{key}: found {value!r:.60}, expected a text")
    return value


def entries(key: str, value: Any) -> list[Any]:
    """Take a list of anything; its entries are checked where they are used."""
    if not isinstance(value, list):
        raise ValueError(f"{key}: found {value!r:.60}, expected a list")
    return value


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


def checked(given: Mapping[str, Any], rules: Mapping[str, Rule], where: str = "") -> dict[str, Any]:
    """Return the values of a table, each as its rule takes it. ValueError for a key without a rule."""
    unknown = next((key for key in given if key not in rules), None)
    if unknown is not None:
        raise ValueError(f"{where}found the key {unknown!r}, {expected_one_of(unknown, rules)}")
    return {key: rules[key](f"{where}{key}", value) for key, value in given.items()}


SHARE = number(0, 1)
NATS = number(-1e6, 0)


def rules_of(kind: type[Any], prefix: str, others: Mapping[str, Rule]) -> dict[str, Rule]:
    """Return the rule of every field of a dataclass, and of those inside it, by dotted key.

    A field has its rule as an annotation, or in `others` by key. KeyError for one without any.
    """
    rules: dict[str, Rule] = {}
    hints = typing.get_type_hints(kind, include_extras=True)
    for name in (each.name for each in fields(kind)):
        key, hint = f"{prefix}{name}", hints[name]
        if is_dataclass(hint) and isinstance(hint, type):
            rules |= rules_of(hint, f"{key}.", others)
        else:
            annotations = typing.get_args(hint)[1:] if typing.get_origin(hint) is typing.Annotated else ()
            rules[key] = next(filter(callable, annotations), None) or others[key]
    return rules
