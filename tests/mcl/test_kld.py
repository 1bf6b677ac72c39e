import math

import numpy as np
import pytest
from scipy.stats import chi2

from maurice_mcl.filter.resampling import KldParameters, adapted_size, kld_size, occupied_bins
from maurice_mcl.records import Belief, normalize, uniform_log_weights

HERE = np.zeros(2)


def _belief(poses, log_weights=None):
    poses = np.asarray(poses, np.float32)
    return Belief(poses, uniform_log_weights(len(poses)) if log_weights is None else log_weights, HERE)


@pytest.mark.parametrize(
    ("bins", "epsilon", "z", "delta"),
    # quantiles of the normal distribution from tables
    [(2, 0.05, 2.326348, 0.01), (50, 0.05, 2.326348, 0.01), (300, 0.02, 1.644854, 0.05), (3, 0.5, 0.0, 0.5)],
)
def test_foxs_formula_by_hand(bins, epsilon, z, delta):
    a = 2 / (9 * (bins - 1))
    expected = math.ceil((bins - 1) / (2 * epsilon) * (1 - a + math.sqrt(a) * z) ** 3)
    assert kld_size(bins, epsilon, delta) == expected


@pytest.mark.parametrize("bins", [2, 10, 100, 1000])
def test_it_approximates_the_chi_square_quantile(bins):
    exact = chi2.ppf(0.99, bins - 1) / (2 * 0.05)
    assert kld_size(bins, 0.05, 0.01) == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("bins", [-1, 0, 1])
def test_one_bin_or_none_needs_one_sample(bins):
    assert kld_size(bins, 0.05, 0.01) == 1


def test_more_bins_more_certainty_and_less_error_need_more():
    sizes = [kld_size(k, 0.05, 0.01) for k in range(1, 400)]
    assert np.all(np.diff(sizes) > 0)
    assert kld_size(50, 0.05, 0.001) > kld_size(50, 0.05, 0.01)
    assert kld_size(50, 0.02, 0.01) > kld_size(50, 0.05, 0.01)


def test_the_bound_holds():
    """Draw as many as it says from k bins: the distance is over epsilon about as rarely as it promises."""
    bins, epsilon, delta, repeats = 40, 0.05, 0.05, 4000
    n = kld_size(bins, epsilon, delta)
    p = np.random.default_rng(0).dirichlet(np.full(bins, 5.0))
    share = np.random.default_rng(1).multinomial(n, p, repeats) / n
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.nansum(share * np.log(share / p), axis=1)
    assert (distance > epsilon).mean() == pytest.approx(delta, abs=4 * np.sqrt(delta / repeats) + 0.01)


def test_bins_by_hand():
    p = KldParameters(bin_m=0.5, heading_bins=4)
    poses = [[0.1, 0.1, 0.1], [0.4, 0.4, 1.5], [0.6, 0.1, 0.1], [0.1, -0.1, 0.1], [0.1, 0.1, -0.1]]
    assert occupied_bins(_belief(poses), p) == 4
    assert occupied_bins(_belief(poses[:2]), p) == 1
    assert occupied_bins(_belief([[0.1, 0.1, -np.pi], [0.1, 0.1, np.pi - 1e-3]]), p) == 2


def test_a_heading_of_pi_is_the_one_of_minus_pi():
    p = KldParameters(heading_bins=24)
    assert occupied_bins(_belief([[0.1, 0.1, np.pi], [0.1, 0.1, -np.pi]]), p) == 1


def test_particles_without_weight_occupy_nothing():
    logs = normalize(np.array([0.0, -np.inf, 0.0]))[0]
    poses = [[0, 0, 0], [5, 5, 0], [0.01, 0.01, 0.01]]
    assert occupied_bins(_belief(poses, logs), KldParameters()) == 1


def test_the_adapted_size_grows_with_the_spread_and_keeps_its_bounds():
    rng = np.random.default_rng(2)
    p = KldParameters(least=150, most=4000)
    unit, amid = rng.normal(size=(3000, 3)), np.array([p.bin_m / 2, p.bin_m / 2, np.pi / 24])
    sizes = [
        adapted_size(_belief(np.clip(unit * s + amid, -3, 3)), p) for s in (0.001, 0.05, 0.1, 0.3, 0.6, 3)
    ]
    assert sizes[0] == 150
    assert sizes[-1] == 4000
    assert np.all(np.diff(sizes) >= 0)
    assert len(set(sizes)) >= 4


def test_between_its_bounds_it_is_the_formula():
    p = KldParameters(bin_m=1.0, heading_bins=1, least=1, most=10**6)
    belief = _belief([[k + 0.5, 0.5, 0.0] for k in range(30)])
    assert adapted_size(belief, p) == kld_size(30, p.epsilon, p.delta)
