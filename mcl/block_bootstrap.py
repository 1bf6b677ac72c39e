"""An interval for the mean of a series whose neighbors are alike: the studentized moving-block bootstrap.

Errors of one drive are no independent draws: where a filter is off at one update it is off at the next.
Blocks of neighboring values are drawn instead of single ones (Kuensch 1989), and the mean of every drawn
series is divided by its own standard error (Goetze and Kuensch 1996), which makes up for few blocks.
"""

from __future__ import annotations

import numpy as np

from .randomness import Domain, stream
from .typing import F64

LEVEL = 0.95
LEAST = 24  # values; with fewer no interval is given
LEAST_BLOCKS = 6  # a block is at most a sixth of the series
DRAWS = 2000  # the ends of an interval move by about a fiftieth of its width from one seed to another
MOST_ALIKE = 0.97  # correlation of neighbors: a longer memory than this cannot be told in any drive


def autocorrelation(values: F64) -> float:
    """Correlation of neighbors in a series (n,), corrected for its bias (Kendall 1954); 0 for a constant."""
    off = values - values.mean()
    total = float(off @ off)
    if total <= 0:
        return 0.0
    found = float(off[1:] @ off[:-1]) / total
    return found + (1 + 3 * found) / len(values)


def block_length(values: F64) -> int:
    """Choose the length of a block: 1.1447 (a n)^(1/3), a = 4 r^2 / (1 - r^2)^2, rounded up.

    That is best for a series of which each value is r times the last plus noise (Andrews 1991,
    section 6). At least 1, at most a sixth of the series.
    """
    alike = min(max(autocorrelation(values), 0.0), MOST_ALIKE)
    memory = 4 * alike**2 / (1 - alike**2) ** 2
    length = int(np.ceil(1.1447 * (memory * len(values)) ** (1 / 3)))
    return min(max(length, 1), max(len(values) // LEAST_BLOCKS, 1))


def mean_interval(values: F64, seed: int = 0) -> tuple[float, float] | None:
    """Give the ends of a 95 % interval about the mean of a series (n,); None for fewer than 24 values.

    It is symmetric, and the same every time. Of a constant series it has no width.
    """
    if len(values) < LEAST:
        return None
    length = block_length(values)
    sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    blocks = (sums[length:] - sums[:-length]) / length  # (n - length + 1,) about the mean of all
    error = float(np.sqrt(np.square(blocks).mean() * length / len(values)))
    reach = error * _critical(blocks, len(values) // length, seed)
    mean = float(values.mean())
    return mean - reach, mean + reach


def _critical(blocks: F64, count: int, seed: int) -> float:
    """Give how many standard errors a drawn mean stays within, in 95 of 100 draws of `count` blocks."""
    chosen = stream(Domain.COMPARE, seed).integers(0, len(blocks), (DRAWS, count))
    drawn = blocks[chosen]
    away = np.abs(drawn.mean(axis=1) - blocks.mean())
    error = drawn.std(axis=1) / np.sqrt(count)
    apart = np.divide(away, error, out=np.zeros(DRAWS), where=error > 0)
    return float(np.quantile(apart, LEVEL))
