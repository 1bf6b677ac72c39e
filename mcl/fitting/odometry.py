"""Motion models to first order: the mean of a movement between true poses, and its covariance, by constants.

The mean is linear in the model's biases, the covariance in its variances, which `odometry_fit` fits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..filter.motion import FloorDrift, MauriceParameters, OdometryParameters, turns_of
from ..values import F64, compose, rotated, wrap_angle

FloorOf = Callable[[F64, F64], str | None]  # names the floor between two points (2,); None: several
TRUTH = np.diag([0.001**2, 0.001**2, math.radians(0.05) ** 2])  # least covariance of a segment: the truth's


@dataclass(frozen=True, slots=True, eq=False)
class MotionSegment:
    """What was measured between two known poses."""

    before: F64  # (3,) x_m, y_m, heading_rad
    motions: tuple[F64, ...]  # each (3,) forward_m, left_m, turn_rad
    after: F64  # (3,)


@dataclass(frozen=True, slots=True, eq=False)
class LinearMotion:
    """A segment by a motion model, to first order."""

    mean: F64  # (3,) where it ends by the measured motions, in the frame of its first pose
    biases: F64  # (3, P) change of that with each constant of the mean
    parts: F64  # (Q, 3, 3) covariance for each variance of 1


def turning(end: F64, about: F64) -> F64:
    """Return how the end of a path (3,) changes with a turn at a pose on it."""
    return np.array([-(end[1] - about[1]), end[0] - about[0], 1.0])


@dataclass(frozen=True, slots=True)
class LinearOdometry:
    """Turn, translate, turn: the four alphas of Probabilistic Robotics, as variances."""

    name: str = "odometry"
    means: tuple[str, ...] = ()
    variances: tuple[str, ...] = ("turn_from_turn", "turn_from_way", "way_from_way", "way_from_turn")

    def linear(self, segment: MotionSegment, means: F64) -> LinearMotion:
        """Return a segment; the mean has no constants (P = 0)."""
        poses = [np.zeros(3)]
        for motion in segment.motions:
            poses.append(compose(poses[-1], motion))
        end, changes, weights = poses[-1], list[F64](), list[tuple[float, ...]]()
        for before, after, motion in zip(poses, poses[1:], segment.motions, strict=False):
            forward, left, _ = motion.tolist()
            way = math.hypot(forward, left)
            first = math.atan2(left, forward) if way > 0 else 0.0
            a, b = turns_of(motion, OdometryParameters().way_from_m)
            course = before[2] + first
            along = np.array([math.cos(course), math.sin(course), 0.0])
            changes += [turning(end, before), along, turning(end, after)]  # by first turn, way, second turn
            weights += [(a**2, way**2, 0, 0), (0, 0, way**2, a**2 + b**2), (b**2, way**2, 0, 0)]
        ways = np.array(changes).reshape(-1, 3)
        parts = (np.array(weights).reshape(-1, 4).T[:, None] * ways.T) @ ways
        return LinearMotion(end, np.zeros((3, 0)), parts)

    def defaults(self) -> tuple[F64, F64]:
        """Return no constants of the mean (P = 0), and usual variances (Q,)."""
        usual = OdometryParameters()
        return np.zeros(0), np.array([getattr(usual, name) for name in self.variances])


@dataclass(frozen=True, slots=True)
class LinearMaurice:
    """The thesis's model: turns with gain, bias and noise, straights with bias and noise, drift by floor.

    Drift is even along a straight: it bends the path as a turn in its middle would. Backward it goes to the
    other side.
    """

    floors: tuple[str, ...]
    floor_of: FloorOf
    name: str = "maurice"

    @property
    def means(self) -> tuple[str, ...]:
        """Names of the constants of the mean."""
        drifts = (f"drift.{floor}.bias_rad_per_m" for floor in self.floors)
        return ("turn_gain", "turn_bias_rad", "straight_bias_m", *drifts)

    @property
    def variances(self) -> tuple[str, ...]:
        """Names of the variances, as standard deviations."""
        return ("turn_sd_rad", "straight_sd_m", *(f"drift.{floor}.sd_rad_per_m" for floor in self.floors))

    def linear(self, segment: MotionSegment, means: F64) -> LinearMotion:
        """Return a segment at some constants (P,) of the mean."""
        least, count = MauriceParameters(), len(self.floors)
        name = self.floor_of(segment.before[:2], segment.after[:2])
        floor = self.floors.index(name) if name in self.floors else 0
        pose = np.zeros(3)
        turns, ways = list[tuple[F64, float, bool]](), list[tuple[F64, float, F64]]()
        for forward, left, turn in (motion.tolist() for motion in segment.motions):
            way, noisy = math.hypot(forward, left), abs(turn) >= least.turn_from_rad
            turns.append((pose, turn, noisy))
            pose = pose + np.array([0, 0, means[0] * turn + (means[1] if noisy else 0.0)])
            if way >= least.straight_from_m:
                drives = way if forward >= 0 else -way
                drifted, course = means[3 + floor] * drives, pose[2] + math.atan2(left, forward)
                along = np.array([math.cos(course + drifted / 2), math.sin(course + drifted / 2), 0.0])
                ways.append((pose + along * (way + means[2]) / 2, drives, along))
                pose = pose + along * (way + means[2]) + np.array([0.0, 0.0, drifted])
        biases, parts = np.zeros((3, 3 + count)), np.zeros((2 + count, 3, 3))
        for at, turn, noisy in turns:
            change = turning(pose, at)
            biases[:, 0] += change * turn
            biases[:, 1] += change * noisy
            parts[0] += np.outer(change, change) * noisy
        for middle, drives, along in ways:
            change = turning(pose, middle) * drives
            biases[:, 2] += along
            biases[:, 3 + floor] += change
            parts[1] += np.outer(along, along)
            parts[2 + floor] += np.outer(change, change)
        return LinearMotion(pose, biases, parts)

    def defaults(self) -> tuple[F64, F64]:
        """Return usual constants of the mean (P,) and variances (Q,)."""
        usual, drift = MauriceParameters(), MauriceParameters().drift.get("", FloorDrift())
        means = [usual.turn_gain, usual.turn_bias_rad, usual.straight_bias_m]
        means += [drift.bias_rad_per_m] * len(self.floors)
        sds = [usual.turn_sd_rad, usual.straight_sd_m, *[drift.sd_rad_per_m] * len(self.floors)]
        return np.array(means), np.square(sds)


LinearModel: TypeAlias = LinearOdometry | LinearMaurice


@dataclass(frozen=True, slots=True, eq=False)
class LinearDrive:
    """N segments by a motion model, to first order, with the error of the measured truth."""

    ends: F64  # (N, 3) by the measured motions
    errors: F64  # (N, 3) what is left to where they really ended
    biases: F64  # (N, 3, P + 2) the last two: with the place on the robot that truth is of
    parts: F64  # (N, Q + 2, 3, 3) the last two: for each variance of 1 of a true position, and heading

    def inverse(self, variances: F64) -> F64:
        """Return the inverse covariance (N, 3, 3) of every segment."""
        return np.asarray(np.linalg.inv(np.einsum("q,nqij->nij", variances, self.parts) + TRUTH))

    def information(self, variances: F64) -> F64:
        """Return the information matrix (P + 2, P + 2) of the mean's constants."""
        return np.asarray(np.einsum("nip,nij,njk->pk", self.biases, self.inverse(variances), self.biases))

    def fisher(self, inverse: F64, variances: F64) -> tuple[F64, F64]:
        """Return the information matrix (Q + 2, Q + 2) of the logs of the variances, and its shares."""
        share = np.einsum("nij,nqjk->nqik", inverse, self.parts)
        return np.einsum("nqij,nrji->qr", share, share) * np.outer(variances, variances) / 2, share


def linearized(segments: Sequence[MotionSegment], model: LinearModel, means: F64, place: F64) -> LinearDrive:
    """Return segments at the constants (P,) of a model's mean; truth is of a place (2,) on the robot."""
    before = _wheels(np.array([segment.before for segment in segments]), place)
    after = _wheels(np.array([segment.after for segment in segments]), place)
    ends_of = zip(before, segments, after, strict=True)
    linear = [
        model.linear(MotionSegment(start, segment.motions, end), means) for start, segment, end in ends_of
    ]
    ends, step = np.array([motion.mean for motion in linear]), after - before
    moved = np.column_stack([*rotated(step[:, 0], step[:, 1], -before[:, 2]), step[:, 2]])
    errors = moved - ends
    errors[:, 2] = wrap_angle(errors[:, 2])
    biases = np.concatenate([np.array([motion.biases for motion in linear]), _swing(ends)], axis=2)
    parts = np.concatenate([np.array([motion.parts for motion in linear]), _measured(ends, place)], axis=1)
    return LinearDrive(ends, errors, biases, parts)


def _wheels(poses: F64, place: F64) -> F64:
    """Return the poses (N, 3) of the wheels' center from those of a place (2,) ahead and left of it."""
    ahead, left = rotated(place[:1], place[1:], poses[:, 2])
    return np.asarray(poses - np.column_stack([ahead, left, np.zeros(len(poses))]))


def _swing(ends: F64) -> F64:
    """Return how ends of paths (N, 3) change with the place of the truth on the robot: (N, 3, 2)."""
    cos, sin, none = np.cos(ends[:, 2]), np.sin(ends[:, 2]), np.zeros(len(ends))
    return np.array([[cos - 1, -sin], [sin, cos - 1], [none, none]]).transpose(2, 0, 1)


def _measured(ends: F64, place: F64) -> F64:
    """Return the covariances (N, 2, 3, 3) of paths' ends for a variance of 1 of both their true poses.

    A wrong true heading also moves the wheels' center about the place (2,) on the robot that truth is of.
    """
    (ahead, left), ones = rotated(place[0], place[1], ends[:, 2]), np.ones(len(ends))
    after = np.column_stack([left, -ahead, ones])
    before = np.column_stack([ends[:, 1] - place[1], place[0] - ends[:, 0], -ones])
    of_heading = sum(change[:, :, None] * change[:, None] for change in (after, before))
    of_position = np.broadcast_to(np.diag([2.0, 2.0, 0.0]), (len(ends), 3, 3))
    return np.stack([of_position, np.asarray(of_heading)], axis=1)
