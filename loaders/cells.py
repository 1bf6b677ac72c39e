"""Cells of CSV tables: a number, or one line that says where it is none."""

from __future__ import annotations

import math
from pathlib import Path

from .errors import LogError
from .fields import MOST, show, up_to


def number_in(file: Path, line: int, column: str, value: str | None) -> float:
    """Read a finite number of sensible size. LogError naming file, line and column otherwise."""
    try:
        number = float(value or "")
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise LogError(file, f"found {show(value)} in column {column!r}, expected a finite number", line)
    if abs(number) > MOST:
        raise LogError(file, f"found {show(value)} in column {column!r}, expected {up_to()}", line)
    return number
