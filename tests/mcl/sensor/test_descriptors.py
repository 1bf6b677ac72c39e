from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from maurice_mcl.sensor.descriptors.histograms import KERNEL, camera_histogram, edge_image, smooth
from maurice_mcl.sensor.descriptors.registry import CHANNELS
from maurice_mcl.sensor.distances import DISTANCES

EACH = pytest.mark.parametrize("name", sorted(CHANNELS))


SIZES = {"chromaticity": 256, "color_grid": 288, "hog": 108, "tiny": 324}


def _flat(value, shape=(10, 12)):
    return np.full((*shape, 3), value, np.uint8)


def _scene(height=144, width=176, seed=6, low=30, high=140):
    """Colored patches under soft shading; values stay within a range, so that gains do not clip them."""
    rng = np.random.default_rng(seed)
    patches = cv2.resize(rng.random((5, 6, 3)), (width, height), interpolation=cv2.INTER_NEAREST)
    shading = cv2.resize(rng.random((4, 4, 3)), (width, height), interpolation=cv2.INTER_LINEAR)
    return np.round(low + (high - low) * (0.7 * patches + 0.3 * shading)).astype(np.uint8)


def _brighter(image, gain, black=24.0):
    return np.clip(np.round((image.astype(float) - black) * gain + black), 0, 255).astype(np.uint8)


def _apart(name, one, other):
    """How far two pictures are, in a unit that has the two of unlike scenes at about 1."""
    describe = CHANNELS[name].describe
    unlike = np.abs(describe(_scene(seed=6)) - describe(_scene(seed=7))).mean()
    return np.abs(describe(one) - describe(other)).mean() / unlike


@EACH
def test_every_channel_measures_any_picture(name):
    channel = CHANNELS[name]
    assert channel.name == name
    assert channel.distance in DISTANCES
    for shape in [(1, 1), (2, 3), (30, 40), (144, 176)]:
        image = np.random.default_rng(1).integers(0, 256, (*shape, 3), dtype=np.uint8)
        kept = image.copy()
        measured = channel.describe(image)
        assert measured.shape == (SIZES.get(name, 84),)
        assert measured.dtype == np.float32
        assert np.isfinite(measured).all()
        assert (measured >= 0).all()
        assert np.array_equal(image, kept)
        assert np.array_equal(channel.describe(image), measured)
        assert np.array_equal(channel.describe(np.asfortranarray(image)), measured)
    assert json.loads(json.dumps(channel.parameters())) == channel.parameters()


@EACH
@pytest.mark.parametrize("value", [0, 24, 127, 255])
def test_every_channel_measures_flat_and_covered_pictures(name, value):
    measured = CHANNELS[name].describe(_flat(value, (30, 40)))
    assert np.isfinite(measured).all()
    assert (measured >= 0).all()


@EACH
def test_every_channel_tells_scenes_apart(name):
    describe = CHANNELS[name].describe
    assert np.abs(describe(_scene(seed=6)) - describe(_scene(seed=7))).max() > 1e-3


@pytest.mark.parametrize("name", ["color", "smoothed", "cumulative", "tiny", "color_grid"])
def test_the_number_of_pixels_does_not_matter(name):
    """Every pixel doubled both ways: the same picture, whose size divides evenly by every raster."""
    image = np.random.default_rng(8).integers(0, 256, (36, 48, 3), dtype=np.uint8)
    doubled = image.repeat(2, axis=0).repeat(2, axis=1)
    describe = CHANNELS[name].describe
    assert describe(doubled) == pytest.approx(describe(image), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("gain", [0.7, 1.3, 1.8])
@pytest.mark.parametrize(("name", "most"), [("chromaticity", 0.15), ("hog", 0.3), ("tiny", 0.01)])
def test_more_or_less_light_changes_little(name, most, gain):
    """At a gain above the black level, which rounding to gray levels alone disturbs.

    It disturbs soft shading's direction most, and so hog.
    """
    image = _scene()
    assert _apart(name, image, _brighter(image, gain)) < most
    assert _apart("color", image, _brighter(image, gain)) > 1, "the thesis's histogram does change"


def test_light_and_flatness():
    image = _scene()
    warm = np.stack([_brighter(image[..., k], g) for k, g in enumerate((1.3, 1.0, 0.8))], axis=2)
    assert _apart("chromaticity", image, warm) > 0.5
    noise = np.random.default_rng(12).normal(0, 12, (144, 176, 3))
    noisy = np.clip(_flat(130, (144, 176)) + noise, 0, 255).astype(np.uint8)
    blurred, color = (np.count_nonzero(CHANNELS[n].describe(noisy)[:28]) for n in ("blurred", "color"))
    assert blurred <= 3 < 10 < color
    assert np.array_equal(CHANNELS["blurred"].describe(_flat(130)), camera_histogram(_flat(130)))
    assert CHANNELS["hog"].describe(_flat(90)).sum() == 0


@pytest.mark.parametrize("name", ["color", "smoothed", "cumulative", "chromaticity"])
def test_a_histogram_does_not_know_left_from_right(name):
    image = _scene(145, 177)  # every other column, where that is used, are the same ones both ways
    assert _apart(name, image, image[:, ::-1].copy()) < 0.02


@pytest.mark.parametrize("name", ["color_grid", "tiny", "hog"])
def test_what_has_a_raster_knows_left_from_right(name):
    image = _scene()
    swapped = np.concatenate([image[:, 88:], image[:, :88]], axis=1)
    assert _apart(name, image, swapped) > 0.3


def test_color_grid_by_hand():
    image = np.zeros((30, 40, 3), np.uint8)
    image[:10, :10] = (16, 50, 240)  # the first part of twelve, filled with one color
    found = CHANNELS["color_grid"].describe(image).reshape(12, 3, 8)
    expected = np.zeros((3, 8))
    expected[0, 0] = expected[1, 1] = expected[2, 7] = 1 / 12
    assert found[0] == pytest.approx(expected)
    assert found[1:].sum() == 0, "what is darker than 16 is in no bin"
    image = np.random.default_rng(9).integers(16, 241, (31, 43, 3), dtype=np.uint8)
    found = CHANNELS["color_grid"].describe(image).reshape(12, 3, 8)
    assert found.sum(axis=(0, 2)) == pytest.approx([1, 1, 1])


def test_cumulative_is_the_running_sum_of_color():
    image = np.random.default_rng(10).integers(0, 256, (31, 17, 3), dtype=np.uint8)
    color = camera_histogram(image).reshape(3, 28)
    found = CHANNELS["cumulative"].describe(image).reshape(3, 28)
    slow = [[color[c, : b + 1].sum() for b in range(28)] for c in range(3)]
    assert found == pytest.approx(np.array(slow), rel=1e-5)
    assert np.all(np.diff(found, axis=1) >= 0)
    distances = [
        np.abs(CHANNELS["cumulative"].describe(_flat(100)) - CHANNELS["cumulative"].describe(_flat(v))).mean()
        for v in (108, 116, 180)
    ]
    assert distances[1] == pytest.approx(2 * distances[0], rel=1e-5)
    assert distances[2] == pytest.approx(10 * distances[0], rel=1e-5)


def test_smoothing_keeps_and_spreads():
    rng = np.random.default_rng(11)
    for histogram in (rng.random(84), np.eye(84)[0], np.eye(84)[27], np.eye(84)[55], np.ones(84)):
        found = smooth(histogram.astype(np.float32)).reshape(3, 28)
        assert found.sum(axis=1) == pytest.approx(histogram.reshape(3, 28).sum(axis=1), rel=1e-5, abs=1e-7)
    assert smooth(np.ones(84, np.float32)) == pytest.approx(np.ones(84), rel=1e-6)
    amid = smooth(np.eye(84, dtype=np.float32)[28 + 10])
    assert amid[28 + 8 : 28 + 13] == pytest.approx(KERNEL)
    assert amid.sum() == pytest.approx(1)
    assert np.flatnonzero(amid).tolist() == list(range(36, 41))
    first = smooth(np.eye(84, dtype=np.float32)[0])
    assert first[:3] == pytest.approx([0.40 + 0.24, 0.24 + 0.06, 0.06])
    assert first[3:].sum() == 0
    image = _scene()
    assert np.array_equal(CHANNELS["smoothed"].describe(image), smooth(camera_histogram(image)))
    brighter = image + np.uint8(8)
    color, smoothed = (
        np.abs(CHANNELS[n].describe(image) - CHANNELS[n].describe(brighter)).sum()
        for n in ("color", "smoothed")
    )
    assert smoothed < 0.9 * color


def test_tiny_by_hand():
    found = CHANNELS["tiny"].describe(_scene()).astype(float) - 1
    assert found.sum() == pytest.approx(0, abs=1e-4)
    assert np.linalg.norm(found) == pytest.approx(1, rel=1e-5)
    almost_flat = _flat(100, (36, 48))
    almost_flat[:4, :4] = 103
    assert np.linalg.norm(CHANNELS["tiny"].describe(almost_flat) - 1) < 0.5, "noise is not blown up"


def test_chromaticity_by_hand():
    found = CHANNELS["chromaticity"].describe(_scene())
    assert found.sum() == pytest.approx(1, rel=1e-5)
    image = np.full((10, 10, 3), (24 + 50, 24 + 30, 24 + 20), np.uint8)  # r 0.5, g 0.3
    cell = int((0.5 - 0.13) * 16 / 0.42) * 16 + int((0.3 - 0.13) * 16 / 0.42)
    assert np.flatnonzero(CHANNELS["chromaticity"].describe(image)).tolist() == [cell]
    assert CHANNELS["chromaticity"].describe(_flat(0)).sum() == 0, "black has no color"


@pytest.mark.parametrize(("across", "direction"), [(True, 0), (False, 4)])
def test_hog_finds_the_direction_of_a_ramp(across, direction):
    ramp = np.linspace(0, 240, 96).astype(np.uint8)
    plane = np.tile(ramp, (96, 1)) if across else np.tile(ramp[:, None], (1, 96))
    found = CHANNELS["hog"].describe(np.repeat(plane[..., None], 3, axis=2)).reshape(12, 9)
    assert np.square(found).sum() == pytest.approx(1, rel=1e-5), "roots of shares"
    assert np.square(found)[:, direction].sum() > 0.95


def test_the_edge_image_of_a_step():
    image = _flat(50, (20, 40))
    image[:, 20:] = 150
    edges = edge_image(image)
    assert (edges.shape, edges.dtype) == (image.shape, np.uint8)
    profile = edges[10, :, 0].astype(int)
    assert profile.argmax() in (19, 20)
    assert profile[19] == profile[20]
    # a Gaussian blur of sd 1 px leaves 0.64 of the step between the two columns beside an edge pixel
    assert profile.max() == pytest.approx(0.5 * 4 * 100 * 0.64, abs=4)
    assert profile[:14].max() == 0
    assert profile[26:].max() == 0
    assert np.array_equal(edges, np.transpose(edge_image(np.transpose(image, (1, 0, 2))), (1, 0, 2)))


def test_an_edge_shows_only_where_it_is():
    image = _flat(50)
    image[:, 6:, 1] = 200
    edges = edge_image(image)
    assert edges[..., 1].max() > 100
    assert edges[..., (0, 2)].max() == 0
    image = cv2.GaussianBlur(
        np.random.default_rng(2).integers(40, 160, (60, 80, 3), dtype=np.uint8), (0, 0), 1
    )
    brighter = image + np.uint8(40)
    edges, color = CHANNELS["edges"], CHANNELS["color"]
    assert np.array_equal(edges.describe(image), edges.describe(brighter))
    assert not np.array_equal(color.describe(image), color.describe(brighter))


@pytest.mark.parametrize("value", [0, 90, 255])
def test_a_flat_picture_has_no_edges(value):
    assert edge_image(_flat(value)).max() == 0
    assert CHANNELS["edges"].describe(_flat(value)).sum() == 0


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


def test_histograms_by_hand():
    image = _flat(100, (16, 16))
    image[:4] = 200
    image[4:5] = 5  # in no bin, but counted as pixels
    histogram = camera_histogram(image).reshape(3, 28)
    assert histogram[:, (200 - 16) // 8] == pytest.approx(256 * 4 / 16)
    assert histogram[:, (100 - 16) // 8] == pytest.approx(256 * 11 / 16)
    assert histogram.sum(axis=1) == pytest.approx(256 * 15 / 16)
    image = np.zeros((4, 4, 3), np.uint8)
    image[..., 0], image[..., 1], image[..., 2] = 20, 30, 40
    filled = np.flatnonzero(camera_histogram(image))
    assert filled.tolist() == [0, 28 + 1, 56 + 3]
    image = np.random.default_rng(0).integers(0, 256, (31, 17, 3), dtype=np.uint8)
    slow = [
        256
        * sum(16 + 8 * b <= v < (24 if b < 27 else 25) + 8 * b for v in image[..., c].ravel().tolist())
        / (31 * 17)
        for c in range(3)
        for b in range(28)
    ]
    assert camera_histogram(image) == pytest.approx(slow)
