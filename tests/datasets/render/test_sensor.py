from __future__ import annotations

import numpy as np
import pytest

from maurice_datasets.render.image_sensor import (
    Exposure,
    Sensor,
    covered,
    draw_exposure,
    falloff,
    metered,
    photograph,
    signal_of,
)

SIZE = (144, 176)


def histogram(pictures: list[np.ndarray]) -> np.ndarray:
    """28 bins of 8 levels a channel (3, 28), in the unit 256 x share of pixels."""
    values = np.stack(pictures)
    edges = np.append(16 + 8 * np.arange(28), 241)
    counts = [np.histogram(values[..., c], bins=edges)[0] for c in range(3)]
    return np.array(counts) * 256 / values[..., 0].size


def gray(level: float) -> np.ndarray:
    return np.full((*SIZE, 3), level, np.float32)


def test_covered_pictures_peak_near_80_in_the_lowest_bins_of_each_channel():
    """Thesis figure 14."""
    bins = histogram([covered(Sensor(), SIZE, np.random.default_rng(k)) for k in range(10)])
    assert (bins.max(axis=1) > 60).all()
    assert (bins.max(axis=1) < 100).all()
    assert (bins.argmax(axis=1) <= 2).all()
    assert bins[:, 8:].sum() < 1


def test_values_rise_with_light_and_stay_within():
    rng = np.random.default_rng(0)
    for level in (0.0, 0.2, 50.0):
        picture = photograph(gray(level), Sensor(), Exposure(), rng)
        assert picture.dtype == np.uint8
        assert picture.min() >= 16
        assert picture.max() <= 240
    rng = np.random.default_rng(0)
    means = [photograph(gray(x), Sensor(), Exposure(), rng).mean() for x in (0.0, 0.05, 0.2, 0.5, 0.9)]
    assert (np.diff(means) > 10).all()


def test_gain_and_falloff_by_hand():
    plain = photograph(gray(0.2), Sensor(), Exposure(), np.random.default_rng(0))
    warm = photograph(gray(0.2), Sensor(), Exposure((1.2, 1.0, 0.8)), np.random.default_rng(0))
    red, green, blue = (warm.astype(float) - plain).mean(axis=(0, 1))
    assert red > 3
    assert green == pytest.approx(0, abs=0.1)
    assert blue < -3
    light = falloff(101, 101, 0.35)
    assert light[50, 50] == pytest.approx(1)
    assert light[0, 0] == pytest.approx(0.65)
    assert light[0, 50] == pytest.approx(1 - 0.35 / 2)


def test_exposures_differ_by_a_few_percent():
    gains = np.array([draw_exposure(np.random.default_rng(k)).gain for k in range(2000)])
    assert gains.mean() == pytest.approx(1, abs=4 * 0.0513 / np.sqrt(2000))
    assert gains.mean(axis=1).std() == pytest.approx(0.0513, rel=0.1)
    between = (gains / gains.mean(axis=1, keepdims=True)).std()
    assert 0.006 < between < 0.018
    light = np.full((20, 31, 3), 0.2, np.float32)
    picture = photograph(light, Sensor(), Exposure(), np.random.default_rng(0), half=True)
    assert picture.shape == light.shape
    assert np.array_equal(picture[:, 0:30:2], picture[:, 1:30:2])


def test_fixed_gain_is_linear_below_white_whatever_the_curve():
    """Half the light gives the signal of half the light: dimming by x is radiance times x."""
    sensor = Sensor()
    levels = np.array([0.1, 0.3, 0.9], np.float32)
    for share in (0.25, 0.6):
        straight = (signal_of(share * levels, sensor, (1, 1, 1)) / sensor.span) ** (1 / sensor.gamma)
        assert straight == pytest.approx(share * levels, rel=1e-4)


@pytest.mark.parametrize("level", [0.03, 0.1, 0.2])
def test_automatic_gain_meets_its_target_and_keeps_white_balance(level):
    sensor, light = (Sensor(), gray(level) * np.linspace(0.5, 1.5, SIZE[1], dtype=np.float32)[None, :, None])
    gain = metered(light, sensor, Exposure((1.1, 1.0, 0.9), automatic=True))
    assert signal_of(light, sensor, gain).mean() == pytest.approx(sensor.target, rel=0.02)
    assert gain[0] / gain[1] == pytest.approx(1.1)
    assert gain[2] / gain[1] == pytest.approx(0.9)


@pytest.mark.parametrize(("level", "limit"), [(0.0, 4.0), (0.001, 4.0), (50.0, 0.4)])
def test_automatic_gain_ends_at_its_limits(level, limit):
    assert metered(gray(level), Sensor(), Exposure(automatic=True)) == pytest.approx((limit,) * 3)
