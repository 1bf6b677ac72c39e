"""Monte Carlo localization, one picture at a time: propose, measure, weight, estimate, resample, recover.

    Bel(x_t) = eta p(o_t | x_t) integral p(x_t | x_t-1, a_t-1) Bel(x_t-1) dx_t-1

This is section 3.1 and figure 1 of the thesis. A localizer holds choices and no state: `step` takes a state
and a frame and returns the next state and a record of the update. A frame does not contain the true pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Literal

import numpy as np

from ..sensor.ahead import Compared
from ..sensor.model import SensorModel
from ..sensor.references import NearestReference
from ..values.arrays import F64
from ..values.geometry import wrap
from ..values.library import USUAL, Library, Radii
from ..values.map import SOLID, Arena
from ..values.randomness import Domain, Purpose, normals, stream
from ..values.records import (
    Belief,
    Comparison,
    Estimate,
    FilterState,
    RecoveryState,
    StepRecord,
    effective_sample_size,
)
from ..values.session import Frame, Moment, Session, expect_frame
from .estimate import estimates
from .motion import MotionModel, MotionOutliers, keep_in, motion_model
from .proposal import (
    MotionProposal,
    Prediction,
    Proposal,
    ProposedParticles,
    Regions,
    belief_at,
    uniform_belief,
)
from .recovery import DRAWS_EVENLY, DRAWS_NEVER, DRAWS_WHERE_LIKELY, Expansion, Recovery, RecoveryStep, none
from .resampling import Resampled, Resampling
from .weighting import Weighting, usable_evidence

RESAMPLED = "resampled"
RESEEDED = "reseeded"
EXPANDED = "expanded"
ALL_ZERO = "all weights zero"
GUIDED = "guided"
LEFT_MAP = "left the map"
NO_NUMBER = "likelihood is no number"  # of a particle in free space: a channel measures NaN
NO_OUTLIERS = MotionOutliers()
BY_MOTION = MotionProposal()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
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
    proposal: Proposal = BY_MOTION
    outliers: MotionOutliers = NO_OUTLIERS
    obstacles: str = SOLID  # of the library's map: `map.OBSTACLES`
    particles: int = 2000
    start_sd: tuple[float, float] = (0.0, 0.0)  # m along x and y, and rad, about the pose where all begin
    seed: int = 0
    radii: Radii = USUAL  # by which the cloud is summarized, and the run judged

    def __repr__(self) -> str:
        """Return what it is, in a line."""
        return f"Localizer({self.particles} particles, {', '.join(self.sensor.names)}, seed {self.seed})"

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
        prediction = self.predict(state.belief, frame)
        proposed = self.proposal.propose(prediction, comparison, state.past)
        watch.lap("propose")
        weighting = self._weigh(proposed, comparison)
        left = weighting.is_outside and self._is_inside(state.belief)
        if left:
            weighting = self._kept_in(prediction, comparison)
        watch.lap("weight")
        both = estimates(weighting.belief, self.radii)
        watch.lap("estimate")
        recovery = self._decide(weighting, left, state.recovery)
        resampled = self.resample(weighting.belief, recovery, frame.step)
        watch.lap("resample")
        recovered = self.recover(resampled, recovery, comparison, frame.step)
        watch.lap("recover")
        record = _record(frame, weighting, left, both, recovery, recovered, watch.took_s)
        past = self.proposal.keep(record, weighting.proposed.movement, state.past)
        return FilterState(frame.step, recovered.belief, recovery.state, past), record

    @property
    def arena(self) -> Arena:
        """The map by which poses are ruled out: the library's, with or without its obstacles."""
        return self.library.arena.trusted(self.obstacles)

    @property
    def draws_new(self) -> str | None:
        """Where it draws new particles: DRAWS_NEVER or another; None: it spreads those that it has."""
        if isinstance(self.recovery.strategy, Expansion):
            return None
        if self.recovery.strategy is none:
            return DRAWS_NEVER if self.proposal.mixture is None else DRAWS_WHERE_LIKELY
        return DRAWS_EVENLY if self.recovery.draw_evenly else DRAWS_WHERE_LIKELY

    def predict(self, belief: Belief, frame: Frame) -> Prediction:
        """Return how the particles of a belief move in a frame."""
        return Prediction(belief, frame, self.motion, self.outliers, self.seed)

    def _weigh(self, proposed: ProposedParticles, comparison: Comparison) -> Weighting:
        return Weighting.of(proposed, self.sensor.at(comparison, proposed.belief.poses))

    def _kept_in(self, prediction: Prediction, comparison: Comparison) -> Weighting:
        """Weigh particles that would all drive out of the map where they were: each turns by itself."""
        # not those that were proposed: a mixture changes which particle is which
        return self._weigh(ProposedParticles(keep_in(prediction.before, prediction.belief)), comparison)

    def _is_inside(self, belief: Belief) -> bool:
        """Return whether a particle with any weight is in free space."""
        inside = self.reference.entries(belief.poses, belief.origin) >= 0
        return bool((inside & np.isfinite(belief.log_weights)).any())

    def _decide(self, weighting: Weighting, left: bool, before: RecoveryState) -> Recovery:
        """Ask the recovery strategy, unless no picture tells whether the cloud is lost."""
        if not (left or weighting.references_speak()):
            return Recovery(0.0, before)
        comparison = weighting.sighting.comparison
        evidence = self.recovery.evidence(weighting.evidence, weighting.log_evidence, comparison)
        return self.recovery.strategy(usable_evidence(evidence, left), before)

    def resample(self, weighted: Belief, recovery: Recovery, step: int) -> Resampled:
        """Copy particles by weight, with room for those that recovery draws, where anything requires it."""
        count = round(recovery.share * weighted.size) or recovery.expand
        if not count and not self.resampling.when(weighted, step):
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


def _record(
    frame: Frame,
    weighting: Weighting,
    left: bool,
    both: tuple[Estimate, Estimate],
    recovery: Recovery,
    recovered: Resampled,
    took_s: Mapping[str, float],
) -> StepRecord:
    happened = {
        GUIDED: weighting.proposed.is_guided,
        LEFT_MAP: left,
        NO_NUMBER: weighting.is_broken and not left,
        ALL_ZERO: not np.isfinite(weighting.log_evidence),
        RESAMPLED: recovered.parents is not None,
        RESEEDED: recovered.injected is not None,
        EXPANDED: recovery.expand,
    }
    return StepRecord(
        frame=frame,
        predicted=weighting.proposed.belief,
        sighting=weighting.sighting,
        weighted=weighting.belief,
        estimate=both[0],
        mean_estimate=both[1],
        effective_sample_size=effective_sample_size(weighting.belief.log_weights),
        log_evidence=weighting.log_evidence,
        calibrated_evidence=weighting.evidence,
        channel_evidence=weighting.by_channel,
        parents=recovered.parents,
        injected=recovered.injected,
        belief=recovered.belief,
        events=tuple(event for event, true in happened.items() if true),
        took_s=took_s,
        recovery_test=recovery.test,
        library_evidence=weighting.sighting.comparison.library_evidence,
    )


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
    Raises ValueError for bad motion parameters in the header, and for a map without free space to start in;
    InputError for a frame of another shape or kind, a number that is not finite, and a repeated step.

        >>> import maurice_mcl as mcl
        >>> steps = list(mcl.run(mcl.make_localizer(mcl.tiny_library(), particles=100), mcl.tiny_session()))
        >>> len(steps), steps[0][1].estimate.pose.shape
        (6, (3,))
    """
    localizer = localizer.of_session(session)
    state = localizer.initialize(session.info.start if isinstance(start, str) else start)
    before = None
    for moment in session.moments():
        expect_frame(moment, before)
        state, record = localizer.step(state, moment.frame)
        before = moment.frame
        yield moment, record
