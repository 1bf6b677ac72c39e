"""Picture files to and from arrays: RGB uint8, top row first, as the camera was held (EXIF).

A picture's size is read from its header first: 200 kB of PNG can hold 256 megapixels, and 5 GB in memory.
"""

from __future__ import annotations

import math
import os
import re
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from maurice_mcl.values import U8

from ..errors import PictureError

JPEG_OPTIONS = (
    *(cv2.IMWRITE_JPEG_QUALITY, 95),
    # Full color resolution: halved chroma would blur the color histograms.
    *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
)
PictureKind = Literal["png", "jpeg"]
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
MAX_PICTURE_BYTES = 256 * 2**20
LIMIT = "MAURICE_MAX_MEGAPIXELS"  # environment variable: pictures of more are refused
MEGAPIXELS = 32.0  # without it; decoding and measuring take about 20 bytes a pixel
_MARKER = re.compile(rb"\xff+([^\x00\xff])", re.DOTALL)
_START_OF_SCAN = 0xDA
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
OS2_HEADER = 12  # bytes of the oldest header of a BMP, whose sizes have two
_END_OF_IMAGE = b"\xff\xd9"


def encode_jpeg(image_rgb: U8) -> bytes:
    """Encode an RGB image (H, W, 3) as JPEG, quality 95, 4:4:4."""
    if image_rgb.dtype != np.uint8 or image_rgb.ndim != 3 or image_rgb.shape[2] != 3:
        raise ValueError(f"a picture is uint8 (H, W, 3), found {image_rgb.dtype} {image_rgb.shape}")
    done, data = cv2.imencode(".jpg", cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR), list(JPEG_OPTIONS))
    if not done:
        raise ValueError(f"a picture of {image_rgb.shape} cannot be written as JPEG")
    return data.tobytes()


def encode_picture(image: U8, kind: PictureKind) -> bytes:
    """Encode an RGB picture (H, W, 3): PNG without any loss, or JPEG of quality 95, 4:4:4."""
    if kind == "jpeg":
        return encode_jpeg(image)
    done, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not done:
        raise ValueError(f"a picture of {image.shape} cannot be written as PNG")
    return data.tobytes()


def decode_picture(data: bytes, *, deep: bool = False) -> U8:
    """Decode a complete JPEG, PNG, WebP or BMP to RGB uint8 (H, W, 3); gray becomes RGB, alpha is dropped.

    Raises PictureError for other formats, cut files (OpenCV would fill them with gray, silently), pictures
    that are too large (`expect_size`) and more than 8 bits a channel (often depth, which no scaling makes a
    color); `deep` takes the upper 8 of 16, for lists that hold a camera's pictures only.
    """
    kind = picture_format(data)
    _WHOLE[kind](data)
    expect_size(*picture_size(data))
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    except cv2.error:
        image = None
    if image is None:
        raise PictureError(f"found a {kind} picture that cannot be decoded, expected a readable one")
    if deep and image.dtype == np.uint16:
        image = (image // 256).astype(np.uint8)
    if image.dtype != np.uint8:
        bits = 8 * image.dtype.itemsize
        raise PictureError(f"found {bits} bits a channel, expected 8; convert the picture to 8 bits")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


OUTSIDE = "--reading pictures_outside=true reads it all the same"


def picture_in(folder: Path, name: str, *, outside: bool = False) -> bytes:
    """Return the encoded bytes of the picture that a recording in `folder` names. PictureError as below.

    A name that leads out of the folder is refused unless `outside`: a recording may come from anywhere, and
    what it shows goes into reports.
    """
    if not outside and leads_outside(name):
        raise PictureError(f"is outside of the folder {folder}, expected a picture in it; {OUTSIDE}")
    return picture_file(folder / name)


def leads_outside(name: str) -> bool:
    """Return whether a relative path that a file names is absolute, or leads out of the file's folder."""
    return Path(name).is_absolute() or Path(os.path.normpath(name)).parts[:1] == ("..",)


def picture_file(file: Path) -> bytes:
    """Return the encoded bytes of a picture's file. PictureError for no regular file, or one too large."""
    try:
        if not file.is_file():
            raise PictureError("found no such picture, expected a file; was it moved away?")
        if file.stat().st_size > MAX_PICTURE_BYTES:
            raise PictureError(f"found a picture of more than {MAX_PICTURE_BYTES // 2**20} MiB")
        return file.read_bytes()
    except (OSError, ValueError) as problem:
        if isinstance(problem, PictureError):
            raise
        raise PictureError(f"cannot be read: {problem}") from None


def most_megapixels() -> float:
    """Return how large a picture may be: MAURICE_MAX_MEGAPIXELS of the environment, or 32. PictureError."""
    text = os.environ.get(LIMIT) or str(MEGAPIXELS)
    with suppress(ValueError):
        if 0 < float(text) < math.inf:
            return float(text)
    raise PictureError(f"found {LIMIT}={text!r}, expected a number of megapixels above 0")


def expect_size(width: int, height: int) -> None:
    """Raise PictureError for a picture with more pixels than `most_megapixels`."""
    most = most_megapixels()
    if width * height > most * 1e6:
        fault = f"found a picture of {width} x {height} pixels, expected at most {most:g} megapixels"
        raise PictureError(f"{fault}; scale it down, or set {LIMIT} if memory allows")


def picture_size(data: bytes) -> tuple[int, int]:
    """Return width and height in pixels by a picture's header. PictureError where it holds none."""
    kind, size = picture_format(data), None
    if kind == "PNG":
        size = _whole(data, 16, 4, "big"), _whole(data, 20, 4, "big")
    elif kind == "JPEG":
        size = _jpeg_size(data)
    elif kind == "BMP":
        wide = 2 if _whole(data, 14, 4) == OS2_HEADER else 4
        size = _whole(data, 18, wide), abs(_whole(data, 18 + wide, wide, signed=wide == 4))
    elif data[12:16] == b"VP8 ":
        size = _whole(data, 26, 2) & 0x3FFF, _whole(data, 28, 2) & 0x3FFF
    elif data[12:16] == b"VP8L":
        bits = _whole(data, 21, 4)
        size = (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    elif data[12:16] == b"VP8X":
        size = _whole(data, 24, 3) + 1, _whole(data, 27, 3) + 1
    if size is None or not min(size) > 0:
        raise PictureError(f"found a {kind} picture without a size, expected a readable one")
    return size


def _whole(
    data: bytes, at: int, count: int, order: Literal["big", "little"] = "little", *, signed: bool = False
) -> int:
    return int.from_bytes(data[at : at + count], order, signed=signed)


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the segments of a JPEG up to its first scan: the code of each, and where it begins."""
    at = 2
    while marker := _MARKER.search(data, at):
        code, at = marker[1][0], marker.end()
        yield code, at
        if code == _START_OF_SCAN:
            return
        at += _whole(data, at, 2, "big")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return the size that the first frame of a JPEG gives, before its first scan."""
    at = next((at for code, at in _segments(data) if code in _FRAMES), None)
    return None if at is None else (_whole(data, at + 5, 2, "big"), _whole(data, at + 3, 2, "big"))


def picture_format(data: bytes) -> str:
    """Name the format by its first bytes: JPEG, PNG, WebP or BMP; PictureError for anything else."""
    if not data:
        raise PictureError("found an empty picture, expected JPEG, PNG, WebP or BMP")
    if data.startswith(b"\xff\xd8"):
        return "JPEG"
    if data.startswith(_PNG_SIGNATURE[: len(data)]):
        return "PNG"
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "WebP"
    if data.startswith(b"BM"):
        return "BMP"
    raise PictureError(f"found a picture that begins with {data[:4]!r}, expected JPEG, PNG, WebP or BMP")


def _check_jpeg(data: bytes) -> None:
    """Walk the segments to the first scan, past thumbnails; the first FF D9 after it is the end."""
    scan = next((at for code, at in _segments(data) if code == _START_OF_SCAN), None)
    if scan is None or data.find(_END_OF_IMAGE, scan) < 0:
        raise PictureError("found a cut JPEG picture (no end marker), expected a whole one")


def _check_png(data: bytes) -> None:
    """Walk the chunks to IEND and compare their checksums."""
    at = len(_PNG_SIGNATURE)
    while (end := at + 8 + int.from_bytes(data[at : at + 4], "big")) + 4 <= len(data):
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            raise PictureError("found a damaged PNG picture (checksum), expected a whole one")
        if data[at + 4 : at + 8] == b"IEND":
            return
        at = end + 4
    raise PictureError("found a cut PNG picture (no IEND), expected a whole one")


def _check_webp(data: bytes) -> None:
    if len(data) < 8 + int.from_bytes(data[4:8], "little"):
        raise PictureError("found a cut WebP picture, expected a whole one")


def _check_bmp(data: bytes) -> None:
    if len(data) < max(26, int.from_bytes(data[2:6], "little")):
        raise PictureError("found a cut BMP picture, expected a whole one")


_WHOLE = {"JPEG": _check_jpeg, "PNG": _check_png, "WebP": _check_webp, "BMP": _check_bmp}
