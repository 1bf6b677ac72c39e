"""Reference selection by interpolation: a particle is weighed by several entries around it.

The nearest few places that can be seen from where the particle is, by a Gaussian kernel of distance, and at
each place the two headings on either side, linearly. Log-likelihoods are averaged, so what is sure at one
entry fades to what is sure at the next instead of jumping at the border of a cell. Never across a wall.
References between the surveyed ones (`between.py`) make the mesh twice as fine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .arena import Arena
from .grid import Grid
from .selection import HEADING_BINS, NearestReference, crosses, distinct_places, spacing
from .typing import F32, F64, I32

HEADING_STEP = np.float32(HEADING_BINS / (2 * np.pi))
NO_WEIGHT = 1e-9  # a cell whose kernel holds less takes its nearest reference's place instead


@dataclass(frozen=True, slots=True)
class InterpolationParameters:
    """How far and how many."""

    between: bool = True  # use references midway between the surveyed ones, in place and heading
    places: int = 4  # weighed at once: the corners of a grid's cell
    width: float = 0.5  # sd of the kernel in units of the spacing of the places in use


@dataclass(frozen=True, slots=True, eq=False)
class Interpolated:
    """Tables: raster cell to K places with weights; place and heading bin to two entries and a share."""

    nearest: NearestReference
    places: I32  # (rows * columns, K)
    weights: F32  # (rows * columns, K) summing to one
    before: I32  # (P, HEADING_BINS) the entry clockwise of a heading
    after: I32  # (P, HEADING_BINS) the one counter-clockwise of it
    share: F32  # (P, HEADING_BINS) of the one after, 0 to 1

    @property
    def grid(self) -> Grid:
        """The raster of free space."""
        return self.nearest.grid

    def entries(self, poses: F32, origin: F64) -> I32:
        """Give the nearest entry (N,), as `NearestReference` does: for pictures and words."""
        return self.nearest.entries(poses, origin)

    def at(self, log_likelihood: F32, poses: F32, origin: F64) -> F32:
        """Give the interpolated log-likelihood (N,) at poses (N, 3) relative to `origin`; -inf outside."""
        cell = self.grid.cells_of(poses[:, :2], origin)
        inside = self.nearest.place_of_cell.take(cell) >= 0
        turn = (poses[:, 2] + np.float32(np.pi)) * HEADING_STEP
        heading = np.minimum(turn.astype(np.int32), HEADING_BINS - 1)
        total = np.zeros(len(poses), np.float32)
        for k in range(self.places.shape[1]):
            at = self.places[:, k].take(cell) * np.int32(HEADING_BINS) + heading
            before, after = (log_likelihood.take(side.take(at)) for side in (self.before, self.after))
            total += self.weights[:, k].take(cell) * (before + self.share.take(at) * (after - before))
        return np.asarray(np.where(inside, total, np.float32(-np.inf)), np.float32)


def interpolated(
    nearest: NearestReference, poses: F64, arena: Arena, parameters: InterpolationParameters | None = None
) -> Interpolated:
    """Build the tables for references (R, 3) upon those of the nearest library entry.

    References are the library's entries first, then those between them, if any.
    """
    parameters = parameters or InterpolationParameters()
    places, place_of_reference = distinct_places(poses[:, :2])
    at, weights = _kernel(nearest, places, arena, parameters)
    before, after, share = _neighbors(len(places), place_of_reference, poses)
    return Interpolated(nearest, at, weights, before, after, share)


def _kernel(
    nearest: NearestReference, places: F64, arena: Arena, parameters: InterpolationParameters
) -> tuple[I32, F32]:
    """Give which of the places (P, 2) count, (cells, K), and their weights for every cell of the raster."""
    tree, centers = cKDTree(places), nearest.grid.centers()
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
    return place.astype(np.int32), weight.astype(np.float32)


def _neighbors(count: int, place_of_reference: I32, poses: F64) -> tuple[I32, I32, F32]:
    """Give the references on either side of every heading at every place, and how far over to the second."""
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
