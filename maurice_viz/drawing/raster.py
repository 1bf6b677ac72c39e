"""Drawing on pixel images: short texts, and encoding for the viewer. Images are (H, W, 3) uint8 RGB."""

from __future__ import annotations

import unicodedata

import cv2
import numpy as np

from maurice_mcl.arrays import U8

from ..style import RGB

FONT = cv2.FONT_HERSHEY_DUPLEX
EDGE_GAIN = 3
JPEG_QUALITY = 90  # 60 microseconds for 176 x 144; a lower one is hardly faster and visible


def ascii_of(text: str) -> str:
    """Return a text in ASCII, all that OpenCV's fonts have: accents are dropped, others become '?'."""
    bare = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    return bare.encode("ascii", "replace").decode("ascii")


def text_size(text: str, height_px: float) -> tuple[int, int]:
    """Return width and height in pixels of a text whose capitals are `height_px` high."""
    (width, height), _ = cv2.getTextSize(ascii_of(text), FONT, _font_scale(height_px), 1)
    return width, height


def put_text(image: U8, text: str, left: float, base: float, height_px: float, color: RGB) -> None:
    """Write a text on an image, in place, with its lower left corner at (left, base)."""
    at = (round(left), round(base))
    thickness = max(1, round(height_px / 26))
    cv2.putText(image, ascii_of(text), at, FONT, _font_scale(height_px), color, thickness, cv2.LINE_AA)


def _font_scale(height_px: float) -> float:
    return height_px / 22.0  # capitals of this font are 22 pixels high at scale 1


def brightened(edges: U8) -> U8:
    """Return an edge image (H, W, 3) `EDGE_GAIN` times as bright, for display only: most edges are faint."""
    return np.asarray(cv2.convertScaleAbs(edges, alpha=EDGE_GAIN), np.uint8)


def jpeg(image: U8, quality: int = JPEG_QUALITY) -> bytes:
    """Encode a picture (H, W, 3) RGB or (H, W) gray as JPEG."""
    return _encoded(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])


def png(image: U8) -> bytes:
    """Encode a drawing (H, W, 3) RGB without loss."""
    return _encoded(".png", image, [])


def _encoded(suffix: str, image: U8, options: list[int]) -> bytes:
    bgr = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    done, data = cv2.imencode(suffix, bgr, options)
    if not done:
        raise ValueError(f"cannot encode an image of shape {image.shape} as {suffix}")
    return np.asarray(data).tobytes()
