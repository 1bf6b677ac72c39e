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

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import Annotated

import numpy as np

from ..values import (
    DOUBTFUL_NATS,
    F32,
    F64,
    Belief,
    Comparison,
    Earlier,
    Frame,
    MeasuredMovement,
    Past,
    PoseProposal,
    PoseSensor,
    Sensed,
    StepRecord,
    compose_motions,
    motion_between,
    number,
    wrap,
    wrap_angle,
)
from ..values.randomness import Purpose
from .motion import measured_motion, widths
from .proposal import MixtureProposal, Prediction, Proposal, ProposedParticles
from .sampling import LEAST_VARIANCE, proposals_of

TRACKED_SHARE = 0.01  # share of the weight near a mode from which on the cloud tracks it by itself
TRACKED_RAD = np.pi / 6
KEPT = 40  # updates
SAME_M, SAME_RAD = 0.3, 0.2  # between estimates and odometry: the estimates tell the movement better
JUMP_M = 2.0  # an estimate that moved so much more than the robot did is another one
# Nats that speak for an estimate: of a start that somebody gave; of each update, as a share of what its
# readings say, as most of that was said before; and at most. Chosen with those in `sensor.laser.history`.
START_NATS, START_M, SHARE, MOST_NATS = 60.0, 1.0, 0.15, 100.0
UNIT = np.float32(0.5)  # standard deviations by which noise is changed to see what it does


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

    def propose(
        self, prediction: Prediction, comparison: Comparison, past: Sequence[Past]
    ) -> ProposedParticles:
        """See `Proposal.propose`."""
        asked = unexplained(comparison, prediction.belief)
        if not asked:
            return ProposedParticles(prediction.belief)
        predicted, link = prediction.belief, 0.0
        movement = movement_of(asked, prediction.frame, past)
        if movement is not None:
            predicted, link = followed(prediction, movement), movement.link
            frame = replace(prediction.frame, motions=movement.motion[None])
            prediction = replace(prediction, frame=frame)
        proposals = confirmed(comparison, predicted, prediction.frame.motions, link, past)
        proposed = self._toward(proposals, predicted, prediction, comparison)
        return replace(proposed, movement=movement)

    def _toward(
        self,
        proposals: Sequence[PoseProposal],
        predicted: Belief,
        prediction: Prediction,
        comparison: Comparison,
    ) -> ProposedParticles:
        """Draw some particles where sensors put the robot and no particle is, or guide some that are near."""
        new = elsewhere(proposals, predicted, self.reach_m) if self.mixture is not None else []
        if self.mixture is not None and new:
            return self.mixture.mixed(predicted, prediction, comparison, new)
        near = tracked(proposals, predicted, self.reach_m) if self.parameters.share > 0 else None
        if near is None or not len(prediction.frame.motions):
            return ProposedParticles(predicted)
        return guided(prediction, *near, self.parameters.share)

    def keep(
        self, record: StepRecord, movement: MeasuredMovement | None, past: Sequence[Past]
    ) -> tuple[Past, ...]:
        """See `Proposal.keep`."""
        return (kept(record, movement, past), *past)[:KEPT]


# How the robot moved, as a sensor measures it.


def unexplained(comparison: Comparison, predicted: Belief) -> list[Sensed]:
    """Return what sensors read that a predicted cloud does not explain for certain."""
    cloud = predicted.poses, predicted.weights, predicted.origin
    return [part for part in comparison.sensed if part.is_explained(*cloud) is not True]


def movement_of(sensed: Sequence[Sensed], frame: Frame, past: Sequence[Past]) -> MeasuredMovement | None:
    """Return how the robot moved by the first sensor that measures it."""
    if not past or not len(frame.motions):
        return None
    motion = reduce(compose_motions, frame.motions)
    movements = (part.movement(motion, earlier(part.name, frame.motions, 0.0, past)) for part in sensed)
    return next((movement for movement in movements if movement is not None), None)


def followed(prediction: Prediction, movement: MeasuredMovement) -> Belief:
    """Return a belief moved as a sensor measured it; as the motion model does where that starts anew."""
    before = prediction.before
    if not movement.is_linked:
        return prediction.belief
    noise = prediction.normals[: before.size]
    return replace(before, poses=measured_motion(before.poses, movement, noise))


# What is kept of updates: the movements, and what speaks for the estimates.


def earlier(name: str, motions: F64, link: float, past: Sequence[Past]) -> list[Earlier]:
    """Return what a sensor read before a frame with some movements (M, 3), the latest first."""
    after = ((motions, link), *((before.motions, before.link) for before in past))
    readings = ({part.name: part.reading for part in before.sensed}.get(name) for before in past)
    return [
        Earlier(*movement, reading, before.estimate, before.trust)
        for movement, reading, before in zip(after, readings, past, strict=False)
    ]


def kept(record: StepRecord, movement: MeasuredMovement | None, past: Sequence[Past]) -> Past:
    """Return what is kept of an update: its movement as best known, and what speaks for the estimate."""
    motions, link = record.frame.motions, 0.0 if movement is None else movement.link
    sensed, estimate = record.sighting.comparison.sensed, record.estimate.pose
    trust = past[0].trust if past else START_NATS * _is_together(record.predicted)
    if past and len(motions):
        between = motion_between(past[0].estimate, estimate)
        motion = reduce(compose_motions, motions) if movement is None else movement.motion
        off_m, off_rad = float(np.hypot(*(between - motion)[:2])), abs(wrap_angle(between[2] - motion[2]))
        is_same = movement is None and off_m < SAME_M and off_rad < SAME_RAD
        motions = (between if is_same else motion)[None]
        if off_m > JUMP_M or not (movement is None or movement.is_linked):
            trust = 0.0
    support = sum(max(0.0, part.support(estimate)) for part in sensed)
    return Past(motions, sensed, estimate, link, min(MOST_NATS, trust + SHARE * support))


def _is_together(cloud: Belief) -> bool:
    """Return whether a cloud began where somebody put it."""
    off = cloud.poses[:, :2] - cloud.weights @ cloud.poses[:, :2]
    return bool(cloud.weights @ (off**2).sum(axis=1) < START_M**2)


# Which proposals a cloud tracks.


def confirmed(
    comparison: Comparison, predicted: Belief, motions: F64, link: float, past: Sequence[Past]
) -> list[PoseProposal]:
    """Return what pose sensors propose whose readings a predicted cloud does not explain, nor may explain.

    The updates before check it, by the movements (M, 3) since then, and how these link the frame to the one
    before.
    """
    asked = comparison.sensed
    if link > DOUBTFUL_NATS:  # else the robot may be where a few particles fit by chance
        cloud = predicted.poses, predicted.weights, predicted.origin
        asked = tuple(part for part in asked if part.is_explained(*cloud) is False)
    return proposals_of(asked, partial(earlier, motions=motions, link=link, past=past))


def elsewhere(proposals: Sequence[PoseProposal], predicted: Belief, reach_m: float) -> list[PoseProposal]:
    """Return the parts of proposals where the predicted cloud is not.

    A cloud that has a hundredth of its weight within `reach_m` and 30 degrees of a mode tracks it by itself,
    and knows more of it than the sensor alone: the past. Not so a cloud whose headings have a standard
    deviation above 30 degrees: too few of its particles are near. A cloud that is together, with a standard
    deviation below `reach_m`, does not follow one thing alone, which may have been moved; one that searches
    does.
    """
    parts, together = [], _deviation_m(predicted) < reach_m
    turned = _deviation_rad(predicted) > TRACKED_RAD
    for proposal in proposals:
        near = np.array([_weight_near(pose, predicted, reach_m) for pose in proposal.poses])
        kept = (near < TRACKED_SHARE) | turned
        if together and proposal.of_one_thing is not None:
            kept &= ~proposal.of_one_thing
        if kept.any():
            parts.append(proposal.only(kept))
    return parts


def tracked(proposals: Sequence[PoseProposal], predicted: Belief, reach_m: float) -> tuple[F64, F64] | None:
    """Return the pose (3,) and covariance (3, 3) of the proposed mode that the predicted cloud tracks.

    It is that with the most weight of both, in the map's frame; None where the cloud tracks none
    (`elsewhere`).
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
    mean = abs(belief.weights @ np.exp(1j * belief.poses[:, 2].astype(np.float64)))
    return float(np.sqrt(-2 * np.log(np.clip(mean, 1e-12, 1.0))))


def _weight_near(pose: F64, predicted: Belief, reach_m: float) -> float:
    """Return the weight of the particles near a pose (3,) in the map's frame."""
    x, y, heading = predicted.poses.T
    away = np.hypot(x - (pose[0] - predicted.origin[0]), y - (pose[1] - predicted.origin[1]))
    turned = np.abs(wrap_angle(heading - pose[2]))
    return float(predicted.weights[(away < reach_m) & (turned < TRACKED_RAD)].sum())


# Guided motion.

# the number of a movement, any poses (n, 3) and the noise (n, 3) of each, to poses after it (n, 3)
Move = Callable[[int, F32, F32], F32]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnNoise:
    """Noise as the motion model draws it: N particles, M movements."""

    normals: F64  # (N, 3 M) standard normals
    widths: F64  # (N, 3 M) what they are multiplied with: more than 1 for motion outliers


def guided(prediction: Prediction, pose: F64, covariance: F64, share: float) -> ProposedParticles:
    """Move the particles, a share of them toward a pose (3,) in the map's frame with a covariance (3, 3)."""
    before, rng = prediction.before, prediction.rng(Purpose.GUIDE)
    target = pose - [*before.origin, 0.0]
    drawn = _drawn(prediction)
    poses, correction = guided_motion(before.poses, prediction.move, drawn, target, covariance, share, rng)
    return ProposedParticles(Belief(poses, before.log_weights, before.origin), correction, is_guided=True)


def _drawn(prediction: Prediction) -> DrawnNoise:
    """Return the noise of a prediction, and how much of it is that of outliers."""
    normals = np.concatenate(prediction.by_movement(prediction.normals), axis=1, dtype=np.float64)
    n, outliers = prediction.before.size, prediction.outliers
    wide = [widths(n, outliers, rng) for rng in prediction.outlier_rngs()]
    return DrawnNoise(normals, np.repeat(np.stack(wide, axis=1), 3, axis=1))


def guided_motion(
    poses: F32,
    move: Move,
    drawn: DrawnNoise,
    pose: F64,
    covariance: F64,
    share: float,
    rng: np.random.Generator,
) -> tuple[F32, F64]:
    """Move N particles (N, 3); return their poses, and the logs (N,) of predicted over proposal density.

    `pose` (3,), in the frame of the particles, and `covariance` (3, 3) are what a sensor proposes.
    """
    still, by_noise = _linearized(poses, move, drawn)
    off = pose - still
    off[:, 2] = wrap(off[:, 2])
    seen = covariance + LEAST_VARIANCE * np.eye(3)
    predicted = by_noise @ np.swapaxes(by_noise, 1, 2) + seen
    # a draw from the noise's posterior: one from its prior, moved by what it does not explain (Matheron)
    missed = rng.standard_normal((len(off), 3)) @ np.linalg.cholesky(seen).T
    unexplained = off - _applied(by_noise, drawn.normals) - missed
    follow = np.flatnonzero(rng.random(len(off)) < share)
    change = np.linalg.solve(predicted[follow], unexplained[follow, :, None])[:, :, 0]
    normals = drawn.normals.copy()
    normals[follow] += np.einsum("nij,ni->nj", by_noise[follow], change)
    # Bayes: the posterior's density over the prior's, at any noise
    seen_density = _log_normal(off - _applied(by_noise, normals), seen[None])
    gain = seen_density - _log_normal(off, predicted)
    correction = -np.logaddexp(np.log1p(-share), np.log(share) + gain)
    noise = (normals * drawn.widths).astype(np.float32)
    for movement in range(noise.shape[1] // 3):
        poses = move(movement, poses, noise[:, 3 * movement : 3 * movement + 3])
    return poses, correction


def _linearized(poses: F32, move: Move, drawn: DrawnNoise) -> tuple[F64, F64]:
    """Return poses (N, 3) without noise, and their derivatives (N, 3, 3 M) by the normals.

    The particles move once without noise and once with each of the normals changed, all of them together.
    """
    count, columns = drawn.normals.shape
    moved = poses
    for movement in range(columns // 3):
        before, moved = len(moved), np.concatenate([moved, *[moved[:count]] * 3])
        noise = np.zeros((3, len(moved)), np.float32)  # column by column
        for k in range(3):
            noise[k, before + k * count :][:count] = UNIT
        moved = move(movement, moved, noise.T)
    still = moved[:count].astype(np.float64)
    by_noise = np.empty((count, 3, columns))
    for column in range(columns):
        there = moved[(column + 1) * count :][:count] - still
        there[:, 2] = wrap(there[:, 2])
        by_noise[:, :, column] = there / UNIT * drawn.widths[:, column, None]
    return still, by_noise


def _applied(by_noise: F64, normals: F64) -> F64:
    return np.asarray(np.einsum("nij,nj->ni", by_noise, normals))


def _log_normal(off: F64, covariance: F64) -> F64:
    """Return the log-density (N,) of normal distributions (N, 3, 3) at distances (N, 3) from their means.

    Covariances (1, 3, 3) are those of all.
    """
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(covariance, off[:, :, None])[:, :, 0])
    return np.asarray(-0.5 * (squared + np.log(np.linalg.det(covariance))))
