"""Raw pictures of every encoding come out in RGB, or are refused by its name."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from maurice_loaders.bags.messages import PLAIN, picture_of
from maurice_loaders.errors import PictureError
from maurice_mcl.values.arrays import U8

RED, GREEN, BLUE = (200, 30, 20), (25, 180, 40), (15, 35, 220)


def message(data: np.ndarray, encoding: str, width: int, height: int, **more: int) -> SimpleNamespace:
    raw = data.tobytes()
    fields = {"step": len(raw) // height, "is_bigendian": 0} | more
    return SimpleNamespace(data=raw, encoding=encoding, width=width, height=height, **fields)


def mosaic(color: tuple[int, int, int], pattern: str) -> U8:
    """An even color as a sensor with this pattern sees it, (8, 8)."""
    cells = [color["rgb".index(letter)] for letter in pattern]
    return np.tile(np.array(cells, np.uint8).reshape(2, 2), (4, 4))


@pytest.fixture
def rgb() -> U8:
    return np.random.default_rng(3).integers(0, 256, (5, 7, 3), dtype=np.uint8)


ORDERS = {
    "rgb8": [0, 1, 2],
    "bgr8": [2, 1, 0],
    "8UC3": [2, 1, 0],
    "rgba8": [0, 1, 2, 0],
    "bgra8": [2, 1, 0, 0],
}


@pytest.mark.parametrize("encoding", ORDERS)
def test_channel_order(encoding: str, rgb: U8) -> None:
    assert np.array_equal(picture_of(message(rgb[..., ORDERS[encoding]], encoding, 7, 5)), rgb)


@pytest.mark.parametrize(("encoding", "order"), [("rgb16", [0, 1, 2]), ("bgr16", [2, 1, 0])])
@pytest.mark.parametrize("big", [0, 1])
def test_16_bits_become_8(encoding: str, order: list[int], big: int, rgb: U8) -> None:
    wide = (rgb[..., order].astype(np.uint16) * 256 + 77).astype(">u2" if big else "<u2")
    assert np.array_equal(picture_of(message(wide, encoding, 7, 5, is_bigendian=big)), rgb)


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_gray_becomes_color(encoding: str, rgb: U8) -> None:
    seen = picture_of(message(rgb[..., 0], encoding, 7, 5))
    assert np.array_equal(seen, np.repeat(rgb[..., :1], 3, axis=2))


@pytest.mark.parametrize("color", [RED, GREEN, BLUE])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("bits", [8, 16])
def test_bayer_patterns(color: tuple[int, int, int], pattern: str, bits: int) -> None:
    cells = mosaic(color, pattern)
    data = cells if bits == 8 else cells.astype("<u2") * 256
    seen = picture_of(message(data, f"bayer_{pattern}{bits}", 8, 8))
    assert np.array_equal(seen, np.broadcast_to(np.array(color, np.uint8), (8, 8, 3)))


@pytest.mark.parametrize(("encoding", "places"), [("uyvy", (1, 3, 0, 2)), ("yuyv", (0, 2, 1, 3))])
def test_yuv_is_near_the_color_it_came_from(encoding: str, places: tuple[int, ...]) -> None:
    y, cr, cb = cv2.cvtColor(np.array([[RED]], np.uint8), cv2.COLOR_RGB2YCrCb)[0, 0].astype(int)
    luma = 16 + y * 219 // 255
    studio = (luma, luma, *(128 + (chroma - 128) * 224 // 255 for chroma in (cb, cr)))
    pair = np.zeros(4, np.uint8)
    pair[list(places)] = studio
    seen = picture_of(message(np.tile(pair, (4, 3)), encoding, 6, 4))
    assert seen.shape == (4, 6, 3)
    assert np.abs(seen.astype(int) - RED).max() <= 6


def test_padded_rows(rgb: U8) -> None:
    rows = np.pad(rgb.reshape(5, 21), ((0, 0), (0, 11)), constant_values=99)
    assert np.array_equal(picture_of(message(rows, "rgb8", 7, 5)), rgb)
    unpadded_end = SimpleNamespace(**vars(message(rows, "rgb8", 7, 5)))
    unpadded_end.data = unpadded_end.data[:-11]
    assert np.array_equal(picture_of(unpadded_end), rgb)


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1", "nv12", "", "rgb8; jpeg"])
def test_others_are_refused_by_name(encoding: str, rgb: U8) -> None:
    with pytest.raises(PictureError, match=repr(encoding)):
        picture_of(message(rgb, encoding, 7, 5))
    for form in ("16UC1; compressedDepth", "h264"):
        with pytest.raises(PictureError, match="found"):
            picture_of(SimpleNamespace(data=b"\x00" * 30, format=form))


@pytest.mark.parametrize("encoding", PLAIN)
def test_sizes_that_cannot_be(encoding: str) -> None:
    for width, height in [(0, 5), (7, 0), (7, 50), (10**6, 10**6), (1, 1), (-3, 4)]:
        with pytest.raises(PictureError):
            picture_of(
                SimpleNamespace(
                    data=b"", encoding=encoding, width=width, height=height, step=3, is_bigendian=0
                )
            )


def test_compressed_pictures_are_rgb(rgb: U8) -> None:
    _, data = cv2.imencode(".png", rgb[..., ::-1])
    assert np.array_equal(picture_of(SimpleNamespace(data=data, format="bgr8; png compressed bgr8")), rgb)


def compressed(pixels: np.ndarray, form: str) -> SimpleNamespace:
    return SimpleNamespace(data=cv2.imencode(".png", pixels)[1].tobytes(), format=form)


@pytest.mark.parametrize("encoding", ["mono16", "rgb16"])
def test_a_camera_of_12_bits_is_not_dark(encoding: str, rgb: U8) -> None:
    image = np.repeat(rgb[..., :1], 3, axis=2) if encoding == "mono16" else rgb
    pixels = rgb[..., 0] if encoding == "mono16" else rgb
    assert np.array_equal(picture_of(message(pixels.astype("<u2") * 16 + 5, encoding, 7, 5)), image)


def test_a_compressed_picture_of_12_or_16_bits_is_a_cameras_by_its_format(rgb: U8) -> None:
    for scale in (16, 256):
        pixels = rgb[..., 0].astype(np.uint16) * scale
        seen = picture_of(compressed(pixels, "mono16; png compressed "))
        assert np.array_equal(seen, np.repeat(rgb[..., :1], 3, axis=2))
        with pytest.raises(PictureError, match="16 bits a channel"):
            picture_of(compressed(pixels, "png"))


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_compressed_bayer_pattern_is_a_color_picture(pattern: str) -> None:
    seen = picture_of(compressed(mosaic(RED, pattern), f"bayer_{pattern}8; jpeg compressed "))
    assert np.abs(seen[2:-2, 2:-2].astype(int) - RED).max() <= 1
    already = np.full((8, 8, 3), RED[::-1], np.uint8)  # by the camera's driver
    seen = picture_of(compressed(already, f"bayer_{pattern}8; jpeg compressed bgr8"))
    assert (seen == RED).all()


def test_compressed_as_rgb_is_turned_round(rgb: U8) -> None:
    assert np.array_equal(picture_of(compressed(rgb, "rgb8; png compressed rgb8")), rgb)
    assert np.array_equal(picture_of(compressed(rgb[..., ::-1], "rgb8; png compressed bgr8")), rgb)
    assert np.array_equal(picture_of(compressed(rgb[..., ::-1], "png")), rgb)
