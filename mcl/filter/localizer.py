"""Monte Carlo localization, one picture at a time: propose, measure, weight, estimate, resample, recover.

    Bel(x_t) = eta p(o_t | x_t) integral p(x_t | x_t-1, a_t-1) Bel(x_t-1) dx_t-1

This is section 3.1 and figure 1 of the thesis. A localizer holds choices and no state: `step` takes a state
and a frame and returns the next state and a record of the update. A frame does not contain the true pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Literal

import numpy as np

from ..errors import InputError
from ..sensor.ahead import Compared
from ..sensor.model import SensorModel
from ..sensor.references import NearestReference
from ..values.arrays import F32, F64
from ..values.geometry import wrap
from ..values.library import USUAL, Library, Radii
from ..values.map import SOLID, Arena
from ..values.randomness import Domain, Purpose, normals, normals_at, stream, words_at
from ..values.records import (
    Belief,
    Comparison,
    FilterState,
    Past,
    Sighting,
    StepRecord,
    effective_sample_size,
    normalize,
)
from ..values.session import Frame, Moment, Session
from .estimate import entry_weights, estimates, log_mean_likelihood
from .guided_motion import DrawnNoise, GuidedMotionParameters, guided_motion
from .motion import MotionModel, MotionOutliers, keep_in, measured_motion, motion_model, widths, with_outliers
from .past import KEPT, kept, movement_of, unexplained
from .proposal import (
    MixtureParameters,
    ProposedParticles,
    Regions,
    belief_at,
    mixture_proposal,
    uniform_belief,
)
from .recovery import Recovery, RecoveryStep
from .resampling import Resampled, Resampling
from .sensor_proposal import can_propose, elsewhere, proposals_of, tracked

RESAMPLED = "resampled"
RESEEDED = "reseeded"
EXPANDED = "expanded"
ALL_ZERO = "all weights zero"
GUIDED = "guided"
LEFT_MAP = "left the map"
NO_NUMBER = "likelihood is no number"  # of a particle in free space: a channel measures NaN
KNOWN_SHARE = 0.5  # share of the weight that references have to speak for before recovery decides
TRACKED_M = 0.3  # on a map, whose places are no references: see `Localizer.tracked_m`
NO_OUTLIERS = MotionOutliers()
USUALLY_GUIDED = GuidedMotionParameters()


@dataclass(frozen=True, slots=True, eq=False)
class Localizer:
    """The choices of one filter. The same choices, session and seed give the same records, bit for bit.

    Make one with `maurice_mcl.make_localizer`; run it over a session with `maurice_mcl.run`.

        >>> import maurice_mcl as mcl
        >>> localizer = mcl.make_localizer(mcl.tiny_library(), particles=100)
        >>> localizer.initialize(None).belief.poses.shape
        (100, 3)
    """

    library: Library
    reference: NearestReference
    regions: Regions
    motion: MotionModel | None  # None: that of the session which `run` is given
    sensor: SensorModel
    resampling: Resampling
    recovery: RecoveryStep
    mixture: MixtureParameters | None = None  # None: all particles are proposed by the motion model
    outliers: MotionOutliers = NO_OUTLIERS
    guided: GuidedMotionParameters = USUALLY_GUIDED
    obstacles: str = SOLID  # of the library's map: `map.OBSTACLES`
    particles: int = 2000
    start_sd: tuple[float, float] = (0.0, 0.0)  # m along x and y, and rad, about the pose where all begin
    seed: int = 0
    radii: Radii = USUAL  # by which the cloud is summarized, and the run judged

    def of_session(self, session: Session) -> Localizer:
        """Return a localizer with the motion model of a session's header, if it has none."""
        if self.motion is not None:
            return self
        return replace(self, motion=motion_model(session.info.motion, self.reference.grid))

    def initialize(self, pose: F64 | None) -> FilterState:
        """Return the state before the first frame: all at a pose (3,) in the map's frame, or anywhere."""
        if pose is not None:
            belief = belief_at(pose, self.particles, self.library.origin)
            return FilterState(0, self._spread(belief) if any(self.start_sd) else belief)
        rng = self._rng(0, Purpose.INITIALIZATION)
        return FilterState(0, uniform_belief(self.reference.grid, self.particles, self.library.origin, rng))

    def _spread(self, belief: Belief) -> Belief:
        """Spread particles about the pose at which they are, by the standard deviations of the start."""
        sd_m, sd_rad = self.start_sd
        noise = normals(self._rng(0, Purpose.INITIALIZATION), belief.size)
        poses = belief.poses + noise * np.array([sd_m, sd_m, sd_rad], np.float32)
        poses[:, 2] = wrap(poses[:, 2])
        return replace(belief, poses=np.asfortranarray(poses))

    def step(
        self, state: FilterState, frame: Frame, compared: Compared | None = None
    ) -> tuple[FilterState, StepRecord]:
        """Process one frame; return the next state and a record. The given state is not changed.

        `compared` is what the sensor model made of the frame, where it did so ahead of the filter.
        Raises InputError for a localizer without a motion model: see `of_session`.
        """
        watch = _Watch()
        comparison = self.sensor.see(frame) if compared is None else compared.comparison
        watch.lap("measure", 0.0 if compared is None else compared.took_s)
        proposal = self.propose(state.belief, frame, comparison, state.past)
        watch.lap("propose")
        sighting = self.sensor.at(comparison, proposal.belief.poses)
        weighted, log_evidence = weigh(proposal, sighting.log_likelihood)
        broken = log_evidence == -np.inf and bool(np.isnan(sighting.log_likelihood).any())
        left = log_evidence == -np.inf and not broken and self._is_inside(state.belief)
        if left:
            # of every particle its own turn, which a mixture has mixed
            predicted = self._predict(state.belief, frame)
            proposal = ProposedParticles(keep_in(state.belief, predicted))
            sighting = self.sensor.at(comparison, proposal.belief.poses)
            weighted, log_evidence = weigh(proposal, sighting.log_likelihood)
        evidence, by_channel = calibrated_evidence(proposal, sighting)
        watch.lap("weight")
        estimate, mean_estimate = estimates(weighted, self.radii)
        watch.lap("estimate")
        recovery = Recovery(0.0, state.recovery)
        if left or references_speak(proposal, sighting):
            given = self.recovery.evidence(evidence, log_evidence, comparison)
            recovery = self.recovery.strategy(usable_evidence(given, left), state.recovery)
        resampled = self.resample(weighted, recovery, frame.step)
        watch.lap("resample")
        recovered = self.recover(resampled, recovery, comparison, frame.step)
        watch.lap("recover")
        record = StepRecord(
            frame=frame,
            predicted=proposal.belief,
            sighting=sighting,
            weighted=weighted,
            estimate=estimate,
            mean_estimate=mean_estimate,
            effective_sample_size=effective_sample_size(weighted.log_weights),
            log_evidence=log_evidence,
            calibrated_evidence=evidence,
            channel_evidence=by_channel,
            parents=recovered.parents,
            injected=recovered.injected,
            belief=recovered.belief,
            events=_events(proposal.is_guided, left, broken, log_evidence, recovery, recovered),
            took_s=watch.took_s,
            recovery_test=recovery.test,
            library_evidence=comparison.library_evidence,
        )
        known = kept(frame, comparison, proposal.belief, proposal.movement, estimate.pose, state.past)
        past = (known, *state.past)[:KEPT]
        return FilterState(frame.step, recovered.belief, recovery.state, past), record

    @property
    def arena(self) -> Arena:
        """The map by which poses are ruled out: the library's, with or without its obstacles."""
        return self.library.arena.trusted(self.obstacles)

    @property
    def is_guided(self) -> bool:
        """Whether sensors propose poses, and particles follow them."""
        return self.guided.share > 0 and can_propose(self.sensor.sensors.values())

    @property
    def tracked_m(self) -> float:
        """How near to where a sensor puts the robot a cloud is that tracks it, in meters."""
        return TRACKED_M if self.library.is_map else self.reference.spacing_m

    def remembered(
        self, belief: Belief, frame: Frame, comparison: Comparison, estimate: F64, past: Sequence[Past]
    ) -> Past:
        """Return what `step` kept of an update: of a run that is known by its clouds and estimates (3,)."""
        predicted, follows = self._predict(belief, frame), self.mixture is not None or self.is_guided
        movement = movement_of(unexplained(comparison, predicted), frame, past) if follows else None
        return kept(frame, comparison, predicted, movement, estimate, past)

    def propose(
        self, belief: Belief, frame: Frame, comparison: Comparison, past: Sequence[Past] = ()
    ) -> ProposedParticles:
        """Move the particles: by the motion model, or as a sensor measures it where they do not explain it.

        With a mixture some are drawn from the picture's likelihood; where a sensor proposes poses, from those
        where the cloud is not. Toward one that the cloud tracks some particles move.
        """
        predicted = self._predict(belief, frame)
        if self.mixture is None and not self.is_guided:
            return ProposedParticles(predicted)
        can_follow, asked = can_propose(self.sensor.sensors.values()), unexplained(comparison, predicted)
        if can_follow and not asked:
            return ProposedParticles(predicted)
        movement = movement_of(asked, frame, past)
        motions, link = frame.motions, 0.0
        if movement is not None:
            motions, link = movement.motion[None], movement.link
            if movement.is_linked:
                noise = self._normals(frame, belief.size)[: belief.size]
                predicted = replace(belief, poses=measured_motion(belief.poses, movement, noise))
        proposals = proposals_of(comparison, predicted, motions, link, past)
        if can_follow and not proposals:
            return ProposedParticles(predicted, movement=movement)
        there = elsewhere(proposals, predicted, self.tracked_m) if can_follow else proposals
        if self.mixture is not None and (there or not can_follow):
            likely, rng = comparison.log_likelihood, self._rng(frame.step, Purpose.MIXTURE)
            nearest, places = self.reference, self.regions
            mixed = mixture_proposal(predicted, likely, nearest, places, self.mixture, rng, there)
            return replace(mixed, movement=movement)
        near = tracked(proposals, predicted, self.tracked_m)
        if near is None or not self.is_guided or not len(frame.motions):
            return ProposedParticles(predicted, movement=movement)
        return replace(self._guided(belief, replace(frame, motions=motions), *near), movement=movement)

    def _guided(self, belief: Belief, frame: Frame, pose: F64, covariance: F64) -> ProposedParticles:
        """Move the particles, some of them toward a pose in the map's frame."""
        drawn, rng = self._drawn(frame, belief.size), self._rng(frame.step, Purpose.GUIDE)

        def move(number: int, poses: F32, noise: F32) -> F32:
            return self._moved(poses, belief.origin, frame.motions[number], noise)

        there = pose - [*belief.origin, 0.0]
        poses, correction = guided_motion(
            belief.poses, move, drawn, there, covariance, self.guided.share, rng
        )
        return ProposedParticles(Belief(poses, belief.log_weights, belief.origin), correction, is_guided=True)

    def _predict(self, belief: Belief, frame: Frame) -> Belief:
        if not len(frame.motions):
            return belief
        noise = self._normals(frame, belief.size)
        if self.outliers.share > 0:
            noise = with_outliers(noise, self.outliers, *self._outlier_rngs(frame))
        poses = belief.poses
        for motion, drawn in zip(frame.motions, _by_movement(noise, belief.size), strict=True):
            poses = self._moved(poses, belief.origin, motion, drawn)
        return Belief(poses, belief.log_weights, belief.origin)

    def _normals(self, frame: Frame, n: int) -> F32:
        """Return standard normals (M N, 3), one movement after another.

        Each has a generator of its own, so that a larger N keeps the draws of a smaller one.
        """
        address, movements = (Domain.FILTER, self.seed, frame.step, Purpose.MOTION), range(len(frame.motions))
        return normals_at([words_at(*address, number) for number in movements], n)

    def _outlier_rngs(self, frame: Frame) -> list[np.random.Generator]:
        """Return what chooses the motion outliers of each movement."""
        return [self._rng(frame.step, Purpose.OUTLIER, number) for number in range(len(frame.motions))]

    def _moved(self, poses: F32, origin: F64, motion: F64, noise: F32) -> F32:
        """Return poses (N, 3) after a movement (3,), with the noise (N, 3) of each."""
        if self.motion is None:
            raise InputError(None, "found no motion model; use `run`, or `of_session` before the first step")
        return self.motion.move(poses, origin, motion, noise)

    def _drawn(self, frame: Frame, n: int) -> DrawnNoise:
        """Return the noise that `_predict` draws, and how much of it is that of outliers."""
        drawn = np.concatenate(_by_movement(self._normals(frame, n), n), axis=1, dtype=np.float64)
        wide = [widths(n, self.outliers, rng) for rng in self._outlier_rngs(frame)]
        return DrawnNoise(drawn, np.repeat(np.stack(wide, axis=1), 3, axis=1))

    def _is_inside(self, belief: Belief) -> bool:
        """Return whether a particle with any weight is in free space."""
        inside = self.reference.entries(belief.poses, belief.origin) >= 0
        return bool((inside & np.isfinite(belief.log_weights)).any())

    def resample(self, weighted: Belief, recovery: Recovery, step: int) -> Resampled:
        """Copy particles by weight, with room for those that recovery draws, where anything requires it."""
        needed = round(recovery.share * weighted.size) or recovery.expand
        if not needed and not self.resampling.when(weighted, step):
            return Resampled(weighted)
        return self.resampling.copies(weighted, recovery.share, lambda purpose: self._rng(step, purpose))

    def recover(
        self, resampled: Resampled, recovery: Recovery, comparison: Comparison, step: int
    ) -> Resampled:
        """Spread the cloud, or draw fresh particles, as the recovery strategy decided."""
        if recovery.expand:  # roughening uses the first numbers of this address
            resampled = self.recovery.expand(resampled, self._rng(step, Purpose.ROUGHEN, 0))
        if not resampled.missing:
            return resampled
        return self.recovery.inject(resampled, comparison, self._rng(step, Purpose.INJECT))

    def _rng(self, step: int, purpose: int, child: int | None = None) -> np.random.Generator:
        return stream(Domain.FILTER, self.seed, step, purpose, child)


def weigh(proposal: ProposedParticles, log_likelihood: F32) -> tuple[Belief, float]:
    """Multiply likelihoods (N,) into the weights; return the new belief and log p(o_t | past).

    If every weight would be zero, the prior weights are kept and the evidence is -inf: no particle with any
    weight is in free space.
    """
    posterior, log_evidence = normalize(proposal.prior_log_weights + log_likelihood)
    if not np.isfinite(log_evidence):
        return proposal.belief, -np.inf
    return Belief(proposal.belief.poses, posterior, proposal.belief.origin), log_evidence


def references_speak(proposal: ProposedParticles, sighting: Sighting) -> bool:
    """Return whether references speak for half of the cloud: else a picture does not tell that it is lost."""
    if sighting.known is None:
        return True
    weights = np.exp(proposal.prior_log_weights)
    return float(weights @ sighting.known) >= KNOWN_SHARE * float(weights.sum())


def calibrated_evidence(proposal: ProposedParticles, sighting: Sighting) -> tuple[float, F64]:
    """Return the log mean of exp(-cost) over the proposed particles: of all sensors, of each channel (C,)."""
    comparison, prior, known = sighting.comparison, proposal.prior_log_weights, sighting.known
    if not comparison.channels and known is None and sighting.sensed is not None:
        inside = np.exp(prior + sighting.sensed).compress(sighting.entries >= 0)  # no reference says anything
        total = inside.sum()
        return float(np.log(total)) if total else -np.inf, np.zeros(0)
    weights = entry_weights(np.exp(prior), sighting.entries, len(comparison.cost), known)
    by_channel = log_mean_likelihood(comparison.channels_explained, weights)
    if sighting.sensed is not None:
        weights = entry_weights(
            np.exp(prior + sighting.sensed), sighting.entries, len(comparison.cost), known
        )
    return float(log_mean_likelihood(comparison.explained_by_channels, weights)[0]), by_channel


def usable_evidence(evidence: float, left: bool) -> float:
    """Return what recovery is told: -inf where the cloud left the map, or the evidence is no number."""
    return -np.inf if left or np.isnan(evidence) else evidence


def _by_movement(noise: F32, n: int) -> list[F32]:
    """Split noise (M N, 3) into that of each movement (N, 3)."""
    return [noise[first : first + n] for first in range(0, len(noise), n)]


def _events(
    guided: bool, left: bool, broken: bool, log_evidence: float, recovery: Recovery, recovered: Resampled
) -> tuple[str, ...]:
    happened = {
        GUIDED: guided,
        LEFT_MAP: left,
        NO_NUMBER: broken,
        ALL_ZERO: not np.isfinite(log_evidence),
        RESAMPLED: recovered.parents is not None,
        RESEEDED: recovered.injected is not None,
        EXPANDED: recovery.expand,
    }
    return tuple(event for event, true in happened.items() if true)


@dataclass(slots=True)
class _Watch:
    """How long the stages of a step took."""

    began: float = field(default_factory=perf_counter)  # of the stage
    took_s: dict[str, float] = field(default_factory=dict)

    def lap(self, stage: str, before_s: float = 0.0) -> None:
        """End a stage, which took some seconds before, too."""
        now = perf_counter()
        self.took_s[stage], self.began = before_s + now - self.began, now


def run(
    localizer: Localizer, session: Session, start: F64 | Literal["header"] | None = "header"
) -> Iterator[tuple[Moment, StepRecord]]:
    """Run a filter over a session, one update at a time, without showing it the true poses.

    `start` is the pose (3,) to begin at (x_m, y_m, heading_rad), or None to spread the particles over all
    free space; by default it is the session header's, or None where the header has none. A localizer without
    a motion model takes the one that the header describes. Yields each moment with the record of its update.
    Raises ValueError for bad motion parameters in the header, and for a map without free space to start in.

        >>> import maurice_mcl as mcl
        >>> steps = list(mcl.run(mcl.make_localizer(mcl.tiny_library(), particles=100), mcl.tiny_session()))
        >>> len(steps), steps[0][1].estimate.pose.shape
        (6, (3,))
    """
    localizer = localizer.of_session(session)
    state = localizer.initialize(session.info.start if isinstance(start, str) else start)
    for moment in session.moments():
        state, record = localizer.step(state, moment.frame)
        yield moment, record
