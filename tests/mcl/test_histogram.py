import numpy as np
import pytest

from maurice_mcl.sensor.descriptors.histogram import camera_histogram


def _flat(value, shape=(10, 12)):
    return np.full((*shape, 3), value, np.uint8)


@pytest.mark.parametrize(
    ("value", "bin_number"),
    [
        (0, None),
        (15, None),
        (16, 0),
        (23, 0),
        (24, 1),
        (231, 26),
        (232, 27),
        (239, 27),
        (240, 27),
        (241, None),
        (255, None),
    ],
)
def test_which_bin_a_value_falls_into(value, bin_number):
    histogram = camera_histogram(_flat(value)).reshape(3, 28)
    expected = np.zeros((3, 28))
    if bin_number is not None:
        expected[:, bin_number] = 255  # 256 x share, capped
    assert np.array_equal(histogram, expected)


def test_the_unit_is_256_times_the_share_of_pixels():
    image = _flat(100, (16, 16))
    image[:4] = 200
    image[4:5] = 5  # in no bin, but counted as pixels
    histogram = camera_histogram(image).reshape(3, 28)
    assert histogram[:, (200 - 16) // 8] == pytest.approx(256 * 4 / 16)
    assert histogram[:, (100 - 16) // 8] == pytest.approx(256 * 11 / 16)
    assert histogram.sum(axis=1) == pytest.approx(256 * 15 / 16)


def test_red_comes_first_then_green_then_blue():
    image = np.zeros((4, 4, 3), np.uint8)
    image[..., 0], image[..., 1], image[..., 2] = 20, 30, 40
    filled = np.flatnonzero(camera_histogram(image))
    assert filled.tolist() == [0, 28 + 1, 56 + 3]


def test_histogram_against_a_slow_count():
    image = np.random.default_rng(0).integers(0, 256, (31, 17, 3), dtype=np.uint8)
    slow = [
        256
        * sum(16 + 8 * b <= v < (24 if b < 27 else 25) + 8 * b for v in image[..., c].ravel().tolist())
        / (31 * 17)
        for c in range(3)
        for b in range(28)
    ]
    assert camera_histogram(image) == pytest.approx(slow)
