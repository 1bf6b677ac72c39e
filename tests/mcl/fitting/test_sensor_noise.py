from __future__ import annotations

import numpy as np
import pytest

from maurice_mcl.fitting.sensor import noise_floor, stretched
from maurice_mcl.sensor.descriptors.histograms import camera_histogram
from maurice_mcl.values.arrays import U8


def dark(seed: int) -> U8:
    noise = np.random.default_rng(seed).normal((26.0, 40.0, 58.0), 3.0, (20, 30, 3))
    return np.clip(noise, 0, 255).astype(np.uint8)


def test_mean_and_sd_are_those_of_the_frames_histograms():
    frames = [dark(seed) for seed in range(5)]
    found = noise_floor(iter(frames))
    histograms = np.array([camera_histogram(frame) for frame in frames], np.float64)
    assert found.frames == 5
    assert found.mean == pytest.approx(histograms.mean(axis=0))
    assert found.sd == pytest.approx(histograms.std(axis=0, ddof=1))
    assert found.level == pytest.approx(np.mean([f.mean(axis=(0, 1)) for f in frames], axis=0))
    assert not found.lit


def test_peaks_name_the_color_and_the_pixel_values_of_their_bin():
    peaks = noise_floor([dark(0), dark(1)]).peaks()
    assert [(p.color, p.first_value, p.last_value) for p in peaks] == [
        ("red", 24, 31),
        ("green", 40, 47),
        ("blue", 56, 63),
    ]
    assert all(0 < p.count <= 255 for p in peaks)
    (red, _, _) = noise_floor([np.full((4, 4, 3), 240, np.uint8)]).peaks()
    assert (red.first_value, red.last_value) == (232, 240)


def test_frames_by_hand():
    assert np.isnan(noise_floor([dark(0)]).sd).all()
    with pytest.raises(ValueError, match="found no picture"):
        noise_floor([])
    assert noise_floor([np.full((4, 4, 3), 150, np.uint8)]).lit
    picture = np.array([[[10, 20, 30]]], np.uint8)
    assert stretched(picture).tolist() == [[[0, 128, 255]]]
    assert stretched(np.full((2, 2, 3), 9, np.uint8)).max() == 0
    assert picture.max() == 30
