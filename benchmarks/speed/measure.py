"""Fair times on a machine that others use too: works in turn, medians, and ratios within each round."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from time import perf_counter

import numpy as np

Work = Callable[[], object]
LIBRARIES = ("numpy", "opencv-python-headless", "scipy", "polars", "rerun-sdk")


@dataclass(frozen=True, slots=True)
class Times:
    """The seconds that a work took, one a round."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        """The median in seconds."""
        return float(np.median(self.seconds))

    def over(self, other: Times) -> tuple[float, float, float]:
        """Return how many times longer this took, round by round: median, 10 and 90 percent."""
        ratios = np.array(self.seconds) / np.array(other.seconds)
        low, middle, high = np.percentile(ratios, (10, 50, 90))
        return float(middle), float(low), float(high)


REPEATS = 5  # of a work within a round


def interleaved(works: Mapping[str, Work], rounds: int, repeats: int = 1) -> dict[str, Times]:
    """Run the works in turn, `rounds` times; a work may return its own seconds, as a float.

    With `repeats`, a work runs so often in a row, and all but the first count by their median: that leaves
    out the cold caches of another work.
    """
    took: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            times = [_seconds(work) for _ in range(repeats)]
            took[name].append(float(np.median(times[1:] or times)))
    return {name: Times(tuple(seconds)) for name, seconds in took.items()}


def _seconds(work: Work) -> float:
    began = perf_counter()
    own = work()
    return own if isinstance(own, float) else perf_counter() - began


@dataclass(frozen=True, slots=True)
class Table:
    """One table of results."""

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = field(default=())

    def markdown(self) -> str:
        """Return the table as Markdown, with its notes below."""
        lines = [f"| {' | '.join(self.columns)} |", f"|{'---|' * len(self.columns)}"]
        lines += [f"| {' | '.join(row)} |" for row in self.rows]
        return "\n".join([*lines, *(f"\n{note}" for note in self.notes)])


def ratio(slower: Times, faster: Times) -> str:
    """Return "3.4 (3.1 to 3.9)": how many times faster, with the spread over rounds."""
    middle, low, high = slower.over(faster)
    return f"{middle:.1f} ({low:.1f} to {high:.1f})"


def machine() -> dict[str, str]:
    """Return what the numbers depend on."""
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    model = platform.processor() or platform.machine()
    return {
        "machine": f"{model}, {os.cpu_count()} cores, {platform.system()}",
        "load at the start": load,
        "Python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }
