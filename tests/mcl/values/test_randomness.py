from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from maurice_mcl.values.randomness import Domain, Purpose, address_words, generator, normals, stream


def test_addresses_count_and_give_the_same_numbers():
    again = [stream(Domain.FILTER, 7, 3, Purpose.MOTION).random(50) for _ in range(2)]
    assert np.array_equal(*again)
    addresses = [(1, 7, 3, 2), (2, 7, 3, 2), (1, 8, 3, 2), (1, 7, 4, 2), (1, 7, 3, 3), (1, 3, 7, 2)]
    draws = {tuple(stream(*address).random(4)) for address in addresses}
    assert len(draws) == len(addresses)
    assert 0 <= stream(1, 2**32 - 1, 2**32 - 1).random() < 1
    draws = np.stack([stream(1, seed, step).random(2000) for seed in range(4) for step in range(4)])
    apart = np.corrcoef(draws)[~np.eye(16, dtype=bool)]
    assert np.abs(apart).max() < 5 / np.sqrt(2000)


@pytest.mark.parametrize("child", [None, 0, 1, 77])
def test_an_address_is_that_of_numpy(child):
    words = np.random.default_rng(8).integers(0, 2**32, (60, 4)).tolist()
    words += [[1, 0, 0, 0], [1, 7, 63, 2], [1, 7, 64, 2], [1, 2**32 - 1, 2**32 - 1, 2**32 - 1]]
    for address in words:
        usual = np.random.default_rng(address)
        if child is not None:
            usual = usual.spawn(child + 1)[child]
        found = stream(*address, child=child)
        assert np.array_equal(found.random(5), usual.random(5))
        assert found.integers(0, 100, 7).tolist() == usual.integers(0, 100, 7).tolist()


def test_many_addresses_at_once_are_those_one_by_one():
    seeds, steps = np.array([0, 5, 2**32 - 1]), np.arange(70)
    words = address_words(1, seeds, steps, 3, 2)
    assert words.shape == (3, 70, 4)
    for run, step in ((0, 0), (1, 69), (2, 64)):
        found = generator(words[run, step]).random(3)
        assert np.array_equal(found, stream(1, int(seeds[run]), step, 3, child=2).random(3))


@pytest.mark.parametrize("address", [(1, -1), (1, 2**32), (1, 0, -5), (1, 0, 0, 2**40)])
def test_a_word_out_of_range_is_refused(address):
    with pytest.raises(ValueError, match="random address"):
        stream(*address)


def test_more_normals_keep_the_first_ones():
    few, many = (normals(stream(1, 5), n) for n in (100, 1000))
    assert (few.shape, few.dtype) == ((100, 3), np.float32)
    assert np.array_equal(many[:100], few)


def test_normals_are_normal_and_independent():
    n = 200_000
    drawn = normals(stream(1, 6), n).astype(np.float64)
    for column in drawn.T:
        assert abs(column.mean()) < 4 / np.sqrt(n)
        assert abs(column.std() - 1) < 4 / np.sqrt(2 * n)
        assert abs(stats.skew(column)) < 4 * np.sqrt(6 / n)
        assert abs(stats.kurtosis(column)) < 4 * np.sqrt(24 / n)
        assert stats.kstest(column, "norm").pvalue > 1e-4
    for power in (1, 2):
        apart = np.corrcoef(drawn.T**power)[~np.eye(3, dtype=bool)]
        assert np.abs(apart).max() < 5 / np.sqrt(n)
    assert np.isfinite(drawn).all()
