"""Whether earlier scans fit a place, too: a single scan of a corridor fits many of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...values import (
    F32,
    F64,
    FITTING_NATS,
    I64,
    LINKED_NATS,
    TRUSTED_NATS,
    Bool,
    Earlier,
    PoseProposal,
    compose_motions,
    inverse,
    rotated,
    wrap_angle,
)
from .models import INDEPENDENT_BEAMS, SIGMA_M, UNKNOWN_NATS, LaserMap

# Chosen on three CARMEN logs (aces, intel, freiburg-079) with maps of their halves, tried on maps of thirds.
LEAST_NATS = 10.0  # of all scans together for a place, over what unknown space would give them
LEAST_SCAN_NATS = -5.0  # one scan lowers a place no further: it may show what the map does not have
SURE_SHARE = 0.97  # of all mass: where several places share it, the robot may be at another one, too
SAME_PLACE_M = 1.0
DRIFT_M, DRIFT_RAD = 3.0, np.pi / 3  # of an estimate at most, where the map says nothing
TURNED_SHARE = 0.5  # of the trust in an estimate, for a place nearby that is turned by more
AHEAD_NATS = 10.0  # over the estimate, for a place to which the robot was carried; twice that for one nearby
RIVAL_NATS = 20.0  # a place less far behind the best one is possible, too
BELIEVED = 0.1  # probability of the places that agree: enough for the scan at hand to decide
ESTIMATE_COVARIANCE = np.diag([0.3**2, 0.3**2, 0.1**2])  # of a pose, m^2 and rad^2
# What it costs in nats to have been carried between two scans that do not fit each other, and between
# two that fit well. Of scans in a row 99 of 100 fit by -1.0 nats a point or better, of those of other places
# 6 of 100. Of many places some fit by chance: one of them costs the log of their number more.
CARRIED_COST, FITTING_COST = 5.0, 18.0
SCANS_WORTH = 0.5  # of a scan's nats: scans of one wall share their errors
CELL_M = 0.3  # side of the cells in which points count once: hit again they say nothing new
SAMPLES = 100  # particles of each place
# standard deviations of a movement in m and rad: at least, per meter of it, and of a heading per radian
LEAST_SD, SD_PER_M, SD_PER_RAD = 0.02, 0.05, 0.1


@dataclass(frozen=True, slots=True, eq=False)
class PlaceAgreement:
    """At which J places of a proposal the robot may be."""

    shares: F64  # (J,) of the likelihood; 0 where it is not
    believed: float  # the probability that it is at one of them, and not at the estimate


def agreeing(map_: LaserMap, proposal: PoseProposal, here: F64, scans: Sequence[Earlier]) -> PlaceAgreement:
    """Return at which places of a proposal the robot may be, by scans: this one, then earlier ones.

    Places are compared with the estimate `here` (3,) and with each other. Either the robot was at a place all
    along, against the trust in the estimates before these scans; or it was carried there between two of the
    scans, which costs the more the better these two fit each other. To a place nearby the filter may have
    drifted. Where little ever spoke for an estimate, all places are as likely as they fit. Else it needs one
    that has nearly all mass, unless the robot was certainly carried.
    """
    poses = np.vstack([proposal.poses, here])
    totals = _nats(map_, poses, np.concatenate([proposal.covariances, ESTIMATE_COVARIANCE[None]]), scans)
    x, y = poses[:, :2].T
    apart_m = np.hypot(x[:, None] - x, y[:, None] - y)
    near, trust = apart_m[-1] < DRIFT_M, scans[-1].trust
    trusted = near * np.where(
        np.abs(wrap_angle(poses[:, 2] - here[2])) < DRIFT_RAD, trust, TURNED_SHARE * trust
    )
    links = np.array([scan.link for scan in scans[1:]])
    before = totals[-1, -1] - totals[-1, :-1] + trust  # nats for here, of the scans before it was carried
    carried = totals[:, :-1] + before - _carried_cost(links, map_.places)
    stayed = totals[:, -1] + trusted
    carried[-1] = -np.inf
    options = np.column_stack([carried, stayed])
    which, nats = options.argmax(axis=1), options.max(axis=1)
    shares = np.exp(SCANS_WORTH * (nats - nats.max()))
    rivals = nats > nats.max() - RIVAL_NATS
    if max(scan.trust for scan in scans[1:]) < TRUSTED_NATS:
        nowhere = np.exp(SCANS_WORTH * (LEAST_NATS - nats.max()))
        elsewhere = float(shares[:-1].sum() / (shares.sum() + nowhere))
        return PlaceAgreement(np.where(rivals, shares, 0.0)[:-1], elsewhere)
    ahead, places = nats - nats[-1], np.arange(len(poses))
    unlinked = np.append(links <= LINKED_NATS, False)[which]
    fits = (totals[places, which] > LEAST_NATS) | near & (ahead > 2 * AHEAD_NATS)
    believed = fits & (_sure(nats, apart_m) | unlinked & rivals & (ahead > AHEAD_NATS))
    return PlaceAgreement(np.where(believed, shares, 0.0)[:-1], BELIEVED)


def _carried_cost(links: F64, places: int) -> F64:
    """Return the nats against having been carried between scans that fit each other by some nats a point."""
    share = np.clip((links - LINKED_NATS) / (FITTING_NATS - LINKED_NATS), 0, 1)
    most = (FITTING_COST + np.log(places)) / SCANS_WORTH
    return np.asarray(CARRIED_COST + (most - CARRIED_COST) * share**2)


def _sure(nats: F64, apart_m: F64) -> Bool:
    """Return which places (J,), and what is near them, have nearly all mass."""
    share = np.exp(SCANS_WORTH * (nats - nats.max()))
    return np.asarray((apart_m < SAME_PLACE_M) @ share > SURE_SHARE * share.sum())


def _nats(map_: LaserMap, poses: F64, covariances: F64, scans: Sequence[Earlier]) -> F64:
    """Return the nats (J, S) by which the first one to S scans speak for poses (J, 3), not for unknown space.

    A particle filter runs backward from each place: where the robot was is as uncertain as its odometry.
    Points that later scans hit, too, are left out, or a corridor would count as often as it was seen.
    """
    rng, count = np.random.default_rng(0), len(poses)
    spread = np.linalg.cholesky(covariances + 1e-6 * np.eye(3))
    drawn = np.einsum("jab,jsb->jsa", spread, rng.standard_normal((count, SAMPLES, 3)))
    poses, total = poses[:, None] + drawn, np.zeros((count, len(scans)))
    middles, field = (np.arange(SAMPLES) + 0.5) / SAMPLES, map_.field("lasting", SIGMA_M)
    back, hit = np.zeros(3), np.zeros(0, np.int64)
    for number, before in enumerate(scans):
        poses = _back(poses, before.motions, rng)
        for motion in before.motions[::-1]:
            back = compose_motions(back, inverse(motion))
        if before.reading is None:
            continue
        cells = _cells(before.reading.ends, back)
        ends = before.reading.ends[~np.isin(cells, hit)]
        if not len(ends):
            continue
        hit = np.concatenate([hit, cells])
        flat = poses.reshape(-1, 3)
        origin = flat[0, :2].copy()
        local: F32 = (flat - [*origin, 0.0]).astype(np.float32)
        nats = field.sums(ends, local, origin) - np.float32(UNKNOWN_NATS * len(ends))
        nats *= np.float32(min(1.0, INDEPENDENT_BEAMS / len(cells)))
        weights = np.exp(np.maximum(nats.astype(np.float64), LEAST_SCAN_NATS)).reshape(count, SAMPLES)
        total[:, number] = np.log(weights.mean(axis=1))
        shares = weights.cumsum(axis=1) / weights.sum(axis=1, keepdims=True)
        parents = np.minimum((shares[:, None] < middles[:, None]).sum(axis=2), SAMPLES - 1)
        poses = np.take_along_axis(poses, parents[:, :, None], axis=1)
    return total.cumsum(axis=1)


def _cells(ends: F64, pose: F64) -> I64:
    """Return numbers (K,) of the cells of a grid in which points (K, 2) seen from a pose (3,) are."""
    x, y = rotated(ends[:, 0], ends[:, 1], pose[2])
    columns, rows = np.floor((x + pose[0]) / CELL_M), np.floor((y + pose[1]) / CELL_M)
    return np.asarray(columns * 2**20 + rows, np.int64)


def _back(poses: F64, motions: F64, rng: np.random.Generator) -> F64:
    """Return poses (J, S, 3) before movements (M, 3), each with noise."""
    for motion in motions[::-1]:
        turned = np.array([0, 0, abs(motion[2])])
        sd = LEAST_SD + SD_PER_M * float(np.hypot(*motion[:2])) + SD_PER_RAD * turned
        moved = motion + sd * rng.standard_normal(poses.shape)
        heading = poses[..., 2] - moved[..., 2]
        x, y = rotated(moved[..., 0], moved[..., 1], heading)
        poses = np.stack([poses[..., 0] - x, poses[..., 1] - y, heading], axis=2)
    return poses
