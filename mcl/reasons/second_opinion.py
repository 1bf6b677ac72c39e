"""A second opinion on whether the filter is lost: a small filter that never believes the first one.

It has as many particles as the library has entries, begins anywhere, and draws a few of them anew from every
picture. So it follows every place that the last pictures and movements speak for, also where the first
filter has no particle left. Its share of the weight near the first one's estimate, beside that of the best
place elsewhere, joins what the lost signal reads (docs/lost-signal.md has both, on unseen drives).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError
from ..filter.localizer import Localizer
from ..filter.proposal import poses_of_entries, uniform_poses
from ..filter.resampling import systematic
from ..library.left_out import WIDENINGS
from ..scoring.lost_signal import MOST_NATS, RATE, BeliefNumbers, LostSignal, probability
from ..values import F32, F64, I32, Domain, Opinion, StepRecord, stream

LEAST_PARTICLES, MOST_PARTICLES = 200, 2000
FRESH_SHARE = 0.05  # of the particles, and of the weight, that every picture draws anew
NEAR_RADII, FAR_RADII = (
    4 / 3,
    2.0,
)  # radii *right* from the estimate: what agrees, what contradicts
NEAR_RAD, FAR_RAD = math.radians(45), math.radians(60)
LEAST_SHARE = 0.01  # of the weight, whose log would fall beyond all bounds

# Logistic regression: log odds that the estimate is not lost, per unit of each feature (docs/lost-signal.md).
OPINION: Mapping[str, float] = {
    "constant": -0.57,
    "gain": 0.56,
    "last gain": 0.53,
    "gap": 0.13,
    "mass": 0.39,
    "spread": -0.21,
    "survivors": -0.37,
    "near": 0.23,
    "apart": 0.39,
    "apart lately": 0.28,
}
SENSED_SHARE = 0.5  # log odds per nat by which pose sensors put the estimate before every other place
# Log odds for a camera whose scales were widened, since its pictures misled: of it by channels alone, and of
# the widening's logarithm. Fitted on real drives by benchmarks/studies/real_belief.py (docs/lost-signal.md).
# Landmarks do not speak for the estimate there: stated above 90 % by them, half of the steps were lost.
WIDENED: Mapping[str, float] = {"constant": 0.5, "log odds": 0.43, "log widening": 0.87}
UNUSED = float(WIDENINGS[-1])  # widened by so much or more, no picture told anything ...
LOG_ODDS_OF_UNUSED = 0.0  # ... so that by its pictures it is never said that it knows where it is
LANDMARKS = "landmarks"  # the pose sensor that reads the camera's pictures, too
# probability of not being lost below which it is an alarm: with a calibrated likelihood, and with any
LOST_BELOW, LOST_BELOW_ANY = 0.5, 0.12


@dataclass(frozen=True, slots=True)
class Shares:
    """Where a second filter is, beside an estimate: shares of its weight."""

    near: float  # at poses that agree with the estimate
    elsewhere: float  # about the one entry, among those that contradict it, with the most


@dataclass(slots=True)
class SecondFilter:
    """A small filter that begins anywhere; it reads movements and pictures, and nothing of another filter.

    >>> import maurice_mcl as mcl
    >>> from maurice_mcl.reasons.second_opinion import SecondFilter
    >>> session, localizer = mcl.tiny_session(), mcl.make_localizer(mcl.tiny_library())
    >>> second = SecondFilter.of(localizer.of_session(session))
    >>> for _, record in mcl.run(localizer, session):
    ...     second.see(record.frame.motions, record.sighting.comparison.explained_by_channels.relative[0])
    >>> 0 <= second.shares(record.estimate.pose).near <= 1
    True
    """

    localizer: Localizer  # of which it takes the map, the library and the motion model
    poses: F32  # (N, 3) at the last picture, relative to the library's origin
    weights: F64  # (N,)
    entries: I32  # (N,) nearest to each pose; -1 outside free space
    begin: F32  # (N, 3) where the next movement begins, all with the same weight
    sizes: F64  # (L,) of the part of the map that is nearest to each entry
    step: int = 0

    @classmethod
    def of(cls, localizer: Localizer) -> SecondFilter:
        """Begin anywhere. InputError for a localizer without a motion model: see `Localizer.of_session`."""
        if localizer.motion is None:
            raise InputError(None, "found no motion model; use `of_session` before a second opinion")
        count = min(max(localizer.library.size, LEAST_PARTICLES), MOST_PARTICLES)
        origin = localizer.library.origin
        poses = uniform_poses(localizer.reference.grid, count, origin, stream(Domain.COMPARE, 0, 0, count))
        even = np.full(count, 1 / count)
        entries = localizer.reference.entries(poses, origin)
        return cls(localizer, poses, even, entries, poses, localizer.regions.sizes())

    def see(self, motions: F64, likelihood: F64) -> None:
        """Process an update: its movements (M, 3), and the likelihood (L,) of every entry, up to a factor."""
        localizer, count, origin = self.localizer, len(self.poses), self.localizer.library.origin
        assert localizer.motion is not None, "see `of`"
        self.step += 1
        rng, self.poses = stream(Domain.COMPARE, 0, self.step, count), self.begin
        noises = rng.standard_normal((len(motions), count, 3), np.float32)
        for motion, noise in zip(motions, noises, strict=True):
            self.poses = localizer.motion.move(self.poses, origin, motion, noise)
        self.entries = localizer.reference.entries(self.poses, origin)
        weights = np.append(likelihood, 0.0).take(self.entries)  # entry -1, outside, is the last
        total = float(weights.sum())
        self.weights = weights / total if total > 0 else np.full(count, 1 / count)
        self._renew(likelihood, rng)

    def _renew(self, likelihood: F64, rng: np.random.Generator) -> None:
        """Resample, and draw a few anew where this picture is likely."""
        localizer, count = self.localizer, len(self.poses)
        fresh = round(FRESH_SHARE * count)
        parents = systematic(self.weights, count - fresh, rng)
        cumulative = np.cumsum(likelihood * self.sizes)
        begin = np.empty((3, count), np.float32)  # column by column
        self.poses.T.take(parents, axis=1, out=begin[:, : len(parents)], mode="clip")
        drawn = poses_of_entries(
            cumulative, localizer.reference.grid, localizer.regions, fresh, localizer.library.origin, rng
        )
        begin[:, len(parents) :] = drawn.T
        self.begin = begin.T

    def shares(self, pose: F64) -> Shares:
        """Return where it is, beside an estimated pose (3,) in the map's frame."""
        right_m = self.localizer.radii.right_m
        relative = np.append(pose[:2] - self.localizer.library.origin, pose[2]).astype(np.float32)
        dx, dy, turned = self.poses.T - relative[:, None]
        squared, ahead = dx**2 + dy**2, np.cos(turned)
        near = (squared < (NEAR_RADII * right_m) ** 2) & (ahead > math.cos(NEAR_RAD))
        far = (squared > (FAR_RADII * right_m) ** 2) | (ahead < math.cos(FAR_RAD))
        by_entry = np.bincount(self.entries + 1, self.weights * far)
        return Shares(float(self.weights @ near), float(by_entry[1:].max(initial=0.0)))


@dataclass(slots=True)
class OpinionReader:
    """Turns numbers of updates into features; keeps running means."""

    _signal: LostSignal = field(default_factory=LostSignal)
    _ahead: float | None = None  # running mean of the nats by which it is near rather than elsewhere

    def features(self, now: BeliefNumbers, shares: Shares) -> dict[str, float]:
        """Return what the probability of the next update is made of, by the names of OPINION."""
        near, elsewhere = (math.log(max(v, LEAST_SHARE)) for v in (shares.near, shares.elsewhere))
        ahead = near - elsewhere
        self._ahead = ahead if self._ahead is None else self._ahead + RATE * (ahead - self._ahead)
        own = {"near": near, "apart": ahead, "apart lately": self._ahead}
        return self._signal.features(now) | own


@dataclass(slots=True)
class SecondOpinion:
    """Follows one run with a second filter, without truth.

    >>> import maurice_mcl as mcl
    >>> from maurice_mcl.reasons.second_opinion import SecondOpinion
    >>> session, localizer = mcl.tiny_session(), mcl.make_localizer(mcl.tiny_library())
    >>> opinion = SecondOpinion.of(localizer.of_session(session))
    >>> for _, record in mcl.run(localizer, session):
    ...     not_lost = opinion.add(record)
    >>> 0 <= not_lost <= 1, opinion.lost
    (True, False)
    """

    second: SecondFilter
    not_lost: float | None = None  # probability that the last estimate is not lost; None: not known
    _reader: OpinionReader = field(default_factory=OpinionReader)
    raw: float = 0.0  # log odds of the last update by channels alone, before the widening counts
    _sensed: float = 0.0  # running mean of the nats by which pose sensors speak for the estimate

    @classmethod
    def of(cls, localizer: Localizer) -> SecondOpinion:
        """Begin beside a filter. InputError without a motion model: see `Localizer.of_session`."""
        return cls(SecondFilter.of(localizer))

    @classmethod
    def beside(cls, localizer: Localizer) -> SecondOpinion | None:
        """Begin beside a filter; None where it has no motion model or no references."""
        return None if localizer.motion is None or not localizer.library.size else cls.of(localizer)

    @property
    def alarm_below(self) -> float:
        """The probability below which an estimate counts as lost: it depends on the filter's likelihood."""
        sensor = self.second.localizer.sensor.parameters
        calibrated = (sensor.blend, sensor.likelihood) == ("calibrated", "exponential")
        return LOST_BELOW if calibrated else LOST_BELOW_ANY

    @property
    def lost(self) -> bool:
        """Whether the last estimate is probably lost."""
        return self.not_lost is not None and self.not_lost < self.alarm_below

    def added_to(self, record: StepRecord) -> StepRecord:
        """Process the next update; return its record with the opinion, where there is one."""
        not_lost = self.add(record)
        return record if not_lost is None else replace(record, opinion=Opinion(not_lost, self.alarm_below))

    def add(self, record: StepRecord) -> float | None:
        """Process the next update; return the probability that its estimate is not lost."""
        numbers = BeliefNumbers.of(record)
        if numbers is None or not math.isfinite(numbers.library_mean):
            return None  # nothing to compare with, or a channel that gives no numbers
        self.second.see(record.frame.motions, record.sighting.comparison.explained_by_channels.relative[0])
        features = self._reader.features(numbers, self.second.shares(record.estimate.pose))
        self._sensed += RATE * (sensed_ahead(record, self.second.localizer) - self._sensed)
        self.raw = sum(weight * features[name] for name, weight in OPINION.items())
        sensor = self.second.localizer.sensor
        misled = sensor.parameters.widening > 1 and LANDMARKS in sensor.sensors
        sensed = 0.0 if misled else SENSED_SHARE * self._sensed
        self.not_lost = recalibrated(self.raw, sensor.parameters.widening, more=sensed)
        return self.not_lost


def recalibrated(
    raw: float, widening: float, weights: Mapping[str, float] = WIDENED, more: float = 0.0
) -> float:
    """Return the probability of not being lost, from its log odds by a camera that was widened so much.

    `more` log odds are those of pose sensors.
    """
    if widening == 1:
        return probability({"log odds": 1.0}, {"log odds": raw}, more)
    if widening >= UNUSED:
        return probability({"log odds": 1.0}, {"log odds": min(raw, LOG_ODDS_OF_UNUSED)}, more)
    features = {"constant": 1.0, "log odds": raw, "log widening": math.log(widening)}
    return probability(weights, features, more)


def sensed_ahead(record: StepRecord, localizer: Localizer) -> float:
    """Return the nats by which pose sensors alone put the estimate before the best reference elsewhere.

    0 where they say nothing, or put another place first: references lie beside the robot, so that pose
    sensors can speak for an estimate, and hardly against it. No more than ten nats count.
    """
    sensed, library = record.sighting.comparison.sensed, localizer.library
    if not sensed:
        return 0.0
    pose, origin = record.estimate.pose, library.origin
    dx, dy, turned = (library.poses - pose).T
    far = (np.hypot(dx, dy) > FAR_RADII * localizer.radii.right_m) | (np.cos(turned) < math.cos(FAR_RAD))
    poses = np.concatenate([pose[None], library.poses[far]]) - np.append(origin, 0.0)
    nats = localizer.sensor.sense_at(record.sighting.comparison, poses.astype(np.float32))
    if nats is None or not far.any():
        return 0.0
    return min(max(float(nats[0] - nats[1:].max()), 0.0), MOST_NATS)
