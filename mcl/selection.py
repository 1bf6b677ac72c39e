"""Reference selection: which library entry a particle is compared with (thesis 3.3 and 4.2.4).

The thesis's rule: the nearest position first, then the nearest heading there; never across a wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .arena import Arena
from .grid import Grid, make_grid
from .typing import F32, F64, I32, Bool

HEADING_BINS = 720  # half a degree; borders between 45-degree headings fall on bin borders
SAME_PLACE_M = 0.001
NEIGHBORS = (1, 8, 64)  # places tried for a free line of sight, in turn, before walking there instead


class Selection(Protocol):
    """Brings what is known of entries to particles."""

    @property
    def grid(self) -> Grid:
        """The raster of free space."""
        ...

    def entries(self, poses: F32, origin: F64) -> I32:
        """Give the nearest entry (N,) of each pose (N, 3) relative to `origin`; -1 outside free space."""
        ...

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Give the log-likelihood (N,) at each pose from that of each reference; -inf outside.

        References are the library's L entries, and after them those between, where the selection has some.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class NearestReference:
    """Two tables: raster cell to place, and place and heading to entry.

    Outside is -1 everywhere, and the last row of each table answers to the index -1.
    """

    grid: Grid
    places: F64  # (P, 2) distinct positions in the library
    place_of_cell: I32  # (rows * columns + 1,) -1 where a robot cannot be
    entry_of: I32  # (P + 1, HEADING_BINS)

    def entries(self, poses: F32, origin: F64) -> I32:
        """Give the entry (N,) that each pose (N, 3) relative to `origin` is compared with; -1 outside."""
        cell = self.grid.cells_of(poses[:, :2], origin)
        place = self.place_of_cell.take(cell)
        turn = (poses[:, 2] + np.float32(np.pi)) * np.float32(HEADING_BINS / (2 * np.pi))
        heading = np.minimum(turn.astype(np.int32), HEADING_BINS - 1)
        return self.entry_of.ravel().take(place * np.int32(HEADING_BINS) + heading)

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Give each pose (N, 3) its nearest entry's log-likelihood (N,): all in a cell share one weight."""
        return of_entries(log_likelihood, self.entries(poses, origin))


def of_entries(log_likelihood: F32, entries: I32) -> F32:
    """Index a log-likelihood (L,) by entries (N,); -inf for the entry -1."""
    return np.append(log_likelihood, np.float32(-np.inf))[entries]  # entry -1, outside, is the table's last


def nearest_reference(poses: F64, arena: Arena) -> NearestReference:
    """Build the tables for library poses (L, 3) in an arena."""
    places, place_of_entry = distinct_places(poses[:, :2])
    grid = make_grid(arena, places)
    entry_of = np.full((len(places) + 1, HEADING_BINS), -1, np.int32)
    for place in range(len(places)):
        entry_of[place] = _by_heading(np.flatnonzero(place_of_entry == place), poses[:, 2])
    place_of_cell = np.append(_place_of_cell(grid, places, arena.walls), np.int32(-1))
    return NearestReference(grid, places, place_of_cell, entry_of)


def distinct_places(xy: F64) -> tuple[F64, I32]:
    """Give the distinct positions (P, 2) of entries (L, 2), and which of them each entry (L,) is at."""
    rounded = np.round(xy / SAME_PLACE_M).astype(np.int64)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return xy[first], inverse.astype(np.int32).ravel()


def spacing(places: F64) -> float:
    """Give the median distance from a place (P, 2) to its nearest neighbor; 1 m where there is but one."""
    if len(places) < 2:
        return 1.0
    return float(np.median(np.asarray(cKDTree(places).query(places, k=2)[0])[:, 1]))


def _by_heading(entries: NDArray[np.intp], headings: F64) -> I32:
    """For every heading bin, the one of these entries whose heading is nearest; the first of equals."""
    centers = (np.arange(HEADING_BINS) + 0.5) * (2 * np.pi / HEADING_BINS) - np.pi
    apart = np.abs((centers[:, None] - headings[entries] + np.pi) % (2 * np.pi) - np.pi)
    return np.asarray(entries[apart.argmin(axis=1)], np.int32)


def _place_of_cell(grid: Grid, places: F64, walls: F64) -> I32:
    """Give the nearest place (rows * columns,) that can be seen from each free cell, -1 for other cells."""
    centers, tree = grid.centers(), cKDTree(places)
    place = np.full(len(centers), -1, np.int32)
    for k in (min(most, len(places)) for most in NEIGHBORS):
        left = np.flatnonzero(grid.free.ravel() & (place < 0))
        nearest = tree.query(centers[left], k=k)[1].reshape(len(left), k)
        place[left] = _first_seen(centers[left], nearest, places, walls)
    return _grow(place.reshape(grid.shape), grid.free).ravel()


def _first_seen(points: F64, choices: NDArray[np.intp], places: F64, walls: F64) -> I32:
    """Give the first of the places chosen (N, K) to which no wall bars the way from each point (N, 2)."""
    place = np.full(len(points), -1, np.int32)
    for choice in choices.T:
        left = np.flatnonzero(place < 0)
        seen = left[~crosses(points[left], places[choice[left]], walls)]
        place[seen] = choice[seen]
    return place


def crosses(start: F64, end: F64, walls: F64) -> Bool:
    """Tell which of the segments start (N, 2) to end (N, 2) any wall (W, 4) cuts through."""
    hit = np.zeros(len(start), bool)
    for x1, y1, x2, y2 in walls:
        a, b = np.array([x1, y1]), np.array([x2, y2])
        apart = _side(a, b, start) * _side(a, b, end) < 0
        between = _side(start, end, a) * _side(start, end, b) <= 0
        hit |= apart & between
    return hit


def _side(a: F64, b: F64, point: F64) -> F64:
    """On which side of the line a to b a point lies: the sign of the cross product."""
    along, off = b - a, point - a
    return np.asarray(along[..., 0] * off[..., 1] - along[..., 1] * off[..., 0])


def _grow(place: I32, free: Bool) -> I32:
    """Let cells that see no place near take the place of the cell one would walk in from."""
    while True:
        padded = np.pad(place, 1, constant_values=-1)
        open_cells = free & (place < 0)
        next_to = np.maximum.reduce(
            [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
        )
        grown = np.where(open_cells, next_to, place)
        if np.array_equal(grown, place):
            return grown
        place = grown
