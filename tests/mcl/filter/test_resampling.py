from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from maurice_mcl.filter import resampling
from maurice_mcl.values.randomness import normals, stream
from maurice_mcl.values.records import Belief, normalize, uniform_log_weights

EACH = pytest.mark.parametrize("name", sorted(resampling.RESAMPLERS))
WEIGHTS = np.array([0.02, 0.31, 0.0, 0.17, 0.0003, 0.4, 0.0997, 0.0])


def _counts(resampler, weights, n, rng):
    parents = resampler(weights, n, rng)
    assert (parents.dtype, parents.shape) == (np.int32, (n,))
    return np.bincount(parents, minlength=len(weights))


def _many(name, n, repeats=5_000):
    rng = stream(9, 3, n)
    return np.array([_counts(resampling.RESAMPLERS[name], WEIGHTS, n, rng) for _ in range(repeats)])


@EACH
@pytest.mark.parametrize("n", [5, 8, 40], ids=["fewer", "as many", "more"])
def test_every_particle_is_copied_in_proportion_to_its_weight(name, n):
    counts = _many(name, n)
    expected, scatter = n * WEIGHTS, counts.std(axis=0)
    off = np.abs(counts.mean(axis=0) - expected)
    # a particle that is rarely copied may not have been copied at all: allow for the Bernoulli error
    error = np.maximum(scatter, np.sqrt(np.minimum(expected, 1) * (1 - np.minimum(expected, 1))))
    assert np.all(off <= 4 * error / np.sqrt(len(counts)) + 1e-12)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.integers(1, 200), st.integers(0, 1000))
def test_systematic_counts_differ_by_less_than_one_from_their_share(raw, n, seed):
    total = sum(raw)
    weights = np.array(raw) / total if total > 0 else np.full(len(raw), 1 / len(raw))
    counts = _counts(resampling.systematic, weights, n, stream(9, seed))
    assert np.all(np.abs(counts - n * weights) < 1 + 1e-9)
    assert counts.sum() == n


def test_counts_scatter_as_they_should():
    for n in (5, 8, 40):
        even, drawn = _many("systematic", n), _many("multinomial", n)
        error = np.hypot(_error_of_variance(even), _error_of_variance(drawn))
        assert np.all(even.var(axis=0) <= drawn.var(axis=0) + 4 * error)
        assert even.var(axis=0).sum() < 0.6 * drawn.var(axis=0).sum()
    counts = _many("multinomial", 40)
    covariance = np.cov(counts.T)
    expected = 40 * (np.diag(WEIGHTS) - np.outer(WEIGHTS, WEIGHTS))
    assert covariance == pytest.approx(expected, abs=4 * 40 * 0.25 * np.sqrt(2 / len(counts)))


def _error_of_variance(counts):
    return np.sqrt(((counts - counts.mean(axis=0)) ** 2).var(axis=0) / len(counts))


@EACH
@given(seed=st.integers(0, 100_000))
def test_particles_of_weight_zero_are_never_chosen(name, seed):
    rng = np.random.default_rng(seed)
    weights = rng.random(50) * (rng.random(50) < 0.3)
    weights[rng.integers(50)] = 1.0
    weights /= weights.sum()
    parents = resampling.RESAMPLERS[name](weights, 37, rng)
    assert np.all(weights[parents] > 0)


@EACH
@pytest.mark.parametrize("where", [0, 3, 9])
def test_one_particle_with_all_the_weight_gets_all_the_copies(name, where):
    weights = np.zeros(10)
    weights[where] = 1
    assert np.all(resampling.RESAMPLERS[name](weights, 25, stream(9, 1)) == where)


@EACH
def test_extreme_weights(name):
    weights = np.array([1e-300, 1.0, 1e-17, 1e-300, 0.0])
    assert np.all(resampling.RESAMPLERS[name](weights, 1000, stream(9, 1)) == 1)
    assert np.array_equal(resampling.RESAMPLERS[name](np.ones(1), 3, stream(9, 1)), [0, 0, 0])
    n = 100_003
    parents = resampling.RESAMPLERS[name](np.full(n, 1 / n), n, stream(9, 2))
    assert parents.min() >= 0
    assert parents.max() < n
    assert np.all(np.diff(parents) >= 0)
    if name == "systematic":
        assert np.bincount(parents).max() <= 2


class _Fixed:
    """A generator whose uniform is known, for systematic resampling at the ends of its range."""

    def __init__(self, value):
        self.value = value

    def random(self):
        return self.value


N = 50_000


def _belief(n=N, heading=0.5, turn=0.4):
    rng = np.random.default_rng(1)
    poses = np.column_stack(
        [rng.uniform(-1, 1, n), rng.uniform(2, 2.5, n), heading + rng.uniform(-turn, turn, n)]
    )
    poses[:2] = [[-1, 2, heading - turn], [1, 2.5, heading + turn]]  # the extent exactly
    poses[:, 2] = (poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return Belief(poses.astype(np.float32), uniform_log_weights(n), np.array([3.0, 4.0]))


def _off(belief, share=0.2):
    found = resampling.roughen(belief, share, normals(stream(9, 1), belief.size))
    off = found.poses.astype(float) - belief.poses
    off[:, 2] = (off[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return found, off


@pytest.mark.parametrize("heading", [0.5, np.pi - 0.1], ids=["amid", "across the seam"])
def test_the_noise_is_gordons(heading):
    _, off = _off(_belief(heading=heading))
    sd = 0.2 * np.array([2.0, 0.5, 0.8]) * N ** (-1 / 3)
    assert off.std(axis=0) == pytest.approx(sd, rel=4 / np.sqrt(2 * N) + 0.001)
    assert np.all(np.abs(off.mean(axis=0)) < 4 * sd / np.sqrt(N) + 1e-6)


def test_roughening_keeps_weights_origin_and_range():
    belief = _belief(heading=np.pi - 0.1)
    found, _ = _off(belief, 5.0)
    assert found.log_weights is belief.log_weights
    assert found.origin is belief.origin
    assert found.poses.dtype == np.float32
    assert np.all((found.poses[:, 2] >= np.float32(-np.pi)) & (found.poses[:, 2] < np.float32(np.pi)))
    belief = _belief(100)
    assert resampling.roughen(belief, 0.0, normals(stream(9, 1), 100)) is belief
    poses = np.tile(np.array([[1, 2, 3]], np.float32), (50, 1))
    belief = Belief(poses, uniform_log_weights(50), np.zeros(2))
    assert resampling.roughen(belief, 0.2, normals(stream(9, 1), 50)).poses == pytest.approx(poses, abs=1e-5)
    belief = _belief(1000)
    copies = Belief(belief.poses[np.repeat(np.arange(10), 100)], normalize(np.zeros(1000))[0], belief.origin)
    found = resampling.roughen(copies, 0.2, normals(stream(9, 2), 1000))
    assert len(np.unique(found.poses, axis=0)) == 1000


def test_nothing_is_changed_in_place():
    belief, noise = _belief(100), normals(stream(9, 1), 100)
    kept = belief.poses.copy(), noise.copy()
    resampling.roughen(belief, 0.2, noise)
    assert np.array_equal(belief.poses, kept[0])
    assert np.array_equal(noise, kept[1])


HERE = np.zeros(2)


def _spread(poses, log_weights=None):
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
    assert resampling.kld_size(bins, epsilon, delta) == expected


@pytest.mark.parametrize("bins", [2, 10, 100, 1000])
def test_it_approximates_the_chi_square_quantile(bins):
    exact = chi2.ppf(0.99, bins - 1) / (2 * 0.05)
    assert resampling.kld_size(bins, 0.05, 0.01) == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("bins", [-1, 0, 1])
def test_one_bin_or_none_needs_one_sample(bins):
    assert resampling.kld_size(bins, 0.05, 0.01) == 1


def test_kld_sizes_grow_and_hold():
    sizes = [resampling.kld_size(k, 0.05, 0.01) for k in range(1, 400)]
    assert np.all(np.diff(sizes) > 0)
    assert resampling.kld_size(50, 0.05, 0.001) > resampling.kld_size(50, 0.05, 0.01)
    assert resampling.kld_size(50, 0.02, 0.01) > resampling.kld_size(50, 0.05, 0.01)
    p = resampling.KldParameters(bin_m=1.0, heading_bins=1, least=100, most=10**6)
    belief = _spread([[k + 0.5, 0.5, 0.0] for k in range(30)])
    assert resampling.adapted_size(belief, p, stream(9, 1)) == resampling.kld_size(30, p.epsilon, p.delta)
    # Draw as many as it says from k bins: the distance is over epsilon about as rarely as it promises
    bins, epsilon, delta, repeats = 40, 0.05, 0.05, 4000
    n = resampling.kld_size(bins, epsilon, delta)
    p = np.random.default_rng(0).dirichlet(np.full(bins, 5.0))
    share = np.random.default_rng(1).multinomial(n, p, repeats) / n
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.nansum(share * np.log(share / p), axis=1)
    assert (distance > epsilon).mean() == pytest.approx(delta, abs=4 * np.sqrt(delta / repeats) + 0.01)


def test_bins_by_hand():
    p = resampling.KldParameters(bin_m=0.5, heading_bins=4)
    poses = [[0.1, 0.1, 0.1], [0.4, 0.4, 1.5], [0.6, 0.1, 0.1], [0.1, -0.1, 0.1], [0.1, 0.1, -0.1]]
    assert _count(_spread(poses), p) == 4
    assert _count(_spread(poses[:2]), p) == 1
    assert _count(_spread([[0.1, 0.1, -np.pi], [0.1, 0.1, np.pi - 1e-3]]), p) == 2
    p = resampling.KldParameters(heading_bins=24)
    assert _count(_spread([[0.1, 0.1, np.pi], [0.1, 0.1, -np.pi]]), p) == 1


def _count(belief, parameters):
    return len(np.unique(resampling.bins_of(belief, parameters)))


@pytest.mark.parametrize("weight", [0.0, 1e-9])
def test_bins_without_drawn_particles_ask_for_none(weight):
    """The size follows from what is drawn: a cloud in a hundred bins with all its weight in one needs few."""
    poses = [[k % 10, k // 10, 0.1] for k in range(100)]
    with np.errstate(divide="ignore"):
        logs = normalize(np.log(np.where(np.arange(100) == 42, 1.0, weight)))[0]
    p = resampling.KldParameters(least=7, most=10**6)
    assert resampling.adapted_size(_spread(poses, logs), p, stream(9, 1)) == 7


def test_the_size_is_that_of_foxs_algorithm():
    """Fox 2003, table 1, draw by draw: the same distribution of sizes."""
    rng = np.random.default_rng(3)
    belief = _spread(rng.normal(size=(300, 3)), normalize(3 * rng.normal(size=300))[0])
    p = resampling.KldParameters(bin_m=0.5, heading_bins=2, epsilon=0.3, least=5, most=400)
    bins = resampling.bins_of(belief, p)

    def drawn_one_by_one():
        filled, drawn = set(), 0
        while drawn < p.most and drawn < max(resampling.kld_size(len(filled), p.epsilon, p.delta), p.least):
            filled.add(bins[rng.choice(300, p=belief.weights)])
            drawn += 1
        return drawn

    slow = np.array([drawn_one_by_one() for _ in range(300)])
    fast = np.array([resampling.adapted_size(belief, p, rng) for _ in range(3000)])
    assert len(np.unique(fast)) > 10
    assert fast.max() < p.most
    assert abs(slow.mean() - fast.mean()) < 4 * np.hypot(
        slow.std() / np.sqrt(300), fast.std() / np.sqrt(3000)
    )


def test_the_adapted_size_grows_with_the_spread_and_keeps_its_bounds():
    rng = np.random.default_rng(2)
    p = resampling.KldParameters(least=150, most=4000)
    unit, amid = rng.normal(size=(3000, 3)), np.array([p.bin_m / 2, p.bin_m / 2, np.pi / 24])
    sizes = [
        resampling.adapted_size(_spread(np.clip(unit * s + amid, -3, 3)), p, stream(9, 1))
        for s in (0.001, 0.05, 0.1, 0.3, 0.6, 3)
    ]
    assert (sizes[0], sizes[-1]) == (150, 4000)
    assert np.all(np.diff(sizes) >= 0)
    assert len(set(sizes)) >= 4


def _effective(weights):
    logs = normalize(np.log(np.asarray(weights, float)))[0]
    return Belief(np.zeros((len(logs), 3), np.float32), logs, np.zeros(2))


EVEN = _effective([1, 1, 1, 1])
UNEVEN = _effective([2, 1, 1])  # 1 / (1/4 + 1/16 + 1/16) = 8/3 of 3


def test_policies_and_ends_by_hand():
    assert all(resampling.always(belief, step) for belief in (EVEN, UNEVEN) for step in (1, 2))
    assert not resampling.below_effective(0.999)(EVEN, 1)
    assert [step for step in range(1, 11) if resampling.every(3)(EVEN, step)] == [3, 6, 9]
    assert all(resampling.every(1)(EVEN, step) for step in range(1, 5))
    parents = resampling.systematic(np.full(7, 1 / 7), 7, _Fixed(np.nextafter(1, 0)))
    assert np.abs(parents - np.arange(7)).max() <= 1


@pytest.mark.parametrize(("share", "expected"), [(0.88, False), (0.89, True), (0.5, False), (1.0, True)])
def test_below_a_share_of_effective_particles(share, expected):
    """8/3 of 3 are 0.889."""
    assert resampling.below_effective(share)(UNEVEN, 1) is expected
