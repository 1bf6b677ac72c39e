"""Constants of a motion model, fitted to the movements between true poses of any drive.

A segment is what was measured between two known poses. To first order its error is normal: its mean is linear
in the model's biases, its covariance linear in the model's variances, so both have maximum likelihood
estimates, the variances by the MM iteration of Zhou et al. (2019). Intervals are on the log scale, from the
information matrix and the scatter of the scores over parts of the drive (a sandwich): movements that are not
quite normal, as slips, and errors that last, as on one floor, widen them. A constant on which the log says
nothing (a drive without turns on the noise of turns), or which its movements cannot tell apart from others
(equal turns: gain and bias), is marked so. The former keeps its default, the latter fit together.

The truth is measured, too: with noise that does not grow with the movement, as a robot shows that stands, and
perhaps at a mast ahead of the wheels. Both are fitted beside the model's own constants where the movements
tell them apart, so that these hold none of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import stdtrit

from ..values import F64, Bool
from .odometry import LinearDrive, LinearModel, MotionSegment, linearized
from .statistics import Fitted

FEWEST_SEGMENTS = 10
MOST_STEPS, LINEARIZATIONS = 400, 4  # of the iteration; times that the mean's constants are fitted anew
CONVERGED_SHARE = 1e-6  # change of the variances, as a share of the errors, at which it has converged
FEWEST_SHOWING = 5  # movements that have to show a constant
WIDEST_LOG = math.log(8)  # of an interval on the log scale, each way, up to which the log tells a variance
# by what the variance of an estimate may grow as others are fitted with it (variance inflation factor;
# Marquardt 1970): at 25, two estimates have a correlation of 0.98
MOST_INFLATION = 25.0
CONFOUNDED_SHARE = 0.5  # of the largest correlation of such an estimate: with these it is confused
SINGULAR, KEPT_SHARE = 1e-9, 0.01  # of information added: to be invertible; to keep what is not told apart
TOO_WIDE = "too few movements, or too little noise, to tell it"
TRUTH_VARIANCES = np.square([0.003, math.radians(0.3)])  # of a true position (m^2), heading (rad^2) at first
TRUTH_PLACE, TRUTH_NOISE = ("ahead_m", "left_m"), ("truth_sd_m", "truth_sd_rad")  # fitted of the truth
SEGMENTS_JOINED = 4  # segments in a row that are looked at as one as well ...
MOST_JOINED_M, MOST_JOINED_RAD = 2.0, 2.0  # up to this length: of a longer one the error is not normal
FEWEST_HALVED = 4 * FEWEST_SEGMENTS  # segments from which on both halves of a drive are fitted as well
TURN_M = 0.3  # a turn of 1 rad counts as this way: half of a robot's length
MOST_UNEXPLAINED = 0.5  # share of the true movements by which odometry may miss them
LARGEST_VARIANCE = 1.0  # variance of the odometry model: an error as large as what it is of
MOST_PARTS, SEGMENTS_A_PART = 8, 5  # most parts of a drive whose scores are compared; least segments of one
FAR_SQUARED = 21.1  # Mahalanobis distance, three dimensions, that one movement in ten thousand exceeds


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
    way_scale: Fitted | None = None  # way really driven over measured; None: the model has its own, no way
    turn_scale: Fitted | None = None  # the same of turns
    # place that truth is of, ahead of the wheels' center; None: no turn shows it
    ahead_m: Fitted | None = None
    left_m: Fitted | None = None  # and left of it
    # of what does not grow with the movement: the noise of a true position, on an axis
    truth_sd_m: float = 0.0
    truth_sd_rad: float = 0.0  # and of a true heading
    unexplained: float = 0.0  # how far longer movements miss the true ones, as a share of these

    def motion_header(self) -> dict[str, Any]:
        """Return the constants as a session's header holds them under robot.motion."""
        header: dict[str, Any] = {"model": self.model}
        for constant in self.constants:
            first, _, rest = constant.name.partition(".")
            floor, _, last = rest.rpartition(".")
            if rest:
                header.setdefault(first, {}).setdefault(floor, {})[last] = constant.value
            else:
                header[first] = constant.value
        return header


def fit_motion(segments: Sequence[MotionSegment], model: LinearModel) -> MotionFit:
    """Fit every constant of a motion model. Raises ValueError, for people, where there are too few segments.

    >>> import numpy as np
    >>> from maurice_mcl.fitting.odometry import MotionSegment
    >>> from maurice_mcl.fitting.odometry import LinearOdometry
    >>> from maurice_mcl.fitting.odometry_fit import fit_motion
    >>> rng = np.random.default_rng(0)
    >>> way = np.array([1.0, 0.0, 0.0])
    >>> ends = [np.array([1 + 0.1 * rng.normal(), 0, 0]) for _ in range(200)]
    >>> fit = fit_motion([MotionSegment(np.zeros(3), (way,), end) for end in ends], LinearOdometry())
    >>> [constant.name for constant in fit.constants if constant.told]
    ['way_from_way']
    """
    if len(segments) < FEWEST_SEGMENTS:
        raise ValueError(
            f"found {len(segments)} movements between true poses, expected {FEWEST_SEGMENTS} or more"
        )
    fit = _fitted(with_longer(segments), model)
    half = len(segments) // 2
    if len(segments) >= FEWEST_HALVED:
        halves = (with_longer(some) for some in (segments[:half], segments[half:]))
        fit = _with_halves(fit, [_fitted(some, model) for some in halves])
    _refuse_absurd(fit)
    return replace(fit, segments=len(segments))


def with_longer(segments: Sequence[MotionSegment]) -> list[MotionSegment]:
    """Return segments, and after every four in a row the one that they are together.

    Over longer segments the noise of the odometry has grown and that of the truth has not, which tells them
    apart.
    """
    both, row = list[MotionSegment](), list[MotionSegment]()
    for segment in segments:
        row = row if row and np.array_equal(row[-1].after, segment.before) else []
        row.append(segment)
        both.append(segment)
        if len(row) == SEGMENTS_JOINED:
            motions = tuple(motion for part in row for motion in part.motions)
            way_m = sum(float(np.hypot(*motion[:2])) for motion in motions)
            turn_rad = sum(abs(float(motion[2])) for motion in motions)
            if way_m <= MOST_JOINED_M and turn_rad <= MOST_JOINED_RAD:
                both.append(MotionSegment(row[0].before, motions, row[-1].after))
            row = []
    return both


def _fitted(segments: Sequence[MotionSegment], model: LinearModel) -> MotionFit:
    means, variances, free, alike = _design(segments, model)
    place = np.zeros(2)
    for _ in range(LINEARIZATIONS):
        linear = linearized(segments, model, means, place)
        change = _generalized(linear, variances, free)
        means, place = means + change[:-2], place + change[-2:]
        variances = _variances(replace(linear, errors=linear.errors - linear.biases @ change), variances)
    linear = linearized(segments, model, means, place)
    return _described(linear, model, np.append(means, place), variances, alike)


def _design(
    segments: Sequence[MotionSegment], model: LinearModel
) -> tuple[F64, F64, F64, list[tuple[str, str]]]:
    """Return where a fit begins: means (P,), variances (Q + 2,), the share of information that is added to
    those of the mean (P + 2,), and which of them cannot be told apart.

    What cannot be told apart from the model's own constants is not fitted of the truth.
    """
    means, variances = model.defaults()
    variances = np.append(variances, TRUTH_VARIANCES)
    linear = linearized(segments, model, means, np.zeros(2))
    fisher, _ = linear.fisher(linear.inverse(variances), variances)
    noise = {name for pair in _confounded((*model.variances, *TRUTH_NOISE), fisher) for name in pair}
    variances[-2:] *= [name not in noise for name in TRUTH_NOISE]
    information = linear.information(variances)
    names = (*model.means, *TRUTH_PLACE)
    added = np.full(len(names), SINGULAR)
    alike = _confounded(names, information)
    if any(name in pair for pair in alike for name in TRUTH_PLACE):
        added[-2:] = np.inf
        alike = _confounded(model.means, information[:-2, :-2])
    untold = {name for pair in alike for name in pair}
    added[:-2] = [KEPT_SHARE if name in untold else SINGULAR for name in model.means]
    return means, variances, added, alike


def _with_halves(fit: MotionFit, halves: Sequence[MotionFit]) -> MotionFit:
    """Widen the intervals to hold what either half of the drive tells alone: errors may differ by place."""
    constants = []
    for constant, *others in zip(fit.constants, *(half.constants for half in halves), strict=True):
        values = [other.fitted.value for other in others if other.told] if constant.told else []
        low, high = min([constant.fitted.low, *values]), max([constant.fitted.high, *values])
        constants.append(replace(constant, fitted=replace(constant.fitted, low=low, high=high)))
    return replace(fit, constants=tuple(constants))


def _unexplained(linear: LinearDrive) -> float:
    """Return how far the longer half of the movements misses the true ones, as a share of these (medians)."""
    errors, moved = (
        np.hypot(rows[:, 0], rows[:, 1]) + TURN_M * np.abs(rows[:, 2])
        for rows in (linear.errors, linear.errors + linear.ends)
    )
    longer = moved >= np.median(moved)
    return float(np.median(errors[longer]) / max(np.median(moved[longer]), 1e-9))


def _refuse_absurd(fit: MotionFit) -> None:
    """Raise ValueError where odometry hardly explains the truth, or by an error as large as the movement."""
    advice = "expected odometry and truth of one drive; `maurice-replay doctor` looks for what is wrong"
    if fit.unexplained > MOST_UNEXPLAINED:
        raise ValueError(f"found odometry that misses the true movements by {fit.unexplained:.0%}, {advice}")
    for constant in fit.constants if fit.model == "odometry" else ():
        if constant.told and constant.fitted.value > LARGEST_VARIANCE:
            what = f"found {constant.name} {constant.fitted.value:.3g}, an error larger than the movement"
            raise ValueError(f"{what}, {advice}")


def _generalized(linear: LinearDrive, variances: F64, added: F64) -> F64:
    """Return the change (P + 2,) of the mean's constants, by generalized least squares.

    Where much information is `added` (P + 2,) only what the movements tell of constants together changes
    them; where it is infinite, nothing does.
    """
    inverse = linear.inverse(variances)
    right = np.einsum("nip,nij,nj->p", linear.biases, inverse, linear.errors)
    length, shape = _shaped(linear.information(variances))
    fitted = np.isfinite(added)
    matrix = shape[np.ix_(fitted, fitted)] + np.diag(added[fitted])
    change = np.zeros(len(added))
    change[fitted] = np.linalg.solve(matrix, (right / length)[fitted]) / length[fitted]
    return change


def _shaped(information: F64) -> tuple[F64, F64]:
    """Return the lengths (n,) of an information matrix and the matrix (n, n) for length one; 1 for unseen."""
    seen = np.diag(information) > 0
    length = np.sqrt(np.where(seen, np.diag(information), 1.0))
    return length, np.asarray(information / np.outer(length, length) + np.diag(np.where(seen, 0.0, 1.0)))


def _confounded(names: Sequence[str], information: F64) -> list[tuple[str, str]]:
    """Return the pairs of n constants that the movements cannot tell apart, by their information (n, n).

    It depends on which movements there are, and not on how well they fit.
    """
    _, shape = _shaped(information)
    inverse = np.linalg.inv(shape + SINGULAR * np.eye(len(names)))
    inflation = np.diag(inverse)
    correlation = np.abs(inverse) / np.sqrt(np.outer(inflation, inflation)) - np.eye(len(names))
    pairs = set[tuple[str, str]]()
    for k in np.flatnonzero(inflation > MOST_INFLATION).tolist():
        others = np.flatnonzero(correlation[k] > CONFOUNDED_SHARE * correlation[k].max()).tolist()
        pairs |= {(names[min(k, other)], names[max(k, other)]) for other in others}
    return sorted(pairs)


def _why(name: str, shows: Bool, alike: Sequence[tuple[str, str]]) -> str:
    """Return why the movements, of which some show a constant (N,), cannot tell it; "" where they can."""
    count = int(shows.sum())
    if not count:
        return "no movement of the log shows it"
    if count < FEWEST_SHOWING:
        return f"only {count} movements show it"
    others = sorted({other for pair in alike if name in pair for other in pair} - {name})
    return f"cannot be told apart from {', '.join(others)} in this log" if others else ""


def _variances(linear: LinearDrive, variances: F64) -> F64:
    """Iterate to the variances (Q + 2,) of largest likelihood; what is 0 stays."""
    for _ in range(MOST_STEPS):
        inverse = linear.inverse(variances)
        pulled = np.einsum("nij,nj->ni", inverse, linear.errors)
        observed = np.einsum("ni,nqij,nj->q", pulled, linear.parts, pulled)
        expected = np.einsum("nij,nqji->q", inverse, linear.parts)
        ratio = np.sqrt(np.divide(observed, expected, out=np.ones_like(expected), where=expected > 0))
        variances = np.where(variances > 0, np.maximum(variances * ratio, 1e-14), 0.0)
        if (np.abs(ratio - 1) * expected * variances).max() < CONVERGED_SHARE * len(linear.errors):
            break
    return variances


def _described(
    linear: LinearDrive, model: LinearModel, means: F64, variances: F64, alike: list[tuple[str, str]]
) -> MotionFit:
    """Describe a fit at means (P + 2,); `alike` are constants of the mean that cannot be told apart."""
    inverse, reach = linear.inverse(variances), _reach(len(linear.errors))
    logs, fisher = _log_variances(linear, inverse, variances)
    count = len(model.variances)
    alike = [*alike, *_confounded(model.variances, fisher[:count, :count])]
    fitted, (usual_means, usual) = _means(linear, inverse, means), model.defaults()
    constants = []
    for k, name in enumerate(model.means):
        shows, value = np.abs(linear.biases[:, :, k]).max(axis=1) > 0, fitted[k].value
        why, default = _why(name, shows, alike), float(usual_means[k])
        interval = Fitted(value, -math.inf, math.inf) if why else fitted[k]
        stands = value if shows.sum() >= FEWEST_SHOWING else default
        constants.append(MotionConstant(name, interval, default, stands, not why, why))
    for k, name in enumerate(model.variances):
        shows, root = np.asarray(linear.parts[:, k].any(axis=(1, 2))), 0.5 if "sd_" in name else 1.0
        default, wide = float(usual[k]) ** root, reach * math.sqrt(logs[k])
        value, low, high = (
            float(variances[k] * math.exp(sign * min(wide, WIDEST_LOG))) ** root for sign in (0, -1, 1)
        )
        why = _why(name, shows, alike)
        stands = value if shows.sum() >= FEWEST_SHOWING else default
        if not why and wide > WIDEST_LOG:
            stands, why = default, TOO_WIDE
        interval = Fitted(value, 0.0, math.inf) if why else Fitted(value, low, high)
        constants.append(MotionConstant(name, interval, default, stands, not why, why))
    far = np.einsum("ni,nij,nj->n", linear.errors, inverse, linear.errors) > FAR_SQUARED
    way, turn = (None, None) if model.means else _scales(linear)
    turns = (np.abs(linear.biases[:, :, -1]).max(axis=1) > 0).any() and means[-2:].any()
    return MotionFit(
        model.name,
        tuple(constants),
        segments=len(far),
        far=int(far.sum()),
        alike=tuple(alike),
        way_scale=way,
        turn_scale=turn,
        ahead_m=fitted[-2] if turns else None,
        left_m=fitted[-1] if turns else None,
        truth_sd_m=math.sqrt(variances[-2]),
        truth_sd_rad=math.sqrt(variances[-1]),
        unexplained=_unexplained(linear),
    )


def _scales(linear: LinearDrive) -> tuple[Fitted | None, Fitted | None]:
    """Return actual over measured: of the ways along their measured direction, and of the turns."""
    ways = np.hypot(linear.ends[:, 0], linear.ends[:, 1])
    along = (linear.ends[:, :2] * linear.errors[:, :2]).sum(axis=1) / np.maximum(ways, 1e-9)
    return _scale(ways, along), _scale(linear.ends[:, 2], linear.errors[:, 2])


def _scale(measured: F64, errors: F64) -> Fitted | None:
    total = float(measured @ measured)
    if total == 0:
        return None
    extra = float(measured @ errors) / total
    left = (errors - extra * measured) * measured
    wide = _reach(len(left)) * math.sqrt(max(float(left @ left), _scatter(left[:, None])[0, 0])) / total
    return Fitted(1 + extra, 1 + extra - wide, 1 + extra + wide)


def _means(linear: LinearDrive, inverse: F64, means: F64) -> list[Fitted]:
    """Return the constants (P + 2,) of the mean with their intervals."""
    weighted = np.einsum("nip,nij->npj", linear.biases, inverse)
    length, shape = _shaped(np.einsum("npj,njk->pk", weighted, linear.biases))
    turned = np.linalg.inv(shape + SINGULAR * np.eye(len(means))) / np.outer(length, length)
    spread = _wider(turned, np.einsum("npj,nj->np", weighted, linear.errors))
    reach = _reach(len(linear.errors)) * np.sqrt(spread)
    return [Fitted(*(float(v) for v in row)) for row in np.array([means, means - reach, means + reach]).T]


def _wider(turned: F64, scores: F64) -> F64:
    """Return variances (P,): by the information's inverse (P, P), or by the scatter of the scores (N, P).

    The wider of both, as with few parts the scatter is too small.
    """
    return np.asarray(np.maximum(np.diag(turned @ _scatter(scores) @ turned), np.diag(turned)))


def _scatter(scores: F64) -> F64:
    """Return the covariance (P, P) of the sum of scores (N, P), by its parts: lasting errors count once."""
    sums = np.array([part.sum(axis=0) for part in np.array_split(scores, _parts(len(scores)))])
    return np.asarray(sums.T @ sums * len(sums) / max(len(sums) - 1, 1))


def _parts(count: int) -> int:
    return max(min(MOST_PARTS, count // SEGMENTS_A_PART), 1)


def _reach(count: int) -> float:
    """Return Student's 95 % reach in standard errors, for the parts of so many segments."""
    return float(stdtrit(max(_parts(count) - 1, 1), 0.975))


def _log_variances(linear: LinearDrive, inverse: F64, variances: F64) -> tuple[F64, F64]:
    """Return the variances (Q + 2,) of the logs of the variances, and their information (Q + 2, Q + 2)."""
    pulled = np.einsum("nij,nj->ni", inverse, linear.errors)
    information, share = linear.fisher(inverse, variances)
    scores = np.einsum("ni,nqij,nj->nq", pulled, linear.parts, pulled) - np.einsum("nqii->nq", share)
    turned = np.linalg.pinv(information + np.diag(np.full(len(variances), 1e-9)))
    return _wider(np.asarray(turned, np.float64), scores * variances / 2).clip(1e-300), information
