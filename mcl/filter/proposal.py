"""Proposals: initialization, pose sampling, and the mixture proposal.

The mixture proposal is that of Thrun, Fox, Burgard and Dellaert (2001). All particles are weighted as draws
of one mixture (the balance heuristic, Veach and Guibas 1995): w = likelihood * p / ((1 - share) k + share q),
with p the predicted density, k that of the particles that are kept, and q that of the sampled poses.
Densities are per library entry, over the poses nearest to it. So that sampled poses count where k is zero, p
is k but for a small share, the robot's chance of having been carried anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..sensor.references import HEADING_BINS, NearestReference
from ..values import (
    F32,
    F64,
    I32,
    SHARE,
    Belief,
    Grid,
    MeasuredMovement,
    PoseProposal,
    number,
    uniform_log_weights,
    wrap,
)
from .resampling import systematic
from .sensor_proposal import SENSOR_SHARE, density, draw_poses

# Pose sampling: evenly over free space, or from the likelihood of a picture.


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


# Mixture proposal (dual MCL): some particles are drawn from the picture's likelihood.


@dataclass(frozen=True, slots=True)
class MixtureParameters:
    """How many particles, and how likely a kidnapping is."""

    share: Annotated[float, number(0, 0.99)] = 0.1  # of the particles
    teleport: Annotated[float, SHARE] = (
        0.01  # probability that the robot was carried anywhere since the last update
    )


@dataclass(frozen=True, slots=True, eq=False)
class ProposedParticles:
    """Particles before the weights are updated by the picture."""

    belief: Belief
    correction: F64 | None = None  # (N,) log of predicted over proposal density; None: drawn as predicted
    is_guided: bool = False  # some moved toward where a sensor puts the robot (`guided_motion`)
    movement: MeasuredMovement | None = None  # as a sensor measured it; None: not asked

    @property
    def prior_log_weights(self) -> F64:
        """Log-weights (N,) as if all were drawn by the motion model; the weights sum to one on average."""
        if self.correction is None:
            return self.belief.log_weights
        return self.belief.log_weights + self.correction


def mixture_proposal(
    predicted: Belief,
    log_likelihood: F32,
    nearest: NearestReference,
    where: Regions,
    parameters: MixtureParameters,
    rng: np.random.Generator,
    proposals: Sequence[PoseProposal] = (),
) -> ProposedParticles:
    """Resample N particles but a share; return them with corrections.

    The share is drawn from the picture's likelihood; most of it from what pose sensors propose, if any do.
    """
    count = round(parameters.share * predicted.size)
    kept = systematic(predicted.weights, predicted.size - count, rng)
    sensors = round(SENSOR_SHARE * count) if proposals else 0
    drawn = likely_poses(log_likelihood, nearest.grid, where, count - sensors, predicted.origin, rng)
    if sensors:
        drawn = np.concatenate([drawn, draw_poses(proposals, sensors, predicted.origin, rng)])
    poses = np.concatenate([predicted.poses[kept], drawn])
    k, even = _kept_shares(predicted, nearest, where), where.sizes() / where.sizes().sum()
    believed = max((proposal.believed for proposal in proposals), default=0.0)  # by earlier readings
    teleport = max(parameters.teleport, believed)
    p = (1 - teleport) * k + teleport * even
    q = shares_of(log_likelihood, where)
    share = (count - sensors) / predicted.size
    mixture = (1 - count / predicted.size) * k + share * q
    ratio = np.divide(p, mixture, out=np.zeros_like(p), where=mixture > 0)  # none is drawn at density 0
    with np.errstate(divide="ignore"):
        per_entry = np.log(ratio)
    entries = nearest.entries(poses, predicted.origin)
    correction = np.append(per_entry, 0.0)[entries]
    if sensors:
        # the densities of the table above are even within the poses nearest to an entry: per m^2 and rad here
        sizes = np.maximum(where.sizes(), 1)  # no pose is nearest to one of size 0
        per_pose = 1 / (sizes * nearest.grid.cell_m**2 * (2 * np.pi / HEADING_BINS))
        of_sensors = sensors / predicted.size * density(proposals, poses, predicted.origin)
        part = np.append(np.stack([p, mixture]) * per_pose, [[1.0], [1.0]], axis=1)[:, entries]
        with np.errstate(divide="ignore"):
            correction = np.where(entries < 0, 0.0, np.log(part[0]) - np.log(part[1] + of_sensors))
    belief = Belief(poses, uniform_log_weights(len(poses)), predicted.origin)
    return ProposedParticles(belief, np.asarray(correction))


def _kept_shares(predicted: Belief, nearest: NearestReference, where: Regions) -> F64:
    """Return the share (L,) of the predicted weight nearest to each entry."""
    entry = nearest.entries(predicted.poses, predicted.origin)
    inside = entry >= 0
    shares = np.bincount(entry[inside], predicted.weights[inside], len(where.place_of_entry))
    return np.asarray(shares, np.float64)
