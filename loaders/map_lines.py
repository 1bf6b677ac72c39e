"""A map given as a text file of wall segments."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from maurice_mcl.arena import Arena, open_arena
from maurice_mcl.typing import F64

from .errors import LogError
from .extent import check_span
from .fields import MOST, show, up_to
from .regular import expect_regular

METRES = {"m": 1.0, "mm": 0.001}


def arena_from_lines(file: Path, unit: str, poses: F64, margin_m: float = 1.0) -> Arena:
    """Read `x1 y1 x2 y2` a line, in "m" or "mm"; empty lines and lines that begin with # are skipped.

    The bounds reach a margin beyond the poses (L, 2 or 3), for a plan of a whole building says nothing
    about rooms that were never surveyed; walls entirely outside are left out. LogError names a bad line,
    or says that the map is larger than any robot's.
    """
    if unit not in METRES:
        raise ValueError(f"found map unit {unit!r}, expected one of {', '.join(METRES)}")
    expect_regular(file, "a map")
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as problem:
        raise LogError(file, f"cannot be read as a map: {problem}") from None
    used = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.strip().startswith("#")]
    segments = np.array([_wall(file, n, line) for n, line in used], np.float64).reshape(-1, 4)
    bounds = open_arena(poses, margin_m).bounds
    arena = Arena(bounds, _near(segments * METRES[unit], bounds))
    check_span(file, poses, arena)
    return arena


def _near(walls: F64, bounds: tuple[float, float, float, float]) -> F64:
    """Keep the walls (W, 4) whose own box meets the bounds."""
    x_min, y_min, x_max, y_max = bounds
    x, y = walls[:, [0, 2]], walls[:, [1, 3]]
    meets_x = (x.max(axis=1) >= x_min) & (x.min(axis=1) <= x_max)
    meets_y = (y.max(axis=1) >= y_min) & (y.min(axis=1) <= y_max)
    near: F64 = walls[meets_x & meets_y]
    return near


def _wall(file: Path, number: int, line: str) -> list[float]:
    try:
        values = [float(word) for word in line.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != 4 or not np.isfinite(values).all():
        raise LogError(file, f"found {show(line.strip())}, expected four numbers x1 y1 x2 y2", number)
    if max(map(abs, values)) > MOST:
        raise LogError(file, f"found {show(line.strip())}, expected each {up_to()}", number)
    return values
