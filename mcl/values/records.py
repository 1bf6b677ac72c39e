"""The values of the filter: belief, recovery state, filter state, and the record of one update."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .arrays import F32, F64, I32, Bool
from .library import USUAL, Radii
from .pose_sensor import Sensed
from .session import Frame

# The belief: a weighted cloud of poses, as a value.


@dataclass(frozen=True, eq=False)
class Belief:
    """N weighted particles. Never changed in place.

    Poses are best stored column by column (Fortran order): the filter reads one coordinate of all particles.

    Poses are float32 relative to `origin`, which is float64 (float32 steps are 3 cm at 500 km). Weights are
    stored as logs and sum to one: `exp(log_weights).sum() == 1`.

        >>> import numpy as np, maurice_mcl as mcl
        >>> belief = mcl.Belief(np.zeros((2, 3), np.float32), np.log([0.25, 0.75]), np.array([5.0, 0.0]))
        >>> belief.size, belief.weights.round(2).tolist(), belief.world_poses[0].tolist()
        (2, [0.25, 0.75], [5.0, 0.0, 0.0])
    """

    poses: F32  # (N, 3) x_m, y_m relative to the origin, heading_rad in [-pi, pi)
    log_weights: F64  # (N,) normalized
    origin: F64  # (2,) x_m, y_m in the map's frame

    @property
    def size(self) -> int:
        """The number of particles N."""
        return len(self.poses)

    @cached_property
    def weights(self) -> F64:
        """Normalized weights (N,), each >= 0, summing to one."""
        return np.exp(self.log_weights)

    @property
    def world_poses(self) -> F64:
        """Poses (N, 3) in the map's frame, float64."""
        world = self.poses.astype(np.float64)
        world[:, :2] += self.origin
        return world


def uniform_log_weights(n: int) -> F64:
    """Return n equal normalized log-weights; n may be 0."""
    return np.full(n, -np.log(max(n, 1)))


def normalize(log_weights: F64) -> tuple[F64, float]:
    """Return normalized log-weights and the log of their sum; unchanged and -inf when all are -inf."""
    top = float(log_weights.max())
    if not np.isfinite(top):
        return log_weights, -np.inf
    total = top + float(np.log(np.exp(log_weights - top).sum()))
    return log_weights - total, total


def effective_sample_size(log_weights: F64) -> float:
    """Return 1 / sum(w^2) (Kong, Liu and Wong 1994), between 1 and N, for normalized log-weights (N,)."""
    return float(1.0 / np.exp(2 * log_weights).sum())


# The state of recovery: running averages of how well the cloud explains pictures.


@dataclass(frozen=True, slots=True)
class RecoveryState:
    """Running averages of how well the cloud explains pictures; 0 before the first.

    Each strategy says what it keeps: nats, or logs of averages, which are -inf for an average of zero.

        >>> import maurice_mcl as mcl
        >>> mcl.RecoveryState(updates=3).slow
        0.0
    """

    slow: float = 0.0
    fast: float = 0.0
    spread: float = 0.0  # running mean of the squared deviation of log-likelihoods, nats squared
    updates: int = 0  # since the last reset


NO_HISTORY = RecoveryState()
PICTURE, AVERAGES, LIBRARY = "picture", "averages", "library"


@dataclass(frozen=True, slots=True)
class RecoveryTest:
    """What a recovery strategy compared at one update: it acts where `found` is below `threshold`.

    `compared` PICTURE: the calibrated evidence of this picture, with the threshold. AVERAGES: the short-term
    average of the mean likelihood, with the long-term one, both as logs. LIBRARY: the log of the cloud's mean
    likelihood, with that of the library's entries.
    """

    compared: str  # PICTURE, AVERAGES or LIBRARY
    threshold: float  # nats; -inf if all pictures on average had no particle in free space
    found: float  # nats; -inf if no particle was in free space


# A second opinion on an estimate, formed outside of the filter.


@dataclass(frozen=True, slots=True)
class Opinion:
    """What a second filter says of an estimate, without truth (docs/lost-signal.md)."""

    not_lost: float  # probability that the estimate is not lost
    alarm_below: float  # probability below which it counts as lost


# The record of one update, and the state that the next update needs.


@dataclass(frozen=True, eq=False)
class Comparison:
    """One picture compared with every reference; qualities alone are relative to this very picture."""

    channels: tuple[str, ...]  # the C channel names, in the order of the rows below
    descriptors: Mapping[str, F32]  # channel -> (D,) what was measured in the picture
    distances: F32  # (C, L) absolute distance D of every entry
    channel_quality: F32  # (C, L) quality of each channel alone
    quality: F32  # (L,) blended quality in [0, 1]
    channel_cost: F32  # (C, L) distances over their calibrated scales: nats
    cost: F32  # (L,) weighted sum, >= 0, of all sensors: what recovery and people compare between pictures
    log_likelihood: F32  # (L,) of every entry, of all sensors; finite
    virtual: F32 = field(default_factory=lambda: np.zeros(0, np.float32))  # (V,) of virtual ones
    sensed: tuple[Sensed, ...] = ()  # of pose sensors, which no reference is needed for
    of_channels: F32 | None = None  # (L,) the channels' part of `log_likelihood`; None: all of it
    verified: tuple[Sensed, ...] = ()  # by what references were verified; their costs are the channels' too

    @property
    def read(self) -> tuple[Sensed, ...]:
        """All that was read in the frame."""
        return (*self.verified, *self.sensed)

    @cached_property
    def of_references(self) -> F32:
        """The channels' log-likelihoods (L + V,) of all references, the virtual ones after the entries."""
        likely = self.log_likelihood if self.of_channels is None else self.of_channels
        return np.append(likely, self.virtual) if len(self.virtual) else likely

    @cached_property
    def explained(self) -> EntryLikelihood:
        """How well each entry explains the picture, of all sensors together, (1, L)."""
        return EntryLikelihood.of(self.cost[None])

    @property
    def by_channels(self) -> Comparison:
        """The same without pose sensors, which know every particle's own pose, as it was verified.

        Not kept: a value that held itself would wait for Python's collector.
        """
        if not self.sensed or self.of_channels is None:
            return self
        nats = sum(part.weight * part.cost for part in self.sensed)
        cost = np.maximum(self.cost - nats, np.float32(0))
        quality = 1 - cost / max(float(cost.max(initial=0.0)), 1e-9)
        return replace(
            self,
            cost=cost,
            quality=np.asarray(quality, np.float32),
            log_likelihood=self.of_channels,
            sensed=(),
            of_channels=None,
        )

    @cached_property
    def explained_by_channels(self) -> EntryLikelihood:
        """The same of all channels, without pose sensors: those know every particle's own pose."""
        return self.by_channels.explained

    @cached_property
    def channels_explained(self) -> EntryLikelihood:
        """The same of each channel alone, (C, L)."""
        return EntryLikelihood.of(self.channel_cost)

    @cached_property
    def library_likelihood(self) -> float:
        """The log of the mean likelihood of all entries: the evidence of a cloud that lies evenly over them.

        Under `power` with sharpness 1 it is the log of the mean quality. NaN for a library without entries.
        """
        explained = EntryLikelihood.of(-self.log_likelihood[None])
        return float(explained.top[0] + np.log(explained.relative.mean())) if len(self.cost) else np.nan

    @cached_property
    def library_evidence(self) -> LibraryEvidence | None:
        """How well the library as a whole explains the picture, by channels; None without one, or entries."""
        if not len(self.cost) or not self.channels:
            return None
        explained = self.explained_by_channels
        top = float(explained.top[0])
        return LibraryEvidence(top + float(np.log(explained.relative.mean())), top)

    def prepare(self) -> None:
        """Compute now what every filter asks for: on the thread that compares, ahead of them."""
        _ = self.of_references
        if self.channels:
            _ = self.explained, self.explained_by_channels, self.channels_explained, self.library_evidence

    def best(self, count: int) -> I32:
        """Return the numbers of the best entries (count,), best first; all L when there are fewer."""
        if count >= len(self.quality):
            return self.ranking()
        some = self.quality.argpartition(-count)[-count:]
        some.sort()  # so that ties keep the library's order
        return some[(-self.quality[some]).argsort(kind="stable")].astype("int32")

    def ranking(self) -> I32:
        """Return entry numbers (L,), best quality first; ties keep the library's order."""
        return (-self.quality).argsort(kind="stable").astype("int32")


@dataclass(frozen=True, slots=True, eq=False)
class EntryLikelihood:
    """exp(-cost) of every entry, relative to the best one: what the evidence of any cloud is made of."""

    relative: F64  # (..., L) at most 1
    top: F64  # (...,) log of what was divided by

    @classmethod
    def of(cls, cost: F32) -> EntryLikelihood:
        """Take costs (..., L) in nats."""
        nats = -cost.astype(np.float64)
        top = nats.max(axis=-1, keepdims=True)
        return cls(np.exp(nats - top), top[..., 0])


@dataclass(frozen=True, slots=True)
class LibraryEvidence:
    """What a cloud's evidence by channels is measured against: that of the library as a whole, in nats."""

    mean: float  # of a cloud that is spread over all entries alike
    best: float  # of a cloud at the entry that explains the picture best


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What a comparison means for each of the N particles."""

    comparison: Comparison
    entries: I32  # (N,) the nearest entry of each particle; -1 outside free space
    log_likelihood: F32  # (N,) log-likelihood of each particle; -inf outside free space
    sensed: F32 | None = None  # (N,) nats of the pose sensors; None: none said anything
    known: F32 | None = None  # (N,) how far references speak for each particle, 0 to 1; None: for all


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """One pose that represents the cloud, and how much of the cloud supports it."""

    pose: F64  # (3,) x_m, y_m, heading_rad in the map's frame
    sd_m: tuple[float, float]  # weighted standard deviation along x and y of its particles
    heading_sd_rad: float  # circular standard deviation of the same particles
    mass: float  # share of all weight that these particles hold
    confidence: float  # share of weight within `radii.confidence_m` of the pose
    converged: float  # share of weight within `radii.cluster_m`
    radii: Radii = USUAL  # by which it was made, and is judged


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StepRecord:
    """One complete update; every set of weights is stored with the particles it belongs to.

    >>> import maurice_mcl as mcl
    >>> _, record = next(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))
    >>> record.weighted.size, record.events
    (2000, ('resampled',))
    """

    frame: Frame
    predicted: Belief  # after the motion model, with the weights carried over from the last step
    sighting: Sighting
    weighted: Belief  # the same particles with weights updated by the picture
    estimate: Estimate  # heaviest cluster of `weighted`: the one that is scored
    mean_estimate: Estimate  # weighted mean of all of `weighted`
    effective_sample_size: float  # of `weighted`, in particles
    log_evidence: float  # log p(o_t | past): log of the mean likelihood; -inf when every particle was outside
    calibrated_evidence: float  # the same of exp(-cost), comparable between runs
    channel_evidence: F64  # (C,) the same of each channel alone
    parents: I32 | None  # (N',) which weighted particle each new one copies, -1: fresh; None: not resampled
    injected: Bool | None  # (N',) freshly injected particles of `belief`; None: none
    belief: Belief  # what the next step starts from
    events: tuple[str, ...]  # what the filter noticed: "resampled", "left the map"
    took_s: Mapping[str, float]  # seconds per stage; not part of what must repeat
    recovery_test: RecoveryTest | None = None  # None: the strategy compared nothing, or it is not known
    library_evidence: LibraryEvidence | None = None  # of the same picture; None: not known
    opinion: Opinion | None = None  # added beside the filter, which never reads it; None: not asked for

    def __repr__(self) -> str:
        """Return where it puts the robot, in a line."""
        x_m, y_m, heading_rad = self.estimate.pose.tolist()
        pose = f"({x_m:.3f} m, {y_m:.3f} m, {heading_rad:.3f} rad)"
        return f"StepRecord(step {self.frame.step} at {pose}, confidence {self.estimate.confidence:.2f})"


@dataclass(frozen=True, slots=True, eq=False)
class Past:
    """What is kept of an update, to check by it what pose sensors propose later."""

    motions: F64  # (M, 3) of its frame
    sensed: tuple[Sensed, ...]
    estimate: F64  # (3,) in the map's frame
    link: float = 0.0  # nats a point by which a sensor's reading fits those before, along the motions
    trust: float = 0.0  # nats by which readings up to this one speak for the estimate


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """Everything the next step needs: a run can continue from its state and its localizer's seed.

    >>> import maurice_mcl as mcl
    >>> state = mcl.make_localizer(mcl.tiny_library(), particles=50).initialize(None)
    >>> state.step, state.belief.size
    (0, 50)
    """

    step: int  # of the last frame; 0 before the first
    belief: Belief
    recovery: RecoveryState = NO_HISTORY  # of the recovery strategy
    past: tuple[Past, ...] = ()  # the last updates, the latest first
