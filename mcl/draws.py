"""Fresh particles: drawn evenly over free space, or where the picture says the robot could be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .grid import Grid
from .selection import HEADING_BINS, NearestReference
from .typing import F32, F64, I32


def evenly(grid: Grid, n: int, origin: F64, rng: np.random.Generator) -> F32:
    """Draw n poses (n, 3) relative to `origin`, evenly over free space and all headings.

    Drawn row by row, so that a larger n keeps a smaller one's draws. Raises ValueError where nothing is free.
    """
    free = np.flatnonzero(grid.free.ravel())
    if not len(free):
        raise ValueError("no free space to start in: obstacles and walls cover the whole map")
    draws = rng.random((n, 4))
    xy = _within(grid, free[(draws[:, 0] * len(free)).astype(np.int64)], draws[:, 1:3], origin)
    heading = draws[:, 3] * (2 * np.pi) - np.pi
    return np.column_stack([xy, heading]).astype(np.float32)


def _within(grid: Grid, cells: NDArray[np.int64], shares: F64, origin: F64) -> F64:
    """Give the points (n, 2) at given shares (n, 2) of the sides of cells (n,)."""
    columns = grid.shape[1]
    index = np.column_stack([cells % columns, cells // columns])
    return np.asarray(grid.corner + grid.cell_m * (index + shares) - origin)


@dataclass(frozen=True, slots=True, eq=False)
class Regions:
    """Where each entry is the nearest: cells sorted by place, heading bins sorted by place and entry."""

    cells: I32  # (free cells,) flat numbers, place by place
    first_cell: I32  # (P + 1,) where each place's cells begin
    place_of_entry: I32  # (L,)
    bins: I32  # (P * HEADING_BINS,) heading bins, entry by entry
    first_bin: I32  # (L + 1,) where each entry's bins begin

    def sizes(self) -> F64:
        """Give how many (cell, heading bin) pairs each entry (L,) is the nearest of."""
        cells, bins = np.diff(self.first_cell), np.diff(self.first_bin)
        return np.asarray(cells[self.place_of_entry] * bins, np.float64)


def regions(nearest: NearestReference, entries: int) -> Regions:
    """Sort the tables of the nearest reference by entry."""
    inside = np.flatnonzero(nearest.place_of_cell[:-1] >= 0)
    place = nearest.place_of_cell[inside]
    by_place = np.argsort(place, kind="stable")
    count = len(nearest.places)
    first_cell = np.searchsorted(place[by_place], np.arange(count + 1))
    owner = nearest.entry_of[:-1].ravel()
    by_entry = np.argsort(owner, kind="stable")
    first_bin = np.searchsorted(owner[by_entry], np.arange(entries + 1))
    place_of_entry = np.zeros(entries, np.int32)
    place_of_entry[owner] = np.repeat(np.arange(count), HEADING_BINS)
    return Regions(
        cells=inside[by_place].astype(np.int32),
        first_cell=first_cell.astype(np.int32),
        place_of_entry=place_of_entry,
        bins=(by_entry % HEADING_BINS).astype(np.int32),
        first_bin=first_bin.astype(np.int32),
    )


def shares_of(log_likelihood: F32, where: Regions) -> F64:
    """Give the probability (L,) that a pose drawn in proportion to the likelihood has each entry nearest."""
    size = where.sizes()
    weight = np.exp(log_likelihood.astype(np.float64) - float(log_likelihood.max())) * size
    return np.asarray(weight / weight.sum())


def from_likelihood(
    log_likelihood: F32, grid: Grid, where: Regions, n: int, origin: F64, rng: np.random.Generator
) -> F32:
    """Draw n poses (n, 3) relative to `origin`, with density in proportion to the likelihood (L,)."""
    draws = rng.random((n, 5))
    cumulative = np.cumsum(shares_of(log_likelihood, where))
    entry = np.minimum(cumulative.searchsorted(draws[:, 0] * cumulative[-1]), len(cumulative) - 1)
    cell = where.cells[_pick(where.first_cell, where.place_of_entry[entry], draws[:, 1])]
    heading_bin = where.bins[_pick(where.first_bin, entry, draws[:, 2])]
    xy = _within(grid, cell.astype(np.int64), draws[:, 3:5], origin)
    heading = (heading_bin + rng.random(n)) * (2 * np.pi / HEADING_BINS) - np.pi
    return np.column_stack([xy, heading]).astype(np.float32)


def _pick(first: I32, group: NDArray[np.integer[Any]], share: F64) -> I32:
    """Give a place between where each group begins and where it ends, by a share (n,) from 0 to 1."""
    begin, size = first[group], first[group + 1] - first[group]
    return np.asarray(begin + (share * size).astype(np.int32), np.int32)
