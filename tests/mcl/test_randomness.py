import numpy as np
import pytest
from scipy import stats

from maurice_mcl.randomness import Domain, Purpose, normals, stream


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
