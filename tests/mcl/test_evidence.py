import numpy as np
import pytest

from maurice_mcl.filter.estimate import log_mean_likelihood
from maurice_mcl.records import Belief, normalize


def _belief(n, seed=0):
    rng = np.random.default_rng(seed)
    return Belief(np.zeros((n, 3), np.float32), normalize(rng.normal(0, 2, n))[0], np.zeros(2))


def _naive(cost, belief, entries):
    return sum(
        w * np.exp(-float(cost[e]))
        for w, e in zip(belief.weights.tolist(), entries.tolist(), strict=True)
        if e >= 0
    )


def test_it_is_the_naive_sum():
    rng = np.random.default_rng(1)
    belief, entries = _belief(300), rng.integers(-1, 20, 300).astype(np.int32)
    cost = rng.gamma(2, 3, (4, 20)).astype(np.float32)
    found = log_mean_likelihood(cost, belief.weights, entries)
    assert found.shape == (4,)
    assert np.exp(found) == pytest.approx([_naive(row, belief, entries) for row in cost], rel=1e-9)
    assert log_mean_likelihood(cost[2], belief.weights, entries) == pytest.approx(found[2])


def test_large_costs_do_not_underflow():
    belief, entries = _belief(3), np.array([0, 1, 1], np.int32)
    found = log_mean_likelihood(np.array([5000, 5001], np.float32), belief.weights, entries)
    share = belief.weights[0] + (1 - belief.weights[0]) * np.exp(-1)
    assert found == pytest.approx(-5000 + np.log(share))


def test_costs_of_entries_that_nobody_is_at_do_not_matter():
    belief, entries = _belief(3), np.array([0, 1, 1], np.int32)
    one, other = (
        log_mean_likelihood(np.array([2, 3, x], np.float32), belief.weights, entries) for x in (0.0, 600.0)
    )
    assert one == pytest.approx(float(other))


def test_it_is_never_over_zero_and_falls_by_what_costs_rise_by():
    belief, entries = _belief(50), np.random.default_rng(2).integers(0, 9, 50).astype(np.int32)
    cost = np.random.default_rng(3).gamma(2, 1, 9).astype(np.float32)
    found = log_mean_likelihood(cost, belief.weights, entries)
    assert found <= 0
    assert log_mean_likelihood(cost + np.float32(4), belief.weights, entries) == pytest.approx(
        found - 4, abs=1e-5
    )
    assert log_mean_likelihood(np.zeros(9, np.float32), belief.weights, entries) == pytest.approx(0, abs=1e-9)


def test_when_all_are_outside_it_is_minus_infinity():
    entries = np.full(5, -1, np.int32)
    found = log_mean_likelihood(np.ones((2, 3), np.float32), _belief(5).weights, entries)
    assert found.tolist() == [-np.inf, -np.inf]


def test_those_outside_explain_nothing():
    belief, entries = _belief(2), np.array([0, -1], np.int32)
    found = log_mean_likelihood(np.zeros(1, np.float32), belief.weights, entries)
    assert np.exp(found) == pytest.approx(belief.weights[0])
