"""ROS and Foxglove images as RGB pictures; encodings that are no color picture are refused by name.

Encodings are those of sensor_msgs/image_encodings.hpp.
"""

from __future__ import annotations

import base64
import binascii
from typing import Any

import cv2
import numpy as np

from maurice_mcl.arrays import U8

from ..errors import PictureError
from ..io.pictures import decode_picture

_AS_IT_IS = -1
PLAIN = {  # encoding: channels, bytes per channel, OpenCV's conversion to RGB
    "rgb8": (3, 1, _AS_IT_IS),
    "bgr8": (3, 1, cv2.COLOR_BGR2RGB),
    "8UC3": (3, 1, cv2.COLOR_BGR2RGB),  # OpenCV's own order
    "rgba8": (4, 1, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, 1, cv2.COLOR_BGRA2RGB),
    "8UC4": (4, 1, cv2.COLOR_BGRA2RGB),
    "mono8": (1, 1, cv2.COLOR_GRAY2RGB),
    "8UC1": (1, 1, cv2.COLOR_GRAY2RGB),
    "rgb16": (3, 2, _AS_IT_IS),
    "bgr16": (3, 2, cv2.COLOR_BGR2RGB),
    "rgba16": (4, 2, cv2.COLOR_RGBA2RGB),
    "bgra16": (4, 2, cv2.COLOR_BGRA2RGB),
    "mono16": (1, 2, cv2.COLOR_GRAY2RGB),
    "bayer_rggb8": (1, 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": (1, 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": (1, 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": (1, 1, cv2.COLOR_BayerGRBG2RGB),
    "bayer_rggb16": (1, 2, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr16": (1, 2, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg16": (1, 2, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg16": (1, 2, cv2.COLOR_BayerGRBG2RGB),
    "yuv422": (2, 1, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (2, 1, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": (2, 1, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": (2, 1, cv2.COLOR_YUV2RGB_YUY2),
}
DEPTH = ("16UC1", "32FC1", "16SC1", "32SC1", "64FC1")
LARGEST = 2**28  # pixels of a picture; no camera has as many


def picture_of(message: Any) -> U8:
    """Return the picture (H, W, 3) RGB of a message, raw or compressed. PictureError when it has none."""
    data = bytes_of(message.data)
    if hasattr(message, "encoding"):
        return raw_picture(data, message)
    form = str(getattr(message, "format", ""))
    if "compressedDepth" in form:
        raise PictureError(f"found a depth picture ({form!r}), expected a color or gray one")
    return decode_picture(data)


def raw_picture(data: bytes, message: Any) -> U8:
    """Convert a raw picture to RGB (H, W, 3); 16 bits per channel become 8, Bayer patterns are demosaiced."""
    encoding = str(message.encoding)
    if encoding not in PLAIN:
        what = "depth, not color" if encoding in DEPTH else f"none of {', '.join(PLAIN)}"
        raise PictureError(f"found a picture with encoding {encoding!r}, which is {what}")
    channels, size, code = PLAIN[encoding]
    rows = _rows(data, message, channels * size)
    if size == 2:
        order = ">u2" if getattr(message, "is_bigendian", 0) else "<u2"
        pixels = (rows.view(order) >> 8).astype(np.uint8)
    else:
        pixels = rows
    shape = (int(message.height), int(message.width), channels)
    pixels = np.ascontiguousarray(pixels.reshape(shape if channels > 1 else shape[:2]))
    try:
        return pixels if code == _AS_IT_IS else np.asarray(cv2.cvtColor(pixels, code), np.uint8)
    except cv2.error:
        size_px = f"{message.width} x {message.height}"
        raise PictureError(f"found a picture of {size_px} pixels, too small for {encoding!r}") from None


def _rows(data: bytes, message: Any, pixel: int) -> U8:
    """Return the rows (H, W * pixel) of a picture without their padding."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    if min(height, width) < 1 or height * width > LARGEST:
        raise PictureError(f"found a picture of {width} x {height} pixels, expected 1 to {LARGEST}")
    if step < width * pixel or len(data) < step * (height - 1) + width * pixel:
        found = f"found {len(data)} bytes and rows of {step} bytes"
        raise PictureError(f"{found}, expected {width} x {height} pixels of {pixel} bytes")
    whole = np.zeros(step * height, np.uint8)
    part = np.frombuffer(data, np.uint8)[: step * height]
    whole[: len(part)] = part
    return np.ascontiguousarray(whole.reshape(height, step)[:, : width * pixel])


def bytes_of(data: Any) -> bytes:
    """Return a message's bytes, which JSON writes as base64. PictureError when they are invalid."""
    if not isinstance(data, str):
        return bytes(data)
    try:
        return base64.b64decode(data, validate=True)
    except (binascii.Error, ValueError):
        raise PictureError("found broken base64, expected a picture") from None
