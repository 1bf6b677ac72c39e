"""Pictures come out as they went in, and never half."""

import cv2
import numpy as np
import pytest

from maurice_loaders.errors import PictureError
from maurice_loaders.io.pictures import decode_picture, encode_jpeg, picture_format
from maurice_mcl.arrays import U8

ENDINGS = ("jpg", "png", "webp", "bmp")


def encoded(image: U8, ending: str) -> bytes:
    done, data = cv2.imencode(f".{ending}", image)
    assert done
    return data.tobytes()


def test_png_keeps_every_pixel_in_rgb_order(image: U8) -> None:
    data = encoded(cv2.cvtColor(image, cv2.COLOR_RGB2BGR), "png")
    assert np.array_equal(decode_picture(data), image)


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


def test_a_jpeg_cut_and_filled_with_zeros_is_refused(image: U8) -> None:
    data = encode_jpeg(image)
    with pytest.raises(PictureError, match="cut JPEG"):
        decode_picture(data[:-20] + bytes(20))


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
    assert decode_picture(whole).shape == image.shape
    with pytest.raises(PictureError, match="cut JPEG"):
        decode_picture(whole[:-1])


def test_what_follows_the_end_of_a_jpeg_does_no_harm(image: U8) -> None:
    assert decode_picture(encode_jpeg(image) + b"maker's notes").shape == image.shape


def test_a_flipped_bit_in_a_png_is_noticed(image: U8) -> None:
    data = bytearray(encoded(image, "png"))
    data[len(data) // 2] ^= 1
    with pytest.raises(PictureError, match="damaged PNG"):
        decode_picture(bytes(data))


def test_gray_becomes_rgb(image: U8) -> None:
    gray = decode_picture(encoded(image[..., 0], "png"))
    assert np.array_equal(gray, np.repeat(image[..., :1], 3, axis=2))


def test_alpha_is_dropped(image: U8) -> None:
    with_alpha = np.dstack([image, np.full(image.shape[:2], 7, np.uint8)])
    assert np.array_equal(decode_picture(encoded(with_alpha, "png")), image[..., ::-1])


def test_16_bits_are_refused_by_name(image: U8) -> None:
    with pytest.raises(PictureError, match="16 bits a channel, expected 8"):
        decode_picture(encoded(image.astype(np.uint16) * 256, "png"))


def test_exif_orientation_is_applied(image: U8) -> None:
    turned_by_90 = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    body = b"Exif\0\0" + turned_by_90
    data = encode_jpeg(image)
    turned = data[:2] + b"\xff\xe1" + (2 + len(body)).to_bytes(2, "big") + body + data[2:]
    assert np.array_equal(decode_picture(turned), np.rot90(decode_picture(data), -1))


@pytest.mark.parametrize("data", [b"", b"GIF89a....", b"hello", bytes(100)])
def test_other_things_are_refused(data: bytes) -> None:
    with pytest.raises(PictureError, match="expected JPEG, PNG, WebP or BMP"):
        decode_picture(data)


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4)])
def test_only_rgb_is_encoded(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="a picture is uint8"):
        encode_jpeg(np.zeros(shape, np.uint8))
