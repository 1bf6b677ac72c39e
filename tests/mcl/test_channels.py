import cv2
import numpy as np
import pytest

from maurice_mcl.channels import CHANNELS
from maurice_mcl.channels.edges import edge_image
from maurice_mcl.channels.histogram import camera_histogram

EACH = pytest.mark.parametrize("name", sorted(CHANNELS))


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


@EACH
def test_every_channel_measures_any_picture(name):
    channel = CHANNELS[name]
    assert channel.name == name
    for shape in [(1, 1), (2, 3), (144, 176)]:
        image = np.random.default_rng(1).integers(0, 256, (*shape, 3), dtype=np.uint8)
        kept = image.copy()
        measured = channel.describe(image)
        assert measured.shape == (84,)
        assert measured.dtype == np.float32
        assert np.isfinite(measured).all()
        assert (measured >= 0).all()
        assert np.array_equal(image, kept)
        assert np.array_equal(channel.describe(np.asfortranarray(image)), measured)
    assert channel.parameters() == channel.parameters()


def test_the_edge_image_of_a_step():
    image = _flat(50, (20, 40))
    image[:, 20:] = 150
    edges = edge_image(image)
    assert edges.shape == image.shape
    assert edges.dtype == np.uint8
    profile = edges[10, :, 0].astype(int)
    assert profile.argmax() in (19, 20)
    assert profile[19] == profile[20]
    # a Gaussian blur of sd 1 px leaves 0.64 of the step between the two columns beside an edge pixel
    assert profile.max() == pytest.approx(0.5 * 4 * 100 * 0.64, abs=4)
    assert profile[:14].max() == 0
    assert profile[26:].max() == 0
    assert np.array_equal(edges, np.transpose(edge_image(np.transpose(image, (1, 0, 2))), (1, 0, 2)))


def test_an_edge_shows_only_in_the_colors_that_it_is_in():
    image = _flat(50)
    image[:, 6:, 1] = 200
    edges = edge_image(image)
    assert edges[..., 1].max() > 100
    assert edges[..., (0, 2)].max() == 0


@pytest.mark.parametrize("value", [0, 90, 255])
def test_a_flat_picture_has_no_edges(value):
    assert edge_image(_flat(value)).max() == 0
    assert CHANNELS["edges"].describe(_flat(value)).sum() == 0


def test_edges_do_not_move_with_brightness_but_color_does():
    image = cv2.GaussianBlur(
        np.random.default_rng(2).integers(40, 160, (60, 80, 3), dtype=np.uint8), (0, 0), 1
    )
    brighter = image + np.uint8(40)
    edges, color = CHANNELS["edges"], CHANNELS["color"]
    assert np.array_equal(edges.describe(image), edges.describe(brighter))
    assert not np.array_equal(color.describe(image), color.describe(brighter))


def test_the_edge_image_against_a_direct_formula():
    image = cv2.GaussianBlur(
        np.random.default_rng(3).integers(0, 256, (30, 40, 3), dtype=np.uint8), (0, 0), 2
    )
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0).astype(float)
    p = np.pad(smooth, ((1, 1), (1, 1), (0, 0)), mode="reflect")
    columns = p[:-2] + 2 * p[1:-1] + p[2:]
    rows = p[:, :-2] + 2 * p[:, 1:-1] + p[:, 2:]
    across, down = columns[:, 2:] - columns[:, :-2], rows[2:] - rows[:-2]
    expected = np.minimum(np.hypot(across, down) / 2, 255)
    assert edge_image(image).astype(float) == pytest.approx(expected, abs=0.51)
