"""How a robot moved between two pictures: SIFT matches and epipolar geometry, for a robot on a plane.

The essential matrix of a camera that moves in a plane has two numbers: the turn and the direction of travel.
So every pair of them on a grid is tried (which needs no random draws), the best ones are refined by least
squares in which outliers count little, and what too few matches agree with says nothing. Wheels do not slide
sideways: the direction is expected between the headings before and after. Lengths come from the floor, below
a camera of known height. A rotation that leaves nothing to explain is a robot that stands or turns in place.
Rays are (left, up) at one unit ahead, in the robot's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..values import F32, F64, U8, Bool, wrap, wrap_angle
from .landmarks.features import root_descriptors

MOST_KEYPOINTS = 500
SIFT_CONTRAST, SIFT_EDGE = 0.01, 20  # of SIFT: many weak points, as pictures are small and walls bare
RATIO_TEST = 0.85  # of the distances to the best and the second best match
FEWEST_MATCHES, FEWEST_AGREEING = 8, 10
LEAST_AGREEING_SHARE = 0.45  # share of the matches
EPIPOLAR_PX = 2.5  # from the epipolar line: a match agrees
MOST_MATCH_NATS = 3.0  # of one match, in nats
SIDEWAYS_RAD = float(np.radians(8))  # sd of the direction of travel of a robot that does not turn
BACKWARD_NATS = 3.0
TURN_STEP_RAD, DIRECTION_STEP_RAD = float(np.radians(2)), float(np.radians(5))  # of the grid
REFINED_STARTS = 4  # places of the grid that are refined
ROUNDS_PX = (4, 4, 2, 2, 1, 1, 1, 1, 1, 1)  # spread that residuals are taken to have, round by round
# Of a robot that moved by 0.1 m, 27 % of the matches at most (95 %) are within 2 px of one turn in place.
FEWEST_TURNED, LEAST_TURNED_SHARE, TURNED_PX = 3, 0.3, 2.0
PARALLAX_PX = 3.0  # that a rotation leaves in the median of all matches: the pair tells of the camera's tilt
TILTS_RAD: F64 = np.radians(np.arange(-24.0, 24.1, 4.0))
TILT_PAIRS, TILT_MATCHES = 8, 60  # with the most matches: the camera's tilt is fitted to these
STEPS_OF_HEIGHT: F64 = np.geomspace(0.1, 8.0, 80)  # lengths tried, in camera heights
FEWEST_ON_FLOOR, CLEAR_MARGIN = 3.0, 1.0  # weighted matches for a length; more than for most others
# What a rotation leaves of a robot that stands or turns in place, in the median of its matches: 1.0 px (90 %
# below 1.9), 0.0 px outward (90 % within 0.3). A step of 0.3 m leaves 6 px (95 % above 3), 5 px outward.
STANDING_PX, STANDING_OUTWARD_PX = 2.2, 0.6


@dataclass(frozen=True, slots=True, eq=False)
class PicturePoints:
    """What can be found again in a picture: points, and what they look like."""

    rays: F64  # (K, 2) left, up of a camera that is level
    looks: F32  # (K, 128) square roots of SIFT, so that their products compare them (RootSIFT)
    pixel: float  # of the picture, in rays


@dataclass(frozen=True, slots=True, eq=False)
class MatchedPoints:
    """Points seen in two pictures."""

    before: F64  # (K, 2) rays
    after: F64  # (K, 2)
    pixel: float

    def first(self, count: int) -> MatchedPoints:
        """Return at most so many, spread over all."""
        stride = -(-len(self.before) // count) or 1
        return MatchedPoints(self.before[::stride], self.after[::stride], self.pixel)

    def tilted(self, tilt_rad: float) -> MatchedPoints:
        """Return the rays in the robot's frame for a camera that looks up by an angle."""
        return MatchedPoints(_tilted(self.before, tilt_rad), _tilted(self.after, tilt_rad), self.pixel)


@dataclass(frozen=True, slots=True)
class RelativeMotion:
    """What two pictures tell about the movement between them."""

    turn_rad: float
    direction_rad: float  # of travel, from the heading before
    step_m: float | None  # 0: it stood or turned in place; None: no floor seen, or no height of the camera


def picture_points(image: U8, fov_rad: float) -> PicturePoints:
    """Find points in a picture (H, W, 3) of a camera with a horizontal field of view.

    >>> import numpy as np
    >>> from maurice_mcl.sensor.visual_odometry import picture_points
    >>> picture_points(np.zeros((48, 64, 3), np.uint8), 1.0).rays.shape
    (0, 2)
    """
    height, width = image.shape[:2]
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    sift = cv2.SIFT.create(MOST_KEYPOINTS, 3, SIFT_CONTRAST, SIFT_EDGE)
    points, looks = sift.detectAndCompute(gray, None)
    focal = width / 2 / np.tan(fov_rad / 2)
    if looks is None or not len(points):
        return PicturePoints(np.zeros((0, 2)), np.zeros((0, 128), np.float32), 1 / focal)
    at = np.array([point.pt for point in points], np.float64)
    rays = ([(width - 1) / 2, (height - 1) / 2] - at) / focal
    return PicturePoints(rays, root_descriptors(np.asarray(looks, np.float32)), 1 / focal)


def match_points(before: PicturePoints, after: PicturePoints) -> MatchedPoints:
    """Pair points that are each other's best match, by far."""
    if min(len(before.looks), len(after.looks)) < 2:
        return MatchedPoints(np.zeros((0, 2)), np.zeros((0, 2)), before.pixel)
    alike = before.looks @ after.looks.T
    best, back = alike.argmax(axis=1), alike.argmax(axis=0)
    top = -np.partition(-alike, 1, axis=1)[:, :2]
    distances = np.sqrt(np.maximum(2 - 2 * top, 0))
    kept = (distances[:, 0] < RATIO_TEST * distances[:, 1]) & (back[best] == np.arange(len(best)))
    return MatchedPoints(before.rays[kept], after.rays[best[kept]], before.pixel)


def relative_motion(matched: MatchedPoints, height_m: float | None = None) -> RelativeMotion | None:
    """Return the movement between two pictures; None where too few matches agree. Rays are level."""
    count, epipolar = len(matched.before), _epipolar(matched)
    if epipolar is None:
        turn = _turn_by_few(matched)
        return None if turn is None else RelativeMotion(turn, 0.0, 0.0)
    _, direction, turn = epipolar
    agreeing = _agreeing(matched, direction, turn)
    if agreeing.sum() < max(FEWEST_AGREEING, LEAST_AGREEING_SHARE * count):
        in_place = _turn_by_few(matched)
        return None if in_place is None else RelativeMotion(in_place, 0.0, 0.0)
    in_place = _turn_in_place(matched, agreeing)
    if in_place is not None:
        return RelativeMotion(in_place, 0.0, 0.0)
    step = None if height_m is None else height_m * _step_by_floor(matched, direction, turn) or None
    return RelativeMotion(turn, float(wrap_angle(direction)), step)


def _epipolar(matched: MatchedPoints) -> tuple[float, float, float] | None:
    """Return the cost in nats, direction and turn that fit best; None for fewer than eight matches."""
    if len(matched.before) < FEWEST_MATCHES:
        return None
    return min((_refined(matched, start) for start in _starts(matched)), key=lambda fit: fit[0])


def camera_tilt(pairs: Sequence[MatchedPoints]) -> float:
    """Return by how much a camera looks up, in radians: the angle at which pairs of pictures agree best.

    The robot should have moved between the two of a pair (`tells_tilt`). Zero where no pair has enough
    matches.
    """
    most = sorted(pairs, key=lambda pair: -len(pair.before))[:TILT_PAIRS]
    chosen = [pair for pair in most if len(pair.before) >= FEWEST_AGREEING]
    if not chosen:
        return 0.0
    costs = np.array([_total_cost(chosen, tilt) for tilt in TILTS_RAD.tolist()])
    best = int(costs.argmin())
    if not 0 < best < len(costs) - 1:
        return float(TILTS_RAD[best])
    low, middle, high = costs[best - 1 : best + 2]
    bend = low - 2 * middle + high
    shift = 0.5 * (low - high) / bend if bend > 0 else 0.0
    return float(TILTS_RAD[best] + shift * (TILTS_RAD[1] - TILTS_RAD[0]))


def _total_cost(pairs: Sequence[MatchedPoints], tilt_rad: float) -> float:
    fits = (_epipolar(pair.first(TILT_MATCHES).tilted(tilt_rad)) for pair in pairs)
    return sum(fit[0] for fit in fits if fit is not None)


def _tilted(rays: F64, tilt_rad: float) -> F64:
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    ahead = np.maximum(cos - sin * rays[:, 1], 1e-3)
    return np.stack([rays[:, 0] / ahead, (sin + cos * rays[:, 1]) / ahead], axis=1)


# Epipolar geometry in the plane: with the direction of travel p and the turn t, a point seen along (l1, u1)
# and then along (l2, u2) has u1 (sin q - l2 cos q) = u2 (sin p - l1 cos p), where q = p - t.


def _off(matched: MatchedPoints, direction: F64, turn: F64) -> F64:
    """Return how far matches (K,) are from where they should be, in rays, for movements (..., 1)."""
    (l1, u1), (l2, u2) = matched.before.T, matched.after.T
    sin_p, cos_p = np.sin(direction), np.cos(direction)
    sin_q, cos_q = np.sin(direction - turn), np.cos(direction - turn)
    first, second = sin_p - l1 * cos_p, sin_q - l2 * cos_q
    slope = (u2 * cos_p) ** 2 + second**2 + (u1 * cos_q) ** 2 + first**2
    return np.asarray((u1 * second - u2 * first) / np.sqrt(slope + 1e-9))


def _sideways(direction: F64, turn: F64) -> tuple[F64, F64, Bool]:
    """Return how far a direction is from halfway through a turn, its variance, and whether it is backward."""
    ahead = wrap(np.asarray(direction - turn / 2, np.float64))
    backward = np.abs(ahead) > np.pi / 2
    off = np.where(backward, ahead - np.copysign(np.pi, ahead), ahead)
    return off, (turn / 2) ** 2 + SIDEWAYS_RAD**2, backward


def _cost(matched: MatchedPoints, direction: F64, turn: F64, spread: float) -> F64:
    """Return what movements (...,) cost in nats."""
    off = _off(matched, direction[..., None], turn[..., None]) / spread
    sideways, variance, backward = _sideways(direction, turn)
    fits = np.minimum(off**2 / 2, MOST_MATCH_NATS).sum(axis=-1)
    return np.asarray(fits + sideways**2 / (2 * variance) + BACKWARD_NATS * backward)


def _starts(matched: MatchedPoints) -> list[tuple[float, float]]:
    """Return the best directions and turns of the grid that are apart from each other."""
    widest = sum(float(np.arctan(np.abs(rays[:, 0]).max())) for rays in (matched.before, matched.after))
    turns = np.arange(-widest, widest + TURN_STEP_RAD, TURN_STEP_RAD)
    directions = np.arange(-np.pi, np.pi, DIRECTION_STEP_RAD)
    direction, turn = (axis.ravel() for axis in np.meshgrid(directions, turns, indexing="ij"))
    cost = _cost(matched, direction, turn, 4 * matched.pixel)
    starts = list[tuple[float, float]]()
    for k in np.argsort(cost)[:400].tolist():
        p, t = float(direction[k]), float(turn[k])
        if all(abs(wrap_angle(p - a)) > 0.2 or abs(t - b) > 0.1 for a, b in starts):
            starts.append((p, t))
        if len(starts) == REFINED_STARTS:
            break
    return starts


def _refined(matched: MatchedPoints, start: tuple[float, float]) -> tuple[float, float, float]:
    """Improve a direction and a turn by least squares; return the cost, and both."""
    at, small = np.array(start), 1e-4
    for rounds in ROUNDS_PX:
        spread = rounds * matched.pixel
        shifted = at + np.array([[0, 0], [small, 0], [0, small]])
        here, *moved = _off(matched, shifted[:, :1], shifted[:, 1:]) / spread
        slopes = (np.array(moved) - here) / small  # (2, K)
        counts = 1 / (1 + here**2) ** 2
        off, variance, _ = _sideways(at[0], at[1])
        tied = np.array([1.0, -0.5])
        curvature = (slopes * counts) @ slopes.T + np.outer(tied, tied) / variance + 1e-3 * np.eye(2)
        step = np.linalg.solve(curvature, slopes @ (counts * here) + tied * off / variance)
        at = at - np.clip(step, -0.1, 0.1)
    agreeing, seen = _agreeing(matched, at[0], at[1]), _ahead(matched, at[0], at[1])
    cost = float(_cost(matched, at[:1], at[1:], matched.pixel)[0]) + int((agreeing & ~seen).sum())
    return cost, float(at[0]), float(at[1])


def _agreeing(matched: MatchedPoints, direction: float, turn: float) -> Bool:
    return np.abs(_off(matched, np.array(direction), np.array(turn))) < EPIPOLAR_PX * matched.pixel


def _ahead(matched: MatchedPoints, direction: float, turn: float) -> Bool:
    """Return which points (K,) both pictures have before the camera, and not behind it."""
    l1, l2 = matched.before[:, 0], matched.after[:, 0]
    ahead, left = np.cos(turn) - np.sin(turn) * l2, np.sin(turn) + np.cos(turn) * l2
    cos, sin = np.cos(direction), np.sin(direction)
    across = ahead * l1 - left
    across = np.where(np.abs(across) < 1e-9, 1e-9, across)
    return np.asarray(((ahead * sin - left * cos) / across > 0) & ((sin - l1 * cos) / across > 0))


def rotation_residuals(matched: MatchedPoints) -> tuple[F64, F64, F64]:
    """Fit a rotation; return it (3, 3), and where it puts points (K, 2) and what it leaves (K, 2), in rays.

    Its axis is free, so the camera's tilt need not be known.
    """
    before, after = (_unit(rays) for rays in (matched.before, matched.after))
    turn = np.median(np.arctan(matched.before[:, 0]) - np.arctan(matched.after[:, 0]))
    rotation = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    for rounds in ROUNDS_PX:
        left = np.linalg.norm(_rays(before @ rotation.T) - matched.after, axis=1) / matched.pixel
        counts = 1 / (1 + (left / rounds) ** 2) ** 2
        u, _, v = np.linalg.svd((after * counts[:, None]).T @ before)
        rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    rotated = _rays(before @ rotation.T)
    return rotation, rotated, matched.after - rotated


def tells_tilt(matched: MatchedPoints) -> bool:
    """Return whether a robot moved between two pictures, so that epipolar lines show the camera's tilt."""
    if len(matched.before) < FEWEST_AGREEING:
        return False
    left = np.linalg.norm(rotation_residuals(matched)[2], axis=1)
    return bool(np.median(left) > PARALLAX_PX * matched.pixel)


def _unit(rays: F64) -> F64:
    vectors = np.column_stack([np.ones(len(rays)), rays])
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _rays(vectors: F64) -> F64:
    return np.asarray(vectors[:, 1:] / np.maximum(vectors[:, :1], 1e-3))


def _turn_in_place(matched: MatchedPoints, agreeing: Bool) -> float | None:
    """Return the turn of a robot that went nowhere; None for one that did, or too few matches to tell.

    Points move outward, away from the direction of travel, while the robot travels ahead.
    """
    if agreeing.sum() < FEWEST_AGREEING:
        return None
    rotation, rotated, left = rotation_residuals(matched)
    turn = float(np.arcsin(np.clip((rotation[0, 1] - rotation[1, 0]) / 2, -1, 1)))
    outward = rotated - [np.tan(-turn / 2), 0]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True) + 1e-9
    away = np.median(np.linalg.norm(left, axis=1)[agreeing]) / matched.pixel
    along = np.median((left * outward).sum(axis=1)[agreeing]) / matched.pixel
    return turn if away < STANDING_PX and abs(along) < STANDING_OUTWARD_PX else None


def _turn_by_few(matched: MatchedPoints) -> float | None:
    """Return the turn in place that some matches agree with to the pixel, as they do not by chance; or None.

    Before a bare wall nothing else tells of a robot that stands.
    """
    if len(matched.before) < FEWEST_TURNED:
        return None
    before, after = (np.arctan(rays[:, 0]) for rays in (matched.before, matched.after))
    turns = (before - after)[:, None]
    aside = np.tan(before - turns) - matched.after[:, 0]
    up = matched.before[:, 1] * np.cos(before) / np.cos(before - turns) - matched.after[:, 1]
    agree = (np.hypot(aside, up) < TURNED_PX * matched.pixel).sum(axis=1)
    best = int(agree.argmax())
    believed = agree[best] >= max(FEWEST_TURNED, LEAST_TURNED_SHARE * len(before))
    return float(turns[best, 0]) if believed else None


def _step_by_floor(matched: MatchedPoints, direction: float, turn: float) -> float:
    """Return the length in camera heights at which most points below the camera lie on one floor; 0: few."""
    low = (matched.before[:, 1] < -3 * matched.pixel) & (matched.after[:, 1] < -3 * matched.pixel)
    (l1, u1), (l2, u2) = matched.before[low].T, matched.after[low].T
    far = -1 / u1
    ahead = far - STEPS_OF_HEIGHT[:, None] * np.cos(direction)
    left = l1 * far - STEPS_OF_HEIGHT[:, None] * np.sin(direction)
    cos, sin = np.cos(turn), np.sin(turn)
    after, beside = cos * ahead + sin * left, cos * left - sin * ahead
    ahead = after > 0.2
    after = np.where(ahead, after, 1.0)
    squared = ((beside / after - l2) ** 2 + (-1 / after - u2) ** 2) / (2 * matched.pixel) ** 2
    agree = np.where(ahead, np.exp(-squared / 2), 0).sum(axis=1)
    best = int(agree.argmax())
    clear = agree[best] - np.median(agree) >= CLEAR_MARGIN
    return float(STEPS_OF_HEIGHT[best]) if agree[best] >= FEWEST_ON_FLOOR and clear else 0.0
