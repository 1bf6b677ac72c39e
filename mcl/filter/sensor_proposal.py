"""Poses that pose sensors propose: drawn from mixtures of normal distributions, and their density."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..values import (
    DOUBTFUL_NATS,
    F32,
    F64,
    Belief,
    Comparison,
    Past,
    PoseProposal,
    PoseSensor,
    wrap,
    wrap_angle,
)
from .past import earlier

SENSOR_SHARE = 0.8  # share of the drawn poses that are a pose sensor's; the others follow the likelihood
TRACKED_SHARE = 0.01  # share of the weight near a mode from which on the cloud tracks it by itself
TRACKED_RAD = np.pi / 6
LEAST_VARIANCE = 1e-6  # added to variances (m^2, rad^2), so that no covariance is singular


def proposals_of(
    comparison: Comparison,
    predicted: Belief | None = None,
    motions: F64 | None = None,
    link: float = 0.0,
    past: Sequence[Past] = (),
) -> list[PoseProposal]:
    """Return what the pose sensors propose for a frame.

    With a predicted cloud nothing is asked of a sensor whose reading that cloud explains, or may explain.
    With movements (M, 3), and how they link the frame to that before, the updates before check proposals.
    """
    asked = comparison.sensed
    if predicted is not None:
        cloud = predicted.poses, predicted.weights, predicted.origin
        if link > DOUBTFUL_NATS:  # else the robot may be where a few particles fit by chance
            asked = tuple(part for part in asked if part.is_explained(*cloud) is False)
    before = past if motions is not None else ()
    movements = np.zeros((0, 3)) if motions is None else motions
    proposals = (part.confirmed(earlier(part.name, movements, link, before)) for part in asked)
    return [proposal for proposal in proposals if proposal is not None]


def can_propose(sensors: Iterable[PoseSensor]) -> bool:
    """Return whether one of the pose sensors proposes poses at all."""
    return any(getattr(sensor, "proposes", False) for sensor in sensors)


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


def draw_poses(proposals: Sequence[PoseProposal], n: int, origin: F64, rng: np.random.Generator) -> F32:
    """Draw n poses (n, 3) relative to `origin` from proposals, each of them as likely as the others."""
    weights, means, covariances = _joined(proposals)
    which = np.minimum(np.searchsorted(np.cumsum(weights), rng.random(n)), len(weights) - 1)
    spread = np.linalg.cholesky(covariances)[which]
    poses = means[which] + np.einsum("nij,nj->ni", spread, rng.standard_normal((n, 3)))
    poses[:, :2] -= origin
    drawn: F32 = poses.astype(np.float32)
    drawn[:, 2] = wrap(drawn[:, 2])
    return drawn


def density(proposals: Sequence[PoseProposal], poses: F32, origin: F64) -> F64:
    """Return the density (N,) per m^2 and rad of `draw_poses` at poses (N, 3) relative to `origin`."""
    weights, means, covariances = _joined(proposals)
    world = poses.astype(np.float64)
    world[:, :2] += origin
    total = np.zeros(len(poses))
    for weight, mean, covariance in zip(weights, means, covariances, strict=True):
        away = world - mean
        away[:, 2] = wrap_angle(away[:, 2])
        squared = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away)
        total += weight * np.exp(-0.5 * squared) / np.sqrt((2 * np.pi) ** 3 * np.linalg.det(covariance))
    return total


def _joined(proposals: Sequence[PoseProposal]) -> tuple[F64, F64, F64]:
    """Return weights (M,), means (M, 3) and covariances (M, 3, 3) of one mixture."""
    shares = [proposal.weights / (proposal.weights.sum() * len(proposals)) for proposal in proposals]
    poses = [proposal.poses for proposal in proposals]
    covariances = np.concatenate([proposal.covariances for proposal in proposals])
    return np.concatenate(shares), np.concatenate(poses), covariances + LEAST_VARIANCE * np.eye(3)
