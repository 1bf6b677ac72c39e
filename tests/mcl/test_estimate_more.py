"""Best particle, several modes, covariance, share within a radius."""

import numpy as np
import pytest

from maurice_mcl.filter.estimate import (
    CLUSTER_M,
    CONFIDENCE_M,
    best_particle,
    covariance,
    heaviest_cluster,
    modes,
    share_within,
    weighted_mean,
)
from maurice_mcl.records import Belief, normalize, uniform_log_weights


def _belief(poses, weights=None, origin=(0.0, 0.0)):
    poses = np.asarray(poses, np.float32)
    with np.errstate(divide="ignore"):
        logs = uniform_log_weights(len(poses)) if weights is None else normalize(np.log(weights))[0]
    return Belief(poses, logs, np.array(origin))


def _blobs(rng, *parts, sd=0.1):
    """Parts are (x, y, heading, n)."""
    return np.vstack([rng.normal((x, y, heading), sd, (n, 3)) for x, y, heading, n in parts])


THREE = [(-3, 0, 1.0, 200), (0, 2, -1.0, 500), (3, -1, 2.0, 300)]


def test_the_best_particle_is_the_heaviest_and_stands_alone():
    found = best_particle(_belief([[0, 0, 0.1], [1, 0, 0.2], [1.1, 0, 0.3]], [0.3, 0.45, 0.25], (10, 20)))
    assert found.pose == pytest.approx([11, 20, 0.2], abs=1e-6)
    assert found.sd_m == (0, 0)
    assert found.heading_sd_rad == pytest.approx(0, abs=1e-6)
    assert found.mass == pytest.approx(0.45)
    assert found.confidence == pytest.approx(0.7)


def test_a_freshly_injected_particle_is_never_the_best():
    belief = _belief([[0, 0, 0], [5, 5, 1]], [0.1, 0.9])
    assert best_particle(belief, np.array([False, True])).pose[0] == pytest.approx(0)
    assert best_particle(belief, np.array([True, True])).pose[0] == pytest.approx(5), "all count then"


def test_modes_are_found_with_their_masses_heaviest_first():
    found = modes(_belief(_blobs(np.random.default_rng(0), *THREE)))
    assert [round(m.mass, 6) for m in found] == [0.5, 0.3, 0.2]
    for mode, (x, y, heading, _) in zip(found, (THREE[1], THREE[2], THREE[0]), strict=True):
        assert mode.pose == pytest.approx([x, y, heading], abs=0.03)
        assert mode.converged == pytest.approx(mode.mass), "shares are of all the weight"


def test_the_first_mode_is_the_scored_estimate():
    rng = np.random.default_rng(1)
    for _ in range(20):
        poses = np.column_stack([rng.uniform(-3, 3, (400, 2)), rng.uniform(-3, 3, 400)])
        belief = _belief(poses, rng.random(400) ** 3)
        found = modes(belief)
        assert sum(m.mass for m in found) <= 1 + 1e-9
        masses = [m.mass for m in found]
        assert masses == sorted(masses, reverse=True)
        assert any(np.array_equal(m.pose, heaviest_cluster(belief).pose) for m in found)


def test_no_particle_belongs_to_two_modes():
    rng = np.random.default_rng(2)
    poses = np.column_stack([np.linspace(0, 6 * CLUSTER_M, 900), np.zeros((900, 2))])
    found = modes(_belief(poses, rng.random(900)), most=50, least=0.0001)
    assert sum(m.mass for m in found) == pytest.approx(1)


def test_modes_can_be_few_and_large_only():
    belief = _belief(_blobs(np.random.default_rng(3), *THREE))
    assert len(modes(belief, most=2)) == 2
    assert len(modes(belief, least=0.25)) == 2
    assert len(modes(_belief([[1, 2, 3]]))) == 1


def test_injected_particles_make_no_mode():
    poses = _blobs(np.random.default_rng(4), *THREE)
    found = modes(_belief(poses), poses[:, 0] < -1.5)
    assert [round(m.mass, 6) for m in found] == [0.625, 0.375]


def test_covariance_against_numpy_away_from_the_seam():
    rng = np.random.default_rng(5)
    mix = np.array([[0.3, 0.1, 0], [0, 0.2, 0.05], [0.02, 0, 0.1]])
    poses = rng.normal(size=(4000, 3)) @ mix
    weights = rng.random(4000)
    found = covariance(_belief(poses, weights, (100, 200)))
    assert found == pytest.approx(np.cov(poses.T, aweights=weights, bias=True), abs=2e-4)
    assert np.linalg.eigvalsh(found).min() > 0


def test_covariance_does_not_know_the_seam():
    poses = np.random.default_rng(6).normal(0, 0.2, (3000, 3))
    turned = poses + np.array([0, 0, np.pi])
    turned[:, 2] = (turned[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert covariance(_belief(turned)) == pytest.approx(covariance(_belief(poses)), abs=1e-6)


def test_covariance_agrees_with_the_spread_of_the_mean():
    belief = _belief(_blobs(np.random.default_rng(7), *THREE))
    found = np.diag(covariance(belief))
    assert found[:2] == pytest.approx(np.square(weighted_mean(belief).sd_m))


def test_share_within_counts_its_rim_and_leaves_fresh_ones_out():
    belief = _belief([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [0.5, 0.3, 0.2], (7, 8))
    at = np.array([7.0, 8.0, 0.0])
    assert [share_within(belief, at, r) for r in (0.5, 1.0, 2.0)] == pytest.approx([0.5, 0.8, 1.0])
    assert share_within(belief, at, 1.0, np.array([False, True, False])) == pytest.approx(0.5 / 0.7)


def test_share_within_agrees_with_confidence():
    belief = _belief(_blobs(np.random.default_rng(8), *THREE, sd=0.3))
    found = heaviest_cluster(belief)
    assert share_within(belief, found.pose, CONFIDENCE_M) == pytest.approx(found.confidence, abs=1e-3)


def _rounded_elsewhere(weights, seed):
    """The same weights as another processor may sum them up: a few units in the last place away."""
    return weights * (1 + np.random.default_rng(seed).uniform(-1e-14, 1e-14, len(weights)))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("turned", [False, True])
def test_of_equally_heavy_clusters_the_lowest_comes_first_then_the_leftmost(turned, seed):
    """Whatever the last digits of the weights say, and in whatever order the particles come."""
    corners = [(0, 0), (4, 0), (0, 3), (4, 3)]
    shape = np.array([[0.02, 0], [0, 0.02], [-0.02, 0], [0, -0.02]])
    poses = np.vstack([np.column_stack([shape + corner, np.zeros(4)]) for corner in corners])
    poses = poses[::-1] if turned else poses
    belief = _belief(poses, _rounded_elsewhere(np.ones(16), seed))
    assert [tuple(np.round(mode.pose[:2], 6) + 0.0) for mode in modes(belief)] == corners
    assert heaviest_cluster(belief).pose[:2] == pytest.approx([0, 0], abs=1e-6)


def test_a_weight_that_is_larger_by_more_than_rounding_decides():
    belief = _belief([[0, 0, 0], [4, 0, 0]], [0.5, 0.5 + 1e-7])
    assert heaviest_cluster(belief).pose[0] == pytest.approx(4)
    assert [mode.pose[0] for mode in modes(belief)] == pytest.approx([4, 0])
    assert best_particle(belief).pose[0] == pytest.approx(4)


@pytest.mark.parametrize("seed", range(20))
def test_of_particles_that_weigh_alike_the_first_is_best(seed):
    poses = np.arange(30).reshape(10, 3) / 10
    belief = _belief(poses, _rounded_elsewhere(np.ones(10), seed))
    assert best_particle(belief).pose[0] == 0


@pytest.mark.parametrize("seed", range(20))
def test_a_hundredth_is_a_mode_however_it_was_rounded(seed):
    poses = [[0, 0, 0]] * 99 + [[4, 0, 0]]
    assert len(modes(_belief(poses, _rounded_elsewhere(np.ones(100), seed)))) == 2
