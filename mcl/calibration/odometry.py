"""Constants of a motion model, fitted to the movements between true poses of any drive.

A segment is what was measured between two known poses. To first order its error is normal: its mean is linear
in the model's biases, its covariance linear in the model's variances, so both have maximum likelihood
estimates, the variances by the MM iteration of Zhou et al. (2019). Intervals are on the log scale, from the
information matrix and the scatter of the scores (a sandwich): movements that are not quite normal, as slips,
widen them. A constant on which the log says nothing (a drive without turns on the noise of turns), or which
its movements cannot tell apart from others (equal turns: gain and bias), is marked so. The former keeps its
default, the latter fit together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from ..arrays import F64, Bool
from ..filter.motion import FloorDrift, MauriceParameters, OdometryParameters, turns_of
from ..geometry import compose, motion_between, wrap_angle
from .motion import FloorOf, MotionSegment
from .statistics import Fitted, student

FEWEST = 10  # segments
STEPS, RELINEARIZED = 400, 4  # of the iteration; times that the mean's constants are fitted anew
SETTLED = 1e-7  # relative change of the variances at which it has converged
Z = 1.959964  # two-sided 95 %
WIDEST = 1.0  # standard error of a variance's log from which on the log does not tell it: a factor of seven
# by what the variance of an estimate may grow as others are fitted with it (variance inflation factor;
# Marquardt 1970): at 25, two estimates have a correlation of 0.98
MOST_INFLATED = 25.0
ALIKE = 0.5  # of the largest correlation of such an estimate: with these it is confused
SINGULAR, KEPT = 1e-9, 0.01  # share of information added: to be invertible, to keep what is not told apart
TOO_WIDE = "too few movements, or too little noise, to tell it"
TRUTH = np.diag([0.001**2, 0.001**2, math.radians(0.05) ** 2])  # least covariance of a segment: the truth's
FAR = 21.1  # squared Mahalanobis distance, three dimensions, that one movement in ten thousand exceeds


@dataclass(frozen=True, slots=True, eq=False)
class LinearMotion:
    """A segment by a motion model, to first order."""

    mean: F64  # (3,) where it ends by the measured motions, in the frame of its first pose
    biases: F64  # (3, P) change of that with each constant of the mean
    parts: F64  # (Q, 3, 3) covariance for each variance of 1


def _turning(end: F64, about: F64) -> F64:
    """Return how the end of a path (3,) changes with a turn at a pose on it."""
    return np.array([-(end[1] - about[1]), end[0] - about[0], 1.0])


@dataclass(frozen=True, slots=True)
class LinearOdometry:
    """Turn, translate, turn: the four alphas of Probabilistic Robotics, as variances."""

    name: str = "odometry"
    means: tuple[str, ...] = ()
    variances: tuple[str, ...] = ("turn_from_turn", "turn_from_way", "way_from_way", "way_from_turn")

    def linear(self, segment: MotionSegment, means: F64) -> LinearMotion:
        """Return a segment; the constants (P,) of the mean are none."""
        poses = [np.zeros(3)]
        for motion in segment.motions:
            poses.append(compose(poses[-1], motion))
        end, parts = poses[-1], np.zeros((4, 3, 3))
        for before, after, motion in zip(poses, poses[1:], segment.motions, strict=False):
            forward, left, _ = (float(v) for v in motion)
            way = math.hypot(forward, left)
            first = math.atan2(left, forward) if way > 0 else 0.0
            a, b = turns_of(motion, OdometryParameters().way_from_m)
            course = before[2] + first
            along = np.array([math.cos(course), math.sin(course), 0.0])
            one, two, three = (np.outer(u, u) for u in (_turning(end, before), along, _turning(end, after)))
            parts += [a**2 * one + b**2 * three, way**2 * (one + three), way**2 * two, (a**2 + b**2) * two]
        return LinearMotion(end, np.zeros((3, 0)), parts)

    def defaults(self) -> tuple[F64, F64]:
        """Return usual constants of the mean (P,), none, and usual variances (Q,)."""
        usual = OdometryParameters()
        return np.zeros(0), np.array([getattr(usual, name) for name in self.variances])


@dataclass(frozen=True, slots=True)
class LinearMaurice:
    """The thesis's model: turns with gain, bias and noise, straights with bias and noise, drift by floor.

    Drift is even along a straight, as in `calibrate motion`: it bends the path as a turn in its middle would.
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
        found = self.floor_of(segment.before[:2], segment.after[:2])
        floor = self.floors.index(found) if found in self.floors else 0
        pose = np.zeros(3)
        turns, ways = list[tuple[F64, float, bool]](), list[tuple[F64, float, F64]]()
        for forward, left, turn in (motion.tolist() for motion in segment.motions):
            way, noisy = math.hypot(forward, left), abs(turn) >= least.turn_from_rad
            turns.append((pose, turn, noisy))
            pose = pose + np.array([0, 0, means[0] * turn + (means[1] if noisy else 0.0)])
            if way >= least.straight_from_m:
                drifted, course = means[3 + floor] * way, pose[2] + math.atan2(left, forward)
                along = np.array([math.cos(course + drifted / 2), math.sin(course + drifted / 2), 0.0])
                ways.append((pose + along * (way + means[2]) / 2, way, along))
                pose = pose + along * (way + means[2]) + np.array([0.0, 0.0, drifted])
        biases, parts = np.zeros((3, 3 + count)), np.zeros((2 + count, 3, 3))
        for at, turn, noisy in turns:
            change = _turning(pose, at)
            biases[:, 0] += change * turn
            biases[:, 1] += change * noisy
            parts[0] += np.outer(change, change) * noisy
        for middle, way, along in ways:
            change = _turning(pose, middle) * way
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


@dataclass(frozen=True, slots=True)
class MotionConstant:
    """One constant of a motion model."""

    name: str  # as under robot.motion in a header
    fitted: Fitted  # with its 95 % interval
    default: float
    # what to filter with: the fitted value, also of constants that only fit together; the default where no
    # movement shows it
    value: float
    told: bool  # whether the log tells it by itself
    why: str = ""  # why not


@dataclass(frozen=True, slots=True)
class MotionFit:
    """All constants of a motion model, fitted to some drives."""

    model: str
    constants: tuple[MotionConstant, ...]
    segments: int  # movements between true poses
    far: int  # of them with an error that one in ten thousand would exceed: slips, perhaps
    alike: tuple[tuple[str, str], ...]  # pairs of constants that cannot be told apart
    way_scale: Fitted | None = None  # way really driven over measured; None: the model has its own, or no way
    turn_scale: Fitted | None = None  # the same of turns

    def motion_header(self) -> dict[str, Any]:
        """Return the constants as a session's header holds them under robot.motion."""
        header: dict[str, Any] = {"model": self.model}
        for one in self.constants:
            first, _, rest = one.name.partition(".")
            floor, _, last = rest.rpartition(".")
            if rest:
                header.setdefault(first, {}).setdefault(floor, {})[last] = one.value
            else:
                header[first] = one.value
        return header


def fit_motion(segments: Sequence[MotionSegment], model: LinearModel) -> MotionFit:
    """Fit every constant of a motion model. Raises ValueError, for people, where there are too few segments.

    >>> import numpy as np
    >>> from maurice_mcl.calibration.motion import MotionSegment
    >>> from maurice_mcl.calibration.odometry import LinearOdometry, fit_motion
    >>> rng = np.random.default_rng(0)
    >>> way = np.array([1.0, 0.0, 0.0])
    >>> ends = [np.array([1 + 0.1 * rng.normal(), 0, 0]) for _ in range(200)]
    >>> found = fit_motion([MotionSegment(np.zeros(3), (way,), end) for end in ends], LinearOdometry())
    >>> [one.name for one in found.constants if one.told]
    ['way_from_way']
    """
    if len(segments) < FEWEST:
        raise ValueError(f"found {len(segments)} movements between true poses, expected {FEWEST} or more")
    means, variances = model.defaults()
    design = _information(_linearized(segments, model, means), variances)
    untold = {name for pair in _confounded(model.means, design) for name in pair}
    free = np.array([name not in untold for name in model.means], bool)
    for _ in range(RELINEARIZED):
        linear = _linearized(segments, model, means)
        change = _generalized(linear, variances, free)
        means = means + change
        variances = _variances(linear.errors - linear.biases @ change, linear.parts, variances)
    return _described(_linearized(segments, model, means), model, means, variances, design)


@dataclass(frozen=True, slots=True, eq=False)
class _Linear:
    """N segments by a motion model, to first order."""

    ends: F64  # (N, 3) by the measured motions
    errors: F64  # (N, 3) what is left to where they really ended
    biases: F64  # (N, 3, P)
    parts: F64  # (N, Q, 3, 3)


def _linearized(segments: Sequence[MotionSegment], model: LinearModel, means: F64) -> _Linear:
    linear = [model.linear(segment, means) for segment in segments]
    ends = np.array([one.mean for one in linear])
    errors = np.array([motion_between(one.before, one.after) for one in segments]) - ends
    errors[:, 2] = wrap_angle(errors[:, 2])
    biases, parts = np.array([one.biases for one in linear]), np.array([one.parts for one in linear])
    return _Linear(ends, errors, biases, parts)


def _inverse(parts: F64, variances: F64) -> F64:
    """Return the inverse covariance (N, 3, 3) of every segment."""
    return np.asarray(np.linalg.inv(np.einsum("q,nqij->nij", variances, parts) + TRUTH))


def _information(linear: _Linear, variances: F64) -> F64:
    """Return the information matrix (P, P) of the mean's constants."""
    inverse = _inverse(linear.parts, variances)
    return np.asarray(np.einsum("nip,nij,njk->pk", linear.biases, inverse, linear.biases))


def _generalized(linear: _Linear, variances: F64, free: Bool) -> F64:
    """Return the change (P,) of the mean's constants, by generalized least squares.

    Of those that are not `free` (P,) only what the movements tell of them together changes.
    """
    inverse = _inverse(linear.parts, variances)
    right = np.einsum("nip,nij,nj->p", linear.biases, inverse, linear.errors)
    length, shape = _shaped(_information(linear, variances))
    kept = shape + np.diag(np.where(free, SINGULAR, KEPT))
    return np.asarray(np.linalg.solve(kept, right / length) / length)


def _shaped(information: F64) -> tuple[F64, F64]:
    """Return the lengths (K,) of an information matrix and the matrix (K, K) for length one; 1 for unseen."""
    seen = np.diag(information) > 0
    length = np.sqrt(np.where(seen, np.diag(information), 1.0))
    return length, np.asarray(information / np.outer(length, length) + np.diag(np.where(seen, 0.0, 1.0)))


def _confounded(names: Sequence[str], information: F64) -> list[tuple[str, str]]:
    """Return the pairs of K constants that the movements cannot tell apart, by their information (K, K).

    It depends on which movements there are, and not on how well they fit.
    """
    _, shape = _shaped(information)
    inverse = np.linalg.inv(shape + SINGULAR * np.eye(len(names)))
    inflation = np.diag(inverse)
    correlation = np.abs(inverse) / np.sqrt(np.outer(inflation, inflation)) - np.eye(len(names))
    pairs = set[tuple[str, str]]()
    for k in np.flatnonzero(inflation > MOST_INFLATED).tolist():
        others = np.flatnonzero(correlation[k] > ALIKE * correlation[k].max()).tolist()
        pairs |= {(names[min(k, other)], names[max(k, other)]) for other in others}
    return sorted(pairs)


def _why(name: str, seen: bool, alike: Sequence[tuple[str, str]]) -> str:
    """Return why the movements cannot tell a constant; "" where they can."""
    if not seen:
        return "no movement of the log shows it"
    others = sorted({other for pair in alike if name in pair for other in pair} - {name})
    return f"cannot be told apart from {', '.join(others)} in this log" if others else ""


def _variances(errors: F64, parts: F64, variances: F64) -> F64:
    """Iterate to the variances (Q,) of largest likelihood."""
    for _ in range(STEPS):
        inverse = _inverse(parts, variances)
        pulled = np.einsum("nij,nj->ni", inverse, errors)
        wanted = np.einsum("ni,nqij,nj->q", pulled, parts, pulled)
        given = np.einsum("nij,nqji->q", inverse, parts)
        ratio = np.sqrt(np.divide(wanted, given, out=np.ones_like(given), where=given > 0))
        variances = np.maximum(variances * ratio, 1e-14)
        if np.abs(ratio - 1).max() < SETTLED:
            break
    return variances


def _described(linear: _Linear, model: LinearModel, means: F64, variances: F64, design: F64) -> MotionFit:
    """Describe a fit; `design` (P, P) is the information matrix of the mean's constants at the defaults."""
    inverse = _inverse(linear.parts, variances)
    logs, information = _log_covariance(linear, inverse, variances)
    sd = np.sqrt(np.diag(logs))
    alike = [*_confounded(model.means, design), *_confounded(model.variances, information)]
    constants, (_, usual) = _mean_constants(linear, model, means, variances, design), model.defaults()
    for k, name in enumerate(model.variances):
        seen = bool(linear.parts[:, k].any())
        root = 0.5 if "sd_" in name else 1.0
        low, high = (variances[k] * math.exp(sign * Z * min(sd[k], 30)) for sign in (-1, 1))
        fitted = Fitted(*(float(v) ** root for v in (variances[k], low, high)))
        if not seen:
            fitted = Fitted(float(usual[k]) ** root, 0.0, math.inf)
        why, default = _why(name, seen, alike), float(usual[k]) ** root
        value = fitted.value
        if not why and sd[k] > WIDEST:
            value, why = default, TOO_WIDE
        constants.append(MotionConstant(name, fitted, default, value, not why, why))
    far = np.einsum("ni,nij,nj->n", linear.errors, inverse, linear.errors) > FAR
    way, turn = (None, None) if model.means else _scales(linear)
    return MotionFit(model.name, tuple(constants), len(far), int(far.sum()), tuple(alike), way, turn)


def _scales(linear: _Linear) -> tuple[Fitted | None, Fitted | None]:
    """Return actual over measured: of the ways along their measured direction, and of the turns."""
    ways = np.hypot(linear.ends[:, 0], linear.ends[:, 1])
    along = (linear.ends[:, :2] * linear.errors[:, :2]).sum(axis=1) / np.maximum(ways, 1e-9)
    return _scale(ways, along), _scale(linear.ends[:, 2], linear.errors[:, 2])


def _scale(measured: F64, errors: F64) -> Fitted | None:
    total = float(measured @ measured)
    if total == 0:
        return None
    extra = float(measured @ errors) / total
    left = errors - extra * measured
    return student(1 + extra, math.sqrt(float(np.square(left * measured).sum())) / total, len(measured) - 1)


def _mean_constants(
    linear: _Linear, model: LinearModel, means: F64, variances: F64, design: F64
) -> list[MotionConstant]:
    alike, (usual, _) = _confounded(model.means, design), model.defaults()
    length, shape = _shaped(_information(linear, variances))
    error = np.sqrt(np.diag(np.linalg.inv(shape + SINGULAR * np.eye(len(means))))) / length
    constants = []
    for k, name in enumerate(model.means):
        why = _why(name, bool(design[k, k] > 0), alike)
        value, reach = float(means[k]), math.inf if why else Z * float(error[k])
        fitted = Fitted(value, value - reach, value + reach)
        constants.append(MotionConstant(name, fitted, float(usual[k]), value, not why, why))
    return constants


def _log_covariance(linear: _Linear, inverse: F64, variances: F64) -> tuple[F64, F64]:
    """Return the covariance (Q, Q) of the logs of the variances, and their information matrix (Q, Q)."""
    pulled = np.einsum("nij,nj->ni", inverse, linear.errors)
    share = np.einsum("nij,nqjk->nqik", inverse, linear.parts)
    scores = np.einsum("ni,nqij,nj->nq", pulled, linear.parts, pulled) - np.einsum("nqii->nq", share)
    scores *= variances / 2
    information = np.einsum("nqij,nrji->qr", share, share) * np.outer(variances, variances) / 2
    turned = np.linalg.pinv(information + np.diag(np.full(len(variances), 1e-9)))
    robust = turned @ (scores.T @ scores) @ turned
    # the wider of both: with few segments the scatter of the scores is too small
    wider = np.maximum(np.diag(robust), np.diag(turned).clip(1e-300))
    return np.diag(wider), np.asarray(information)
