"""Where a robot in the plane must be to see matched landmarks where it does: robust, and with its covariance.

A camera of known tilt leaves three unknowns. With c and s the cosine and sine of the heading, and (a, b) the
robot's place turned into its own frame, a match gives two equations that are linear in (c, s, a, b): its
direction in the plane, and its slope. Two matches give a hypothesis; all are scored at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, wrap
from .camera import PinholeCamera, directions, linearize_poses, project

MOST_HYPOTHESES = 400
MOST_MODES = 4
WIDE_PX = 4.0  # standard deviation that hypotheses are scored with, and refinement begins with
MOST_REFINED = 8  # hypotheses that are refined: those that are at most ...
REFINED_NATS = 20.0  # ... so far below the best
REFINEMENT_STEPS = 8
SCALE_TOLERANCE = 0.35  # by which c^2 + s^2 of a hypothesis may differ from one
FARTHEST_STEP = 0.5  # meters or radians, of one step of refinement
MODE_RADIUS_M, MODE_RADIUS_RAD = 0.15, 0.15  # modes nearer to each other are one


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """K matches of keypoints to landmarks."""

    pixels: F64  # (K, 2)
    points: F64  # (K, 3)
    inlier: F64  # (K,) probability of being right, before anything is known of the pose
    sd_px: F64  # (K,) of a right one, along one axis


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One pose that matches agree on."""

    pose: F64  # (3,)
    covariance: F64  # (3, 3)
    score: float  # nats above no agreement at all
    right: F64  # (K,) probability of each match to be right, at this pose

    @property
    def inliers(self) -> float:
        """Expected number of right matches."""
        return float(self.right.sum())


def modes_of(camera: PinholeCamera, matched: Matched, area_px: float) -> list[Mode]:
    """Return the poses that matches agree on, best first, at most `MOST_MODES`."""
    if len(matched.pixels) < 3:
        return []
    # about a local origin: what is solved for two matches has no digits left at UTM coordinates
    origin = np.append(matched.points[:, :2].mean(axis=0), 0.0)
    matched = replace(matched, points=matched.points - origin)
    hypotheses = hypotheses_of(camera, matched)
    if not len(hypotheses):
        return []
    score = scores(camera, matched, hypotheses, area_px)
    order = np.argsort(-score, kind="stable")
    order = order[score[order] > score.max() - REFINED_NATS]
    chosen = hypotheses[order[_apart(hypotheses[order], MOST_REFINED)]]
    modes = sorted(refined(camera, matched, chosen, area_px), key=lambda mode: -mode.score)
    numbers = _apart(np.stack([mode.pose for mode in modes]), MOST_MODES)
    return [replace(modes[k], pose=modes[k].pose + origin) for k in numbers]


def _apart(poses: F64, most: int) -> list[int]:
    """Return the numbers of the first poses (H, 3) that are apart from those before, at most `most`."""
    left = np.ones(len(poses), np.bool_)
    numbers: list[int] = []
    while left.any() and len(numbers) < most:
        k = int(left.argmax())
        numbers.append(k)
        far = np.hypot(*(poses[:, :2] - poses[k, :2]).T) > MODE_RADIUS_M
        left &= far | (np.abs(wrap(poses[:, 2] - poses[k, 2])) > MODE_RADIUS_RAD)
        left[k] = False
    return numbers


def hypotheses_of(camera: PinholeCamera, matched: Matched) -> F64:
    """Return poses (H, 3) of pairs of matches, drawn by their chance of being right; always the same."""
    first, second = _pairs(matched.inlier)
    angle, slope = directions(camera, matched.pixels)
    c, s = np.cos(angle - camera.yaw_rad), np.sin(angle - camera.yaw_rad)
    x, y, z = matched.points.T
    zero, up = np.zeros_like(c), z - camera.height_m
    # robot's frame: p = (cX + sY - a, -sX + cY - b); across: sin p_x = cos p_y; along: slope * |p| = up
    across = np.stack([s * x - c * y, s * y + c * x, -s, c], axis=1)
    along = slope[:, None] * np.stack([c * x + s * y, c * y - s * x, -c, -s], axis=1)
    left = np.stack([across[first], along[first], across[second], along[second]], axis=1)
    right = np.stack([zero[first], up[first], zero[second], up[second]], axis=1)
    solvable = np.abs(np.linalg.det(left)) > 1e-9
    solved = np.linalg.solve(left[solvable], right[solvable][:, :, None])[:, :, 0]
    scale = np.hypot(solved[:, 0], solved[:, 1])
    sane = np.abs(scale - 1) < SCALE_TOLERANCE
    heading = np.arctan2(solved[sane, 1], solved[sane, 0])
    a, b = solved[sane, 2], solved[sane, 3]
    ch, sh = np.cos(heading), np.sin(heading)
    return np.column_stack([ch * a - sh * b, sh * a + ch * b, wrap(heading - camera.yaw_rad)])


def _pairs(chance: F64) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return numbers of pairs, the likeliest right first."""
    first, second = np.triu_indices(len(chance), 1)
    if len(first) > MOST_HYPOTHESES:
        rng = np.random.default_rng(0)
        weight = chance[first] * chance[second]
        sample = rng.choice(len(first), MOST_HYPOTHESES, replace=False, p=weight / weight.sum())
        first, second = first[sample], second[sample]
    return first.astype(np.intp), second.astype(np.intp)


def outlier_part(inlier: F64, sd_px: F64, area_px: float) -> F64:
    """Return the density of wrong matches (K,) over that of right ones at their best."""
    return (1 - inlier) / inlier * (2 * np.pi * sd_px**2 / area_px)


def scores(camera: PinholeCamera, matched: Matched, poses: F64, area_px: float) -> F64:
    """Return how many nats (H,) above no agreement poses (H, 3) are, with wide residuals."""
    sd = np.hypot(matched.sd_px, WIDE_PX)
    origin = poses[:1, :2].mean(axis=0)
    near = (poses - [*origin, 0.0]).astype(np.float32)
    pixels, _ = project(camera, near, (matched.points - [*origin, 0.0]).astype(np.float32))
    off = pixels - matched.pixels.T[:, None, :].astype(np.float32)
    agree: F32 = np.exp(-0.5 * (off[0] ** 2 + off[1] ** 2) / (sd**2).astype(np.float32))
    wrong = outlier_part(matched.inlier, sd, area_px)
    return np.asarray(np.log1p(agree / wrong.astype(np.float32)).sum(axis=1), np.float64)


def refined(camera: PinholeCamera, matched: Matched, poses: F64, area_px: float) -> list[Mode]:
    """Refine poses (H, 3) by expectation and maximization, from wide residuals to the true ones."""
    for step in range(REFINEMENT_STEPS):
        sd = np.hypot(matched.sd_px, WIDE_PX * 0.5**step)
        agreed = _agreement(camera, matched, poses, sd, area_px)
        change = np.linalg.solve(agreed.information, agreed.pull[:, :, None])[:, :, 0]
        poses = poses + np.clip(change, -FARTHEST_STEP, FARTHEST_STEP)
    agreed = _agreement(camera, matched, poses, matched.sd_px, area_px)
    poses = np.column_stack([poses[:, :2], wrap(poses[:, 2])])
    covariances = np.linalg.inv(agreed.information) * agreed.variance[:, None, None]
    values = zip(poses, covariances, agreed.score.tolist(), agreed.right, strict=True)
    return [Mode(*value) for value in values]


@dataclass(frozen=True, slots=True, eq=False)
class _Agreement:
    """How matches agree with H poses."""

    information: F64  # (H, 3, 3)
    pull: F64  # (H, 3)
    score: F64  # (H,)
    right: F64  # (H, K) probability of each match to be right
    variance: F64  # (H,) of the residuals of right matches, over what was expected; at least 1


def _agreement(camera: PinholeCamera, matched: Matched, poses: F64, sd: F64, area_px: float) -> _Agreement:
    pixels, by_pose, seen = linearize_poses(camera, poses, matched.points)
    off = matched.pixels.T - pixels
    squared = (off[:, 0] ** 2 + off[:, 1] ** 2) / sd**2
    agree = np.where(seen, np.exp(-0.5 * squared), 0.0)
    wrong = outlier_part(matched.inlier, sd, area_px)
    right = agree / (agree + wrong)
    weighted = by_pose * (right / sd**2)[:, None, :, None]
    rows = len(poses), -1, 3
    information = np.swapaxes(weighted.reshape(rows), 1, 2) @ by_pose.reshape(rows) + 1e-6 * np.eye(3)
    pull = (off.reshape(len(poses), 1, -1) @ weighted.reshape(rows))[:, 0]
    variance = np.sum(right * squared, axis=1) / np.maximum(2 * right.sum(axis=1) - 3, 1.0)
    score = np.log1p(agree / wrong).sum(axis=1)
    return _Agreement(information, pull, score, right, np.maximum(variance, 1.0))
