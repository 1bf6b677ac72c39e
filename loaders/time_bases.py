"""Units of time stamps, and clocks that disagree."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from .fields import MOST_T_S

PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
UNIX_S = (6.3e8, MOST_T_S)  # 1990 to 2096: what a time since 1970 looks like
SLOWEST_S = 5.0  # a longer time from sample to sample means that the unit is a smaller one


class Span:
    """First and last time of something, and how often it came."""

    def __init__(self) -> None:
        self.count = 0
        self.first_s = 0.0
        self.last_s = 0.0

    def add(self, t_s: float) -> None:
        """Take in one time."""
        self.first_s = t_s if self.count == 0 else min(self.first_s, t_s)
        self.last_s = t_s if self.count == 0 else max(self.last_s, t_s)
        self.count += 1

    def overlaps(self, other: Span, slack_s: float = 0.0) -> bool:
        """Tell whether two spans have a time in common, or nearly so."""
        return self.first_s <= other.last_s + slack_s and other.first_s <= self.last_s + slack_s


def detect_unit(stamps: Sequence[str]) -> str:
    """Tell the unit of a column of time stamps: "s", "ms", "us" or "ns".

    By size where they count from 1970, else by the median step, which is taken to be at most 5 s. A decimal
    point means seconds unless the size speaks against it.
    """
    values = np.array([float(stamp) for stamp in stamps])
    middle = float(np.median(np.abs(values)))
    for unit, per_s in PER_SECOND.items():
        if UNIX_S[0] <= middle / per_s <= UNIX_S[1]:
            return unit
    if middle <= MOST_T_S and any("." in stamp for stamp in stamps):
        return "s"
    steps = np.abs(np.diff(values))
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    small = [unit for unit, per_s in PER_SECOND.items() if step / per_s <= SLOWEST_S]
    fitting = [unit for unit in small if middle / PER_SECOND[unit] <= MOST_T_S]
    return fitting[0] if fitting else "ns"


def unit_in(name: str) -> str | None:
    """Give the unit that the name of a column holds, as in "timestamp [ns]"."""
    unit = name.partition("[")[2].rstrip("] ")
    return unit if unit in PER_SECOND else None


def seconds(stamp: str, unit: str) -> float:
    """Give a stamp in seconds; whole numbers of nanoseconds keep all the digits that a float can hold."""
    per_s = PER_SECOND[unit]
    try:
        return int(stamp) / per_s
    except ValueError:
        return float(stamp) / per_s


def clock_s(text: str) -> float:
    """Give Unix seconds of a date and time of day, UTC unless it says otherwise. ValueError for others."""
    if ":" not in text:
        raise ValueError(f"found {text!r:.60}, expected a date and a time of day")
    whole, dot, rest = text.strip().partition(".")
    digits = len(rest) - len(rest.lstrip("0123456789"))
    moment = datetime.fromisoformat(whole + rest[digits:])
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return moment.timestamp() + (float(f"0.{rest[:digits]}") if dot and digits else 0.0)


def apart(name: str, span: Span, other_name: str, other: Span) -> str:
    """Say where two clocks stand, and what would bring the second's beginning to the first's."""
    spans = f"{name} go from {span.first_s:.3f} to {span.last_s:.3f} s"
    others = f"{other_name} from {other.first_s:.3f} to {other.last_s:.3f} s"
    return f"{spans}, {others}; their beginnings are {span.first_s - other.first_s:.3f} s apart"
