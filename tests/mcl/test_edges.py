import cv2
import numpy as np
import pytest

from maurice_mcl.sensor.descriptors import CHANNELS
from maurice_mcl.sensor.descriptors.edges import edge_image


def _flat(value, shape=(10, 12)):
    return np.full((*shape, 3), value, np.uint8)


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
