"""A map as a library: bins of pose space instead of reference pictures, for robots without a camera.

A particle filter over a map needs no references. Where the library has some, its mixture proposal counts
particles by the reference nearest to them; here it counts them by places on a lattice and eight headings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..values import (
    F32,
    F64,
    FREE,
    I32,
    MOST_CELLS,
    Arena,
    Bool,
    Grid,
    Keep,
    Library,
    OccupancyMap,
    place_tree,
)
from .references import HEADING_BINS, LookedUp, NearestReference, nearest_reference, of_entries

MOST_PLACES = 500
LEAST_APART_M = 0.5  # places closer together tell less than they cost
HEADINGS = 8


def map_library(occupancy: OccupancyMap, name: str) -> Library:
    """Return a library of places on a map (L, 3), without pictures. InputError for a map without free cells.

    >>> import numpy as np
    >>> from maurice_mcl.sensor.map_places import map_library
    >>> from maurice_mcl.values.laser import OccupancyMap
    >>> map_library(OccupancyMap(np.zeros((20, 40), np.uint8), 0.1, np.zeros(2)), "hall").size
    256
    """
    free = occupancy.free
    if not free.any():
        raise InputError(None, f"the map {name!r} has no free cell, expected some; is it inverted?")
    area_m2 = float(free.sum()) * occupancy.cell_m**2
    stride = max(round(max(LEAST_APART_M, math.sqrt(area_m2 / MOST_PLACES)) / occupancy.cell_m), 1)
    rows, columns = _lattice(free, stride)
    places = occupancy.corner + occupancy.cell_m * (np.column_stack([columns, rows]) + 0.5)
    headings = (np.arange(HEADINGS) + 0.5) * (2 * np.pi / HEADINGS) - np.pi
    poses = np.column_stack([np.repeat(places, HEADINGS, axis=0), np.tile(headings, len(places))])
    arena = Arena(occupancy.bounds, np.zeros((0, 4)), occupancy=occupancy)
    return Library(name, poses, (None,) * len(poses), {}, arena)


def _lattice(free: Bool, stride: int) -> tuple[F64, F64]:
    """Return the row and column of one free cell in each square of a lattice that has any."""
    rows, columns = np.nonzero(free)
    square = (rows // stride) * (free.shape[1] // stride + 1) + columns // stride
    away = np.hypot(rows % stride - stride / 2, columns % stride - stride / 2)  # from the square's middle
    order = np.lexsort((away, square))
    first = order[np.unique(square[order], return_index=True)[1]]
    return rows[first].astype(np.float64), columns[first].astype(np.float64)


@dataclass(frozen=True, eq=False)
class MapReference(NearestReference):
    """The nearest place of a map, also beyond its rectangle: off the map is a place as unknown space is."""

    def entries(self, poses: F32, origin: F64) -> I32:
        """See `NearestReference.entries`; -1 for poses that are no numbers alone."""
        entries = super().entries(poses, origin)
        beyond = np.flatnonzero(entries < 0)
        if len(beyond):
            entries[beyond] = self._beyond(poses[beyond], origin)
        return entries

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> LookedUp:
        """See `NearestReference.look`."""
        entries = self.entries(poses, origin)
        return entries, of_entries(log_likelihood, entries), None

    def _beyond(self, poses: F32, origin: F64) -> I32:
        """Return the entry (N,) of poses (N, 3) off the map: by the middles of cells, as on it."""
        _, heading = self.bins_of(poses, origin)
        low, cell_m = self.grid.corner, self.grid.cell_m
        middles = low + cell_m * (np.floor((poses[:, :2] + origin - low) / cell_m) + 0.5)
        known, entries = np.isfinite(middles).all(axis=1), np.full(len(poses), -1, np.int32)
        if known.any():
            place = place_tree(self.places).query(middles[known])[1]
            entries[known] = self.entry_of[place, heading[known]]
        return entries


def reference_of(library: Library, arena: Arena | None = None) -> NearestReference:
    """Return which of a library's entries each pose is nearest to: of a map's places, or of references.

    `arena` replaces the library's own walls and obstacles. On an occupancy map no pose is ruled out: a robot
    may be where a cell was not seen, or is taken for occupied.
    """
    if library.is_map and library.occupancy is not None:
        return _of_places(library.poses, library.occupancy, library.keep)
    return nearest_reference(library.poses, library.arena if arena is None else arena, library.keep)


def _of_places(poses: F64, occupancy: OccupancyMap, keep: Keep) -> NearestReference:
    grid, places = _grid(occupancy), poses[::HEADINGS, :2]
    about = [grid.corner, grid.cell_m, grid.shape, places]
    (nearest,) = keep("map cells 1", about, lambda: (_nearest(places, grid),))
    bins = np.arange(HEADING_BINS) // (HEADING_BINS // HEADINGS)
    entry_of = np.arange(len(places))[:, None] * HEADINGS + bins
    outside = np.full((1, HEADING_BINS), -1)
    return MapReference(
        grid,
        places,
        np.append(nearest, -1).astype(np.int32),
        np.concatenate([entry_of, outside]).astype(np.int32),
    )


def _nearest(places: F64, grid: Grid) -> I32:
    return np.asarray(place_tree(places).query(grid.centers())[1], np.int32)


def _grid(occupancy: OccupancyMap) -> Grid:
    """Return the map's free cells as a raster, coarser where the map has more cells than a raster may."""
    cells = occupancy.cells == FREE
    merged = math.ceil(math.sqrt(cells.size / MOST_CELLS))
    if merged > 1:
        height, width = (-(-side // merged) * merged for side in cells.shape)
        padded = np.zeros((height, width), bool)
        padded[: cells.shape[0], : cells.shape[1]] = cells
        cells = padded.reshape(height // merged, merged, width // merged, merged).any(axis=(1, 3))
    side_m = occupancy.cell_m * merged
    none = np.zeros(cells.shape, np.uint8)
    return Grid(occupancy.corner.astype(np.float64), side_m, cells, none > 0, none, ("",))
