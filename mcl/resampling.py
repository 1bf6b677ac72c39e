"""Resampling: normalized weights (N,) and a generator to the parent of each of n new particles.

Every scheme is unbiased: the expected number of copies of particle i is n * w_i.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from .typing import F64, I32

Resampler = Callable[[F64, int, np.random.Generator], I32]


def multinomial(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """Select with replacement (thesis 3.4): n independent draws, returned in ascending order."""
    # sorted uniforms out of exponential gaps (Devroye 1986, V.3), so that the search runs forward
    gaps = rng.standard_exponential(n + 1).cumsum()
    cumulative, last = _cumulative(weights)
    found = cumulative.searchsorted(gaps[:-1] / gaps[-1], side="right")
    return np.asarray(np.minimum(found, last), np.int32)


def systematic(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """One draw, then even steps (Carpenter, Clifford and Fearnhead 1999): the least scatter of counts."""
    cumulative, last = _cumulative(weights)
    ends = np.ceil(cumulative * n - rng.random()).astype(np.int32)
    ends[last:] = n
    copies = ends.copy()
    copies[1:] -= ends[:-1]
    return np.repeat(np.arange(len(weights), dtype=np.int32), copies)


def stratified(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """One draw in each of n even stretches (Kitagawa 1996): between multinomial and systematic."""
    cumulative, last = _cumulative(weights)
    points = (np.arange(n) + rng.random(n)) / n
    return np.asarray(np.minimum(cumulative.searchsorted(points, side="right"), last), np.int32)


def residual(weights: F64, n: int, rng: np.random.Generator) -> I32:
    """Copy the whole part of n * w first, then draw the rest from what is left (Liu and Chen 1998)."""
    share = weights * (n / weights.sum(dtype=np.float64))
    whole = np.floor(share).astype(np.int32)
    missing = n - int(whole.sum())
    left = share - whole
    if missing > 0 and left.sum() > 0:
        whole += np.bincount(multinomial(left, missing, rng), minlength=len(weights)).astype(np.int32)
    elif missing:  # rounding alone left some over, or took one too many
        whole[int(weights.argmax())] += missing
    return np.repeat(np.arange(len(weights), dtype=np.int32), whole)


def _cumulative(weights: F64) -> tuple[F64, int]:
    """Running sums (N,) that end at exactly 1, and the last particle with any weight.

    Rounding would otherwise let a point fall beyond it, on a particle of weight zero.
    """
    cumulative = weights.cumsum(dtype=np.float64)
    cumulative /= cumulative[-1]
    return cumulative, int(cumulative.searchsorted(1.0))


RESAMPLERS: Mapping[str, Resampler] = {
    "multinomial": multinomial,
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
}
