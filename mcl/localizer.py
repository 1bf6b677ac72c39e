"""Monte Carlo localization: predict, measure, weight, resample, estimate. Thesis 3.1 and figure 1.

    Bel(x_t) = eta p(o_t | x_t) integral p(x_t | x_t-1, a_t-1) Bel(x_t-1) dx_t-1

A localizer holds choices and no state; `step` takes a state and a frame and gives the next state and a
record of everything that happened. Truth is no part of a frame, so it cannot get in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from .belief import Belief, effective_sample_size, normalize, uniform_log_weights
from .estimate import heaviest_cluster, weighted_mean
from .library import Library
from .motion import MotionModel, motion_model
from .policies import ResamplePolicy, always
from .randomness import Domain, Purpose, normals, stream
from .records import FilterState, StepRecord
from .resampling import RESAMPLERS, Resampler
from .selection import NearestReference, nearest_reference
from .sensor import DEFAULT_SHARPNESS, FEATURES, SensorModel, SensorParameters, particle_log_likelihood
from .session import Frame, Moment, Session
from .start import anywhere, at_pose
from .typing import F32, F64, I32

RESAMPLED = "resampled"
ALL_ZERO = "all weights zero"


@dataclass(frozen=True, slots=True, eq=False)
class Localizer:
    """The choices of one run. The same choices, session and seed give the same records."""

    library: Library
    reference: NearestReference
    motion: MotionModel
    sensor: SensorModel
    resampler: Resampler
    resample_when: ResamplePolicy = always
    particles: int = 2000
    seed: int = 0

    def start(self, pose: F64 | None) -> FilterState:
        """Begin at a known pose (3,) in the map's frame, or anywhere for None."""
        if pose is not None:
            return FilterState(0, at_pose(pose, self.particles, self.library.origin))
        rng = stream(Domain.FILTER, self.seed, 0, Purpose.START)
        return FilterState(0, anywhere(self.reference.grid, self.particles, self.library.origin, rng))

    def step(self, state: FilterState, frame: Frame) -> tuple[FilterState, StepRecord]:
        """Take in one frame; the state that was given is left as it was."""
        took: dict[str, float] = {}
        with _timed(took, "predict"):
            predicted = self._predict(state.belief, frame)
        with _timed(took, "measure"):
            descriptors = self.sensor.measure(frame.image)
            sighting = self.sensor.sight(descriptors, predicted.poses)
        with _timed(took, "weight"):
            weighted, log_evidence = weigh(predicted, particle_log_likelihood(sighting))
        with _timed(took, "estimate"):
            estimate = heaviest_cluster(weighted, state.injected)
            mean = weighted_mean(weighted, state.injected)
        with _timed(took, "resample"):
            belief, parents = self._resample(weighted, frame.step)
        record = StepRecord(
            frame=frame,
            predicted=predicted,
            sighting=sighting,
            weighted=weighted,
            estimate=estimate,
            mean=mean,
            effective_sample_size=effective_sample_size(weighted.log_weights),
            log_evidence=log_evidence,
            parents=parents,
            injected=None,
            belief=belief,
            events=_events(log_evidence, parents),
            took_s=took,
        )
        return FilterState(frame.step, belief), record

    def _predict(self, belief: Belief, frame: Frame) -> Belief:
        rng = stream(Domain.FILTER, self.seed, frame.step, Purpose.MOTION)
        poses: F32 = belief.poses
        # a generator a movement, so that a larger N keeps a smaller one's draws in all of them
        for motion, own in zip(frame.motions, rng.spawn(len(frame.motions)), strict=True):
            poses = self.motion.move(poses, belief.origin, motion, normals(own, belief.size))
        return Belief(poses, belief.log_weights, belief.origin)

    def _resample(self, weighted: Belief, step: int) -> tuple[Belief, I32 | None]:
        if not self.resample_when(weighted):
            return weighted, None
        rng = stream(Domain.FILTER, self.seed, step, Purpose.RESAMPLE)
        parents = self.resampler(weighted.weights, weighted.size, rng)
        copies = weighted.poses.take(parents, axis=0)
        return Belief(copies, uniform_log_weights(len(parents)), weighted.origin), parents


def weigh(predicted: Belief, log_likelihood: F32) -> tuple[Belief, float]:
    """Multiply likelihoods (N,) into the weights; give the new belief and log p(o_t | past).

    When every weight would be zero (all particles with any weight are outside free space) the picture is
    taken as uninformative: the prior weights stay, and the evidence is -inf, which the step reports as the
    event "all weights zero".
    """
    posterior, log_evidence = normalize(predicted.log_weights + log_likelihood)
    if not np.isfinite(log_evidence):
        return predicted, -np.inf
    return Belief(predicted.poses, posterior, predicted.origin), log_evidence


def _events(log_evidence: float, parents: I32 | None) -> tuple[str, ...]:
    zero = () if np.isfinite(log_evidence) else (ALL_ZERO,)
    return zero if parents is None else (*zero, RESAMPLED)


@contextmanager
def _timed(took: dict[str, float], stage: str) -> Iterator[None]:
    began = perf_counter()
    yield
    took[stage] = perf_counter() - began


def make_localizer(
    library: Library,
    session: Session,
    *,
    reference: NearestReference | None = None,
    feature: str = "blended",
    particles: int = 2000,
    seed: int = 0,
    resampler: str = "systematic",
    sharpness: float = DEFAULT_SHARPNESS,
    motion: Mapping[str, Any] | None = None,
) -> Localizer:
    """Put together the localizer for a session from names; the robot's own motion model is used.

    `motion` holds motion parameters, named as in a header, that take the place of the session's own.

    `reference`, the library's tables, can be shared among localizers: they take a while to build.

    Raises KeyError for an unknown feature or resampler, ValueError for bad motion parameters.
    """
    reference = reference or nearest_reference(library.poses, library.arena)
    parameters = SensorParameters(FEATURES[feature], sharpness)
    return Localizer(
        library=library,
        reference=reference,
        motion=motion_model(motion or session.info.motion, reference.grid),
        sensor=SensorModel(library, reference, parameters),
        resampler=RESAMPLERS[resampler],
        particles=particles,
        seed=seed,
    )


def run(localizer: Localizer, session: Session, start: F64 | None) -> Iterator[tuple[Moment, StepRecord]]:
    """Go through a session a step at a time. The filter gets frames; truth passes by beside it."""
    state = localizer.start(start)
    for moment in session.moments():
        state, record = localizer.step(state, moment.frame)
        yield moment, record
