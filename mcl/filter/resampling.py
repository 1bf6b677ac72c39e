"""Resampling: schemes, when to resample, roughening, and the number of particles.

Every scheme is unbiased: the expected number of copies of particle i is n * w_i.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import NormalDist
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..values.arrays import F32, F64, I32, Bool
from ..values.geometry import INCH_M, circular_mean, wrap
from ..values.own_parts import called, is_own, made, own_part
from ..values.randomness import Purpose, normals
from ..values.records import Belief, effective_sample_size, uniform_log_weights
from ..values.setting_rules import number, whole

# Schemes: from normalized weights (N,) and a generator to the parent of each of n new particles.

Resampler = Callable[[F64, int, np.random.Generator], I32]


def multinomial(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """Select with replacement (thesis 3.4): n independent draws, returned in ascending order."""
    # sorted uniforms from exponential gaps (Devroye 1986, V.3), so that the search runs forward
    gaps = rng.standard_exponential(n + 1).cumsum()
    cumulative, last = _cumulative(weights)
    parents = cumulative.searchsorted(gaps[:-1] / gaps[-1], side="right")
    return np.asarray(np.minimum(parents, last), np.int32)


def systematic(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """Select by one draw and even steps (Carpenter, Clifford and Fearnhead 1999): lowest variance."""
    cumulative, last = _cumulative(weights)
    ends = np.ceil(cumulative * n - rng.random()).astype(np.intp)
    ends[last:] = n
    # the parent of a copy is how many particles have all of theirs before it
    return np.bincount(ends)[:n].cumsum().astype(np.int32)


def stratified(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """Select by one draw in each of n even strata (Kitagawa 1996): between multinomial and systematic."""
    cumulative, last = _cumulative(weights)
    points = (np.arange(n) + rng.random(n)) / n
    return np.asarray(np.minimum(cumulative.searchsorted(points, side="right"), last), np.int32)


def residual(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """Copy the integer part of n * w, then draw the rest from the remainders (Liu and Chen 1998)."""
    share = weights * (n / weights.sum(dtype=np.float64))
    copies = np.floor(share).astype(np.int32)
    missing = n - int(copies.sum())
    remainders = share - copies
    if missing > 0 and remainders.sum() > 0:
        copies += np.bincount(multinomial(remainders, missing, rng), minlength=len(weights)).astype(np.int32)
    elif missing:  # rounding error
        copies[int(weights.argmax())] += missing
    return np.repeat(np.arange(len(weights), dtype=np.int32), copies)


def _cumulative(weights: F64) -> tuple[F64, int]:
    """Return running sums (N,) that end at exactly 1, and the last particle with any weight."""
    cumulative = weights.cumsum(dtype=np.float64)
    cumulative /= cumulative[-1]
    return cumulative, int(cumulative.searchsorted(1.0))


RESAMPLERS: Mapping[str, Resampler] = MappingProxyType(
    {
        "multinomial": multinomial,
        "systematic": systematic,
        "stratified": stratified,
        "residual": residual,
    }
)


def resampler_of(name: str) -> Resampler:
    """Return the scheme of a name: ours, or a function of the user's. ValueError if it is not available.

    What a user's function raises, and anything but n numbers of particles, is an InputError of one line.
    """
    if not is_own(name):
        return RESAMPLERS[name]
    function = made("resampler", own_part("resampler", name))

    def resampler(weights: F64, n: int, rng: np.random.Generator) -> I32:
        parents = np.asarray(called(f"resampler {name}", function, weights.copy(), n, rng))
        is_whole = parents.dtype.kind in "iu" and parents.shape == (n,)
        if not is_whole or (n and not 0 <= parents.min() <= parents.max() < len(weights)):
            expected = (
                f"expected {n} whole numbers ({n},) from 0 to {len(weights) - 1}, the parent of each particle"
            )
            raise InputError(None, f"resampler {name}: found {parents.dtype} {parents.shape}, {expected}")
        return parents.astype(np.int32)

    return resampler


# When to resample: plain functions of the belief and the step.

ResamplePolicy = Callable[[Belief, int], bool]  # the weighted belief, the step (1 for the first picture)


def always(belief: Belief, step: int) -> bool:
    """Resample at every update, as the thesis does (3.4)."""
    return True


def below_effective(share: float) -> ResamplePolicy:
    """Resample when the effective sample size falls below a share (0 to 1) of N (Liu and Chen 1995)."""

    def policy(belief: Belief, step: int) -> bool:
        return effective_sample_size(belief.log_weights) < share * belief.size

    return policy


def every(count: int) -> ResamplePolicy:
    """Resample at every `count`-th update."""

    def policy(belief: Belief, step: int) -> bool:
        return step % count == 0

    return policy


# by name, from the settings of all: a share of N, and a number of updates
POLICIES: Mapping[str, Callable[[float, int], ResamplePolicy]] = {
    "always": lambda share, count: always,
    "effective": lambda share, count: below_effective(share),
    "every": lambda share, count: every(count),
}


# Roughening: a little noise on copies, so that they differ (Gordon, Salmond and Smith 1993).


def roughen(belief: Belief, share: float, noise: F32) -> Belief:
    """Add noise (N, 3) of sd share * E * N^(-1/3), E the cloud's extent in each of x, y and heading."""
    if share <= 0 or belief.size == 0:
        return belief
    extent = np.ptp(belief.poses, axis=0)
    middle = circular_mean(belief.poses[:, 2], belief.weights)[0]
    extent[2] = np.ptp(wrap(belief.poses[:, 2] - np.float32(middle)))
    sd = np.asarray(share * extent * belief.size ** (-1 / 3), np.float32)
    poses = belief.poses + noise * sd
    poses[:, 2] = wrap(poses[:, 2])
    return Belief(np.asarray(poses, np.float32), belief.log_weights, belief.origin)


# Adaptive size: as many particles as the spread of those that are drawn requires (KLD sampling; Fox 2003).


@dataclass(frozen=True, slots=True)
class KldParameters:
    """Bins, error bound, confidence, and limits of the size."""

    epsilon: Annotated[float, number(1e-4, 1)] = 0.05  # largest distance allowed (nav2's pf_err is 0.05)
    delta: Annotated[float, number(1e-9, 0.5)] = (
        0.01  # probability of a larger distance (nav2's pf_z is 0.99)
    )
    bin_m: Annotated[float, number(1e-3, 1e3)] = 9 * INCH_M  # side of a bin: half of an 18 in grid
    heading_bins: Annotated[int, whole(1, 3600)] = 24  # 15 degrees each
    least: Annotated[int, whole(1, 10_000_000)] = 100  # particles at least
    most: Annotated[int, whole(1, 10_000_000)] = 20_000  # particles at most


def kld_size(bins: ArrayLike, epsilon: float, delta: float) -> NDArray[np.int64]:
    """Return the samples needed for k filled bins (...) (Fox 2003, equation 7); 1 where k is 1 or less."""
    free = np.maximum(np.asarray(bins) - 1, 1)
    a = 2 / (9 * free)
    z = NormalDist().inv_cdf(1 - delta)
    samples = np.ceil(free / (2 * epsilon) * (1 - a + np.sqrt(a) * z) ** 3)
    return np.where(np.asarray(bins) > 1, samples, 1).astype(np.int64)


def bins_of(belief: Belief, parameters: KldParameters) -> NDArray[np.intp]:
    """Return the bin (N,) of place and heading of every particle, numbered from 0."""
    place = np.floor(belief.poses[:, :2] / np.float32(parameters.bin_m)).astype(np.int64)
    turn = belief.poses[:, 2] * np.float32(parameters.heading_bins / (2 * math.pi))
    heading = np.floor(turn).astype(np.int64) % parameters.heading_bins
    column, row = (place - place.min(axis=0)).T
    cell = column * (row.max() + 1) + row
    return np.unique(cell * parameters.heading_bins + heading, return_inverse=True)[1]


def adapted_size(belief: Belief, parameters: KldParameters, rng: np.random.Generator) -> int:
    """Return how many particles to draw: one by one by weight, until there are enough for the bins they fill.

    This is Fox's stopping rule, within the bounds. The draws only decide the size, so that every scheme can
    make the copies and stays unbiased.
    """
    bins = bins_of(belief, parameters)
    usable = len(np.unique(bins[belief.log_weights > -np.inf]))
    sizes = kld_size(np.arange(usable + 1), parameters.epsilon, parameters.delta)
    limit = min(max(int(sizes[-1]), parameters.least), parameters.most)
    cumulative, last = _cumulative(belief.weights)
    drawn = np.minimum(cumulative.searchsorted(rng.random(limit), side="right"), last)
    first = np.unique(bins[drawn], return_index=True)[1]  # draws that fill a new bin
    filled = np.bincount(first, minlength=limit).cumsum()  # after each draw
    enough = np.arange(1, limit + 1) >= np.maximum(sizes[filled], parameters.least)
    return int(enough.argmax()) + 1 if enough.any() else limit


# The resampling step: from weighted particles to their copies.

Generators = Callable[[int], np.random.Generator]  # by purpose


@dataclass(frozen=True, slots=True, eq=False)
class Resampled:
    """A belief after resampling, and where its particles came from."""

    belief: Belief
    parents: I32 | None = None  # (N',) of each particle, -1: fresh; None: not resampled
    injected: Bool | None = None  # (N',) which are fresh; None: none
    missing: int = 0  # particles that recovery has yet to draw


@dataclass(frozen=True, slots=True, eq=False)
class Resampling:
    """When and how a belief is resampled, and to how many particles."""

    scheme: Resampler
    when: ResamplePolicy
    roughening: float = 0.0  # 0: none
    kld: KldParameters | None = None  # None: the number of particles stays

    def copies(self, weighted: Belief, share: float, rng: Generators) -> Resampled:
        """Return copies of equal weight; a share (0 to 1) of the particles is left to recovery."""
        size = weighted.size
        if self.kld is not None:
            size = adapted_size(weighted, self.kld, rng(Purpose.SIZE))
        fresh = round(share * size)
        parents = self.scheme(weighted.weights, size - fresh, rng(Purpose.RESAMPLE))
        poses = weighted.poses.T.take(parents, axis=1).T  # column by column
        belief = Belief(poses, uniform_log_weights(len(parents)), weighted.origin)
        if self.roughening > 0:
            belief = roughen(belief, self.roughening, normals(rng(Purpose.ROUGHEN), belief.size))
        return Resampled(belief, parents, missing=fresh)
