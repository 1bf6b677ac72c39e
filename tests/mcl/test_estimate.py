import numpy as np
import pytest

from maurice_mcl.filter.estimate import heaviest_cluster, weighted_mean
from maurice_mcl.geometry import INCH_M
from maurice_mcl.records import Belief, normalize, uniform_log_weights

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


def test_weighted_mean_by_hand():
    found = weighted_mean(_belief([[0, 0, 0.1], [0.2, 0, 0.3], [5, 0, 0.2]], [0.5, 0.25, 0.25], (10, 20)))
    assert found.pose == pytest.approx([11.3, 20.0, 0.175], abs=1e-3)
    x = np.array([0, 0.2, 5])
    w = np.array([0.5, 0.25, 0.25])
    assert found.sd_m == pytest.approx((np.sqrt(w @ (x - 1.3) ** 2), 0.0), abs=1e-6)
    assert found.mass == pytest.approx(1)
    assert found.confidence == 0, "nobody is within a foot of the mean"


def test_weighted_mean_heading_across_the_seam():
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


def test_weights_decide_not_numbers():
    poses = _two_rooms()
    weights = np.where(poses[:, 0] < 0, 0.1, 1.0)
    assert heaviest_cluster(_belief(poses, weights)).pose == pytest.approx([1.5, -0.5, -2.0], abs=0.03)


@pytest.mark.parametrize("estimator", [weighted_mean, heaviest_cluster])
def test_injected_particles_are_left_out(estimator):
    poses = _two_rooms()
    injected = poses[:, 0] < 0
    found = estimator(_belief(poses), injected)
    alone = estimator(_belief(poses[~injected]))
    assert found.pose == pytest.approx(alone.pose, abs=1e-5)
    assert found.sd_m == pytest.approx(alone.sd_m, abs=1e-5)
    shares = [(e.mass, e.confidence, e.converged) for e in (found, alone)]
    assert shares[0] == pytest.approx(shares[1])


def test_when_all_are_injected_all_count():
    belief = _belief(_two_rooms())
    found = heaviest_cluster(belief, np.ones(belief.size, bool))
    assert found.pose == pytest.approx(heaviest_cluster(belief).pose)


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


def test_a_cluster_on_any_place_of_the_raster_is_found():
    rng = np.random.default_rng(3)
    for shift in rng.uniform(0, 1.3, (40, 2)):
        far = np.column_stack([rng.uniform(-6, 6, (300, 2)), np.zeros(300)])
        poses = np.vstack([far, _blob(rng, *shift, 0, 100, 0.1)])
        assert heaviest_cluster(_belief(poses)).pose[:2] == pytest.approx(shift, abs=0.15)


def test_stragglers_a_thousand_kilometres_away_do_no_harm():
    poses = np.vstack([_two_rooms(), [[1e6, 0, 0], [0, -1e6, 0]]])
    found = heaviest_cluster(_belief(poses))
    assert found.converged > 0.3
    assert min(np.hypot(*(found.pose[:2] - c)) for c in ([-1.5, 0.5], [1.5, -0.5])) < 0.05


def test_particles_without_weight_count_nothing():
    poses = np.vstack([_two_rooms(), np.tile([2.5, 2.5, 0.0], (2000, 1))])
    weights = np.append(np.ones(1000), np.zeros(2000))
    found = heaviest_cluster(_belief(poses, weights))
    assert found.pose == pytest.approx([-1.5, 0.5, 1.0], abs=0.02)


def test_confidence_and_convergence_count_their_circles():
    poses = np.array([[0, 0, 0]] * 6 + [[11.9 * INCH_M, 0, 0], [-11.9 * INCH_M, 0, 0]])
    poses = np.vstack([poses, [[0, 23.9 * INCH_M, 0], [0, -23.9 * INCH_M, 0], [0, 2, 0]]])
    found = heaviest_cluster(_belief(poses))
    assert found.pose[:2] == pytest.approx([0, 0], abs=1e-6)
    assert found.confidence == pytest.approx(8 / 11)
    assert found.converged == pytest.approx(10 / 11)


def test_the_same_cloud_far_from_the_origin():
    near, far = (heaviest_cluster(_belief(_two_rooms(), origin=at)) for at in ((0, 0), (5e5, -3e5)))
    assert far.pose - [5e5, -3e5, 0] == pytest.approx(near.pose, abs=1e-9)
    assert far.sd_m == near.sd_m
