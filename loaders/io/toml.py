"""Values as TOML. `tomli-w` writes neither inline tables nor comments behind values, which our files have."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import date, datetime, time
from typing import Any


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
