"""Picture files to and from arrays: RGB uint8, top row first, as the camera was held (EXIF).

A picture's size is read from its header first: 200 kB of PNG can hold 256 megapixels, and 5 GB in memory.
"""

from __future__ import annotations

import io
import math
import os
import zlib
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Literal
from unicodedata import normalize

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
_END_OF_IMAGE = b"\xff\xd9"


def encode_jpeg(image_rgb: U8) -> bytes:
    """Encode an RGB image (H, W, 3) as JPEG, quality 95, 4:4:4."""
    if image_rgb.dtype != np.uint8 or image_rgb.ndim != 3 or image_rgb.shape[2] != 3:
        raise ValueError(f"a picture is uint8 (H, W, 3), found {image_rgb.dtype} {image_rgb.shape}")
    success, data = cv2.imencode(".jpg", cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR), list(JPEG_OPTIONS))
    if not success:
        raise ValueError(f"a picture of {image_rgb.shape} cannot be written as JPEG")
    return data.tobytes()


def encode_picture(image: U8, kind: PictureKind) -> bytes:
    """Encode an RGB picture (H, W, 3): PNG without any loss, or JPEG of quality 95, 4:4:4."""
    if kind == "jpeg":
        return encode_jpeg(image)
    success, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not success:
        raise ValueError(f"a picture of {image.shape} cannot be written as PNG")
    return data.tobytes()


def decode_picture(data: bytes, *, deep: bool = False) -> U8:
    """Decode a complete JPEG, PNG, WebP or BMP to RGB uint8 (H, W, 3); gray becomes RGB, alpha is dropped.

    Raises PictureError for other formats, cut files (OpenCV would fill them with gray, silently), pictures
    that are too large (`expect_size`) and more than 8 bits a channel (often depth, which no scaling makes a
    color); `deep` scales them to 8, for what holds a camera's pictures only.
    """
    image = decode_pixels(data, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    if deep and image.dtype == np.uint16:
        image = eight_bits(image)
    if image.dtype != np.uint8:
        bits = 8 * image.dtype.itemsize
        raise PictureError(f"found {bits} bits a channel, expected 8; convert the picture to 8 bits")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


def decode_pixels(data: bytes, how: int) -> Any:
    """Decode a picture as OpenCV's `how` has it: channels and bits as stored, or as asked. PictureError."""
    kind = picture_format(data)
    size, header = _read_header(data)
    _expect_whole(kind, data, header)
    expect_size(*size)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), how)
    except cv2.error:
        image = None
    if image is None:
        raise PictureError(f"found a {kind} picture that cannot be decoded, expected a readable one")
    return image


CAMERA_BITS = 12  # of a camera whose pictures take two bytes a channel and use no more of them


def eight_bits(pixels: Any) -> U8:
    """Return pixels of 16 bits with 8: the upper 8 of 16, or of 12 where a camera has no more."""
    bits = 16 if pixels.size and pixels.max() >= 2**CAMERA_BITS else CAMERA_BITS
    return np.asarray(pixels >> (bits - 8), np.uint8)


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
    # no Path is made: a library may name a hundred thousand
    return os.path.isabs(name) or os.path.normpath(name).split(os.sep, 1)[0] == ".."  # noqa: PTH117


def picture_file(file: Path) -> bytes:
    """Return the encoded bytes of a picture's file. PictureError for no regular file, or one too large."""
    try:
        if not file.is_file() and not (file := _spelled_otherwise(file)).is_file():
            raise PictureError("found no such picture, expected a file; was it moved away?")
        if file.stat().st_size > MAX_PICTURE_BYTES:
            raise PictureError(f"found a picture of more than {MAX_PICTURE_BYTES // 2**20} MiB")
        return file.read_bytes()
    except (OSError, ValueError) as problem:
        if isinstance(problem, PictureError):
            raise
        raise PictureError(f"cannot be read: {problem}") from None


def _spelled_otherwise(file: Path) -> Path:
    """Return a file whose accents are written in the other way: copying between systems changes that."""
    forms = (Path(normalize(form, str(file))) for form in ("NFC", "NFD"))
    return next((other for other in forms if other.is_file()), file)


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
    return _read_header(data)[0]


def _read_header(data: bytes) -> tuple[tuple[int, int], int]:
    """Return a picture's size by its header, and where that ends. PictureError where it cannot be read."""
    kind, content = picture_format(data), io.BytesIO(data)
    name = kind if kind == "WebP" else kind.capitalize()
    plugin = import_module(f"PIL.{name}ImagePlugin")  # a replay of scans does without
    try:
        return getattr(plugin, f"{name}ImageFile")(content).size, content.tell()
    except (OSError, SyntaxError, ValueError):  # as Pillow says it
        raise PictureError(f"found a cut {kind} picture (no whole header), expected a whole one") from None


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


def _expect_whole(kind: str, data: bytes, header: int) -> None:
    """Raise PictureError for a cut picture: a JPEG ends behind its header, and so behind any thumbnail."""
    if kind == "PNG":
        return _check_png(data)
    if kind == "JPEG":
        cut = data.find(_END_OF_IMAGE, header) < 0
    else:
        at, more = (4, 8) if kind == "WebP" else (2, 0)  # where the length is, and what it leaves out
        cut = len(data) < int.from_bytes(data[at : at + 4], "little") + more
    if cut:
        raise PictureError(f"found a cut {kind} picture, expected a whole one")
    return None


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
