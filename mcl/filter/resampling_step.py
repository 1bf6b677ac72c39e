"""Renewal: from weighted particles to the next step's: resampling, reseeding, size, all together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import F32, F64, I32, Bool
from ..geometry import wrap
from ..randomness import Purpose, normals
from ..records import Belief, Comparison, RecoveryState, uniform_log_weights
from ..sensor.references import NearestReference, spacing
from .proposal import MixtureParameters, Regions, likely_poses, mixture_proposal, uniform_poses
from .recovery import RecoveryStrategy
from .resampling import KldParameters, ResamplePolicy, Resampler, adapted_size, roughen

Generators = Callable[[int], np.random.Generator]  # by purpose


@dataclass(frozen=True, slots=True, eq=False)
class Resampled:
    """What the next step starts from, and where it came from."""

    belief: Belief
    parents: I32 | None
    injected: Bool | None
    recovery: RecoveryState
    expanded: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class ResamplingStep:
    """How particles are renewed after they were weighed."""

    nearest: NearestReference
    where: Regions
    resampler: Resampler
    when: ResamplePolicy
    strategy: RecoveryStrategy
    draw_evenly: bool = False  # fresh particles over all free space, not where the picture says
    roughening: float = 0.0
    kld: KldParameters | None = None
    mixture: MixtureParameters | None = None

    def mix_in(
        self, predicted: Belief, comparison: Comparison, rng: np.random.Generator
    ) -> tuple[Belief, F64 | None]:
        """Replace some predicted particles by mixture draws, where that is asked for; else hand them on."""
        if self.mixture is None:
            return predicted, None
        return mixture_proposal(
            predicted, comparison.log_likelihood, self.nearest, self.where, self.mixture, rng
        )

    def renew(
        self,
        weighted: Belief,
        comparison: Comparison,
        evidence: float,
        recovery: RecoveryState,
        step: int,
        rng: Generators,
    ) -> Resampled:
        """Resample and reseed as the policies say; a belief that is reseeded is always resampled."""
        wanted = self.strategy(evidence, recovery)
        size = weighted.size if self.kld is None else adapted_size(weighted, self.kld)
        fresh = round(wanted.share * size)
        if not (fresh or wanted.expand or size != weighted.size or self.when(weighted, step)):
            return Resampled(weighted, None, None, wanted.state)
        parents = self.resampler(weighted.weights, size - fresh, rng(Purpose.RESAMPLE))
        copies = Belief(
            weighted.poses.take(parents, axis=0), uniform_log_weights(len(parents)), weighted.origin
        )
        if self.roughening > 0:
            copies = roughen(copies, self.roughening, normals(rng(Purpose.ROUGHEN), copies.size))
        if wanted.expand:
            copies = self._spread(copies, rng(Purpose.ROUGHEN).spawn(1)[0])  # roughening took its numbers
        if not fresh:
            return Resampled(copies, parents, None, wanted.state, wanted.expand)
        drawn = self._draw(comparison, fresh, weighted.origin, rng(Purpose.INJECT))
        poses = np.concatenate([copies.poses, drawn])
        belief = Belief(poses, uniform_log_weights(size), weighted.origin)
        parents = np.append(parents, np.full(fresh, -1, np.int32))
        injected = np.arange(size) >= size - fresh
        return Resampled(belief, parents, injected, wanted.state, wanted.expand)

    def _draw(self, comparison: Comparison, n: int, origin: F64, rng: np.random.Generator) -> F32:
        if self.draw_evenly:
            return uniform_poses(self.nearest.grid, n, origin, rng)
        return likely_poses(comparison.log_likelihood, self.nearest.grid, self.where, n, origin, rng)

    def _spread(self, belief: Belief, rng: np.random.Generator) -> Belief:
        """Move every particle by about the library's spacing and an eighth of a turn."""
        reach = spacing(self.nearest.places)
        sd = np.array([reach, reach, np.pi / 8], np.float32)
        poses = belief.poses + normals(rng, belief.size) * sd
        poses[:, 2] = wrap(poses[:, 2])
        return Belief(np.asarray(poses, np.float32), belief.log_weights, belief.origin)
