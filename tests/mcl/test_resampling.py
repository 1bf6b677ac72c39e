import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.filter.resampling import RESAMPLERS, multinomial, systematic
from maurice_mcl.randomness import stream

EACH = pytest.mark.parametrize("name", sorted(RESAMPLERS))
WEIGHTS = np.array([0.02, 0.31, 0.0, 0.17, 0.0003, 0.4, 0.0997, 0.0])


def _counts(resampler, weights, n, rng):
    parents = resampler(weights, n, rng)
    assert parents.dtype == np.int32
    assert parents.shape == (n,)
    return np.bincount(parents, minlength=len(weights))


def _many(name, n, repeats=20_000):
    rng = stream(9, 3, n)
    return np.array([_counts(RESAMPLERS[name], WEIGHTS, n, rng) for _ in range(repeats)])


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
    counts = _counts(systematic, weights, n, stream(9, seed))
    assert np.all(np.abs(counts - n * weights) < 1 + 1e-9)
    assert counts.sum() == n


def test_counts_of_single_particles_scatter_less_in_systematic_than_in_multinomial():
    for n in (5, 8, 40):
        even, drawn = _many("systematic", n), _many("multinomial", n)
        error = np.hypot(_error_of_variance(even), _error_of_variance(drawn))
        assert np.all(even.var(axis=0) <= drawn.var(axis=0) + 4 * error)
        assert even.var(axis=0).sum() < 0.6 * drawn.var(axis=0).sum()


def _error_of_variance(counts):
    return np.sqrt(((counts - counts.mean(axis=0)) ** 2).var(axis=0) / len(counts))


def test_multinomial_counts_scatter_as_a_multinomial_does():
    counts = _many("multinomial", 40)
    covariance = np.cov(counts.T)
    expected = 40 * (np.diag(WEIGHTS) - np.outer(WEIGHTS, WEIGHTS))
    assert covariance == pytest.approx(expected, abs=4 * 40 * 0.25 * np.sqrt(2 / len(counts)))


@EACH
@given(seed=st.integers(0, 100_000))
def test_particles_of_weight_zero_are_never_chosen(name, seed):
    rng = np.random.default_rng(seed)
    weights = rng.random(50) * (rng.random(50) < 0.3)
    weights[rng.integers(50)] = 1.0
    weights /= weights.sum()
    parents = RESAMPLERS[name](weights, 37, rng)
    assert np.all(weights[parents] > 0)


@EACH
@pytest.mark.parametrize("where", [0, 3, 9])
def test_one_particle_with_all_the_weight_gets_all_the_copies(name, where):
    weights = np.zeros(10)
    weights[where] = 1
    assert np.all(RESAMPLERS[name](weights, 25, stream(9, 1)) == where)


@EACH
def test_extreme_weights(name):
    weights = np.array([1e-300, 1.0, 1e-17, 1e-300, 0.0])
    assert np.all(RESAMPLERS[name](weights, 1000, stream(9, 1)) == 1)
    assert np.array_equal(RESAMPLERS[name](np.ones(1), 3, stream(9, 1)), [0, 0, 0])


@EACH
def test_many_equal_weights_whose_sum_is_not_exactly_one(name):
    n = 100_003
    parents = RESAMPLERS[name](np.full(n, 1 / n), n, stream(9, 2))
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


@pytest.mark.parametrize("offset", [0.0, 0.25, 0.96875])
def test_systematic_against_a_slow_independent_version(offset):
    rng = np.random.default_rng(5)
    for n, size in [(7, 5), (20, 20), (3, 30)]:
        raw = rng.integers(0, 5, size)
        raw[0] += 1
        slow = _slow(raw, n, offset)
        assert systematic(raw / raw.sum(), n, _Fixed(offset)).tolist() == pytest.approx(slow)


def test_systematic_at_the_very_end_of_its_range():
    parents = systematic(np.full(7, 1 / 7), 7, _Fixed(np.nextafter(1, 0)))
    assert np.abs(parents - np.arange(7)).max() <= 1


def _slow(raw, n, offset):
    """Walk through the particles with a pointer, weights as whole numbers."""
    total, chosen, particle, end = int(raw.sum()), [], 0, int(raw[0])
    for point in range(n):
        while (point + offset) * total >= end * n:
            particle += 1
            end += int(raw[particle])
        chosen.append(particle)
    return chosen


def test_multinomial_against_numpys_choice():
    n, repeats = 50, 4000
    ours = np.array([_counts(multinomial, WEIGHTS, n, stream(9, 4, k)) for k in range(repeats)])
    rng = np.random.default_rng(6)
    theirs = np.array(
        [
            _counts(lambda w, k, r: r.choice(len(w), k, p=w).astype(np.int32), WEIGHTS, n, rng)
            for _ in range(repeats)
        ]
    )
    error = np.sqrt((ours.var(axis=0) + theirs.var(axis=0)) / repeats)
    assert np.all(np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) <= 4 * error + 1e-12)
