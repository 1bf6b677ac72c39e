"""How a robot moved between scans, by the scans: the last one is matched with those before (laser odometry).

The scans before are laid out along their movements, and the movement that makes the last one fit is found by
importance sampling around what the wheels measured (Olson, ICRA 2009, rates a grid of movements in the same
way). Where the map says nothing, a filter drifts a sixth to an eleventh as far as by its wheels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...values import (
    DOUBTFUL_NATS,
    F32,
    F64,
    LINKED_NATS,
    Earlier,
    MeasuredMovement,
    compose_motions,
    inverse,
    rotated,
)

SCANS = 10  # before this one that it is matched with
REACH_M = 20.0  # points farther off are left out
CELL_M, MARGIN_M = 0.05, 0.5
MOST_POINTS, MOST_BEFORE, LEAST_POINTS = 60, 180, 20  # of this scan, and of each before it
SIGMA_M, OUTLIER = 0.1, 0.1  # as in the calibrated model: some points hit what was not in view before
SCAN_WORTH = 0.5  # of a scan's nats: scans of one wall share their errors
# standard deviations of what wheels measure in m and rad: at least, and per meter and rad of it
SD_M, SD_RAD, SD_PER_M, SD_PER_RAD, SD_RAD_PER_M = 0.05, 0.03, 0.1, 0.1, 0.05
LEAST_COVARIANCE = np.diag([0.01, 0.01, 0.003]) ** 2  # covariance of a movement at least
SLIP_SD = np.array([0.5, 0.5, 0.4])  # of the same (m, m, rad) where wheels slip
# Nats a point. A scan that fits worse than CLEAR_NATS may come after a slip, if the movement with a slip fits
# better by SLIP_GAIN, and at least as well as SLIP_NATS.
CLEAR_NATS, SLIP_GAIN, SLIP_NATS = -0.3, 0.2, -0.6
ROUNDS = 4  # of importance sampling, each about the last one's mean
DRAWN: F64 = np.random.default_rng(0).standard_normal((300, 3))  # the same for every scan
DRAWN[0] = 0.0


def movement_by_scans(points: F64, motion: F64, earlier: Sequence[Earlier]) -> MeasuredMovement | None:
    """Return how a robot moved that now sees points (K, 2); None where it sees too few.

    `motion` (3,) is what its wheels measured; `earlier` has the scans before, the latest first, and how it
    moved between them.
    """
    points, before = _thinned(points, MOST_POINTS), _laid_out(earlier)
    if len(points) < LEAST_POINTS or len(before) < LEAST_POINTS:
        return None
    seen, distance_m, turn = _Seen.of(before), float(np.hypot(*motion[:2])), abs(float(motion[2]))
    turn_sd = SD_RAD + SD_PER_RAD * turn + SD_RAD_PER_M * distance_m
    wheels = np.array([SD_M + SD_PER_M * distance_m] * 2 + [turn_sd])
    movement = _matched(seen, points, motion, wheels)
    if movement.link > CLEAR_NATS:
        return movement
    slipped = _matched(seen, points, motion, SLIP_SD)
    if slipped.link > max(movement.link + SLIP_GAIN, SLIP_NATS):
        return slipped if movement.is_linked else replace(slipped, link=DOUBTFUL_NATS)
    return movement if movement.is_linked else replace(movement, motion=motion)


def _matched(seen: _Seen, points: F64, motion: F64, wheels: F64) -> MeasuredMovement:
    """Return the movement by which points (K, 2) fit best; wheels have standard deviations (3,)."""
    mean, covariance = motion, np.diag(wheels**2)
    for _ in range(ROUNDS):
        moved = mean + DRAWN @ np.linalg.cholesky(covariance).T
        nats = SCAN_WORTH * seen.nats(points, moved)
        nats += 0.5 * (DRAWN**2).sum(axis=1) - 0.5 * (((moved - motion) / wheels) ** 2).sum(axis=1)
        weights = np.exp(nats - nats.max())
        weights /= weights.sum()
        mean = weights @ moved
        off = moved - mean
        covariance = (off.T * weights) @ off + LEAST_COVARIANCE
    return MeasuredMovement(mean, covariance, float(seen.nats(points, mean[None])[0]) / len(points))


def _laid_out(earlier: Sequence[Earlier]) -> F64:
    """Return the points (K, 2) of the scans before, in the frame of the latest."""
    parts, back = [np.zeros((0, 2))], np.zeros(3)
    for number, before in enumerate(earlier[:SCANS]):
        if number and before.link <= LINKED_NATS:
            break
        for motion in before.motions[::-1] if number else ():
            back = compose_motions(back, inverse(motion))
        if before.reading is not None:
            points = _thinned(before.reading.scan.points(), MOST_BEFORE)
            parts.append(np.column_stack(rotated(points[:, 0], points[:, 1], back[2])) + back[:2])
    return _near(np.concatenate(parts))


def _thinned(points: F64, most: int) -> F64:
    """Return at most so many of the points (K, 2) that are near, evenly chosen."""
    points = _near(points)
    count = min(most, len(points))
    return points[(2 * np.arange(count) + 1) * len(points) // max(2 * count, 1)]


def _near(points: F64) -> F64:
    kept: F64 = points[np.hypot(points[:, 0], points[:, 1]) < REACH_M]
    return kept


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """How far places are from the nearest of some points."""

    apart_m: F32  # (H, W)
    corner: F64  # (2,)

    @classmethod
    def of(cls, points: F64) -> _Seen:
        """Measure from points (K, 2)."""
        corner = points.min(axis=0) - MARGIN_M
        columns, rows = ((points - corner) / CELL_M).astype(np.int32).T
        margin = round(MARGIN_M / CELL_M) + 1
        cells = np.ones((rows.max() + margin, columns.max() + margin), np.uint8)
        cells[rows, columns] = 0
        apart = cv2.distanceTransform(cells, cv2.DIST_L2, cv2.DIST_MASK_5)
        return cls(np.asarray(apart * np.float32(CELL_M), np.float32), corner)

    def nats(self, points: F64, moved: F64) -> F64:
        """Return how well points (K, 2) fit after movements (N, 3), in nats (N,) of all of them."""
        cos, sin = np.cos(moved[:, 2:]), np.sin(moved[:, 2:])
        x, y = points.T
        columns = (moved[:, :1] + cos * x - sin * y - self.corner[0]) / CELL_M - 0.5
        rows = (moved[:, 1:2] + sin * x + cos * y - self.corner[1]) / CELL_M - 0.5
        places = columns.astype(np.float32), rows.astype(np.float32)
        outside = cv2.BORDER_CONSTANT
        off = cv2.remap(self.apart_m, *places, cv2.INTER_LINEAR, borderMode=outside, borderValue=REACH_M)
        near = np.exp(off * off * np.float32(-0.5 / SIGMA_M**2))
        nats: F64 = np.log(near * np.float32(1 - OUTLIER) + np.float32(OUTLIER)).sum(axis=1, dtype=np.float64)
        return nats
