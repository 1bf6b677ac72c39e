"""Results as plain values, which JSON has: objects, lists, texts, numbers, true, false and null."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from typing import Any, ClassVar

import numpy as np


def plain(value: Any, *properties: str) -> dict[str, Any]:
    """Return a dataclass or a mapping as a JSON object, with some of its properties after its fields.

    What is within it becomes what `plain_value` says; a result within it that has a `to_json` of its own is
    what that returns.

        >>> from pathlib import Path
        >>> plain({"file": Path("a.log"), "share": float("nan"), "steps": (1, 2)})
        {'file': 'a.log', 'share': None, 'steps': [1, 2]}
    """
    if isinstance(value, Mapping):
        return {key: plain_value(entry) for key, entry in value.items()}
    names = (*(field.name for field in fields(value)), *properties)
    return {name: plain_value(getattr(value, name)) for name in names}


def plain_value(value: Any) -> Any:
    """Return any value as JSON has it: an array or a tuple is a list, a path a text, nan and inf are None."""
    if hasattr(value, "to_json"):
        return value.to_json()
    if isinstance(value, Mapping) or is_dataclass(value):
        return plain(value)
    if isinstance(value, (np.ndarray, np.generic)):
        return plain_value(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain_value(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, PurePath) else value


class Plain:
    """A dataclass that is plain as JSON: its fields, then the properties that `also` names."""

    __slots__ = ()
    also: ClassVar[tuple[str, ...]] = ()

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON: meters, radians, seconds and shares; what is not known is null."""
        return plain(self, *self.also)
