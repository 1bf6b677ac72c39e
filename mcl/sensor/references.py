"""References: which library entries a particle is compared with. Never across a wall.

- Lookup, the thesis's rule: the nearest position, then the nearest heading there, once per raster cell.
- Interpolation: the nearest few visible places by a Gaussian kernel of distance, and at each place the two
  headings on either side, linearly. Log-likelihoods are averaged, so nothing jumps at the border of a cell.
- Virtual references: means of descriptors replace pictures that were not taken halfway between two places or
  headings. Averaging likelihoods cannot: the mean of two poor matches is poor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import F32, F64, I32, Bool
from ..geometry import wrap
from ..library import ChannelIndex
from ..map import Arena, Grid, make_grid, place_tree, spacing

# Lookup: the nearest library entry (thesis 3.3 and 4.2.4).

HEADING_BINS = 720  # half a degree; borders between 45-degree headings fall on bin borders
HEADING_STEP = np.float32(HEADING_BINS / (2 * np.pi))
SAME_PLACE_M = 0.001
NEIGHBORS = (1, 8, 64)  # places tried for a free line of sight, in turn


class ReferenceLookup(Protocol):
    """Maps values of entries to particles."""

    @property
    def grid(self) -> Grid:
        """The raster of free space."""
        ...

    def entries(self, poses: F32, origin: F64) -> I32:
        """Return the nearest entry (N,) of each pose (N, 3) relative to `origin`; -1 outside free space."""
        ...

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Return the log-likelihood (N,) at each pose from that of each reference; -inf outside."""
        ...

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> tuple[I32, F32]:
        """Return what `entries` and `at` return, for less than both."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class NearestReference:
    """Two tables: raster cell to place, place and heading to entry; the last rows stand for outside, -1."""

    grid: Grid
    places: F64  # (P, 2) distinct positions in the library
    place_of_cell: I32  # (rows * columns + 1,) -1 where a robot cannot be
    entry_of: I32  # (P + 1, HEADING_BINS)

    def entries(self, poses: F32, origin: F64) -> I32:
        """Return the entry (N,) that each pose (N, 3) relative to `origin` is compared with; -1 outside."""
        return self.entries_at(*self.bins_of(poses, origin))

    def bins_of(self, poses: F32, origin: F64) -> tuple[I32, I32]:
        """Return the cell, -1 outside, and the heading bin of each pose, (N,) each: indexes of the tables."""
        turn = poses[:, 2] + np.float32(np.pi)
        turn *= HEADING_STEP
        heading = turn.astype(np.int32)
        return self.grid.cells_of(poses[:, :2], origin), np.minimum(heading, HEADING_BINS - 1, out=heading)

    def entries_at(self, cell: I32, heading: I32) -> I32:
        """Return the entry (N,) for cells and heading bins (N,)."""
        at = self.place_of_cell.take(cell)
        at *= np.int32(HEADING_BINS)
        at += heading
        return self.entry_of.ravel().take(at)

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Return the log-likelihood (N,) of the nearest entry of each pose (N, 3); -inf outside."""
        return of_entries(log_likelihood, self.entries(poses, origin))

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> tuple[I32, F32]:
        """Return the nearest entry of each pose, and its log-likelihood."""
        entries = self.entries(poses, origin)
        return entries, of_entries(log_likelihood, entries)


def of_entries(log_likelihood: F32, entries: I32) -> F32:
    """Index a log-likelihood (L,) by entries (N,); -inf for the entry -1."""
    return np.append(log_likelihood, np.float32(-np.inf)).take(entries)  # entry -1, outside, is the last


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
    """Return the distinct positions (P, 2) of entries (L, 2), and which of them each entry (L,) is at."""
    rounded = np.round(xy / SAME_PLACE_M).astype(np.int64)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return xy[first], inverse.astype(np.int32).ravel()


def _by_heading(entries: NDArray[np.intp], headings: F64) -> I32:
    """Return the entry of nearest heading for every heading bin; the first of equals."""
    centers = (np.arange(HEADING_BINS) + 0.5) * (2 * np.pi / HEADING_BINS) - np.pi
    apart = np.abs((centers[:, None] - headings[entries] + np.pi) % (2 * np.pi) - np.pi)
    return np.asarray(entries[apart.argmin(axis=1)], np.int32)


def _place_of_cell(grid: Grid, places: F64, walls: F64) -> I32:
    """Return the nearest place (rows * columns,) that can be seen from each free cell, -1 for other cells."""
    centers, tree = grid.centers(), place_tree(places)
    place = np.full(len(centers), -1, np.int32)
    for k in (min(most, len(places)) for most in NEIGHBORS):
        left = np.flatnonzero(grid.free.ravel() & (place < 0))
        nearest = tree.query(centers[left], k=k)[1].reshape(len(left), k)
        place[left] = _first_seen(centers[left], nearest, places, walls)
    return _grow(place.reshape(grid.shape), grid.free).ravel()


def _first_seen(points: F64, choices: NDArray[np.intp], places: F64, walls: F64) -> I32:
    """Return the first of the chosen places (N, K) that no wall hides from each point (N, 2)."""
    place = np.full(len(points), -1, np.int32)
    for choice in choices.T:
        left = np.flatnonzero(place < 0)
        seen = left[~crosses(points[left], places[choice[left]], walls)]
        place[seen] = choice[seen]
    return place


MOST_PAIRS = 2**13  # of segments and walls at a time: a core's own cache holds them


def crosses(start: F64, end: F64, walls: F64) -> Bool:
    """Return which (N,) of the segments from start (N, 2) to end (N, 2) any wall (W, 4) crosses.

    A block of segments against all walls at once: setting up a replay asks this hundreds of times.
    """
    hit = np.zeros(len(start), bool)
    if not len(walls):
        return hit
    block = max(MOST_PAIRS // len(walls), 1)
    wall_start, wall_end = walls.T[:2], walls.T[2:]  # (2, W)
    for first in range(0, len(start), block):
        some = slice(first, first + block)
        a, b = start[some].T[:, :, None], end[some].T[:, :, None]  # (2, n, 1)
        apart = _side(wall_start, wall_end, a) * _side(wall_start, wall_end, b) < 0
        straddles = _side(a, b, wall_start) * _side(a, b, wall_end) <= 0
        hit[some] = (apart & straddles).any(axis=1)
    return hit


def _side(a: F64, b: F64, point: F64) -> F64:
    """Return a number whose sign tells on which side of the line a to b a point is (cross product).

    The first axis of all three holds x and y; the others are broadcast.
    """
    return np.asarray((b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]))


def _grow(place: I32, free: Bool) -> I32:
    """Assign cells that see no place the place of the neighboring cell they are entered from."""
    while True:
        padded = np.pad(place, 1, constant_values=-1)
        open_cells = free & (place < 0)
        beside = [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
        next_to = np.maximum.reduce(beside)
        grown = np.where(open_cells, next_to, place)
        if np.array_equal(grown, place):
            return grown
        place = grown


# Interpolation: a particle is weighted by several entries around it.

NO_WEIGHT = 1e-9  # a cell with a smaller kernel sum uses its nearest place instead


@dataclass(frozen=True, slots=True)
class InterpolationParameters:
    """How far and how many."""

    virtual: bool = True  # use references midway between the surveyed ones, in place and heading
    places: int = 4  # combined: the corners of a grid's cell
    width: float = 0.5  # sd of the kernel in units of the spacing of the places in use


@dataclass(frozen=True, slots=True, eq=False)
class InterpolatedReference:
    """Tables: raster cell to K places with weights; place and heading bin to two entries and a share."""

    nearest: NearestReference
    places: I32  # (K, rows * columns)
    weights: F32  # (K, rows * columns) summing to one over K
    before: I32  # (P, HEADING_BINS) the entry clockwise of a heading
    after: I32  # (P, HEADING_BINS) the one counter-clockwise of it
    share: F32  # (P, HEADING_BINS) of the one after, 0 to 1

    @property
    def grid(self) -> Grid:
        """The raster of free space."""
        return self.nearest.grid

    def entries(self, poses: F32, origin: F64) -> I32:
        """Return the nearest entry (N,), as `NearestReference` does: for display."""
        return self.nearest.entries(poses, origin)

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Return the interpolated log-likelihood (N,) at poses (N, 3) relative to `origin`; -inf outside."""
        return self._values_at(log_likelihood, *self.nearest.bins_of(poses, origin))

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> tuple[I32, F32]:
        """Return the nearest entry of each pose, and its interpolated log-likelihood."""
        cell, heading = self.nearest.bins_of(poses, origin)
        return self.nearest.entries_at(cell, heading), self._values_at(log_likelihood, cell, heading)

    def pays_for(self, poses: int) -> bool:
        """Return whether so many poses look up more values than `at_headings` computes."""
        return poses * len(self.places) > self.before.size

    def at_headings(self, log_likelihood: F32) -> F32:
        """Return the log-likelihood (P * HEADING_BINS,) at every place and heading."""
        values = log_likelihood.take(self.before.ravel())
        apart = log_likelihood.take(self.after.ravel())
        apart -= values
        apart *= self.share.ravel()
        values += apart
        return values

    def among_places(self, value_at: Callable[[I32], F32], cell: I32, heading: I32) -> F32:
        """Return what `at` does, (N,), from the values at places and headings, for cells and bins (N,)."""
        total = np.zeros(len(cell), np.float32)
        cell = cell.astype(np.intp)  # once: every lookup would convert it
        for place, weight in zip(self.places, self.weights, strict=True):
            at = place.take(cell)
            at *= np.int32(HEADING_BINS)
            at += heading
            value = value_at(at)
            value *= weight.take(cell)
            total += value
        np.copyto(total, np.float32(-np.inf), where=self.nearest.place_of_cell.take(cell) < 0)
        return total

    def _values_at(self, log_likelihood: F32, cell: I32, heading: I32) -> F32:
        def value_at(at: I32) -> F32:
            value = log_likelihood.take(self.before.take(at))
            apart = log_likelihood.take(self.after.take(at))
            apart -= value
            apart *= self.share.take(at)
            value += apart
            return value

        return self.among_places(value_at, cell, heading)


def interpolated_reference(
    nearest: NearestReference, poses: F64, arena: Arena, parameters: InterpolationParameters | None = None
) -> InterpolatedReference:
    """Build the tables for references (R, 3): the library's entries, then the virtual ones, if any."""
    parameters = parameters or InterpolationParameters()
    places, place_of_reference = distinct_places(poses[:, :2])
    at, weights = _kernel(nearest, places, arena, parameters)
    before, after, share = _neighbors(len(places), place_of_reference, poses)
    return InterpolatedReference(nearest, at, weights, before, after, share)


def _kernel(
    nearest: NearestReference, places: F64, arena: Arena, parameters: InterpolationParameters
) -> tuple[I32, F32]:
    """Return which of the places (P, 2) count, (K, cells), and their weights for every cell of the raster."""
    tree, centers = place_tree(places), nearest.grid.centers()
    count = min(parameters.places, len(places))
    looked = min(count + 4, len(places))  # some may be behind a wall
    away, place = (np.asarray(a).reshape(len(centers), looked) for a in tree.query(centers, k=looked))
    weight = np.exp(-0.5 * np.square(away / (parameters.width * spacing(places))))
    for k in range(looked):
        weight[:, k] *= ~crosses(centers, places[place[:, k]], arena.walls)
    heaviest = np.argsort(-weight, axis=1, kind="stable")[:, :count]
    place, weight = (np.take_along_axis(a, heaviest, axis=1) for a in (place, weight))
    alone = weight.sum(axis=1) < NO_WEIGHT
    surveyed = nearest.places[np.maximum(nearest.place_of_cell[:-1][alone], 0)]
    place[alone] = np.asarray(tree.query(surveyed)[1])[:, None]
    weight[alone] = 1
    weight /= weight.sum(axis=1, keepdims=True)
    return np.ascontiguousarray(place.T, np.int32), np.ascontiguousarray(weight.T, np.float32)


def _neighbors(count: int, place_of_reference: I32, poses: F64) -> tuple[I32, I32, F32]:
    """Return the references on either side of each heading at each place, and the share of the second."""
    centers = (np.arange(HEADING_BINS) + 0.5) * (2 * np.pi / HEADING_BINS) - np.pi
    before = np.empty((count, HEADING_BINS), np.int32)
    after, share = before.copy(), np.empty((count, HEADING_BINS), np.float32)
    by_place = np.argsort(place_of_reference, kind="stable")
    first = np.searchsorted(place_of_reference[by_place], np.arange(count + 1))
    for place in range(count):
        here = by_place[first[place] : first[place + 1]]
        turned = (poses[here, 2][None, :] - centers[:, None]) % (2 * np.pi)  # (bins, references) ahead of it
        ahead, behind = turned.argmin(axis=1), turned.argmax(axis=1)
        to, back = turned.min(axis=1), 2 * np.pi - turned.max(axis=1)
        before[place], after[place] = here[behind], here[ahead]
        share[place] = back / (to + back)
    return before, after, share


# Virtual references: what a picture taken midway between surveyed ones would measure.

VIRTUAL_NEIGHBORS = 1.5  # spacings: a grid's next nodes along its lines and diagonals, and no others
MOST_TURNED = np.radians(60)  # between two headings at one place: views that still overlap
MOST_JOINED = 4  # places with a common middle
SAME_HEADING = np.radians(15)  # of two places: views that show the same scene


@dataclass(frozen=True, slots=True, eq=False)
class VirtualReferences:
    """V poses and the surveyed entries whose descriptors are averaged there, in equal shares."""

    poses: F64  # (V, 3) in the map's frame
    sources: I32  # (V, K) entry numbers; rows with fewer than K repeat them in turn

    def extend(self, index: Mapping[str, ChannelIndex]) -> dict[str, ChannelIndex]:
        """Append the V means to every channel's references: (L, D) to (L + V, D)."""
        return {name: self._extended(channel) for name, channel in index.items()}

    def _extended(self, channel: ChannelIndex) -> ChannelIndex:
        total = np.zeros((len(self.sources), channel.references.shape[1]), np.float32)
        for column in self.sources.T:
            total += channel.references[column]
        total /= np.float32(self.sources.shape[1])
        return replace(channel, references=np.concatenate([channel.references, total]))


def virtual_references(poses: F64, arena: Arena) -> VirtualReferences:
    """Find the poses midway between those of a library (L, 3) in heading and place, never across a wall."""
    places, place_of_entry = distinct_places(poses[:, :2])
    views = _views(poses, place_of_entry)
    turned = views[views[:, 0] != views[:, 1]]
    rows = [np.tile(turned, 4)]
    groups = _neighbors_between(places, arena.walls)
    headings = wrap(_middle(poses[views, 2]))
    place_of_view = place_of_entry[views[:, 0]]
    by_place = [np.flatnonzero(place_of_view == place) for place in range(len(places))]
    for group in groups:
        rows.append(_joined(views, headings, [by_place[place] for place in group]))
    sources = np.concatenate(rows).astype(np.int32)
    middles = np.column_stack([poses[sources, :2].mean(axis=1), wrap(_middle(poses[sources, 2]))])
    return VirtualReferences(middles, sources)


def _views(poses: F64, place_of_entry: I32) -> NDArray[np.int64]:
    """Return pairs of entries (W, 2) at one place: each with itself, and with the next if they overlap."""
    pairs = [np.column_stack([np.arange(len(poses))] * 2)]
    for place in range(int(place_of_entry.max(initial=-1)) + 1):
        entries = np.flatnonzero(place_of_entry == place)
        entries = entries[np.argsort(poses[entries, 2] % (2 * np.pi), kind="stable")]
        following = np.roll(entries, -1)
        gap = (poses[following, 2] - poses[entries, 2]) % (2 * np.pi)
        overlap = (gap > 0) & (gap <= MOST_TURNED)
        pairs.append(np.column_stack([entries, following])[overlap])
    return np.concatenate(pairs)


def _neighbors_between(places: F64, walls: F64) -> list[list[int]]:
    """Return groups of places with a common middle: two along a grid's line, four around a cell's center."""
    tree = place_tree(places)
    pairs = tree.query_pairs(VIRTUAL_NEIGHBORS * spacing(places), output_type="ndarray").reshape(-1, 2)
    pairs = pairs[~crosses(places[pairs[:, 0]], places[pairs[:, 1]], walls)]
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    middle = np.round(places[pairs].mean(axis=1) / SAME_PLACE_M).astype(np.int64)
    groups: dict[tuple[int, int], list[int]] = {}
    for (x, y), pair in zip(middle.tolist(), pairs.tolist(), strict=True):
        groups.setdefault((x, y), []).extend(pair)
    return [group[:MOST_JOINED] for group in groups.values()]


def _joined(views: NDArray[np.int64], headings: F64, members: list[NDArray[np.intp]]) -> NDArray[np.int64]:
    """Join the views of several places with the same heading: rows (W, 8) of entries."""
    first = members[0]
    chosen, alike = [first], np.ones(len(first), bool)
    for other in members[1:]:
        apart = np.abs(wrap(headings[first][:, None] - headings[other]))
        nearest = apart.argmin(axis=1)
        alike &= apart[np.arange(len(first)), nearest] <= SAME_HEADING
        chosen.append(other[nearest])
    entries = np.concatenate([views[view[alike]] for view in chosen], axis=1)
    return entries[:, np.arange(8) % entries.shape[1]]


def _middle(headings: F64) -> F64:
    return np.asarray(np.arctan2(np.sin(headings).mean(axis=1), np.cos(headings).mean(axis=1)))
