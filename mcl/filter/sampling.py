"""Poses drawn evenly, where a picture or a sensor puts the robot, and where a run begins.

Densities of pictures are per library entry, over the poses nearest to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sensor.references import HEADING_BINS, NearestReference
from ..values import (
    F32,
    F64,
    I32,
    Belief,
    Earlier,
    Grid,
    PoseProposal,
    Sensed,
    uniform_log_weights,
    wrap,
    wrap_angle,
)

# Evenly over free space, or from the likelihood of a picture.


def uniform_poses(grid: Grid, n: int, origin: F64, rng: np.random.Generator) -> F32:
    """Draw n poses (n, 3) evenly over free space and headings. ValueError if nothing is free."""
    free = np.flatnonzero(grid.free.ravel())
    if not len(free):
        raise ValueError("no free space to start in: obstacles and walls cover the whole map")
    draws = rng.random((n, 4))
    xy = _within(grid, free[(draws[:, 0] * len(free)).astype(np.int64)], draws[:, 1:3], origin)
    heading = draws[:, 3] * (2 * np.pi) - np.pi
    return np.column_stack([xy, heading]).astype(np.float32)


def _within(grid: Grid, cells: NDArray[np.int64], shares: F64, origin: F64) -> F64:
    """Return the points (n, 2) at given shares (n, 2) of the sides of cells (n,)."""
    columns = grid.shape[1]
    index = np.column_stack([cells % columns, cells // columns])
    return np.asarray(grid.corner + grid.cell_m * (index + shares) - origin)


@dataclass(frozen=True, slots=True, eq=False)
class Regions:
    """The poses nearest to each entry: cells sorted by place, heading bins sorted by place and entry."""

    cells: I32  # (free cells,) flat numbers, place by place
    first_cell: I32  # (P + 1,) where each place's cells begin
    place_of_entry: I32  # (L,)
    bins: I32  # (P * HEADING_BINS,) heading bins, entry by entry
    first_bin: I32  # (L + 1,) where each entry's bins begin

    def sizes(self) -> F64:
        """Return how many (cell, heading bin) pairs are nearest to each entry (L,)."""
        cells, bins = np.diff(self.first_cell), np.diff(self.first_bin)
        return np.asarray(cells[self.place_of_entry] * bins, np.float64)


def regions(nearest: NearestReference, entries: int) -> Regions:
    """Sort the tables of the nearest reference by entry."""
    inside = np.flatnonzero((nearest.place_of_cell[:-1] >= 0) & nearest.grid.free.ravel())
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
    """Return the probability (L,) of each entry to be nearest to a pose drawn from the likelihood."""
    size = where.sizes()
    top = float(log_likelihood[size > 0].max(initial=-np.inf))  # of those that any pose is nearest to
    if not np.isfinite(top):  # a channel measured no number: any pose is as likely as another
        return np.asarray(size / size.sum())
    weight = np.exp(np.minimum(log_likelihood.astype(np.float64) - top, 0.0)) * size
    return np.asarray(weight / weight.sum())


def likely_poses(
    log_likelihood: F32, grid: Grid, where: Regions, n: int, origin: F64, rng: np.random.Generator
) -> F32:
    """Draw n poses (n, 3) relative to `origin`, with density in proportion to the likelihood (L,)."""
    return poses_of_entries(np.cumsum(shares_of(log_likelihood, where)), grid, where, n, origin, rng)


def poses_of_entries(
    cumulative: F64, grid: Grid, where: Regions, n: int, origin: F64, rng: np.random.Generator
) -> F32:
    """Draw n poses (n, 3) relative to `origin`, each nearest to an entry by cumulative shares (L,)."""
    draws = rng.random((n, 5))
    entry = np.minimum(cumulative.searchsorted(draws[:, 0] * cumulative[-1]), len(cumulative) - 1)
    cell = where.cells[_pick(where.first_cell, where.place_of_entry[entry], draws[:, 1])]
    heading_bin = where.bins[_pick(where.first_bin, entry, draws[:, 2])]
    xy = _within(grid, cell.astype(np.int64), draws[:, 3:5], origin)
    heading = (heading_bin + rng.random(n)) * (2 * np.pi / HEADING_BINS) - np.pi
    return np.column_stack([xy, heading]).astype(np.float32)


def _pick(first: I32, group: NDArray[np.integer[Any]], share: F64) -> I32:
    """Return an index within each group, by a share (n,) from 0 to 1."""
    begin, size = first[group], first[group + 1] - first[group]
    return np.asarray(begin + (share * size).astype(np.int32), np.int32)


# Poses that pose sensors propose: mixtures of normal distributions.

SENSOR_SHARE = 0.8  # share of the drawn poses that are a pose sensor's; the others follow the likelihood
LEAST_VARIANCE = 1e-6  # added to variances (m^2, rad^2), so that no covariance is singular


def proposals_of(
    sensed: Iterable[Sensed], earlier: Callable[[str], Sequence[Earlier]] = lambda name: ()
) -> list[PoseProposal]:
    """Return what pose sensors propose, checked by what each of them, by its name, read before."""
    proposals = (part.confirmed(earlier(part.name)) for part in sensed)
    return [proposal for proposal in proposals if proposal is not None]


def draw_poses(proposals: Sequence[PoseProposal], n: int, origin: F64, rng: np.random.Generator) -> F32:
    """Draw n poses (n, 3) relative to `origin` from proposals, each of them as likely as the others."""
    weights, means, covariances = _joined(proposals)
    which = np.minimum(np.searchsorted(np.cumsum(weights), rng.random(n)), len(weights) - 1)
    spread = np.linalg.cholesky(covariances)[which]
    poses = means[which] + np.einsum("nij,nj->ni", spread, rng.standard_normal((n, 3)))
    poses[:, :2] -= origin
    drawn: F32 = poses.astype(np.float32)
    drawn[:, 2] = wrap(drawn[:, 2])
    return drawn


def density(proposals: Sequence[PoseProposal], poses: F32, origin: F64) -> F64:
    """Return the density (N,) per m^2 and rad of `draw_poses` at poses (N, 3) relative to `origin`."""
    weights, means, covariances = _joined(proposals)
    world = poses.astype(np.float64)
    world[:, :2] += origin
    total = np.zeros(len(poses))
    for weight, mean, covariance in zip(weights, means, covariances, strict=True):
        away = world - mean
        away[:, 2] = wrap_angle(away[:, 2])
        squared = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away)
        total += weight * np.exp(-0.5 * squared) / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(covariance))
    return total


def _joined(proposals: Sequence[PoseProposal]) -> tuple[F64, F64, F64]:
    """Return weights (M,), means (M, 3) and covariances (M, 3, 3) of one mixture."""
    shares = [proposal.weights / (proposal.weights.sum() * len(proposals)) for proposal in proposals]
    poses = [proposal.poses for proposal in proposals]
    covariances = np.concatenate([proposal.covariances for proposal in proposals])
    return np.concatenate(shares), np.concatenate(poses), covariances + LEAST_VARIANCE * np.eye(3)


# By a picture, and by what pose sensors propose for it.


def from_sensors(n: int, proposals: Sequence[PoseProposal]) -> int:
    """Return how many of n poses are drawn from what pose sensors propose, not from the likelihood."""
    return round(SENSOR_SHARE * n) if proposals else 0


def informed_poses(
    log_likelihood: F32,
    proposals: Sequence[PoseProposal],
    grid: Grid,
    where: Regions,
    n: int,
    origin: F64,
    rng: np.random.Generator,
) -> F32:
    """Draw n poses (n, 3) relative to `origin` from the likelihood (L,), and most of them from proposals."""
    sensors = from_sensors(n, proposals)
    drawn = likely_poses(log_likelihood, grid, where, n - sensors, origin, rng)
    if not sensors:
        return drawn
    return np.concatenate([drawn, draw_poses(proposals, sensors, origin, rng)])


# Initialization: at a known pose, or anywhere.


def belief_at(pose: F64, n: int, origin: F64) -> Belief:
    """Place all n particles at one pose (3,): position tracking, zero variance (thesis 3.6.2)."""
    poses = np.empty((n, 3), np.float32)
    poses[:, :2] = pose[:2] - origin
    poses[:, 2] = wrap(np.asarray(pose[2:3], np.float64))[0]
    return Belief(poses, uniform_log_weights(n), origin)


def uniform_belief(grid: Grid, n: int, origin: F64, rng: np.random.Generator) -> Belief:
    """Spread n particles evenly over free space and all headings: global localization (see above)."""
    return Belief(uniform_poses(grid, n, origin, rng), uniform_log_weights(n), origin)
