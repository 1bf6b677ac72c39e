"""Distances: how far a picture's descriptor is from every reference's, chosen by name.

Every function takes a sample (D,) and a channel's index of L references and returns (L,) float32, >= 0, and
0 for a reference equal to the sample. Those of one channel can be compared between pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..values import F32, Centered, ChannelIndex, units_of

Distance = Callable[[F32, ChannelIndex], F32]

BLOCK_NUMBERS = 1 << 16  # 256 kB: fits into a core's cache
CANCELLATION_RATIO = 0.02  # squared difference over lengths: below, products lose the fifth digit


def thesis(sample: F32, index: ChannelIndex) -> F32:
    """Mean of max(|s - r| - n, 0) / m over bins, noise floor n, relevance m (thesis 3.3, as a sum)."""
    relevant = index.relevance > 0
    inverse = np.zeros_like(index.relevance)
    inverse[relevant] = 1 / index.relevance[relevant]

    def over_floor(gap: F32) -> F32:
        np.abs(gap, out=gap)
        gap -= index.noise_floor
        return np.maximum(gap, 0, out=gap)

    return _by_blocks(over_floor, sample, index.references, inverse / np.float32(len(sample)))


def l1(sample: F32, index: ChannelIndex) -> F32:
    """Mean of |s - r| (Swain and Ballard's intersection, 1991, is one minus half of it for shares)."""
    equal = np.full(len(sample), 1 / max(len(sample), 1), np.float32)
    return _by_blocks(lambda gap: np.abs(gap, out=gap), sample, index.references, equal)


def l2(sample: F32, index: ChannelIndex) -> F32:
    """Root of the mean of (s - r) squared."""
    return _by_products(sample, index.centered)


def chi2(sample: F32, index: ChannelIndex) -> F32:
    """Mean of (s - r)^2 / (s + r): differences count more where there is little (Rubner et al. 2000)."""
    both = index.references + sample
    squared = np.square(index.references - sample)
    share = np.divide(squared, both, out=np.zeros_like(squared), where=both > 0)
    return np.asarray(share.mean(axis=1), np.float32)


def hellinger(sample: F32, index: ChannelIndex) -> F32:
    """Root of the mean of (root s - root r) squared: L2 of square roots (Hellinger 1909; Bhattacharyya)."""
    return _by_products(np.sqrt(sample), index.centered_roots)


def cosine(sample: F32, index: ChannelIndex) -> F32:
    """One minus the cosine of the angle between s and r: what networks' descriptors are compared by."""
    apart = _by_products(units_of(sample), index.centered_units)
    return np.asarray(np.square(apart) * np.float32(len(sample) / 2), np.float32)


def _by_products(sample: F32, references: Centered) -> F32:
    """Return the root (L,) of each row's mean squared difference, as |r|^2 - 2 r.s + |s|^2.

    One product with the library takes a tenth of the time of L x D differences. Where the difference is
    small beside the lengths the terms cancel, so those few rows are measured by their differences.
    """
    own = sample - references.middle
    lengths = references.squared + own @ own
    squared = lengths - 2 * (references.rows @ own)
    near = np.flatnonzero(squared < CANCELLATION_RATIO * lengths)
    squared[near] = np.square(references.rows[near] - own).sum(axis=1)
    return np.asarray(np.sqrt(squared / np.float32(max(len(sample), 1))), np.float32)


def _by_blocks(size_of: Callable[[F32], F32], sample: F32, references: F32, weights: F32) -> F32:
    """Return the weighted sum (L,) of the size of each row's differences, by blocks that fit the cache.

    `size_of` may work in place. The weighted sum is a product, twice as fast as numpy's mean.
    """
    count, size = references.shape
    rows = max(BLOCK_NUMBERS // max(size, 1), 1)
    result, gap = np.empty(count, np.float32), np.empty((min(rows, count), size), np.float32)
    for first in range(0, count, rows):
        block = references[first : first + rows]
        some = size_of(np.subtract(block, sample, out=gap[: len(block)]))
        np.matmul(some, weights, out=result[first : first + rows])
    return result


DISTANCES: Mapping[str, Distance] = {
    "thesis": thesis,
    "l1": l1,
    "l2": l2,
    "chi2": chi2,
    "hellinger": hellinger,
    "cosine": cosine,
}
SIGNED = frozenset({"l1", "l2", "cosine"})  # that may be chosen for numbers below 0


def contributions(distance: str, sample: F32, reference: F32, index: ChannelIndex) -> F32:
    """Return what each element (D,) adds; the mean is the distance (of "l2", "hellinger": squared)."""
    gap = np.abs(reference - sample)
    match distance:
        case "thesis":
            return _share(np.maximum(gap - index.noise_floor, 0), index.relevance)
        case "l2":
            return np.asarray(np.square(gap), np.float32)
        case "chi2":
            return _share(np.square(gap), reference + sample)
        case "hellinger":
            return np.asarray(np.square(np.sqrt(reference) - np.sqrt(sample)), np.float32)
        case "cosine":
            apart = np.square(units_of(reference) - units_of(sample))
            return np.asarray(apart * np.float32(len(sample) / 2), np.float32)
        case _:
            return np.asarray(gap, np.float32)


def _share(part: F32, whole: F32) -> F32:
    return np.asarray(np.divide(part, whole, out=np.zeros_like(part), where=whole > 0), np.float32)
