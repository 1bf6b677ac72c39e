"""R independent runs of one filter, all of N particles, stepped as one array.

A step of a run in which something rare happens (all weights zero, fresh particles, a cloud that is wider than
a hundred radii) is taken by `Localizer.step` instead: batches do only what nearly always happens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sensor.ahead import Compared
from ..sensor.references import InterpolatedReference
from ..values.arrays import F32, F64, I32, U64, Bool
from ..values.randomness import Domain, Purpose, address_words, generator, normals_at
from ..values.records import Belief, Comparison, FilterState, RecoveryState, StepRecord, uniform_log_weights
from ..values.session import Frame
from .estimate import Clouds, are_wide, batch_estimates
from .localizer import Localizer
from .motion import with_outliers
from .proposal import MotionProposal
from .resampling import Resampler, always, systematic

BLOCK_PARTICLES = 32_768  # stepped at once: with fewer, numpy's calls cost more than a full cache
MOST_PARTICLES = 4096  # of a run: with more, its own passes cost more than numpy's calls
BLOCK_STEPS = 64  # for which addresses of random numbers are made at once

Runs = NDArray[np.intp]  # (r,) some of the R runs, by number
Put = Callable[[Runs, dict[str, NDArray[Any]]], None]  # runs, and what was found in each
PutRecord = Callable[[int, StepRecord], None]


def can_batch(localizer: Localizer) -> bool:
    """Return whether every choice of a filter is one that batches know."""
    resampling = localizer.resampling
    known = isinstance(localizer.proposal, MotionProposal) and not localizer.sensor.references.is_partial
    known = known and resampling.kld is None and resampling.roughening <= 0
    return known and localizer.particles <= MOST_PARTICLES and localizer.motion is not None


@dataclass(slots=True, eq=False)
class Batch:
    """The states of R runs, column by column, and the seeds they are drawn from."""

    localizer: Localizer
    seeds: Sequence[int]
    poses: F32  # (3, R, N)
    log_weights: F64  # (R, N)
    recovery: list[RecoveryState]  # (R,)
    step: int = 0  # of the last frame
    addresses: dict[tuple[int, int | None], tuple[int, U64]] = field(default_factory=dict)

    @classmethod
    def begin(cls, localizer: Localizer, seeds: Sequence[int], states: Sequence[FilterState]) -> Batch:
        """Begin every run in its state; all clouds have the localizer's number of particles."""
        poses = np.stack([state.belief.poses.T for state in states], axis=1)
        log_weights = np.stack([state.belief.log_weights for state in states])
        recovery = [state.recovery for state in states]
        return cls(localizer, seeds, poses, log_weights, recovery, states[0].step)

    def advance(self, frame: Frame, comparison: Comparison, put: Put, put_record: PutRecord) -> None:
        """Process one frame in every run, and hand over what was found."""
        count, particles = self.log_weights.shape
        references, values = self.localizer.sensor.references, None
        if isinstance(references, InterpolatedReference) and references.pays_for(self.log_weights.size):
            values = references.at_headings(comparison.of_references)
        group = max(BLOCK_PARTICLES // particles, 1)
        for first in range(0, count, group):
            rows = slice(first, min(first + group, count))
            self._advance_some(rows, frame, comparison, values, put, put_record)
        self.step = frame.step

    def _advance_some(
        self,
        rows: slice,
        frame: Frame,
        comparison: Comparison,
        values: F32 | None,
        put: Put,
        put_record: PutRecord,
    ) -> None:
        """Process one frame in some runs: the steps of `Localizer.step`, with one row for each run."""
        runs, prior = np.arange(rows.start, rows.stop), self.log_weights[rows]
        moved = self._moved(rows, frame)
        entries, likelihood = self._looked_up(moved, comparison, values)
        sensed = self.localizer.sensor.sense_at(comparison, moved.reshape(3, -1).T, moved.shape[1])
        if sensed is not None:
            sensed = sensed.reshape(moved.shape[1:])
            likelihood = likelihood + np.float32(self.localizer.sensor.parameters.sharpness) * sensed
        posterior = prior + likelihood
        usual = np.isfinite(posterior.max(axis=1))
        if not usual.all():
            self._alone(runs[~usual], frame, comparison, put_record)
            runs, moved, entries, posterior = runs[usual], moved[:, usual], entries[usual], posterior[usual]
            prior = prior[usual]
            sensed = None if sensed is None else sensed[usual]
        if not len(runs):
            return
        prior = prior if sensed is None else prior + sensed
        evidence = self._evidence(np.exp(prior), entries, comparison)
        log_evidence = _normalize(posterior)
        clouds = Clouds.of(moved, np.exp(posterior), self.localizer.library.origin)
        recovery_evidence = evidence
        if self.localizer.recovery.is_relative:
            recovery_evidence = log_evidence - comparison.library_likelihood
        acts, states = self._recoveries(runs, recovery_evidence)
        odd = acts | are_wide(clouds, self.localizer.radii.cluster_m)
        if odd.any():
            self._alone(runs[odd], frame, comparison, put_record)
            usual, clouds = ~odd, clouds.some(~odd)
            runs, moved, posterior = runs[usual], moved[:, usual], posterior[usual]
            evidence, log_evidence = evidence[usual], log_evidence[usual]
            states = [state for state, odd_run in zip(states, odd, strict=True) if not odd_run]
        if len(runs):
            numbers = batch_estimates(clouds, self.localizer.radii)
            numbers |= {"log_evidence": log_evidence, "calibrated_evidence": evidence}
            numbers["effective_sample_size"] = 1.0 / np.exp(2 * posterior).sum(axis=1)
            numbers |= self._resampled(runs, moved, posterior, clouds.weights, frame.step)
            for run, state in zip(runs.tolist(), states, strict=True):
                self.recovery[run] = state
            put(runs, numbers)

    def _moved(self, rows: slice, frame: Frame) -> F32:
        """Return the poses (3, r, N) after every movement of a frame."""
        localizer, particles = self.localizer, self.log_weights.shape[1]
        assert localizer.motion is not None, "see can_batch"
        poses: F32 = self.poses[:, rows].reshape(3, -1).T
        for number, motion in enumerate(frame.motions):
            noise = normals_at(self._words(frame.step, Purpose.MOTION, number)[rows], particles)
            if localizer.outliers.share > 0:
                rngs = map(generator, self._words(frame.step, Purpose.OUTLIER, number)[rows])
                noise = with_outliers(noise, localizer.outliers, *rngs)
            poses = localizer.motion.move(poses, localizer.library.origin, motion, noise)
        return poses.T.reshape(3, -1, particles)

    def _looked_up(self, moved: F32, comparison: Comparison, values: F32 | None) -> tuple[I32, F32]:
        """Return the nearest entry and the log-likelihood of every particle, (r, N) each."""
        references, nearest = self.localizer.sensor.references, self.localizer.reference
        poses, shape = moved.reshape(3, -1).T, moved.shape[1:]
        if values is None or not isinstance(references, InterpolatedReference):
            entries, likelihood, _ = references.look(
                comparison.of_references, poses, self.localizer.library.origin
            )
        else:
            cell, heading = nearest.bins_of(poses, self.localizer.library.origin)
            entries = nearest.entries_at(cell, heading)
            likelihood, _ = references.among_places(values.take, cell, heading, entries < 0)
        return entries.reshape(shape), likelihood.reshape(shape)

    def _evidence(self, prior: F64, entries: I32, comparison: Comparison) -> F64:
        """Return the calibrated evidence (r,): `log_mean_likelihood` of every row."""
        bins = len(comparison.cost) + 1
        row = np.arange(len(entries))[:, None] * bins
        shares = np.bincount((entries + 1 + row).ravel(), prior.ravel(), len(entries) * bins)
        explained = comparison.explained_by_channels
        with np.errstate(divide="ignore"):
            mean = np.log(np.vecdot(explained.relative[0], shares.reshape(-1, bins)[:, 1:]))
        return np.asarray(mean + explained.top, np.float64)

    def _recoveries(self, runs: Runs, evidence: F64) -> tuple[Bool, list[RecoveryState]]:
        """Return in which runs recovery acts, and its next states."""
        particles = self.log_weights.shape[1]
        recoveries = [
            self.localizer.recovery.strategy(nats, self.recovery[run])
            for run, nats in zip(runs.tolist(), evidence.tolist(), strict=True)
        ]
        acts = [recovery.expand or round(recovery.share * particles) > 0 for recovery in recoveries]
        return np.array(acts, bool), [recovery.state for recovery in recoveries]

    def _resampled(
        self, runs: Runs, moved: F32, posterior: F64, weights: F64, step: int
    ) -> dict[str, NDArray[Any]]:
        """Resample the runs whose policy asks for it, and keep all as what the next step begins with."""
        particles, resampling = self.log_weights.shape[1], self.localizer.resampling
        origin, beliefs = self.localizer.library.origin, range(len(runs))
        if resampling.when is always:
            copied = np.ones(len(runs), bool)
        else:
            decisions = [resampling.when(Belief(moved[:, k].T, posterior[k], origin), step) for k in beliefs]
            copied = np.array(decisions, bool)
        parents = np.full(len(runs), particles, np.int32)
        if not copied.all():
            others = runs[~copied]
            self.poses[:, others], self.log_weights[others] = moved[:, ~copied], posterior[~copied]
        if copied.any():
            words = self._words(step, Purpose.RESAMPLE)[runs[copied]]
            of = _parents(resampling.scheme, weights[copied], [generator(run_words) for run_words in words])
            parents[copied] = 1 + np.count_nonzero(of[:, 1:] != of[:, :-1], axis=1)
            of += np.flatnonzero(copied)[:, None] * particles
            self.poses[:, runs[copied]] = moved.reshape(3, -1).take(of, axis=1)
            self.log_weights[runs[copied]] = uniform_log_weights(particles)
        return {"parents": parents, "resampled": copied}

    def _alone(self, runs: Runs, frame: Frame, comparison: Comparison, put_record: PutRecord) -> None:
        """Take one step of some runs by the filter itself."""
        for run in runs.tolist():
            belief = Belief(self.poses[:, run].T, self.log_weights[run], self.localizer.library.origin)
            state = FilterState(self.step, belief, self.recovery[run])
            localizer = replace(self.localizer, seed=self.seeds[run])
            state, record = localizer.step(state, frame, Compared(comparison, 0.0))
            self.poses[:, run], self.log_weights[run] = state.belief.poses.T, state.belief.log_weights
            self.recovery[run] = state.recovery
            put_record(run, record)

    def _words(self, step: int, purpose: int, child: int | None = None) -> U64:
        """Return what begins the generators (R, 4) of all runs at an address."""
        block, key = step // BLOCK_STEPS, (purpose, child)
        if self.addresses.get(key, (None,))[0] != block:
            steps = np.arange(block * BLOCK_STEPS, (block + 1) * BLOCK_STEPS)
            self.addresses[key] = block, address_words(Domain.FILTER, self.seeds, steps, purpose, child)
        return self.addresses[key][1][:, step % BLOCK_STEPS]


def _normalize(log_weights: F64) -> F64:
    """Normalize rows (r, N) in place; return the logs of their sums (r,)."""
    top = log_weights.max(axis=1)
    total = top + np.log(np.exp(log_weights - top[:, None]).sum(axis=1))
    log_weights -= total[:, None]
    return np.asarray(total, np.float64)


def _parents(scheme: Resampler, weights: F64, rngs: Sequence[np.random.Generator]) -> NDArray[np.intp]:
    """Return the parents (r, N) in every row that a scheme finds for the row alone."""
    particles = weights.shape[1]
    if scheme is not systematic:
        rows = [scheme(row, particles, rng) for row, rng in zip(weights, rngs, strict=True)]
        return np.stack(rows).astype(np.intp)
    cumulative = weights.cumsum(axis=1)
    cumulative /= cumulative[:, -1:]
    ends = cumulative * particles
    ends -= np.array([rng.random() for rng in rngs])[:, None]
    ends = np.ceil(ends, out=ends).astype(np.intp)
    np.copyto(ends, particles, where=cumulative >= 1.0)
    ends += np.arange(len(ends))[:, None] * (particles + 1)
    ended = np.bincount(ends.ravel(), minlength=len(ends) * (particles + 1))
    return np.asarray(ended.reshape(-1, particles + 1)[:, :-1].cumsum(axis=1))
