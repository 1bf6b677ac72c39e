"""Proposals: from where the particles of an update are drawn, and how they are weighted for that.

The plain one is the motion model: every particle moves with noise of its own. The mixture proposal is that of
Thrun, Fox, Burgard and Dellaert (2001). All particles are weighted as draws of one mixture (the balance
heuristic, Veach and Guibas 1995): w = likelihood * p / ((1 - share) k + share q), with p the predicted
density, k that of the particles that are kept, and q that of the sampled poses. Densities are per library
entry, over the poses nearest to it. So that sampled poses count where k is zero, p is k but for a small
share, the robot's chance of having been carried anywhere. Filters with pose sensors: `following`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..sensor.references import HEADING_BINS, NearestReference
from ..values.arrays import F32, F64, I32
from ..values.geometry import wrap, wrap_angle
from ..values.map import Grid
from ..values.pose_sensor import MeasuredMovement, PoseProposal, ReadBefore, Sensed
from ..values.randomness import Domain, Purpose, normals_at, stream, words_at
from ..values.records import Belief, Comparison, Past, StepRecord, uniform_log_weights
from ..values.session import Frame
from ..values.setting_rules import SHARE, number
from .motion import MotionModel, MotionOutliers, with_outliers
from .resampling import systematic

# Poses drawn evenly over free space, or from the likelihood of a picture.


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


def proposals_of(sensed: Iterable[Sensed], earlier: ReadBefore = lambda name: ()) -> list[PoseProposal]:
    """Return what pose sensors propose, checked by what each of them, by its name, read before."""
    proposals = (part.confirmed(earlier) for part in sensed)
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


# The seam: what a proposal is given, and what it returns.

Updates = Sequence[Past]  # what was kept of earlier ones, the latest first


@dataclass(frozen=True, eq=False)
class Prediction:
    """How the particles of a belief move in a frame, which every proposal begins with.

    Noise has an address (seed, step, movement): who asks again gets the same, and a larger belief keeps the
    noise of a smaller one.
    """

    before: Belief
    frame: Frame
    model: MotionModel | None
    outliers: MotionOutliers
    seed: int

    @cached_property
    def belief(self) -> Belief:
        """The particles as the motion model moves them, with the weights that they had."""
        if not len(self.frame.motions):
            return self.before
        noise, poses = self.normals, self.before.poses
        if self.outliers.share > 0:
            noise = with_outliers(noise, self.outliers, *self.outlier_rngs())
        for movement in range(len(self.frame.motions)):
            poses = self.move(movement, poses, noise[movement * self.before.size :][: self.before.size])
        return Belief(poses, self.before.log_weights, self.before.origin)

    @cached_property
    def normals(self) -> F32:
        """Standard normals (M N, 3), one movement after another."""
        address = (Domain.FILTER, self.seed, self.frame.step, Purpose.MOTION)
        words = [words_at(*address, movement) for movement in range(len(self.frame.motions))]
        return normals_at(words, self.before.size)

    def move(self, movement: int, poses: F32, noise: F32) -> F32:
        """Return poses (N, 3) after the movement of this number, with the noise (N, 3) of each.

        Raises InputError without a motion model.
        """
        if self.model is None:
            raise InputError(None, "found no motion model; use `run`, or `of_session` before the first step")
        return self.model.move(poses, self.before.origin, self.frame.motions[movement], noise)

    def outlier_rngs(self) -> list[np.random.Generator]:
        """Return what chooses the motion outliers of each movement."""
        return [self.rng(Purpose.OUTLIER, movement) for movement in range(len(self.frame.motions))]

    def rng(self, purpose: int, child: int | None = None) -> np.random.Generator:
        """Return a generator of the filter for this update."""
        return stream(Domain.FILTER, self.seed, self.frame.step, purpose, child)


@dataclass(frozen=True, slots=True, eq=False)
class ProposedParticles:
    """Particles before the weights are updated by the picture."""

    belief: Belief
    correction: F64 | None = None  # (N,) log of predicted over proposal density; None: drawn as predicted
    is_guided: bool = False  # some moved toward where a sensor puts the robot (`following`)
    movement: MeasuredMovement | None = None  # as a sensor measured it; None: not asked

    @property
    def prior_log_weights(self) -> F64:
        """Log-weights (N,) as if all were drawn by the motion model; the weights sum to one on average."""
        if self.correction is None:
            return self.belief.log_weights
        return self.belief.log_weights + self.correction


class Proposal(Protocol):
    """Where the particles of an update are drawn, and what is kept of it for those after it."""

    @property
    def mixture(self) -> MixtureProposal | None:
        """What draws some particles anew at every update; None: nothing does."""
        return None

    def propose(self, prediction: Prediction, comparison: Comparison, past: Updates) -> ProposedParticles:
        """Return particles before they are weighted by the picture."""
        ...

    def keep(self, record: StepRecord, movement: MeasuredMovement | None, past: Updates) -> tuple[Past, ...]:
        """Return what the next update may ask for, the latest first: of an update and of those before it."""
        return ()


@dataclass(frozen=True, slots=True)
class MotionProposal(Proposal):
    """Draw all particles by the motion model, as the thesis does."""

    def propose(self, prediction: Prediction, comparison: Comparison, past: Updates) -> ProposedParticles:
        """See `Proposal.propose`."""
        return ProposedParticles(prediction.belief)


# Mixture proposal (dual MCL): some particles are drawn from the picture's likelihood.


@dataclass(frozen=True, slots=True)
class MixtureParameters:
    """How many particles, and how likely a kidnapping is."""

    share: Annotated[float, number(0, 0.99)] = 0.1  # of the particles
    teleport: Annotated[float, SHARE] = (
        0.01  # probability that the robot was carried anywhere since the last update
    )


@dataclass(frozen=True, slots=True, eq=False)
class MixtureProposal(Proposal):
    """Draw a share of the particles from the picture's likelihood, or as pose sensors propose."""

    parameters: MixtureParameters
    reference: NearestReference
    regions: Regions

    @property
    def mixture(self) -> MixtureProposal:
        """See `Proposal.mixture`."""
        return self

    def propose(self, prediction: Prediction, comparison: Comparison, past: Updates) -> ProposedParticles:
        """See `Proposal.propose`."""
        likely, rng = comparison.log_likelihood, prediction.rng(Purpose.MIXTURE)
        return self.mixed(prediction.belief, likely, rng, proposals_of(comparison.sensed))

    def mixed(
        self,
        predicted: Belief,
        log_likelihood: F32,
        rng: np.random.Generator,
        proposals: Sequence[PoseProposal] = (),
    ) -> ProposedParticles:
        """Resample N particles but a share; return them with corrections.

        The share is drawn from the picture's likelihood (L,); most of it from what pose sensors propose, if
        any do.
        """
        count, origin = round(self.parameters.share * predicted.size), predicted.origin
        kept = systematic(predicted.weights, predicted.size - count, rng)
        grid, where = self.reference.grid, self.regions
        drawn = informed_poses(log_likelihood, proposals, grid, where, count, origin, rng)
        poses = np.concatenate([predicted.poses[kept], drawn])
        correction = self._correction(poses, predicted, log_likelihood, proposals)
        return ProposedParticles(Belief(poses, uniform_log_weights(len(poses)), origin), correction)

    def _correction(
        self, poses: F32, predicted: Belief, log_likelihood: F32, proposals: Sequence[PoseProposal]
    ) -> F64:
        """Return the log (N,) of predicted over proposal density at the poses (N, 3) of the mixture."""
        count, sizes = round(self.parameters.share * predicted.size), self.regions.sizes()
        sensors = from_sensors(count, proposals)
        believed = max((proposal.believed for proposal in proposals), default=0.0)  # by earlier readings
        teleport = self.parameters.teleport
        k, q = self._kept_shares(predicted), shares_of(log_likelihood, self.regions)
        p = (1 - believed) * ((1 - teleport) * k + teleport * (sizes / sizes.sum()))
        mixture = (1 - count / predicted.size) * k + (count - sensors) / predicted.size * q
        entries = self.reference.entries(poses, predicted.origin)
        if not sensors:
            ratio = np.divide(p, mixture, out=np.zeros_like(p), where=mixture > 0)  # 0: none is drawn
            with np.errstate(divide="ignore"):
                return np.append(np.log(ratio), 0.0)[entries]
        # these densities are even within the poses nearest to an entry, if any: per m^2 and rad
        per_pose = 1 / (np.maximum(sizes, 1) * self.reference.grid.cell_m**2 * (2 * np.pi / HEADING_BINS))
        of_sensors = density(proposals, poses, predicted.origin)
        part = np.append(np.stack([p, mixture]) * per_pose, [[1.0], [1.0]], axis=1)[:, entries]
        with np.errstate(divide="ignore"):
            predicted_density = np.log(part[0] + believed * of_sensors)
            proposed = np.log(part[1] + sensors / predicted.size * of_sensors)
            return np.where(entries < 0, 0.0, predicted_density - proposed)

    def _kept_shares(self, predicted: Belief) -> F64:
        """Return the share (L,) of the predicted weight nearest to each entry."""
        entry = self.reference.entries(predicted.poses, predicted.origin)
        inside = entry >= 0
        shares = np.bincount(entry[inside], predicted.weights[inside], len(self.regions.place_of_entry))
        return np.asarray(shares, np.float64)
