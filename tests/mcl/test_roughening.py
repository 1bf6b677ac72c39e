import numpy as np
import pytest

from maurice_mcl.filter.resampling import roughen
from maurice_mcl.randomness import normals, stream
from maurice_mcl.records import Belief, normalize, uniform_log_weights

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
    found = roughen(belief, share, normals(stream(9, 1), belief.size))
    off = found.poses.astype(float) - belief.poses
    off[:, 2] = (off[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return found, off


@pytest.mark.parametrize("heading", [0.5, np.pi - 0.1], ids=["amid", "across the seam"])
def test_the_noise_is_gordons(heading):
    _, off = _off(_belief(heading=heading))
    sd = 0.2 * np.array([2.0, 0.5, 0.8]) * N ** (-1 / 3)
    assert off.std(axis=0) == pytest.approx(sd, rel=4 / np.sqrt(2 * N) + 0.001)
    assert np.all(np.abs(off.mean(axis=0)) < 4 * sd / np.sqrt(N) + 1e-6)


def test_weights_and_origin_stay_and_headings_keep_their_range():
    belief = _belief(heading=np.pi - 0.1)
    found, _ = _off(belief, 5.0)
    assert found.log_weights is belief.log_weights
    assert found.origin is belief.origin
    assert found.poses.dtype == np.float32
    assert np.all((found.poses[:, 2] >= np.float32(-np.pi)) & (found.poses[:, 2] < np.float32(np.pi)))


def test_nothing_is_changed_in_place():
    belief, noise = _belief(100), normals(stream(9, 1), 100)
    kept = belief.poses.copy(), noise.copy()
    roughen(belief, 0.2, noise)
    assert np.array_equal(belief.poses, kept[0])
    assert np.array_equal(noise, kept[1])


def test_a_share_of_nothing_changes_nothing():
    belief = _belief(100)
    assert roughen(belief, 0.0, normals(stream(9, 1), 100)) is belief


def test_a_cloud_in_one_point_stays_there():
    poses = np.tile(np.array([[1, 2, 3]], np.float32), (50, 1))
    belief = Belief(poses, uniform_log_weights(50), np.zeros(2))
    assert roughen(belief, 0.2, normals(stream(9, 1), 50)).poses == pytest.approx(poses, abs=1e-5)


def test_copies_differ_afterwards():
    belief = _belief(1000)
    copies = Belief(belief.poses[np.repeat(np.arange(10), 100)], normalize(np.zeros(1000))[0], belief.origin)
    found = roughen(copies, 0.2, normals(stream(9, 2), 1000))
    assert len(np.unique(found.poses, axis=0)) == 1000
