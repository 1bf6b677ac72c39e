"""Small drawings of few colors: their pixels are numbers of a palette.

What is drawn at every update is drawn this way: painting takes a third of the time, encoding a quarter, and
a PNG has half the bytes of one in full color.
"""

from __future__ import annotations

import zlib
from functools import lru_cache

import cv2
import numpy as np

from maurice_mcl.values import U8, Bool

from ..style import RGB
from .canvas import put_text, text_size

INK_LEVELS = 8  # colors of a smooth edge, from the ground to the ink
MOST_COLORS = 256
CACHED_TEXTS = 1024  # texts in memory, about 4 kB each
TEXT_PAD_PX = 3  # pixels of room around a text

SIGNATURE = b"\x89PNG\r\n\x1a\n"
BY_PALETTE = b"\x08\x03\x00\x00\x00"  # 8 bits a pixel, colors from a palette, no interlacing
AS_IT_IS, FROM_ABOVE = 0, 2  # PNG's filters: a pixel, or less the one above it, which is mostly the same


class IndexedColors:
    """Colors by number; filled where a module begins, so that a number is a constant."""

    def __init__(self, *, of_letters: bool = False) -> None:
        self._of_letters = of_letters  # whether rows differ so much that they are best packed as they are
        self._colors: list[RGB] = []
        self._table = b""  # the colors as a PNG has them

    def flat(self, color: RGB) -> int:
        """Add a color; return its number."""
        return self.ramp(color, color, 1)

    def ramp(self, ground: RGB, ink: RGB, levels: int = INK_LEVELS) -> int:
        """Add colors from a ground to an ink; return the number of the first."""
        first, low, high = len(self._colors), np.array(ground), np.array(ink)
        shares = np.linspace(0, 1, levels) if levels > 1 else np.ones(1)
        for red, green, blue in (low + shares[:, None] * (high - low)).round().astype(int).tolist():
            self._colors.append((red, green, blue))
        assert len(self._colors) <= MOST_COLORS
        self._table = _chunk(b"PLTE", self.colors.tobytes())
        return first

    @property
    def colors(self) -> U8:
        """All colors (K, 3)."""
        return np.array(self._colors, np.uint8)

    def png(self, image: U8) -> bytes:
        """Encode a drawing (H, W) of these numbers."""
        height, width = image.shape
        rows = np.empty((height, width + 1), np.uint8)
        rows[:, 0] = AS_IT_IS if self._of_letters else FROM_ABOVE
        if self._of_letters:
            rows[:, 1:] = image
        else:
            rows[0, 1:] = image[0]
            np.subtract(image[1:], image[:-1], out=rows[1:, 1:])
        packer = zlib.compressobj(1, zlib.DEFLATED, 15, 8, zlib.Z_RLE)
        size = width.to_bytes(4, "big") + height.to_bytes(4, "big")
        header = _chunk(b"IHDR", size + BY_PALETTE)
        pixels = _chunk(b"IDAT", packer.compress(rows.data) + packer.flush())
        return b"".join([SIGNATURE, header, self._table, pixels, END_CHUNK])


def _chunk(kind: bytes, data: bytes) -> bytes:
    return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(data, zlib.crc32(kind)).to_bytes(4, "big")


END_CHUNK = _chunk(b"IEND", b"")


def fill(image: U8, where: Bool, number: int) -> None:
    """Give the pixels of a drawing (H, W) where `where` (H, W) holds a color, in place."""
    cv2.copyTo(np.full_like(image, number), where.view(np.uint8), image)  # half of what numpy takes


def write(image: U8, text: str, left: float, base: float, height_px: float, ink: int) -> None:
    """Write a text on a drawing (H, W), in place, with its lower left corner at (left, base).

    `ink` is the first number of a ramp, from what is under the text to the color of its letters.
    """
    shades, inked, above = _letters(text, height_px, ink)
    top, at = round(base) - above, round(left) - TEXT_PAD_PX
    skipped, hidden = max(-top, 0), max(-at, 0)
    part = image[top + skipped : max(top + len(shades), 0), at + hidden : max(at + shades.shape[1], 0)]
    visible = slice(skipped, skipped + part.shape[0]), slice(hidden, hidden + part.shape[1])
    if part.size:
        cv2.copyTo(shades[visible], inked[visible], part)


@lru_cache(maxsize=CACHED_TEXTS)
def _letters(text: str, height_px: float, ink: int) -> tuple[U8, U8, int]:
    """Return a text (h, w) in its inks, where it has any, and how many rows are above its base."""
    width, height = text_size(text, height_px)
    above = height + TEXT_PAD_PX
    image = np.zeros((above + height // 2 + TEXT_PAD_PX, width + 2 * TEXT_PAD_PX, 3), np.uint8)
    put_text(image, text, TEXT_PAD_PX, above, height_px, (255, 255, 255))
    covered = np.asarray(cv2.extractChannel(image, 0), np.float32) * ((INK_LEVELS - 1) / 255)
    shades = covered.round().astype(np.uint8)
    return shades + np.uint8(ink), (shades > 0).view(np.uint8), above
