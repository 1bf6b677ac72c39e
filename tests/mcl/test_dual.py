import numpy as np
import pytest

from maurice_mcl.filter.proposal import MixtureParameters, mixture_proposal, regions, shares_of
from maurice_mcl.map import Arena
from maurice_mcl.randomness import stream
from maurice_mcl.records import Belief, normalize
from maurice_mcl.sensor.references import nearest_reference

MIDDLE = np.array([2.0, 1.5])
ARENA = Arena((0.0, 0.0, 4.0, 3.0), np.zeros((0, 4)))


def _library():
    places = [(0.5, 0.5), (1.5, 0.5), (2.5, 1.5), (3.5, 2.5)]
    return np.array([[x, y, k * np.pi / 2 - 3] for x, y in places for k in range(4)])


NEAREST = nearest_reference(_library(), ARENA)
WHERE = regions(NEAREST, 16)
LOGS = np.random.default_rng(0).normal(-20, 1, 16).astype(np.float32)


def _belief(n=1000, seed=1):
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(-2, 0, n), rng.uniform(-1.5, 1.5, n), rng.uniform(-3, 3, n)])
    return Belief(poses.astype(np.float32), normalize(rng.normal(0, 1, n))[0], MIDDLE)


def _mix(belief=None, share=0.3, teleport=0.05, logs=LOGS, seed=2):
    belief = _belief() if belief is None else belief
    parameters = MixtureParameters(share, teleport)
    found = mixture_proposal(belief, logs, NEAREST, WHERE, parameters, stream(9, seed))
    return found.belief, found.correction


def test_the_size_stays_and_all_weigh_the_same_before_the_picture():
    mixed, correction = _mix()
    assert mixed.size == 1000
    assert mixed.poses.dtype == np.float32
    assert correction.shape == (1000,)
    assert mixed.weights == pytest.approx(np.full(1000, 1e-3))


def test_the_first_are_copies_of_predicted_ones_and_the_last_share_is_new():
    belief = _belief()
    mixed, _ = _mix(belief)
    known = set(map(bytes, belief.poses))
    old = [bytes(row) in known for row in mixed.poses]
    assert all(old[:700])
    assert not any(old[700:])


def test_the_correction_is_predicted_density_over_the_mixtures():
    belief = _belief()
    mixed, correction = _mix(belief)
    entry = NEAREST.entries(belief.poses, MIDDLE)
    p = np.array([belief.weights[entry == k].sum() for k in range(16)])
    p = 0.95 * p + 0.05 * WHERE.sizes() / WHERE.sizes().sum()
    q = shares_of(LOGS, WHERE)
    expected = p / (0.7 * p + 0.3 * q)
    assert np.exp(correction) == pytest.approx(expected[NEAREST.entries(mixed.poses, MIDDLE)])


def test_without_teleport_a_dual_draw_where_nobody_was_never_counts():
    mixed, correction = _mix(teleport=0.0)
    entry = NEAREST.entries(_belief().poses, MIDDLE)
    found = NEAREST.entries(mixed.poses, MIDDLE)
    nobody = ~np.isin(found, entry)
    assert nobody.sum() > 20
    assert np.all(correction[nobody] == -np.inf)
    assert np.isfinite(correction[~nobody]).all()
    assert np.isfinite(_mix(teleport=0.01)[1]).all()


def test_a_share_of_nothing_is_resampling_alone():
    mixed, correction = _mix(share=0.0, teleport=0.0)
    assert correction == pytest.approx(np.zeros(1000))
    known = set(map(bytes, _belief().poses))
    assert all(bytes(row) in known for row in mixed.poses)


def test_corrected_means_are_those_of_the_prediction():
    """Mean over the mixture of p / mixture times anything known by entry is the mean over the prediction."""
    belief, repeats = _belief(), 400
    entry = NEAREST.entries(belief.poses, MIDDLE)
    value = np.random.default_rng(3).normal(size=16)
    found = []
    for seed in range(repeats):
        mixed, correction = _mix(belief, teleport=0.0, seed=seed)
        found.append(np.mean(np.exp(correction) * value[NEAREST.entries(mixed.poses, MIDDLE)]))
    truth = belief.weights @ value[entry]
    assert abs(np.mean(found) - truth) < 4 * np.std(found) / np.sqrt(repeats)


def test_an_entry_that_is_nearest_of_nothing_does_no_harm():
    twice = np.vstack([_library(), _library()[:1]])  # the same pose again
    nearest = nearest_reference(twice, ARENA)
    logs = np.append(LOGS, np.float32(5))
    where = regions(nearest, 17)
    assert where.sizes()[16] == 0
    for teleport in (0.0, 0.01):
        parameters = MixtureParameters(0.3, teleport)
        mixed = mixture_proposal(_belief(), logs, nearest, where, parameters, stream(9, 2))
        assert not np.isnan(mixed.correction).any()
        assert np.isfinite(mixed.belief.poses).all()


def test_particles_outside_are_left_to_die():
    belief = _belief()
    poses = belief.poses.copy()
    poses[:300, 0] = 50.0
    mixed, correction = _mix(Belief(poses, belief.log_weights, MIDDLE))
    outside = NEAREST.entries(mixed.poses, MIDDLE) < 0
    assert 100 < outside.sum() < 400
    assert not np.isnan(correction).any()


def test_what_is_given_is_not_changed():
    belief = _belief()
    kept = belief.poses.copy(), belief.log_weights.copy(), LOGS.copy()
    _mix(belief)
    assert np.array_equal(belief.poses, kept[0])
    assert np.array_equal(belief.log_weights, kept[1])
    assert np.array_equal(LOGS, kept[2])
