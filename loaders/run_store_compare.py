"""Comparing two updates to the last bit."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from .run_store_rows import TOOK, StepRows


@dataclass(frozen=True, slots=True)
class Difference:
    """The first field in which an update is not the same."""

    step: int
    field: str  # "estimate_x_m", or "particles.x_m" with the particle's number
    stored: str
    now: str

    def __str__(self) -> str:
        return f"step {self.step}, {self.field}: stored {self.stored}, now {self.now}"


def first_difference(stored: StepRows, now: StepRows) -> Difference | None:
    """Give the first field that differs, clouds first, as everything else follows from them; None when none.

    What a step took is no part of what must repeat.
    """
    step = stored.step["step"]
    clouds = {"particles": (stored.particles, now.particles), "renewed": (stored.renewed, now.renewed)}
    if stored.step["picture_sha256"] != now.step["picture_sha256"]:
        return Difference(step, "picture", str(stored.step["picture"]), "another picture")
    found = _of_cloud(step, "particles", *clouds["particles"]) or _of_row(step, stored, now)
    return found or _of_cloud(step, "renewed", *clouds["renewed"])


def _of_row(step: int, stored: StepRows, now: StepRows) -> Difference | None:
    for name, value in stored.step.items():
        if name != TOOK and not same(value, now.step.get(name)):
            return Difference(step, name, repr(value), repr(now.step.get(name)))
    return None


def _of_cloud(step: int, table: str, stored: pl.DataFrame, now: pl.DataFrame) -> Difference | None:
    if stored.height != now.height:
        return Difference(step, table, f"{stored.height} rows", f"{now.height} rows")
    for name in stored.columns:
        a, b = stored[name].to_numpy(), now[name].to_numpy()
        if a.tobytes() == b.tobytes():
            continue
        width = a.dtype.itemsize
        bits = [np.frombuffer(v.tobytes(), np.uint8).reshape(-1, width) for v in (a, b)]
        row = int((bits[0] != bits[1]).any(axis=1).argmax())
        return Difference(step, f"{table}.{name} of particle {row}", repr(a[row].item()), repr(b[row].item()))
    return None


def same(a: Any, b: Any) -> bool:
    """Tell whether two values are the same to the last bit: 0.0 and -0.0 are not."""
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return struct.pack("d", a) == struct.pack("d", b)
    return type(a) is type(b) and bool(a == b)
