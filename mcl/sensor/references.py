"""References: which library entries a particle is compared with. Never across a wall.

- Lookup, the thesis's rule: the nearest position, then the nearest heading there, once per raster cell.
- Interpolation: the nearest few visible places by a Gaussian kernel of distance, and at each place the two
  headings on either side, linearly. Log-likelihoods are averaged, so nothing jumps at the border of a cell.

A reference says nothing about a pose far from it, in place or in heading. What a picture is worth there fades
to what it is worth to someone who knows nothing: the mean likelihood of all references.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import Annotated, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..values.arrays import F32, F64, I32, Bool
from ..values.geometry import INCH_M, wrap_angle
from ..values.map import Arena, Grid, crosses, make_grid
from ..values.nearest import Keep, distinct_places, made_anew, place_tree, spacing
from ..values.setting_rules import number, truth, whole

# Lookup: the nearest library entry (thesis 3.3 and 4.2.4).

OVERLAP_RAD = np.radians(60)  # between two headings at one place: views that still overlap
REACH_SPACINGS, SILENT_SPACINGS = 2.5, 3.0  # from a place: its references speak, and no longer do
LEAST_REACH_M = 18 * INCH_M  # at least: the spacing that the scales of the channels were fitted with
ENOUGH_PLACES_SHARE = 0.25  # of the weight of the places around a pose: enough to know what is there

HEADING_BINS = 720  # half a degree; borders between 45-degree headings fall on bin borders
HEADING_STEP = np.float32(HEADING_BINS / (2 * np.pi))
VISIBLE_NEIGHBORS = (1, 8, 64)  # places tried for a free line of sight, in turn


class ReferenceLookup(Protocol):
    """Maps values of entries to particles."""

    @property
    def grid(self) -> Grid:
        """The raster of free space."""

    def entries(self, poses: F32, origin: F64) -> I32:
        """Return the nearest entry (N,) of each pose (N, 3) relative to `origin`; -1 outside free space."""

    @property
    def is_partial(self) -> bool:
        """Whether there are poses that no reference speaks for."""

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Return the log-likelihood (N,) at each pose from that of each reference; -inf outside."""

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> LookedUp:
        """Return what `entries` and `at` return, for less than both, and how far references speak for it."""


LookedUp: TypeAlias = tuple[I32, F32, F32 | None]  # (N,) entries, log-likelihoods, and known; None: all is


def knowing_nothing(log_likelihood: F32) -> np.float32:
    """Return the log of the mean likelihood of all references (R,): what a picture is worth anywhere."""
    top = log_likelihood.max(initial=-np.inf)
    if not np.isfinite(top):
        return np.float32(0)
    return np.float32(top + np.log(np.exp(log_likelihood - top).mean(dtype=np.float64)))


def _mixed(values: F32, known: F32 | None, log_likelihood: F32) -> F32:
    """Return log-likelihoods (N,) where references say how far they are known, 0 to 1; nothing else gains."""
    if known is None:
        return values
    mixed = known * values + (1 - known) * knowing_nothing(log_likelihood)
    return np.asarray(np.where(known < 1, mixed, values), np.float32)  # outside, -inf, is known


@dataclass(frozen=True, eq=False)
class NearestReference:
    """Two tables: raster cell to place, place and heading to entry; the last rows stand for outside, -1."""

    grid: Grid
    places: F64  # (P, 2) distinct positions in the library
    place_of_cell: I32  # (rows * columns + 1,) -1 where a robot cannot be
    entry_of: I32  # (P + 1, HEADING_BINS)
    # how far the entry speaks for poses there, 0 to 1; None: for all of them
    faced: F32 | None = None  # (P + 1, HEADING_BINS) by its heading
    reached: F32 | None = None  # (rows * columns + 1,) by its place

    @cached_property
    def spacing_m(self) -> float:
        """The median distance from a place to the next."""
        return spacing(self.places)

    def entries(self, poses: F32, origin: F64) -> I32:
        """Return the entry (N,) that each pose (N, 3) relative to `origin` is compared with; -1 outside."""
        return self.entries_at(*self.bins_of(poses, origin))

    def bins_of(self, poses: F32, origin: F64) -> tuple[I32, I32]:
        """Return the cell, -1 outside, and the heading bin of each pose, (N,) each: indexes of the tables.

        Headings of particles are in [-pi, pi); those of a true pose, or of a saved run, may be any.
        """
        turn = poses[:, 2] + np.float32(np.pi)
        turn *= HEADING_STEP
        if len(turn) and not (turn.min() >= 0 and turn.max() <= HEADING_BINS):
            turn = (wrap_angle(poses[:, 2].astype(np.float64)) + np.pi) * HEADING_STEP
        heading = turn.astype(np.int32)
        return self.grid.cells_of(poses[:, :2], origin), np.minimum(heading, HEADING_BINS - 1, out=heading)

    def entries_at(self, cell: I32, heading: I32) -> I32:
        """Return the entry (N,) for cells and heading bins (N,)."""
        return self.entry_of.take(self._at(cell, heading))

    def _at(self, cell: I32, heading: I32) -> I32:
        """Return where in the flattened tables by place and heading cells and heading bins (N,) are."""
        at = self.place_of_cell.take(cell)
        at *= np.int32(HEADING_BINS)
        at += heading
        return at

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Return the log-likelihood (N,) of the nearest entry of each pose (N, 3); -inf outside."""
        return self.look(log_likelihood, poses, origin)[1]

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> LookedUp:
        """Return the nearest entry of each pose, its log-likelihood, and how far it speaks for the pose."""
        cell, heading = self.bins_of(poses, origin)
        entries, known = self.entries_at(cell, heading), self._known_at(cell, heading)
        return entries, _mixed(of_entries(log_likelihood, entries), known, log_likelihood), known

    @property
    def is_partial(self) -> bool:
        """Whether there are poses that no reference speaks for."""
        return self.faced is not None or self.reached is not None

    def _known_at(self, cell: I32, heading: I32) -> F32 | None:
        """Return how far the nearest entry speaks for cells and heading bins (N,), 0 to 1; None: for all."""
        if not self.is_partial:
            return None
        known = np.ones(len(cell), np.float32)
        if self.faced is not None:
            known *= self.faced.take(self._at(cell, heading))
        if self.reached is not None:
            known *= self.reached.take(cell)
        return known


def of_entries(log_likelihood: F32, entries: I32) -> F32:
    """Index a log-likelihood (L,) by entries (N,); -inf for the entry -1."""
    return np.append(log_likelihood, np.float32(-np.inf)).take(entries)  # entry -1, outside, is the last


def nearest_reference(poses: F64, arena: Arena, keep: Keep = made_anew) -> NearestReference:
    """Build the tables for library poses (L, 3) in an arena; `keep` may have the dear ones from before."""
    places, place_of_entry = distinct_places(poses[:, :2])
    grid = make_grid(arena, places)
    entry_of = np.full((len(places) + 1, HEADING_BINS), -1, np.int32)
    turned = np.zeros((len(places) + 1, HEADING_BINS))  # of the last row: outside, where nothing is faded
    for place in range(len(places)):
        here = np.flatnonzero(place_of_entry == place)
        entry_of[place], turned[place] = _by_heading(here, poses[:, 2])
    about = [grid.corner, grid.cell_m, grid.free, places, arena.walls]
    (place_of_cell,) = keep("cells 1", about, lambda: (_place_of_cell(grid, places, arena.walls),))
    faced = _faded(turned, OVERLAP_RAD / 2, OVERLAP_RAD)
    reached = _faded(_to_place(grid, places, place_of_cell), *_reach(places))
    return NearestReference(grid, places, place_of_cell, entry_of, faced, reached)


def _reach(places: F64) -> tuple[float, float]:
    """Return how far in meters places (P, 2) speak for poses around them, and where they no longer do."""
    spacing_m = max(spacing(places), LEAST_REACH_M / REACH_SPACINGS)
    return REACH_SPACINGS * spacing_m, SILENT_SPACINGS * spacing_m


def _to_place(grid: Grid, places: F64, place_of_cell: I32) -> F64:
    """Return the distance (cells + 1,) in meters from each cell to its place; 0 where it has none."""
    away = np.zeros(len(place_of_cell))
    inside = np.flatnonzero(place_of_cell >= 0)
    away[inside] = np.linalg.norm(grid.centers()[inside] - places[place_of_cell[inside]], axis=1)
    return away


def _faded(values: F64, full: float, none: float) -> F32 | None:
    """Return 1 for values up to `full`, 0 from `none` on, linearly in between; None: 1 everywhere."""
    if values.max(initial=0.0) <= full * (1 + 1e-6):
        return None
    return np.asarray(np.clip((none - values) / (none - full), 0, 1), np.float32)


def _by_heading(entries: NDArray[np.intp], headings: F64) -> tuple[I32, F64]:
    """Return the entry of nearest heading for every heading bin, the first of equals, and how far it is."""
    centers = (np.arange(HEADING_BINS) + 0.5) * (2 * np.pi / HEADING_BINS) - np.pi
    turned = np.abs(wrap_angle(centers[:, None] - headings[entries]))
    return np.asarray(entries[turned.argmin(axis=1)], np.int32), np.asarray(turned.min(axis=1), np.float64)


def _place_of_cell(grid: Grid, places: F64, walls: F64) -> I32:
    """Return the nearest place (cells + 1,) that can be seen from each free cell, -1 for others, and last."""
    centers, tree = grid.centers(), place_tree(places)
    place = np.full(len(centers), -1, np.int32)
    for k in (min(most, len(places)) for most in VISIBLE_NEIGHBORS):
        left = np.flatnonzero(grid.free.ravel() & (place < 0))
        nearest = tree.query(centers[left], k=k)[1].reshape(len(left), k)
        place[left] = _first_seen(centers[left], nearest, places, walls)
    return np.append(_grow(place.reshape(grid.shape), grid.free), np.int32(-1))


def _first_seen(points: F64, choices: NDArray[np.intp], places: F64, walls: F64) -> I32:
    """Return the first of the chosen places (N, n) that no wall hides from each point (N, 2)."""
    place = np.full(len(points), -1, np.int32)
    for choice in choices.T:
        left = np.flatnonzero(place < 0)
        seen = left[~crosses(points[left], places[choice[left]], walls)]
        place[seen] = choice[seen]
    return place


def _grow(place: I32, free: Bool) -> I32:
    """Assign cells that see no place the place of the neighboring cell they are entered from."""
    while True:
        padded = np.pad(place, 1, constant_values=-1)
        open_cells = free & (place < 0)
        beside = [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
        grown = np.where(open_cells, np.maximum.reduce(beside), place)
        if np.array_equal(grown, place):
            return grown
        place = grown


# Interpolation: a particle is weighted by several entries around it.

BLOCK_POSES = 8192  # poses that are looked up at a time: what they need stays in a core's cache
LEAST_KERNEL_SUM = 1e-9  # a cell with a smaller kernel sum uses its nearest place instead


@dataclass(frozen=True, slots=True)
class InterpolationParameters:
    """How far and how many."""

    # use references midway between the surveyed ones, in place and heading
    virtual: Annotated[bool, truth] = True
    places: Annotated[int, whole(1, 64)] = 4  # combined: the corners of a grid's cell
    # sd of the kernel in units of the spacing of the places in use
    width: Annotated[float, number(0.01, 100)] = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class InterpolatedReference:
    """Tables: raster cell to n places with weights; place and heading bin to two entries and a share."""

    nearest: NearestReference
    places: I32  # (n, rows * columns)
    weights: F32  # (n, rows * columns) summing to one over n
    before: I32  # (P, HEADING_BINS) the entry clockwise of a heading
    after: I32  # (P, HEADING_BINS) the one counter-clockwise of it
    share: F32  # (P, HEADING_BINS) of the one after, 0 to 1
    faced: F32 | None = None  # (P, HEADING_BINS) how far those two speak for a heading; None: for all

    @property
    def grid(self) -> Grid:
        """The raster of free space."""
        return self.nearest.grid

    def entries(self, poses: F32, origin: F64) -> I32:
        """Return the nearest entry (N,), as `NearestReference` does: for display."""
        return self.nearest.entries(poses, origin)

    @property
    def is_partial(self) -> bool:
        """Whether there are poses that no reference speaks for."""
        return self.faced is not None or self.nearest.reached is not None

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Return the interpolated log-likelihood (N,) at poses (N, 3) relative to `origin`; -inf outside."""
        return self.look(log_likelihood, poses, origin)[1]

    def look(self, log_likelihood: F32, poses: F32, origin: F64) -> LookedUp:
        """Return the nearest entry of each pose, its interpolated log-likelihood, and how far it is known."""
        if len(poses) <= BLOCK_POSES:
            return self._look(log_likelihood, poses, origin)
        some = (poses[first : first + BLOCK_POSES] for first in range(0, len(poses), BLOCK_POSES))
        looked, join = (self._look(log_likelihood, part, origin) for part in some), np.concatenate
        entries, values, known = zip(*looked, strict=True)
        return join(entries), join(values), join(known) if self.is_partial else None

    def _look(self, log_likelihood: F32, poses: F32, origin: F64) -> LookedUp:
        cell, heading = self.nearest.bins_of(poses, origin)
        entries = self.nearest.entries_at(cell, heading)

        def value_at(at: NDArray[np.intp]) -> F32:
            value = log_likelihood.take(self.before.take(at))
            step = log_likelihood.take(self.after.take(at))
            step -= value
            step *= self.share.take(at)
            value += step
            return value

        values, known = self.among_places(value_at, cell, heading, entries < 0)
        return entries, _mixed(values, known, log_likelihood), known

    def pays_for(self, poses: int) -> bool:
        """Return whether so many poses look up more values than `at_headings` computes."""
        return poses * len(self.places) > self.before.size

    def at_headings(self, log_likelihood: F32) -> F32:
        """Return the log-likelihood (P * HEADING_BINS,) at every place and heading."""
        values = log_likelihood.take(self.before.ravel())
        step = log_likelihood.take(self.after.ravel())
        step -= values
        step *= self.share.ravel()
        values += step
        return values

    def among_places(
        self, value_at: Callable[[NDArray[np.intp]], F32], cell: I32, heading: I32, outside: Bool
    ) -> tuple[F32, F32 | None]:
        """Return the mean (N,) of values (n, N) at places and headings, by cells and bins (N,); -inf outside.

        Places count by their distance, and as far as they speak for the heading. Also returns how far any
        does, (N,) from 0 to 1; None: everywhere.
        """
        cell = cell.astype(np.intp)  # once: every lookup would convert it
        at = np.multiply(self.places.take(cell, axis=1), HEADING_BINS, dtype=np.intp)
        at += heading
        values, shares = value_at(at), self.weights.take(cell, axis=1)
        if self.faced is not None:
            shares *= self.faced.take(at)
        values *= shares
        total = np.add.reduce(values)  # place after place
        np.copyto(total, np.float32(-np.inf), where=outside)
        if not self.is_partial:
            return total, None
        known = np.ones(len(cell), np.float32) if self.faced is None else np.add.reduce(shares)
        total /= np.where(known > 0, known, np.float32(1))
        known = np.minimum(known / np.float32(ENOUGH_PLACES_SHARE), 1)
        if self.nearest.reached is not None:
            known *= self.nearest.reached.take(cell)
        known[outside] = 1
        return total, known


def interpolated_reference(
    nearest: NearestReference, poses: F64, arena: Arena, how: InterpolationParameters, keep: Keep = made_anew
) -> InterpolatedReference:
    """Build the tables for references (R, 3): the library's entries, then the virtual ones, if any."""

    def make() -> tuple[I32 | F32 | F64, ...]:
        places, place_of_reference = distinct_places(poses[:, :2])
        beside = _neighbors(len(places), place_of_reference, poses)
        return *_kernel(nearest, places, arena, how), *beside

    cells = [nearest.grid.corner, nearest.grid.cell_m, nearest.places, nearest.place_of_cell]
    about = [*cells, poses, arena.walls, *astuple(how)]
    at, weights, before, after, share, turned = keep("interpolated 1", about, make)
    faced = _faded(turned, OVERLAP_RAD / 2, OVERLAP_RAD)
    return InterpolatedReference(nearest, at, weights, before, after, share, faced)


def _kernel(
    nearest: NearestReference, places: F64, arena: Arena, parameters: InterpolationParameters
) -> tuple[I32, F32]:
    """Return which of the places (P, 2) count, (n, cells), and their weights for every cell of the raster."""
    tree, centers = place_tree(places), nearest.grid.centers()
    count = min(parameters.places, len(places))
    looked = min(count + 4, len(places))  # some may be behind a wall
    away, place = (np.asarray(a).reshape(len(centers), looked) for a in tree.query(centers, k=looked))
    weight = np.exp(-0.5 * np.square(away / (parameters.width * spacing(places))))
    for k in range(looked):
        weight[:, k] *= ~crosses(centers, places[place[:, k]], arena.walls)
    heaviest = np.argsort(-weight, axis=1, kind="stable")[:, :count]
    place, weight = (np.take_along_axis(a, heaviest, axis=1) for a in (place, weight))
    alone = weight.sum(axis=1) < LEAST_KERNEL_SUM
    surveyed = nearest.places[np.maximum(nearest.place_of_cell[:-1][alone], 0)]
    place[alone] = np.asarray(tree.query(surveyed)[1])[:, None]
    weight[alone] = 1
    weight /= weight.sum(axis=1, keepdims=True)
    return np.ascontiguousarray(place.T, np.int32), np.ascontiguousarray(weight.T, np.float32)


def _neighbors(count: int, place_of_reference: I32, poses: F64) -> tuple[I32, I32, F32, F64]:
    """Return the references on either side of each heading, the share of the second, and the nearest's angle.

    Each is (count, HEADING_BINS). Where no heading between the two is near both, the nearer one counts alone.
    """
    centers = (np.arange(HEADING_BINS) + 0.5) * (2 * np.pi / HEADING_BINS) - np.pi
    before, after = np.empty((2, count, HEADING_BINS), np.int32)
    share, nearest = np.empty((count, HEADING_BINS), np.float32), np.empty((count, HEADING_BINS))
    by_place = np.argsort(place_of_reference, kind="stable")
    first = np.searchsorted(place_of_reference[by_place], np.arange(count + 1))
    for place in range(count):
        here = by_place[first[place] : first[place + 1]]
        turned = (poses[here, 2][None, :] - centers[:, None]) % (2 * np.pi)  # (bins, references) ahead of it
        ahead, behind = turned.argmin(axis=1), turned.argmax(axis=1)
        to, back = turned.min(axis=1), 2 * np.pi - turned.max(axis=1)
        before[place], after[place] = here[behind], here[ahead]
        share[place] = np.where(to + back > 2 * OVERLAP_RAD, back > to, back / (to + back))
        nearest[place] = np.minimum(to, back)
    return before, after, share, nearest
