"""Resampling, effective sample size and weighing against independent code: filterpy and dynesty."""

from __future__ import annotations

import dynesty.utils
import filterpy.monte_carlo.resampling as theirs
import numpy as np
import pytest
from filterpy.discrete_bayes import update

from maurice_mcl.filter.proposal import ProposedParticles
from maurice_mcl.filter.resampling import multinomial, residual, stratified, systematic
from maurice_mcl.filter.weighting import weigh
from maurice_mcl.values.randomness import stream
from maurice_mcl.values.records import Belief, effective_sample_size, normalize, uniform_log_weights

SIZES = [1, 2, 7, 100, 2000]


def _weights(n, seed):
    """Weights from nearly even to almost all on one."""
    rng = np.random.default_rng(seed)
    weights = rng.gamma(0.2, 1, n) + 1e-12
    return weights / weights.sum()


class _Given:
    """A generator that gives known uniforms, for one and for the other."""

    def __init__(self, drawn):
        self.drawn = drawn

    def random(self, n=None):
        return self.drawn


@pytest.mark.parametrize("n", SIZES)
def test_systematic_chooses_what_filterpy_does(monkeypatch, n):
    for seed in range(20):
        offset, weights = np.random.default_rng(seed).random(), _weights(n, seed)
        monkeypatch.setattr(theirs, "random", lambda offset=offset: offset)
        assert np.array_equal(systematic(weights, n, _Given(offset)), theirs.systematic_resample(weights))


@pytest.mark.parametrize("n", SIZES)
def test_stratified_chooses_what_filterpy_does(monkeypatch, n):
    for seed in range(20):
        drawn, weights = np.random.default_rng(seed).random(n), _weights(n, seed)
        monkeypatch.setattr(theirs, "random", lambda count, drawn=drawn: drawn)
        assert np.array_equal(stratified(weights, n, _Given(drawn)), theirs.stratified_resample(weights))


def test_multinomial_counts_have_filterpys_means_and_covariance(monkeypatch):
    n, repeats, rng = 20, 20_000, np.random.default_rng(1)
    monkeypatch.setattr(theirs, "random", rng.random)
    weights, own = np.random.default_rng(3).dirichlet(np.full(n, 3.0)), stream(9, 1)
    ours = np.array([np.bincount(multinomial(weights, n, own), minlength=n) for _ in range(repeats)])
    other = np.array([np.bincount(theirs.multinomial_resample(weights), minlength=n) for _ in range(repeats)])
    error = np.sqrt((ours.var(axis=0) + other.var(axis=0)) / repeats)
    assert np.all(np.abs(ours.mean(axis=0) - other.mean(axis=0)) <= 4 * error + 1e-12)
    scale = np.sqrt(np.outer(other.var(axis=0), other.var(axis=0)))
    assert np.all(np.abs(np.cov(ours.T) - np.cov(other.T)) <= 0.1 * scale)


def test_copies_are_those_of_filterpy_and_dynesty(monkeypatch):
    """Only these: filterpy 2.0 draws the rest from `w - copies`, not from `n w - copies`."""
    monkeypatch.setattr(theirs, "random", lambda count: np.zeros(count))
    for seed in range(20):
        copies = np.random.default_rng(seed).multinomial(64, _weights(64, seed))
        chosen = theirs.residual_resample(copies / 64)
        assert np.array_equal(residual(copies / 64, 64, stream(9, seed)), chosen)
        assert np.array_equal(np.bincount(chosen, minlength=64), copies)
    # Its choices come in random order, so the copies of each are compared
    for seed in range(20):
        weights = _weights(200, seed)
        chosen = dynesty.utils.resample_equal(np.arange(200), weights, np.random.default_rng(seed))
        offset = np.random.default_rng(seed).random()
        ours = systematic(weights, 200, _Given(offset))
        assert np.array_equal(np.bincount(ours, minlength=200), np.bincount(chosen, minlength=200))


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("spread", [0.0, 1.0, 30.0])
def test_effective_sample_size_is_dynestys(n, spread):
    logs = np.random.default_rng(n).normal(-500, spread, n)
    ours = effective_sample_size(normalize(logs)[0])
    assert ours == pytest.approx(dynesty.utils.get_neff_from_logwt(logs), rel=1e-9)


def test_weighing_is_filterpys_discrete_bayes_update():
    rng = np.random.default_rng(5)
    prior, likelihood = rng.dirichlet(np.ones(300)), rng.random(300)
    belief = Belief(np.zeros((300, 3), np.float32), np.log(prior), np.zeros(2))
    weighted, log_evidence = weigh(ProposedParticles(belief), np.log(likelihood))
    assert weighted.weights == pytest.approx(update(likelihood, prior), rel=1e-9)
    assert np.exp(log_evidence) == pytest.approx((likelihood * prior).sum())
    even = Belief(belief.poses, uniform_log_weights(300), belief.origin)
    weighted, _ = weigh(ProposedParticles(even), np.log(likelihood))
    assert weighted.weights == pytest.approx(likelihood / likelihood.sum())
