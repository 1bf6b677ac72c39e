"""Session logs broken on purpose, each in one way that people get wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

Record = dict[str, Any]
Break = Callable[[list[Record]], list[Record]]


def odometry(change: Callable[[float, float, float], tuple[float, float, float]]) -> Break:
    def apply(records: list[Record]) -> list[Record]:
        return [r | {"odometry": list(change(*r["odometry"]))} if "odometry" in r else r for r in records]

    return apply


def in_the_world(records: list[Record], begin_rad: float, *, poses: bool) -> list[Record]:
    """Write poses, or steps along fixed axes, where motions belong."""
    x = y = 0.0
    heading, found = begin_rad, []
    for record in records:
        if "odometry" in record:
            forward, left, turn = record["odometry"]
            dx = forward * math.cos(heading) - left * math.sin(heading)
            dy = forward * math.sin(heading) + left * math.cos(heading)
            x, y, heading = x + dx, y + dy, heading + turn
            record = record | {"odometry": [x, y, heading] if poses else [dx, dy, turn]}
        found.append(record)
    return found


def times(factor: float) -> Break:
    return lambda records: [r | {"t": r["t"] * factor} for r in records]


def late(key: str, seconds: float) -> Break:
    """Stamp one kind of record late, and keep the log in order."""

    def apply(records: list[Record]) -> list[Record]:
        moved = [r | {"t": r["t"] + seconds} if key in r else r for r in records]
        return sorted(moved, key=lambda r: float(r["t"]))

    return apply


def truth(change: Callable[[float, float, float], tuple[float, float, float]]) -> Break:
    return lambda records: [r | {"truth": list(change(*r["truth"]))} if "truth" in r else r for r in records]


BREAKS: dict[str, tuple[str, Break]] = {  # name -> (code of the finding, how)
    "clockwise": ("turn-clockwise", odometry(lambda f, s, t: (f, s, -t))),
    "degrees": ("turn-degrees", odometry(lambda f, s, t: (f, s, math.degrees(t)))),
    "clockwise degrees": ("turn-clockwise-degrees", odometry(lambda f, s, t: (f, s, -math.degrees(t)))),
    "swapped": ("frame-swapped", odometry(lambda f, s, t: (s, f, t))),
    "backward": ("frame-backward", odometry(lambda f, s, t: (-f, -s, t))),
    "absolute": ("frame-absolute", partial(in_the_world, begin_rad=0.0, poses=True)),
    "world": ("frame-world", partial(in_the_world, begin_rad=0.4, poses=False)),
    "millimeters": ("scale", odometry(lambda f, s, t: (1000 * f, 1000 * s, t))),
    "centimeters": ("scale", odometry(lambda f, s, t: (100 * f, 100 * s, t))),
    "gain": ("turn-gain", odometry(lambda f, s, t: (f, s, 2 * t))),
    "nanoseconds": ("time-unit", times(1e9)),
    "milliseconds": ("time-unit", times(1e3)),
    "odometry late": ("odometry-delay", late("odometry", 9.0)),
    "truth in degrees": ("truth-degrees", truth(lambda x, y, h: (x, y, math.degrees(h)))),
    "truth in millimeters": ("truth-scale", truth(lambda x, y, h: (1000 * x, 1000 * y, h))),
}


def broken(log: Path, out: Path, how: Break | None, *, truth: bool = True) -> Path:
    """Write a broken copy of a session log; pictures are those of the original."""
    header, *records = (json.loads(line) for line in log.read_text().splitlines())
    folder = log.parent.resolve()
    if header.get("survey"):
        header["survey"] = str(folder / header["survey"])
    kept = [r for r in records if truth or not {"truth", "event"} & set(r)]
    changed = kept if how is None else how(kept)
    pictures = out.parent / "pictures"
    if not pictures.exists():
        pictures.symlink_to(folder / "pictures")
    out.write_text("\n".join(json.dumps(line) for line in [header, *changed]) + "\n")
    return out
