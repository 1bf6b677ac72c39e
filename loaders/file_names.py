"""The order of file names as people mean it: frame9 before frame10."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

_DIGITS = re.compile(r"(\d+)")


def natural_order(files: Iterable[Path]) -> list[Path]:
    """Sort by name, numbers in names by their value."""
    return sorted(files, key=lambda file: _parts(file.name))


def _parts(name: str) -> list[tuple[int, int, str]]:
    parts = _DIGITS.split(name)
    return [(1, int(part), "") if part.isdecimal() else (0, 0, part) for part in parts]
