"""Pictures come out as they went in, and never half."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from unicodedata import normalize

import cv2
import numpy as np
import pytest

from maurice_loaders.errors import PictureError
from maurice_loaders.files.pictures import (
    decode_picture,
    encode_jpeg,
    picture_file,
    picture_format,
    picture_size,
)
from maurice_mcl.values.arrays import U8

ENDINGS = ("jpg", "png", "webp", "bmp")


def encoded(image: U8, ending: str) -> bytes:
    done, data = cv2.imencode(f".{ending}", image)
    assert done
    return data.tobytes()


def test_jpeg_keeps_color_at_full_resolution() -> None:
    stripes = np.zeros((16, 16, 3), np.uint8)
    stripes[:, ::2] = (255, 0, 0)
    stripes[:, 1::2] = (0, 0, 255)
    back = decode_picture(encode_jpeg(stripes)).astype(int)
    assert np.abs(back - stripes).max() < 40  # halved chroma would mix red and blue to purple


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_format_is_named_and_decoded(image: U8, ending: str) -> None:
    data = encoded(image, ending)
    assert picture_format(data).lower() in (ending, "jpeg")
    assert decode_picture(data).shape == image.shape


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_cut_pictures_are_refused(image: U8, ending: str, share: float) -> None:
    data = encoded(image, ending)
    with pytest.raises(PictureError, match="expected"):
        decode_picture(data[: int(len(data) * share)])


@pytest.mark.parametrize("length", [1, 2**31, 2**32 - 1])
def test_a_png_whose_end_claims_more_than_is_there_is_cut(
    image: U8, length: int, capfd: pytest.CaptureFixture[str]
) -> None:
    data = bytearray(encoded(image, "png"))
    data[-12:-8] = length.to_bytes(4, "big")
    with pytest.raises(PictureError, match="cut PNG"):
        decode_picture(bytes(data))
    assert capfd.readouterr().err == ""  # the decoder has words of its own for it


def test_an_end_marker_in_a_thumbnail_does_not_hide_a_cut(image: U8) -> None:
    data = encode_jpeg(image)
    thumbnail = b"\xff\xe1" + (2 + len(data)).to_bytes(2, "big") + data
    whole = data[:2] + thumbnail + data[2:]
    assert decode_picture(whole + b"maker's notes").shape == image.shape
    with pytest.raises(PictureError, match="cut JPEG"):
        decode_picture(whole[:-1])


def test_pngs_keep_every_pixel_in_rgb_order_and_alpha_is_dropped(image: U8) -> None:
    alpha = np.full((*image.shape[:2], 1), 7, np.uint8)
    gray = np.repeat(image[..., :1], 3, axis=2)
    for written, seen in (
        (image[..., ::-1], image),
        (np.dstack([image[..., ::-1], alpha]), image),
        (image[..., 0], gray),
    ):
        assert np.array_equal(decode_picture(encoded(written, "png")), seen)


def test_exif_orientation_is_applied(image: U8) -> None:
    turned_by_90 = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    body = b"Exif\0\0" + turned_by_90
    data = encode_jpeg(image)
    turned = data[:2] + b"\xff\xe1" + (2 + len(body)).to_bytes(2, "big") + body + data[2:]
    assert np.array_equal(decode_picture(turned), np.rot90(decode_picture(data), -1))


def damaged_png(image: U8) -> bytes:
    data = bytearray(encoded(image, "png"))
    data[len(data) // 2] ^= 1
    return bytes(data)


BAD: dict[str, tuple[Callable[[U8], bytes], str]] = {
    "a JPEG cut and filled with zeros": (lambda image: encode_jpeg(image)[:-20] + bytes(20), "cut JPEG"),
    "a flipped bit": (damaged_png, "damaged PNG"),
    "16 bits": (lambda image: encoded(image.astype(np.uint16) * 256, "png"), "16 bits a channel, expected 8"),
} | {
    repr(data): (lambda _, data=data: data, "expected JPEG, PNG, WebP or BMP")
    for data in (b"", b"GIF89a....", b"hello", bytes(100))
}


@pytest.mark.parametrize("name", BAD)
def test_other_things_are_refused(image: U8, name: str) -> None:
    made, told = BAD[name]
    with pytest.raises(PictureError, match=told):
        decode_picture(made(image))


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4)])
def test_only_rgb_is_encoded(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="a picture is uint8"):
        encode_jpeg(np.zeros(shape, np.uint8))


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize(("width", "height"), [(1, 1), (16, 12), (300, 7), (1, 5000)])
def test_the_size_is_read_from_the_header(ending: str, width: int, height: int) -> None:
    image = np.random.default_rng(0).integers(0, 255, (height, width, 3), dtype=np.uint8)
    assert picture_size(encoded(image, ending)) == (width, height)


def test_sizes_of_rarer_headers_are_read(image: U8) -> None:
    height, width = image.shape[:2]
    for ending, options in {
        "webp": [cv2.IMWRITE_WEBP_QUALITY, 101],  # lossless
        "jpg": [cv2.IMWRITE_JPEG_PROGRESSIVE, 1],
    }.items():
        done, data = cv2.imencode(f".{ending}", image, options)
        assert done
        assert picture_size(data.tobytes()) == (width, height)
    with_alpha = np.dstack([image, image[..., 0]])  # WebP's extended header
    assert picture_size(encoded(with_alpha, "webp")) == (width, height)
    old = b"BM" + bytes(12) + (12).to_bytes(4, "little") + bytes([7, 0, 9, 0, 1, 0, 24, 0, *bytes(4)])
    assert picture_size(old) == (7, 9)


@pytest.mark.parametrize("ending", ENDINGS)
def test_more_pixels_than_the_limit_are_refused_before_they_are_decoded(
    ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = encoded(np.zeros((100, 200, 3), np.uint8), ending)
    assert decode_picture(data).shape == (100, 200, 3)
    monkeypatch.setenv("MAURICE_MAX_MEGAPIXELS", "0.0199")
    monkeypatch.setattr(cv2, "imdecode", None)
    with pytest.raises(PictureError, match=r"200 x 100 pixels, expected at most 0\.0199 megapixels"):
        decode_picture(data)


@pytest.mark.parametrize("limit", ["many", "nan", "-1", "0", "inf"])
def test_a_limit_that_is_no_number_is_refused(image: U8, limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAURICE_MAX_MEGAPIXELS", limit)
    with pytest.raises(PictureError, match="expected a number of megapixels"):
        decode_picture(encoded(image, "png"))


def test_no_header_that_is_cut_or_changed_makes_the_size_fail(image: U8) -> None:
    rng = np.random.default_rng(0)
    for ending in ENDINGS:
        whole = np.frombuffer(encoded(image, ending), np.uint8)
        for _ in range(500):
            data = whole[: rng.integers(1, 40)].copy() if rng.random() < 0.5 else whole.copy()
            data[rng.integers(0, min(len(data), 40))] = rng.integers(0, 256)
            with suppress(PictureError):
                assert min(picture_size(data.tobytes())) > 0


def test_a_picture_of_a_pipe_or_a_device_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "zero.png").symlink_to("/dev/zero")
    for name in ("pipe.png", "zero.png", "none.png", "a\0b.png", "."):
        with pytest.raises(PictureError, match=r"no such picture|cannot be read"):
            picture_file(tmp_path / name)


@pytest.mark.parametrize("forms", [("NFC", "NFD"), ("NFD", "NFC")])
def test_a_picture_whose_accents_are_written_otherwise_is_found(
    forms: tuple[str, str], tmp_path: Path
) -> None:
    """As after copying from a Mac, where the log has one form and the folder the other."""
    on_disk, named = (tmp_path / normalize(form, "Büro-é.jpg") for form in forms)
    on_disk.write_bytes(b"picture")
    assert picture_file(named) == b"picture"
