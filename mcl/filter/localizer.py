"""Monte Carlo localization: predict, measure, weight, resample, estimate. Thesis 3.1 and figure 1.

    Bel(x_t) = eta p(o_t | x_t) integral p(x_t | x_t-1, a_t-1) Bel(x_t-1) dx_t-1

A localizer holds choices and no state; `step` takes a state and a frame and gives the next state and a
record of everything that happened. Truth is no part of a frame, so it cannot get in.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from ..arrays import F32, F64
from ..library import Library
from ..randomness import Domain, Purpose, normals, stream
from ..records import Belief, FilterState, StepRecord, effective_sample_size, normalize
from ..sensor.model import SensorModel
from ..sensor.references import NearestReference
from ..session import Frame, Moment, Session
from .estimate import heaviest_cluster, log_mean_likelihood, weighted_mean
from .motion import MotionModel, MotionOutliers, with_outliers
from .proposal import belief_at, uniform_belief
from .resampling_step import Resampled, ResamplingStep

RESAMPLED = "resampled"
RESEEDED = "reseeded"
EXPANDED = "expanded"
ALL_ZERO = "all weights zero"
NO_OUTLIERS = MotionOutliers()


@dataclass(frozen=True, slots=True, eq=False)
class Localizer:
    """The choices of one run. The same choices, session and seed give the same records."""

    library: Library
    reference: NearestReference
    motion: MotionModel
    sensor: SensorModel
    resampling: ResamplingStep
    outliers: MotionOutliers = NO_OUTLIERS
    particles: int = 2000
    seed: int = 0

    def initialize(self, pose: F64 | None) -> FilterState:
        """Begin at a known pose (3,) in the map's frame, or anywhere for None."""
        if pose is not None:
            return FilterState(0, belief_at(pose, self.particles, self.library.origin))
        rng = stream(Domain.FILTER, self.seed, 0, Purpose.INITIALIZATION)
        return FilterState(0, uniform_belief(self.reference.grid, self.particles, self.library.origin, rng))

    def step(self, state: FilterState, frame: Frame) -> tuple[FilterState, StepRecord]:
        """Take in one frame; the state that was given is left as it was."""
        took: dict[str, float] = {}
        with _timed(took, "predict"):
            predicted = self._predict(state.belief, frame)
        with _timed(took, "measure"):
            comparison = self.sensor.compare(self.sensor.measure(frame.image))
            predicted, correction = self.resampling.mix_in(
                predicted, comparison, self._rng(frame.step, Purpose.MIXTURE)
            )
            sighting = self.sensor.at(comparison, predicted.poses)
        with _timed(took, "weight"):
            weighted, log_evidence = weigh(predicted, sighting.log_likelihood, correction)
            prior = _corrected(predicted, correction)
            evidence = log_mean_likelihood(comparison.cost[None], prior, sighting.entries)
            by_channel = log_mean_likelihood(comparison.channel_cost, prior, sighting.entries)
        with _timed(took, "estimate"):
            fresh = state.injected if correction is None else None
            estimate = heaviest_cluster(weighted, fresh)
            mean = weighted_mean(weighted, fresh)
        with _timed(took, "resample"):
            renewed = self.resampling.renew(
                weighted,
                comparison,
                float(evidence[0]),
                state.recovery,
                frame.step,
                lambda purpose: self._rng(frame.step, purpose),
            )
        record = StepRecord(
            frame=frame,
            predicted=predicted,
            sighting=sighting,
            weighted=weighted,
            estimate=estimate,
            mean_estimate=mean,
            effective_sample_size=effective_sample_size(weighted.log_weights),
            log_evidence=log_evidence,
            calibrated_evidence=float(evidence[0]),
            channel_evidence=by_channel,
            parents=renewed.parents,
            injected=renewed.injected,
            belief=renewed.belief,
            events=_events(log_evidence, renewed),
            took_s=took,
        )
        return FilterState(frame.step, renewed.belief, renewed.injected, renewed.recovery), record

    def _rng(self, step: int, purpose: int) -> np.random.Generator:
        return stream(Domain.FILTER, self.seed, step, purpose)

    def _predict(self, belief: Belief, frame: Frame) -> Belief:
        poses: F32 = belief.poses
        # a generator a movement, so that a larger N keeps a smaller one's draws in all of them
        count = len(frame.motions)
        usual = self._rng(frame.step, Purpose.MOTION).spawn(count)
        slips = self._rng(frame.step, Purpose.OUTLIER).spawn(count)
        for motion, own, slip in zip(frame.motions, usual, slips, strict=True):
            noise = with_outliers(normals(own, belief.size), self.outliers, slip)
            poses = self.motion.move(poses, belief.origin, motion, noise)
        return Belief(poses, belief.log_weights, belief.origin)


def weigh(predicted: Belief, log_likelihood: F32, correction: F64 | None = None) -> tuple[Belief, float]:
    """Multiply likelihoods (N,) into the weights; give the new belief and log p(o_t | past).

    `correction` (N,) is the log of predicted over proposal density where particles were drawn otherwise.
    When every weight would be zero (all particles with any weight are outside free space) the picture is
    taken as uninformative: the prior weights stay, and the evidence is -inf, which the step reports as the
    event "all weights zero".
    """
    posterior, log_evidence = normalize(_corrected(predicted, correction).log_weights + log_likelihood)
    if not np.isfinite(log_evidence):
        return predicted, -np.inf
    return Belief(predicted.poses, posterior, predicted.origin), log_evidence


def _corrected(predicted: Belief, correction: F64 | None) -> Belief:
    """Weigh particles that were drawn otherwise as if they had been predicted; sums to one on average."""
    if correction is None:
        return predicted
    return Belief(predicted.poses, predicted.log_weights + correction, predicted.origin)


def _events(log_evidence: float, renewed: Resampled) -> tuple[str, ...]:
    happened = {
        ALL_ZERO: not np.isfinite(log_evidence),
        RESAMPLED: renewed.parents is not None,
        RESEEDED: renewed.injected is not None,
        EXPANDED: renewed.expanded,
    }
    return tuple(event for event, true in happened.items() if true)


@contextmanager
def _timed(took: dict[str, float], stage: str) -> Iterator[None]:
    began = perf_counter()
    yield
    took[stage] = perf_counter() - began


def run(localizer: Localizer, session: Session, start: F64 | None) -> Iterator[tuple[Moment, StepRecord]]:
    """Go through a session a step at a time. The filter gets frames; truth passes by beside it."""
    state = localizer.initialize(start)
    for moment in session.moments():
        state, record = localizer.step(state, moment.frame)
        yield moment, record
