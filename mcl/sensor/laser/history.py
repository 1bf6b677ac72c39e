"""Whether earlier scans fit a place, too: a single scan of a corridor fits many places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...values import F32, F64, Bool, Earlier, PoseProposal, rotated
from .models import LaserMap, calibrated, in_unknown_space

# Chosen on three CARMEN logs (aces, intel, freiburg-079) with maps of their halves, tried on maps of thirds.
LEAST_NATS = 10.0  # by which the scans together speak for the place rather than for unknown space
MOST_AGAINST = -20.0  # nats of one scan: it may show what the map does not have
SURE_SHARE = 0.97  # of all mass: a place that others nearly equal may be none of them
SAME_PLACE_M = 1.0
SLIP_M = 3.0  # from where the filter thinks to be: so far wheels may slip in a few updates
BELIEVED = 0.1  # probability of the places that agree: most are right, and the scan at hand decides
HERE = np.diag([0.3**2, 0.3**2, 0.1**2])  # covariance of where the filter thinks to be
# by how many nats scans must speak for having been carried off: on the map, and off it, where nothing is seen
CARRIED_NATS, CARRIED_OFF_MAP_NATS = 80.0, 140.0
# nats of the first scan that was not explained: a robot that drives off the map sees unknown space, worth 0
AGAINST_NATS = -5.0
SCANS_WORTH = 0.5  # of a scan's nats: scans of one wall share their errors
SAMPLES = 100  # of each place
# standard deviations of a movement in m and rad: at least, per meter of it, and of a heading per radian
LEAST, PER_M, PER_RAD = 0.02, 0.05, 0.1


def agreeing(
    there: LaserMap,
    proposal: PoseProposal,
    here: F64,
    scans: Sequence[Earlier],
    unexplained: int,
    *,
    off_map: bool,
) -> Bool:
    """Return at which places (J,) of a proposal the robot may be, by scans: this one, then earlier ones.

    They are compared with `here` (3,), where the filter thinks to be. Of the scans before this one the last
    `unexplained` were not explained by the estimates: a place has to explain those, and either all before, or
    those so much better that the robot was carried off. Where wheels slip, or somebody pushes the robot, the
    odometry does not lead back to the scans before: a place nearby needs this scan alone. A robot off the map
    may be in a corridor that looks like one of the map, and then like several places of it: only one that no
    other equals is believed.
    """
    poses = np.vstack([proposal.poses, here])
    totals = _nats(there, poses, np.concatenate([proposal.covariances, HERE[None]]), scans)
    nats = totals[:, unexplained]
    carried = nats > nats[-1] + CARRIED_NATS
    if off_map:
        stayed, before = totals[:, -1], totals[-1, -1] - nats[-1]
        nats = np.maximum(stayed, nats + before - CARRIED_OFF_MAP_NATS)
    x, y = poses[:, :2].T
    apart_m = np.hypot(x[:, None] - x, y[:, None] - y)
    agree = _sure(nats, apart_m) & (nats > LEAST_NATS)
    if not off_map:
        now = totals[:, 0]
        slipped = _sure(now, apart_m) & (now > LEAST_NATS) & (apart_m[-1] < SLIP_M)
        agree |= slipped | carried & (nats > LEAST_NATS)
    return np.asarray(agree[:-1])


def _sure(nats: F64, apart_m: F64) -> Bool:
    """Return which places (J,), and what is near them, have nearly all mass."""
    share = np.exp(SCANS_WORTH * (nats - nats.max()))
    return np.asarray((apart_m < SAME_PLACE_M) @ share > SURE_SHARE * share.sum())


def contradicts(there: LaserMap, before: Earlier) -> bool:
    """Return whether a scan speaks against its estimate, more than a drive into unknown space would."""
    if before.reading is None:
        return False
    pose = np.array([[0.0, 0.0, before.estimate[2]]], np.float32)
    nats = calibrated(there, before.reading, pose, before.estimate[:2], 0.0)
    return float(nats[0] - in_unknown_space(before.reading)) < AGAINST_NATS


def _nats(there: LaserMap, poses: F64, covariances: F64, scans: Sequence[Earlier]) -> F64:
    """Return the nats (J, S) by which the first one to S scans speak for poses (J, 3), not for unknown space.

    A particle filter runs backward from each place: where the robot was is as uncertain as its odometry.
    """
    rng, count = np.random.default_rng(0), len(poses)
    spread = np.linalg.cholesky(covariances + 1e-6 * np.eye(3))
    drawn = np.einsum("jab,jsb->jsa", spread, rng.standard_normal((count, SAMPLES, 3)))
    poses, total = poses[:, None] + drawn, np.zeros((count, len(scans)))
    middles = (np.arange(SAMPLES) + 0.5) / SAMPLES
    for number, before in enumerate(scans):
        poses = _back(poses, before.motions, rng)
        if before.reading is None:
            continue
        flat = poses.reshape(-1, 3)
        origin = flat[0, :2].copy()
        local: F32 = (flat - [*origin, 0.0]).astype(np.float32)
        nats = calibrated(there, before.reading, local, origin, 0.0) - in_unknown_space(before.reading)
        weights = np.exp(np.maximum(nats.astype(np.float64), MOST_AGAINST)).reshape(count, SAMPLES)
        total[:, number] = np.log(weights.mean(axis=1))
        shares = weights.cumsum(axis=1) / weights.sum(axis=1, keepdims=True)
        parents = np.minimum((shares[:, None] < middles[:, None]).sum(axis=2), SAMPLES - 1)
        poses = np.take_along_axis(poses, parents[:, :, None], axis=1)
    return total.cumsum(axis=1)


def _back(poses: F64, motions: F64, rng: np.random.Generator) -> F64:
    """Return poses (J, S, 3) before movements (M, 3), each with noise."""
    for motion in motions[::-1]:
        sd = LEAST + PER_M * float(np.hypot(*motion[:2])) + PER_RAD * np.array([0, 0, abs(motion[2])])
        moved = motion + sd * rng.standard_normal(poses.shape)
        heading = poses[..., 2] - moved[..., 2]
        x, y = rotated(moved[..., 0], moved[..., 1], heading)
        poses = np.stack([poses[..., 0] - x, poses[..., 1] - y, heading], axis=2)
    return poses
