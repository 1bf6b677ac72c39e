from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from maurice_mcl.filter.estimate import (
    covariance,
    entry_weights,
    estimates,
    first_heaviest,
    heaviest_cluster,
    log_mean_likelihood,
    modes,
    share_within,
    weighted_mean,
)
from maurice_mcl.values.geometry import INCH_M
from maurice_mcl.values.library import USUAL
from maurice_mcl.values.records import Belief, EntryLikelihood, normalize, uniform_log_weights

RADIUS_M = 24 * INCH_M


def _belief(poses, weights=None, origin=(0.0, 0.0)):
    poses = np.asarray(poses, np.float32)
    with np.errstate(divide="ignore"):
        logs = uniform_log_weights(len(poses)) if weights is None else normalize(np.log(weights))[0]
    return Belief(poses, logs, np.array(origin))


def _blob(rng, x, y, heading, n, sd=0.1):
    return np.column_stack([rng.normal(x, sd, n), rng.normal(y, sd, n), rng.normal(heading, sd, n)])


def _two_rooms(seed=0):
    rng = np.random.default_rng(seed)
    return np.vstack([_blob(rng, -1.5, 0.5, 1.0, 600), _blob(rng, 1.5, -0.5, -2.0, 400)])


def test_both_estimates_are_those_one_by_one():
    belief = _belief(_two_rooms())
    one_by_one = (heaviest_cluster(belief), weighted_mean(belief))
    for found, alone in zip(estimates(belief), one_by_one, strict=True):
        assert np.array_equal(found.pose, alone.pose)
        assert asdict(replace(found, pose=0)) == asdict(replace(alone, pose=0))


def test_weighted_mean_by_hand():
    found = weighted_mean(_belief([[0, 0, 0.1], [0.2, 0, 0.3], [5, 0, 0.2]], [0.5, 0.25, 0.25], (10, 20)))
    assert found.pose == pytest.approx([11.3, 20.0, 0.175], abs=1e-3)
    x = np.array([0, 0.2, 5])
    w = np.array([0.5, 0.25, 0.25])
    assert found.sd_m == pytest.approx((np.sqrt(w @ (x - 1.3) ** 2), 0.0), abs=1e-6)
    assert found.mass == pytest.approx(1)
    assert found.confidence == 0, "nobody is within a foot of the mean"
    found = weighted_mean(_belief([[0, 0, np.pi - 0.2], [0, 0, -np.pi + 0.1]]))
    assert abs(found.pose[2]) == pytest.approx(np.pi - 0.05, abs=1e-6)


@pytest.mark.parametrize("estimator", [weighted_mean, heaviest_cluster])
def test_one_pose_is_its_own_estimate(estimator):
    found = estimator(_belief(np.tile([0.3, -0.7, 2.0], (500, 1)), origin=(3, 4)))
    assert found.pose == pytest.approx([3.3, 3.3, 2.0], abs=1e-6)
    assert found.sd_m == pytest.approx((0, 0), abs=1e-6)
    assert found.heading_sd_rad == pytest.approx(0, abs=1e-5)
    assert (found.mass, found.confidence, found.converged) == pytest.approx((1, 1, 1))


def test_the_heaviest_cluster_is_where_the_mean_is_not():
    belief = _belief(_two_rooms())
    cluster, mean = heaviest_cluster(belief), weighted_mean(belief)
    assert cluster.pose == pytest.approx([-1.5, 0.5, 1.0], abs=0.02)
    assert cluster.mass == pytest.approx(0.6)
    assert cluster.converged == pytest.approx(0.6)
    assert cluster.sd_m == pytest.approx((0.1, 0.1), abs=0.015)
    assert cluster.heading_sd_rad == pytest.approx(0.1, abs=0.015)
    assert np.hypot(*(mean.pose[:2] - [-1.5, 0.5])) > 1
    assert mean.converged < 0.05
    poses = _two_rooms()
    weights = np.where(poses[:, 0] < 0, 0.1, 1.0)
    assert heaviest_cluster(_belief(poses, weights)).pose == pytest.approx([1.5, -0.5, -2.0], abs=0.03)
    poses = np.vstack([_two_rooms(), np.tile([2.5, 2.5, 0.0], (2000, 1))])
    weights = np.append(np.ones(1000), np.zeros(2000))
    assert heaviest_cluster(_belief(poses, weights)).pose == pytest.approx([-1.5, 0.5, 1.0], abs=0.02)


def _brute(xy, weights):
    """Mean shift from every particle to its end; give the mode with most weight around it."""
    best, most = None, -1.0
    for center in xy[::7]:
        for _ in range(500):
            near = np.hypot(*(xy - center).T) <= RADIUS_M
            moved = weights[near] @ xy[near] / weights[near].sum()
            if np.hypot(*(moved - center)) < 1e-9:
                break
            center = moved
        mass = weights[np.hypot(*(xy - center).T) <= RADIUS_M].sum()
        if mass > most:
            best, most = center, mass
    return best, most


@pytest.mark.parametrize("seed", range(6))
def test_against_brute_force_mean_shift_on_clouds_of_many_modes(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(20, 150, 6)
    blobs = [_blob(rng, *rng.uniform(-2.5, 2.5, 2), 0, n, rng.uniform(0.05, 0.3)) for n in sizes]
    poses = np.vstack([*blobs, np.column_stack([rng.uniform(-2.6, 2.6, (60, 2)), np.zeros(60)])])
    weights = rng.random(len(poses))
    belief = _belief(poses, weights)
    mode, mass = _brute(belief.poses[:, :2].astype(float), belief.weights)
    found = heaviest_cluster(belief)
    xy, center = belief.poses[:, :2].astype(float), found.pose[:2]
    near = np.hypot(*(xy - center).T) <= RADIUS_M
    assert np.hypot(*(belief.weights[near] @ xy[near] / belief.weights[near].sum() - center)) < 0.02
    # of modes that weigh almost the same, either will do
    assert found.mass >= 0.97 * mass
    assert found.mass > 0.999 * mass or np.hypot(*(center - mode)) > RADIUS_M


def test_clusters_anywhere_count_their_circles():
    rng = np.random.default_rng(3)
    for shift in rng.uniform(0, 1.3, (40, 2)):
        far = np.column_stack([rng.uniform(-6, 6, (300, 2)), np.zeros(300)])
        poses = np.vstack([far, _blob(rng, *shift, 0, 100, 0.1)])
        assert heaviest_cluster(_belief(poses)).pose[:2] == pytest.approx(shift, abs=0.15)
    poses = np.vstack([_two_rooms(), [[1e6, 0, 0], [0, -1e6, 0]]])
    found = heaviest_cluster(_belief(poses))
    assert found.converged > 0.3
    assert min(np.hypot(*(found.pose[:2] - c)) for c in ([-1.5, 0.5], [1.5, -0.5])) < 0.05
    near, far = (heaviest_cluster(_belief(_two_rooms(), origin=at)) for at in ((0, 0), (5e5, -3e5)))
    assert far.pose - [5e5, -3e5, 0] == pytest.approx(near.pose, abs=1e-9)
    assert far.sd_m == near.sd_m
    poses = np.array([[0, 0, 0]] * 6 + [[11.9 * INCH_M, 0, 0], [-11.9 * INCH_M, 0, 0]])
    poses = np.vstack([poses, [[0, 23.9 * INCH_M, 0], [0, -23.9 * INCH_M, 0], [0, 2, 0]]])
    found = heaviest_cluster(_belief(poses))
    assert found.pose[:2] == pytest.approx([0, 0], abs=1e-6)
    assert found.confidence == pytest.approx(8 / 11)
    assert found.converged == pytest.approx(10 / 11)


# Best particle, several modes, covariance, share within a radius.


def _blobs(rng, *parts, sd=0.1):
    """Parts are (x, y, heading, n)."""
    return np.vstack([rng.normal((x, y, heading), sd, (n, 3)) for x, y, heading, n in parts])


THREE = [(-3, 0, 1.0, 200), (0, 2, -1.0, 500), (3, -1, 2.0, 300)]


def test_modes_are_found_with_their_masses():
    found = modes(_belief(_blobs(np.random.default_rng(0), *THREE)))
    assert [round(m.mass, 6) for m in found] == [0.5, 0.3, 0.2]
    for mode, (x, y, heading, _) in zip(found, (THREE[1], THREE[2], THREE[0]), strict=True):
        assert mode.pose == pytest.approx([x, y, heading], abs=0.03)
        assert mode.converged == pytest.approx(mode.mass), "shares are of all the weight"
    belief = _belief(_blobs(np.random.default_rng(3), *THREE))
    assert len(modes(belief, most=2)) == 2
    assert len(modes(belief, least=0.25)) == 2
    assert len(modes(_belief([[1, 2, 3]]))) == 1


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


def test_modes_share_no_particle():
    rng = np.random.default_rng(2)
    poses = np.column_stack([np.linspace(0, 6 * USUAL.cluster_m, 900), np.zeros((900, 2))])
    found = modes(_belief(poses, rng.random(900)), most=50, least=0.0001)
    assert sum(m.mass for m in found) == pytest.approx(1)
    belief = _belief([[0, 0, 0], [4, 0, 0]], [0.5, 0.5 + 1e-7])
    assert heaviest_cluster(belief).pose[0] == pytest.approx(4)
    assert [mode.pose[0] for mode in modes(belief)] == pytest.approx([4, 0])


def test_covariance_is_numpys_and_knows_no_seam():
    rng = np.random.default_rng(5)
    mix = np.array([[0.3, 0.1, 0], [0, 0.2, 0.05], [0.02, 0, 0.1]])
    poses = rng.normal(size=(4000, 3)) @ mix
    weights = rng.random(4000)
    found = covariance(_belief(poses, weights, (100, 200)))
    assert found == pytest.approx(np.cov(poses.T, aweights=weights, bias=True), abs=2e-4)
    assert np.linalg.eigvalsh(found).min() > 0
    poses = np.random.default_rng(6).normal(0, 0.2, (3000, 3))
    turned = poses + np.array([0, 0, np.pi])
    turned[:, 2] = (turned[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert covariance(_belief(turned)) == pytest.approx(covariance(_belief(poses)), abs=1e-6)
    belief = _belief(_blobs(np.random.default_rng(7), *THREE))
    found = np.diag(covariance(belief))
    assert found[:2] == pytest.approx(np.square(weighted_mean(belief).sd_m))


def test_share_within_counts_its_rim_and_agrees_with_confidence():
    belief = _belief([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [0.5, 0.3, 0.2], (7, 8))
    at = np.array([7.0, 8.0, 0.0])
    assert [share_within(belief, at, r) for r in (0.5, 1.0, 2.0)] == pytest.approx([0.5, 0.8, 1.0])
    belief = _belief(_blobs(np.random.default_rng(8), *THREE, sd=0.3))
    found = heaviest_cluster(belief)
    assert share_within(belief, found.pose, USUAL.confidence_m) == pytest.approx(found.confidence, abs=1e-3)


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


@pytest.mark.parametrize("seed", range(20))
def test_of_particles_that_weigh_alike_the_first_is_best(seed):
    poses = np.arange(30).reshape(10, 3) / 10
    belief = _belief(poses, _rounded_elsewhere(np.ones(10), seed))
    assert first_heaviest(belief.weights) == 0


@pytest.mark.parametrize("seed", range(20))
def test_a_hundredth_is_a_mode_however_it_was_rounded(seed):
    poses = [[0, 0, 0]] * 99 + [[4, 0, 0]]
    assert len(modes(_belief(poses, _rounded_elsewhere(np.ones(100), seed)))) == 2


def _weighted(n, seed=0):
    rng = np.random.default_rng(seed)
    return Belief(np.zeros((n, 3), np.float32), normalize(rng.normal(0, 2, n))[0], np.zeros(2))


def _log_mean(cost, weights, entries):
    return log_mean_likelihood(EntryLikelihood.of(cost), entry_weights(weights, entries, cost.shape[-1]))


def _naive(cost, belief, entries):
    return sum(
        w * np.exp(-float(cost[e]))
        for w, e in zip(belief.weights.tolist(), entries.tolist(), strict=True)
        if e >= 0
    )


def test_the_mean_likelihood_by_hand():
    rng = np.random.default_rng(1)
    belief, entries = _weighted(300), rng.integers(-1, 20, 300).astype(np.int32)
    cost = rng.gamma(2, 3, (4, 20)).astype(np.float32)
    found = _log_mean(cost, belief.weights, entries)
    assert found.shape == (4,)
    assert np.exp(found) == pytest.approx([_naive(row, belief, entries) for row in cost], rel=1e-9)
    assert _log_mean(cost[2], belief.weights, entries) == pytest.approx(found[2])
    belief, entries = _weighted(3), np.array([0, 1, 1], np.int32)
    found = _log_mean(np.array([5000, 5001], np.float32), belief.weights, entries)
    share = belief.weights[0] + (1 - belief.weights[0]) * np.exp(-1)
    assert found == pytest.approx(-5000 + np.log(share))
    belief, entries = _weighted(3), np.array([0, 1, 1], np.int32)
    one, other = (_log_mean(np.array([2, 3, x], np.float32), belief.weights, entries) for x in (0.0, 600.0))
    assert one == pytest.approx(float(other))
    belief, entries = _weighted(2), np.array([0, -1], np.int32)
    found = _log_mean(np.zeros(1, np.float32), belief.weights, entries)
    assert np.exp(found) == pytest.approx(belief.weights[0])
    entries = np.full(5, -1, np.int32)
    found = _log_mean(np.ones((2, 3), np.float32), _weighted(5).weights, entries)
    assert found.tolist() == [-np.inf, -np.inf]


def test_it_is_never_over_zero_and_falls_by_what_costs_rise_by():
    belief, entries = _weighted(50), np.random.default_rng(2).integers(0, 9, 50).astype(np.int32)
    cost = np.random.default_rng(3).gamma(2, 1, 9).astype(np.float32)
    found = _log_mean(cost, belief.weights, entries)
    assert found <= 0
    assert _log_mean(cost + np.float32(4), belief.weights, entries) == pytest.approx(found - 4, abs=1e-5)
    assert _log_mean(np.zeros(9, np.float32), belief.weights, entries) == pytest.approx(0, abs=1e-9)
