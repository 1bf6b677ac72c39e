import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_mcl.sensor.fusion import Blended
from maurice_mcl.sensor.likelihood import LIKELIHOODS, exponential, power


def _of_quality(*values):
    quality = np.array(values, np.float32)
    return Blended(1 - quality, quality)


def test_sharpness_one_is_the_quality_itself():
    blended = _of_quality(1.0, 0.5, 0.25, 0.002)
    assert np.exp(power(blended, 1.0)) == pytest.approx(blended.quality, rel=1e-5)
    assert np.exp(power(blended, 4.0)) == pytest.approx(blended.quality**4.0, rel=1e-4)


def test_the_worst_entry_is_unlikely_but_not_ruled_out():
    found = power(_of_quality(0.0, 1e-9, 1e-3, 1.0), 8.0)
    assert np.isfinite(found).all()
    assert found == pytest.approx([8 * np.log(1e-3)] * 3 + [0])


def test_exponential_by_hand():
    blended = Blended(np.array([0, 0.5, 3], np.float32), np.zeros(3, np.float32))
    assert exponential(blended, 2.0).tolist() == [0, -1, -6]


@pytest.mark.parametrize("name", sorted(LIKELIHOODS))
def test_sharpness_zero_makes_blind(name):
    assert np.array_equal(LIKELIHOODS[name](_of_quality(0.0, 0.4, 1.0), 0.0), np.zeros(3))


@pytest.mark.parametrize("name", sorted(LIKELIHOODS))
@given(raw=st.lists(st.floats(0, 1, width=32), min_size=1, max_size=30), sharpness=st.floats(0.01, 300))
def test_finite_never_over_one_and_rising_with_quality(name, raw, sharpness):
    blended = _of_quality(*sorted(raw))
    found = LIKELIHOODS[name](blended, sharpness)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    assert np.all(found <= 0)
    assert np.all(np.diff(found) >= 0)


@pytest.mark.parametrize("name", sorted(LIKELIHOODS))
def test_sharpness_multiplies(name):
    blended = _of_quality(0.1, 0.7, 0.9)
    assert LIKELIHOODS[name](blended, 6.0) == pytest.approx(3 * LIKELIHOODS[name](blended, 2.0), rel=1e-5)
