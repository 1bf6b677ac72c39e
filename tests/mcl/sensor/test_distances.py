from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.sensor.distances import (
    DISTANCES,
    chi2,
    contributions,
    cosine,
    hellinger,
    l1,
    l2,
    thesis,
)
from maurice_mcl.values.library import ChannelIndex

EACH = pytest.mark.parametrize("name", sorted(DISTANCES))


def _index(seed=0, entries=20, bins=84, floor=0.7):
    rng = np.random.default_rng(seed)
    references = rng.gamma(0.6, 6.0, (entries, bins)).astype(np.float32)
    noise = (rng.random(bins) * 2 * floor).astype(np.float32)
    return ChannelIndex(references, noise, references.max(axis=0))


def _sample(seed=1, bins=84):
    return np.random.default_rng(seed).gamma(0.6, 6.0, bins).astype(np.float32)


def _small():
    """Two references of four bins, the third one empty all over the library."""
    references = np.array([[0, 4, 0, 1], [9, 1, 0, 0]], np.float32)
    return ChannelIndex(references, np.array([1, 0.5, 0, 2], np.float32), np.array([10, 4, 0, 2], np.float32))


@pytest.mark.parametrize(
    ("distance", "expected"),
    [
        # |s - r| is (4, 3, 1, 1) and (5, 0, 1, 2) for the sample (4, 1, 1, 2)
        (thesis, [(3 / 10 + 2.5 / 4) / 4, (4 / 10) / 4]),
        (l1, [9 / 4, 8 / 4]),
        (l2, [np.sqrt(27 / 4), np.sqrt(30 / 4)]),
        (chi2, [(16 / 4 + 9 / 5 + 1 / 1 + 1 / 3) / 4, (25 / 13 + 1 / 1 + 4 / 2) / 4]),
        (cosine, [1 - 6 / np.sqrt(22 * 17), 1 - 37 / np.sqrt(22 * 82)]),
        (hellinger, [np.sqrt((4 + 1 + 1 + (np.sqrt(2) - 1) ** 2) / 4), np.sqrt((1 + 0 + 1 + 2) / 4)]),
    ],
)
def test_by_hand(distance, expected):
    assert distance(np.array([4, 1, 1, 2], np.float32), _small()) == pytest.approx(expected, rel=1e-6)


@EACH
@given(seed=st.integers(0, 10_000), entries=st.integers(1, 5), bins=st.integers(1, 90))
def test_never_negative_finite_and_zero_to_itself(name, seed, entries, bins):
    index = _index(seed, entries, bins)
    found = DISTANCES[name](_sample(seed + 1, bins), index)
    assert (found.shape, found.dtype) == ((entries,), np.float32)
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    itself = [DISTANCES[name](row, index)[k] for k, row in enumerate(index.references)]
    assert itself == [0] * entries


@EACH
def test_distances_are_symmetric_and_pure(name):
    index, sample = _index(), _sample()
    there = DISTANCES[name](sample, index)
    for k, row in enumerate(index.references):
        swapped = ChannelIndex(sample[None], index.noise_floor, index.relevance)
        assert DISTANCES[name](row, swapped)[0] == pytest.approx(there[k], rel=1e-5)
    nothing = np.zeros((3, 8), np.float32)
    index = ChannelIndex(nothing, nothing[0], nothing[0])
    assert np.array_equal(DISTANCES[name](nothing[0], index), np.zeros(3))
    index, sample = _index(), _sample()
    kept = index.references.copy(), index.noise_floor.copy(), index.relevance.copy(), sample.copy()
    DISTANCES[name](sample, index)
    contributions(name, sample, index.references[0], index)
    now = index.references, index.noise_floor, index.relevance, sample
    assert all(np.array_equal(a, b) for a, b in zip(kept, now, strict=True))
    index = _index()
    assert [DISTANCES[name](row, index).argmin() for row in index.references] == list(range(20))


@pytest.mark.parametrize("name", ["l1", "l2"])
def test_a_metric_knows_no_shorter_way_round(name):
    rng = np.random.default_rng(3)
    a, b, c = (rng.gamma(1, 3, (200, 12)).astype(np.float32) for _ in range(3))

    def between(x, y):
        return np.array(
            [DISTANCES[name](p, ChannelIndex(q[None], q, q))[0] for p, q in zip(x, y, strict=True)]
        )

    assert np.all(between(a, c) <= between(a, b) + between(b, c) + 1e-5)


def _naive(sample, index):
    """The thesis's formula as it is printed, over the number of bins."""
    sums = []
    for reference in index.references.tolist():
        total = 0.0
        for s, r, n, m in zip(
            sample.tolist(), reference, index.noise_floor.tolist(), index.relevance.tolist(), strict=True
        ):
            total += max(abs(s - r) - n, 0) / m if m > 0 else 0.0
        sums.append(total / len(sample))
    return sums


def test_the_thesiss_formula_and_its_parts():
    assert thesis(_sample(), _index()) == pytest.approx(_naive(_sample(), _index()), rel=1e-5)
    index = _index()
    plain = ChannelIndex(index.references, np.zeros_like(index.noise_floor), np.ones_like(index.relevance))
    assert l1(_sample(), index) == pytest.approx(_naive(_sample(), plain), rel=1e-5)
    rng = np.random.default_rng(4)
    s, r = rng.dirichlet(np.ones(30), 2).astype(np.float32)
    index = ChannelIndex(r[None], r, r)
    assert 30 * l1(s, index)[0] == pytest.approx(2 * (1 - np.minimum(s, r).sum()), rel=1e-4)


def test_bins_without_relevance_count_nothing():
    index = _index()
    references, relevance = index.references.copy(), index.relevance.copy()
    references[:, 10:50] = relevance[10:50] = 0
    index = ChannelIndex(references, index.noise_floor, relevance)
    found = thesis(_sample(), index)
    assert np.isfinite(found).all()
    assert found == pytest.approx(_naive(_sample(), index), rel=1e-5)
    assert contributions("thesis", _sample(), references[0], index)[10:50].max() == 0


def test_differences_under_the_noise_floor_are_no_differences():
    index = _index()
    quiet = ChannelIndex(index.references, np.full(84, 3.0, np.float32), index.relevance)
    assert thesis(index.references[4] + np.float32(2.9), quiet)[4] == 0
    assert thesis(index.references[4] + np.float32(3.5), quiet)[4] > 0


@EACH
def test_the_mean_of_contributions_is_the_distance_or_its_square(name):
    index = _index()
    index.relevance[5] = 0  # a bin that is empty all over the library
    parts = np.array([contributions(name, _sample(), reference, index) for reference in index.references])
    distance = DISTANCES[name](_sample(), index)
    expected = distance**2 if name in ("l2", "hellinger") else distance
    assert parts.shape == index.references.shape
    assert parts.mean(axis=1) == pytest.approx(expected, rel=1e-5)
    assert np.min(parts) >= 0
