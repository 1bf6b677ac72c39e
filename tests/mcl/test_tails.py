import numpy as np
import pytest

from maurice_mcl.filter.motion import MotionOutliers, with_outliers
from maurice_mcl.randomness import normals, stream

N = 200_000
NOISE = normals(stream(9, 1), N)


@pytest.mark.parametrize(("share", "widen"), [(0.05, 4.0), (0.3, 2.0)])
def test_share_and_variance(share, widen):
    found = with_outliers(NOISE, MotionOutliers(share, widen), stream(9, 2))
    wide = (found != NOISE).any(axis=1)
    assert abs(wide.mean() - share) < 4 * np.sqrt(share * (1 - share) / N)
    assert found[wide] == pytest.approx(widen * NOISE[wide])
    variance = 1 + share * (widen**2 - 1)
    # of x squared: 3 (1 + share (widen^4 - 1)) less the variance squared
    error = np.sqrt((3 * (1 + share * (widen**4 - 1)) - variance**2) / N)
    assert np.all(np.abs(np.square(found).mean(axis=0) - variance) < 4 * error)
    assert np.all(np.abs(found.mean(axis=0)) < 4 * np.sqrt(variance / N))


def test_a_slip_is_of_the_whole_movement():
    found = with_outliers(NOISE, MotionOutliers(0.1, 4.0), stream(9, 3))
    wide = (found != NOISE).any(axis=1)
    assert (found[wide] != NOISE[wide]).all()


def test_beyond_three_deviations_lie_many_more():
    found = with_outliers(NOISE, MotionOutliers(0.05, 4.0), stream(9, 4))
    beyond = (np.abs(found[:, 2]) > 3).mean()
    expected = 0.95 * 0.0026998 + 0.05 * 0.4532547
    assert abs(beyond - expected) < 4 * np.sqrt(expected / N)


def test_without_a_share_noise_is_handed_on_and_no_number_is_drawn():
    rng = stream(9, 5)
    assert with_outliers(NOISE, MotionOutliers(), rng) is NOISE
    assert rng.random() == stream(9, 5).random()


def test_noise_is_left_alone_and_a_larger_n_keeps_a_smaller_ones():
    kept = NOISE.copy()
    many = with_outliers(NOISE, MotionOutliers(0.2), stream(9, 6))
    few = with_outliers(NOISE[:100], MotionOutliers(0.2), stream(9, 6))
    assert np.array_equal(NOISE, kept)
    assert np.array_equal(many[:100], few)
    assert many.dtype == np.float32
