"""Weights by a picture: the posterior, and what the picture says of the cloud as a whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..values.arrays import F32, F64
from ..values.records import Belief, Sighting, normalize
from .estimate import entry_weights, log_mean_likelihood
from .proposal import ProposedParticles

KNOWN_SHARE = 0.5  # share of the weight that references have to speak for before recovery decides


@dataclass(frozen=True, slots=True, eq=False)
class Weighting:
    """Particles as proposed, what a picture means for each of them, and the belief that follows."""

    proposed: ProposedParticles
    sighting: Sighting
    belief: Belief
    log_evidence: float  # log p(o_t | past); -inf: no particle has any weight, and the belief is the prior
    evidence: float  # calibrated, of all sensors
    by_channel: F64  # (C,) the same of each channel alone

    @classmethod
    def of(cls, proposed: ProposedParticles, sighting: Sighting) -> Weighting:
        """Weigh particles by what they would see."""
        weighted = weigh(proposed, sighting.log_likelihood)
        return cls(proposed, sighting, *weighted, *calibrated_evidence(proposed, sighting))

    @property
    def is_broken(self) -> bool:
        """Whether no particle has any weight since a channel measures NaN in free space."""
        return self.log_evidence == -np.inf and bool(np.isnan(self.sighting.log_likelihood).any())

    @property
    def is_outside(self) -> bool:
        """Whether no particle with any weight is in free space."""
        return self.log_evidence == -np.inf and not self.is_broken

    def references_speak(self) -> bool:
        """Return whether references speak for half of the cloud; else no picture can show that it is lost."""
        known, weights = self.sighting.known, np.exp(self.proposed.prior_log_weights)
        return known is None or float(weights @ known) >= KNOWN_SHARE * float(weights.sum())


def weigh(proposed: ProposedParticles, log_likelihood: F32) -> tuple[Belief, float]:
    """Multiply likelihoods (N,) into the weights; return the new belief and log p(o_t | past).

    If every weight would be zero, the prior weights are kept and the evidence is -inf: no particle with any
    weight is in free space.
    """
    posterior, log_evidence = normalize(proposed.prior_log_weights + log_likelihood)
    if not np.isfinite(log_evidence):
        return proposed.belief, -np.inf
    return Belief(proposed.belief.poses, posterior, proposed.belief.origin), log_evidence


def calibrated_evidence(proposed: ProposedParticles, sighting: Sighting) -> tuple[float, F64]:
    """Return the log mean of exp(-cost) over the cloud: of all sensors, and of each channel (C,)."""
    comparison, prior, known = sighting.comparison, proposed.prior_log_weights, sighting.known
    if not comparison.channels and known is None and sighting.sensed is not None:
        inside = np.exp(prior + sighting.sensed).compress(sighting.entries >= 0)  # no reference says anything
        total = inside.sum()
        return float(np.log(total)) if total else -np.inf, np.zeros(0)
    weights = entry_weights(np.exp(prior), sighting.entries, len(comparison.cost), known)
    by_channel = log_mean_likelihood(comparison.channels_explained, weights)
    if sighting.sensed is not None:
        sensed = np.exp(prior + sighting.sensed)
        weights = entry_weights(sensed, sighting.entries, len(comparison.cost), known)
    return float(log_mean_likelihood(comparison.explained_by_channels, weights)[0]), by_channel


def usable_evidence(evidence: float, left: bool) -> float:
    """Return the evidence for recovery: -inf if the cloud left the map or the evidence is no number."""
    return -np.inf if left or np.isnan(evidence) else evidence
