"""Whether earlier scans fit a place, too: a single scan of a corridor fits many places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...values import F32, F64, Bool, Earlier, PoseProposal, rotated
from .models import LaserMap, calibrated, in_unknown_space

# Chosen on two CARMEN logs (aces, intel) with maps of their halves, tried on a third (freiburg-079) and on
# maps of thirds.
LEAST_NATS = 10.0  # by which the earlier scans together speak for the place rather than for unknown space
MOST_AGAINST = -20.0  # nats of one scan: it may show what the map does not have
SURE_SHARE = 0.97  # of the proposal's mass: a place that others nearly equal may be none of them
SAME_PLACE_M = 1.0
SCANS_WORTH = 0.5  # of a scan's nats: scans of one wall share their errors
SAMPLES = 100  # of each place
# standard deviations of a movement in m and rad: at least, per meter of it, and of a heading per radian
LEAST, PER_M, PER_RAD = 0.02, 0.05, 0.1


def agreeing(there: LaserMap, proposal: PoseProposal, earlier: Sequence[Earlier]) -> Bool:
    """Return at which place (J,) of a proposal the robot surely is, by the earlier scans, the latest first.

    A robot off the map may be in a corridor that looks like one of the map, and then it looks like several
    places of it: only one that no other equals is believed. Without an earlier scan all are.
    """
    if all(before.reading is None for before in earlier):
        return np.ones(len(proposal.poses), np.bool_)
    nats = _nats(there, proposal, earlier)
    mass = np.log(proposal.weights) + SCANS_WORTH * nats
    share = np.exp(mass - mass.max())
    x, y = proposal.poses[:, :2].T
    same = np.hypot(x[:, None] - x, y[:, None] - y) < SAME_PLACE_M
    return np.asarray((nats > LEAST_NATS) & (same @ share > SURE_SHARE * share.sum()))


def _nats(there: LaserMap, proposal: PoseProposal, earlier: Sequence[Earlier]) -> F64:
    """Return the nats (J,) by which earlier scans speak for the places rather than for unknown space.

    A particle filter runs backward from each place: where the robot was is as uncertain as its odometry.
    """
    rng, count = np.random.default_rng(0), len(proposal.poses)
    spread = np.linalg.cholesky(proposal.covariances + 1e-6 * np.eye(3))
    drawn = np.einsum("jab,jsb->jsa", spread, rng.standard_normal((count, SAMPLES, 3)))
    poses, total = proposal.poses[:, None] + drawn, np.zeros(count)
    middles = (np.arange(SAMPLES) + 0.5) / SAMPLES
    for before in earlier:
        poses = _back(poses, before.motions, rng)
        if before.reading is None:
            continue
        flat = poses.reshape(-1, 3)
        origin = flat[0, :2].copy()
        local: F32 = (flat - [*origin, 0.0]).astype(np.float32)
        nats = calibrated(there, before.reading, local, origin, 0.0) - in_unknown_space(before.reading)
        weights = np.exp(np.maximum(nats.astype(np.float64), MOST_AGAINST)).reshape(count, SAMPLES)
        total += np.log(weights.mean(axis=1))
        shares = weights.cumsum(axis=1) / weights.sum(axis=1, keepdims=True)
        parents = np.minimum((shares[:, None] < middles[:, None]).sum(axis=2), SAMPLES - 1)
        poses = np.take_along_axis(poses, parents[:, :, None], axis=1)
    return total


def _back(poses: F64, motions: F64, rng: np.random.Generator) -> F64:
    """Return poses (J, S, 3) before movements (M, 3), each with noise."""
    for motion in motions[::-1]:
        sd = LEAST + PER_M * float(np.hypot(*motion[:2])) + PER_RAD * np.array([0, 0, abs(motion[2])])
        moved = motion + sd * rng.standard_normal(poses.shape)
        heading = poses[..., 2] - moved[..., 2]
        x, y = rotated(moved[..., 0], moved[..., 1], heading)
        poses = np.stack([poses[..., 0] - x, poses[..., 1] - y, heading], axis=2)
    return poses
