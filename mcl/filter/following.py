"""Following sensors: particles move as a scan or landmarks tell where the cloud does not explain them.

What a pose sensor reads is asked three things, each only where the predicted cloud does not explain it: how
the robot moved since the frame before, where the sensor alone would put the robot, and whether the updates
before agree. Poses where the cloud is not are for the mixture proposal; toward one that it tracks, some of
the particles are guided.

Guided motion: where motion noise is wide beside what a sensor knows, most particles land where the
likelihood is nearly zero. Here some of them draw their noise from what it is likely to have been, given the
proposed pose: the improved proposal of FastSLAM 2.0 (Montemerlo et al. 2003), which is the optimal importance
function of Doucet et al. (2000) for a motion model that is linear in its noise. The draws are those of a
mixture, weighted by the balance heuristic (Veach and Guibas 1995). So the filter stays exact whatever the
proposal says: a proposal decides where particles are spent, and is no evidence. No weight is multiplied by
more than 1 / (1 - share).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import Annotated

import numpy as np

from ..values.arrays import F64
from ..values.geometry import compose_motions, motion_between, wrap, wrap_angle
from ..values.pose_sensor import (
    DOUBTFUL_NATS,
    FITTING_NATS,
    TRUSTED_NATS,
    Earlier,
    MeasuredMovement,
    PoseProposal,
    PoseSensor,
    Sensed,
)
from ..values.randomness import Purpose
from ..values.records import Belief, Comparison, Past, StepRecord
from ..values.session import Frame
from ..values.setting_rules import number
from .motion import measured_motion, widths
from .proposal import (
    LEAST_VARIANCE,
    MixtureProposal,
    Prediction,
    Proposal,
    ProposedParticles,
    Updates,
    proposals_of,
)

TRACKED_SHARE = 0.01  # of the weight near a mode: with as much, the cloud tracks it by itself
TRACKED_RAD = np.pi / 6
TRACKED_COSINE = np.cos(TRACKED_RAD)
KEPT_UPDATES = 40
# A robot that was not carried for so many updates is sought only at every so many: with people around it, a
# cloud that is right explains few readings.
LAST_LINKS, SEARCH_EVERY = 3, 10
# Where two estimates differ from odometry by less, their difference is the better measure of the movement.
SAME_M, SAME_RAD = 0.3, 0.2
JUMP_M = 2.0  # an estimate that moved so much farther than the robot is that of another place
# Nats of trust in an estimate: at a start that somebody gave, which is a cloud no wider than START_SD_M; of
# each update, as a share of its readings' support, most of which repeats what was read before; and at most.
# Chosen together with the constants of `sensor.laser.history`.
START_NATS, START_SD_M, SUPPORT_SHARE, MOST_TRUST_NATS = 60.0, 1.0, 0.15, 100.0
# Of a start for which no reading speaks yet: a place has to fit the first scan better by as much, or a start
# in a corridor would lose to whichever of many others fits best. A wrong start costs one scan about 30.
DOUBTED_NATS = 20.0
NOISE_STEP = np.float32(0.5)  # standard deviations: the step of the derivatives by the noise


@dataclass(frozen=True, slots=True)
class GuidedMotionParameters:
    """How many particles follow a sensor that proposes poses; without such a sensor none do."""

    share: Annotated[float, number(0, 0.99)] = 0.5  # of the particles, on average


def can_propose(sensors: Iterable[PoseSensor]) -> bool:
    """Return whether one of the pose sensors proposes poses at all."""
    return any(getattr(sensor, "proposes", False) for sensor in sensors)


@dataclass(frozen=True, slots=True, eq=False)
class GuidedProposal(Proposal):
    """Move particles as pose sensors measure it, and some of them to where these put the robot."""

    parameters: GuidedMotionParameters
    reach_m: float  # how near to a proposed pose a cloud is that tracks it
    mixture: MixtureProposal | None = None

    def propose(self, prediction: Prediction, comparison: Comparison, past: Updates) -> ProposedParticles:
        """See `Proposal.propose`."""
        predicted, link = prediction.belief, 0.0
        past = past or begun(prediction.before)
        asked = unexplained(comparison, predicted)
        is_doubted = bool(past) and max(before.trust for before in past) < TRUSTED_NATS
        if not (asked or is_doubted):
            return ProposedParticles(predicted)
        movement = movement_of(asked, prediction.frame, past)
        if movement is not None:
            predicted, link = followed(prediction, movement), movement.link
            prediction = replace(prediction, frame=replace(prediction.frame, motions=movement.motion[None]))
        if link > DOUBTFUL_NATS and not is_doubted:  # else a few particles may fit by chance
            asked = unexplained(comparison, predicted, for_certain=True)
            if prediction.frame.step % SEARCH_EVERY and is_settled(link, past):
                asked = ()
        else:
            asked = comparison.sensed
        before = partial(earlier, motions=prediction.frame.motions, link=link, past=past)
        proposals = proposals_of(asked, before)
        return replace(self._toward(proposals, predicted, prediction, comparison), movement=movement)

    def _toward(
        self,
        proposals: Sequence[PoseProposal],
        predicted: Belief,
        prediction: Prediction,
        comparison: Comparison,
    ) -> ProposedParticles:
        """Draw some particles where sensors put the robot and no particle is, or guide some that are near."""
        if self.mixture is not None:
            untracked = elsewhere(proposals, predicted, self.reach_m)
            if untracked:
                rng = prediction.rng(Purpose.MIXTURE)
                return self.mixture.mixed(predicted, comparison.log_likelihood, rng, untracked)
        near = tracked(proposals, predicted, self.reach_m)
        if near is None or self.parameters.share == 0 or not len(prediction.frame.motions):
            return ProposedParticles(predicted)
        return guided_motion(prediction, *near, self.parameters.share)

    def keep(self, record: StepRecord, movement: MeasuredMovement | None, past: Updates) -> tuple[Past, ...]:
        """See `Proposal.keep`."""
        return (kept(record, movement, past), *past)[:KEPT_UPDATES]


# How the robot moved, as a sensor measures it, and when it may be elsewhere.


def is_settled(link: float, past: Updates) -> bool:
    """Return whether the last readings fit each other so well that the robot was not carried."""
    return (
        len(past) >= LAST_LINKS and min(link, *(before.link for before in past[:LAST_LINKS])) > FITTING_NATS
    )


def unexplained(comparison: Comparison, predicted: Belief, for_certain: bool = False) -> Sequence[Sensed]:
    """Return what sensors read that a predicted cloud does not explain, or else may not explain."""
    cloud = predicted.poses, predicted.weights, predicted.origin
    explained = [(part, part.is_explained(*cloud)) for part in comparison.sensed]
    return [part for part, is_so in explained if not is_so and not (is_so is None and for_certain)]


def movement_of(sensed: Sequence[Sensed], frame: Frame, past: Updates) -> MeasuredMovement | None:
    """Return how the robot moved by the first sensor that measures it."""
    if not past or not len(frame.motions):
        return None
    motion = reduce(compose_motions, frame.motions)
    before = partial(earlier, motions=frame.motions, link=0.0, past=past)
    movements = (part.movement(motion, before) for part in sensed)
    return next((movement for movement in movements if movement is not None), None)


def followed(prediction: Prediction, movement: MeasuredMovement) -> Belief:
    """Return a belief moved as a sensor measured it; as the motion model does where that starts anew."""
    before = prediction.before
    if not movement.is_linked:
        return prediction.belief
    return replace(before, poses=measured_motion(before.poses, movement, prediction.normals[: before.size]))


# What is kept of updates: the movements, and what speaks for the estimates.


def earlier(name: str, motions: F64, link: float, past: Updates) -> list[Earlier]:
    """Return what a sensor read before a frame with some movements (M, 3), the latest first."""
    after = ((motions, link), *((before.motions, before.link) for before in past))
    readings = ({part.name: part.reading for part in before.sensed}.get(name) for before in past)
    return [
        Earlier(*movement, reading, before.estimate, before.trust)
        for movement, reading, before in zip(after, readings, past, strict=False)
    ]


def begun(before: Belief) -> tuple[Past, ...]:
    """Return a start that somebody gave as an update before the first one, which read nothing."""
    if not _deviation_m(before) < START_SD_M:
        return ()
    x, y = before.weights @ before.poses[:, :2] + before.origin
    heading = np.angle(before.weights @ np.exp(1j * before.poses[:, 2].astype(np.float64)))
    return (Past(np.zeros((0, 3)), (), np.array([x, y, heading]), 0.0, DOUBTED_NATS),)


def kept(record: StepRecord, movement: MeasuredMovement | None, past: Updates) -> Past:
    """Return what is kept of an update: its movement as best known, and the trust in its estimate."""
    motions, link = record.frame.motions, 0.0 if movement is None else movement.link
    sensed, estimate = record.sighting.comparison.sensed, record.estimate.pose
    support = sum(max(0.0, part.support(estimate)) for part in sensed)
    trust = past[0].trust if past else _trust_in_start(record.predicted, support)
    if trust < TRUSTED_NATS:  # what a scan says for several places says little for one of them
        support *= record.estimate.mass
    if past and len(motions):
        between = motion_between(past[0].estimate, estimate)
        motion = reduce(compose_motions, motions) if movement is None else movement.motion
        off_m, off_rad = float(np.hypot(*(between - motion)[:2])), abs(wrap_angle(between[2] - motion[2]))
        is_same = movement is None and off_m < SAME_M and off_rad < SAME_RAD
        motions = (between if is_same else motion)[None]
        if off_m > JUMP_M or not (movement is None or movement.is_linked):
            trust = 0.0
    return Past(motions, sensed, estimate, link, min(MOST_TRUST_NATS, trust + SUPPORT_SHARE * support))


def _trust_in_start(predicted: Belief, support: float) -> float:
    if not _deviation_m(predicted) < START_SD_M:
        return 0.0
    return START_NATS if support > 0 else DOUBTED_NATS


# Which proposals a cloud tracks.


def elsewhere(proposals: Sequence[PoseProposal], predicted: Belief, reach_m: float) -> list[PoseProposal]:
    """Return the parts of proposals where the predicted cloud is not.

    A cloud that has a hundredth of its weight within `reach_m` and 30 degrees of a mode tracks it by itself,
    and knows more of it than the sensor alone: the past. Not so a cloud whose headings have a standard
    deviation above 30 degrees: too few of its particles are near. A cloud with a standard deviation below
    `reach_m` is not drawn to what a single object speaks for, which may have been moved; a wider one, which
    searches, is.
    """
    parts, together = [], _deviation_m(predicted) < reach_m
    turned = _deviation_rad(predicted) > TRACKED_RAD
    for proposal in proposals:
        near = np.array([_weight_near(pose, predicted, reach_m) for pose in proposal.poses])
        kept = (near < TRACKED_SHARE) | turned
        if together and proposal.from_one_object is not None:
            kept &= ~proposal.from_one_object
        if kept.any():
            parts.append(proposal.only(kept))
    return parts


def tracked(proposals: Sequence[PoseProposal], predicted: Belief, reach_m: float) -> tuple[F64, F64] | None:
    """Return the pose (3,) and covariance (3, 3) of the proposed mode that the predicted cloud tracks.

    Of several it is that with the largest product of both weights; None where the cloud tracks none
    (`elsewhere`). In the map's frame.
    """
    most, mode = 0.0, None
    for proposal in proposals:
        for pose, covariance, weight in zip(
            proposal.poses, proposal.covariances, proposal.weights.tolist(), strict=True
        ):
            near = _weight_near(pose, predicted, reach_m)
            if near >= TRACKED_SHARE and near * weight > most:
                most, mode = near * weight, (pose, covariance)
    return mode


def _deviation_m(belief: Belief) -> float:
    """Return the standard deviation of a cloud's places, of x and y together."""
    weights = belief.weights
    off = belief.poses[:, :2] - weights @ belief.poses[:, :2]
    return float(np.sqrt(weights @ (off**2).sum(axis=1)))


def _deviation_rad(belief: Belief) -> float:
    """Return the circular standard deviation of a cloud's headings."""
    heading = belief.poses[:, 2].astype(np.float64)
    mean = np.hypot(belief.weights @ np.cos(heading), belief.weights @ np.sin(heading))
    return float(np.sqrt(-2 * np.log(np.clip(mean, 1e-12, 1.0))))


def _weight_near(pose: F64, predicted: Belief, reach_m: float) -> float:
    """Return the weight of the particles near a pose (3,) in the map's frame."""
    x, y, heading = predicted.poses.T
    dx, dy = x - (pose[0] - predicted.origin[0]), y - (pose[1] - predicted.origin[1])
    near = (dx * dx + dy * dy < reach_m**2) & (np.cos(heading - pose[2]) > TRACKED_COSINE)
    return float(predicted.weights @ near)


# Guided motion.


def guided_motion(prediction: Prediction, pose: F64, covariance: F64, share: float) -> ProposedParticles:
    """Move N particles, a share of them toward the pose (3,) that a sensor proposes in the map's frame.

    The correction is the log of the predicted over the proposal density. `covariance` is (3, 3).
    """
    before, rng = prediction.before, prediction.rng(Purpose.GUIDE)
    by_movement = np.split(prediction.normals, len(prediction.frame.motions))
    normals = np.concatenate([part.T for part in by_movement], dtype=np.float64)  # (3 M, N)
    outliers = [widths(before.size, prediction.outliers, rng) for rng in prediction.outlier_rngs()]
    widening = np.repeat(np.stack(outliers), 3, axis=0)  # (3 M, N), more than 1 for outliers
    still, by_noise = _linearized(prediction, widening)
    off = (pose - [*before.origin, 0.0])[:, None] - still
    off[2] = wrap(off[2])
    seen = covariance + LEAST_VARIANCE * np.eye(3)
    predicted = NormalFactor.of(np.einsum("ikn,jkn->ijn", by_noise, by_noise) + seen[:, :, None])
    # a draw from the noise's posterior: one from its prior, moved by what it does not explain (Matheron)
    missed = np.linalg.cholesky(seen) @ rng.standard_normal((before.size, 3)).T
    unexplained = off - _applied(by_noise, normals) - missed
    follow = rng.random(before.size) < share
    change = predicted.solved(np.where(follow, unexplained, 0.0))
    normals += np.einsum("ijn,in->jn", by_noise, change)
    # Bayes: the posterior's density over the prior's, at any noise
    seen_density = NormalFactor.of(seen[:, :, None]).log_density(off - _applied(by_noise, normals))
    gain = seen_density - predicted.log_density(off)
    correction = -np.logaddexp(np.log1p(-share), np.log(share) + gain)
    noise, poses = (normals * widening).astype(np.float32), before.poses
    for movement in range(len(noise) // 3):
        poses = prediction.move(movement, poses, noise[3 * movement : 3 * movement + 3].T)
    return ProposedParticles(Belief(poses, before.log_weights, before.origin), correction, is_guided=True)


def _linearized(prediction: Prediction, widening: F64) -> tuple[F64, F64]:
    """Return poses (3, N) without noise, and their derivatives (3, 3 M, N) by the normals.

    The particles move once without noise and once with each of the normals changed, all of them together.
    """
    moved, (columns, count) = prediction.before.poses, widening.shape
    for movement in range(columns // 3):
        before, moved = len(moved), np.concatenate([moved, *[moved[:count]] * 3])
        noise = np.zeros((3, len(moved)), np.float32)  # column by column
        for k in range(3):
            noise[k, before + k * count :][:count] = NOISE_STEP
        moved = prediction.move(movement, moved, noise.T)
    poses = moved.T.reshape(3, columns + 1, count)
    still = poses[:, 0].astype(np.float64)
    by_noise = poses[:, 1:] - still[:, None]
    by_noise[2] = wrap(by_noise[2])
    by_noise *= widening / NOISE_STEP
    return still, by_noise


def _applied(by_noise: F64, normals: F64) -> F64:
    """Return what normals (3 M, N) do to the poses: (3, N)."""
    return np.asarray(np.einsum("ijn,jn->in", by_noise, normals))


@dataclass(frozen=True, slots=True, eq=False)
class NormalFactor:
    """Cholesky's factors of covariances (3, 3, N) of normal distributions, or of one (3, 3, 1) for all N.

    An element of all of them at a time: LAPACK takes most of its time for a small matrix to begin.
    """

    diagonal: tuple[F64, F64, F64]  # (N,) each
    below: tuple[F64, F64, F64]  # (N,) each: rows and columns (1, 0), (2, 0), (2, 1)

    @classmethod
    def of(cls, covariances: F64) -> NormalFactor:
        """Factor covariances that are not singular."""
        (a, _, _), (b, d, _), (c, e, f) = covariances
        first = np.sqrt(a)
        b, c = b / first, c / first
        second = np.sqrt(d - b * b)
        e = (e - b * c) / second
        return cls((first, second, np.sqrt(f - c * c - e * e)), (b, c, e))

    def _whitened(self, off: F64) -> tuple[F64, F64, F64]:
        """Return distances (3, N) from the means in standard deviations, independent of each other."""
        (p, q, r), (b, c, e) = self.diagonal, self.below
        x = off[0] / p
        y = (off[1] - b * x) / q
        return x, y, (off[2] - c * x - e * y) / r

    def solved(self, off: F64) -> F64:
        """Return the inverse of each covariance times a distance (3, N)."""
        (p, q, r), (b, c, e), (x, y, z) = self.diagonal, self.below, self._whitened(off)
        z = z / r
        y = (y - e * z) / q
        return np.stack([(x - b * y - c * z) / p, y, z])

    def log_density(self, off: F64) -> F64:
        """Return the log-density (N,) at distances (3, N) from the means, up to a constant."""
        (p, q, r), (x, y, z) = self.diagonal, self._whitened(off)
        return np.asarray(-0.5 * (x * x + y * y + z * z) - np.log(p * q * r))
