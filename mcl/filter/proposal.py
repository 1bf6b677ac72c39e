"""Proposals: from where the particles of an update are drawn, and how they are weighted for that.

The plain one is the motion model: every particle moves with noise of its own. The mixture proposal is that of
Thrun, Fox, Burgard and Dellaert (2001). All particles are weighted as draws of one mixture (the balance
heuristic, Veach and Guibas 1995): w = likelihood * p / ((1 - share) k + share q), with p the predicted
density, k that of the particles that are kept, and q that of the sampled poses. Densities are per library
entry, over the poses nearest to it. So that sampled poses count where k is zero, p is k but for a small
share, the robot's chance of having been carried anywhere. Filters with pose sensors: `following`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Protocol

import numpy as np

from ..errors import InputError
from ..sensor.references import HEADING_BINS, NearestReference
from ..values import (
    F32,
    F64,
    SHARE,
    Belief,
    Comparison,
    Frame,
    MeasuredMovement,
    Past,
    PoseProposal,
    StepRecord,
    number,
    uniform_log_weights,
)
from ..values.randomness import Domain, Purpose, normals_at, stream, words_at
from .motion import MotionModel, MotionOutliers, with_outliers
from .resampling import systematic
from .sampling import Regions, density, from_sensors, informed_poses, proposals_of, shares_of

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
        for movement, drawn in enumerate(self.by_movement(noise)):
            poses = self.move(movement, poses, drawn)
        return Belief(poses, self.before.log_weights, self.before.origin)

    @cached_property
    def normals(self) -> F32:
        """Standard normals (M N, 3), one movement after another."""
        address = (Domain.FILTER, self.seed, self.frame.step, Purpose.MOTION)
        words = [words_at(*address, movement) for movement in range(len(self.frame.motions))]
        return normals_at(words, self.before.size)

    def by_movement(self, noise: F32) -> list[F32]:
        """Split noise (M N, 3) into that of each movement (N, 3)."""
        n = self.before.size
        return [noise[first : first + n] for first in range(0, len(noise), n)]

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
        teleport = max(self.parameters.teleport, believed)
        k, q = self._kept_shares(predicted), shares_of(log_likelihood, self.regions)
        p = (1 - teleport) * k + teleport * (sizes / sizes.sum())
        mixture = (1 - count / predicted.size) * k + (count - sensors) / predicted.size * q
        entries = self.reference.entries(poses, predicted.origin)
        if not sensors:
            ratio = np.divide(p, mixture, out=np.zeros_like(p), where=mixture > 0)  # 0: none is drawn
            with np.errstate(divide="ignore"):
                return np.append(np.log(ratio), 0.0)[entries]
        # these densities are even within the poses nearest to an entry, if any: per m^2 and rad
        per_pose = 1 / (np.maximum(sizes, 1) * self.reference.grid.cell_m**2 * (2 * np.pi / HEADING_BINS))
        of_sensors = sensors / predicted.size * density(proposals, poses, predicted.origin)
        part = np.append(np.stack([p, mixture]) * per_pose, [[1.0], [1.0]], axis=1)[:, entries]
        with np.errstate(divide="ignore"):
            return np.where(entries < 0, 0.0, np.log(part[0]) - np.log(part[1] + of_sensors))

    def _kept_shares(self, predicted: Belief) -> F64:
        """Return the share (L,) of the predicted weight nearest to each entry."""
        entry = self.reference.entries(predicted.poses, predicted.origin)
        inside = entry >= 0
        shares = np.bincount(entry[inside], predicted.weights[inside], len(self.regions.place_of_entry))
        return np.asarray(shares, np.float64)
