"""Texts that the viewer can show: what its font has no sign for is written as a code.

The viewer's font (Inter) has Latin, Greek and Cyrillic letters and many signs. For anything else its window
shows boxes, and without a screen it stops altogether (0.41), so that one Chinese letter in a label would
prevent every picture of the recording.
"""

from __future__ import annotations

import unicodedata
from typing import Any

RANGES = (
    (0x20, 0x24F),
    (0x370, 0x3E1),
    (0x3F0, 0x52F),
    (0x1E00, 0x1EFF),
    (0x2010, 0x2030),
    (0x2070, 0x20BF),
    (0x2100, 0x214F),
    (0x2190, 0x22FF),
    (0x25A0, 0x25FF),
)  # first and last of each, as tried out in 0.41
WITHOUT_GLYPH = (0x149, 0x1C4)


def legible(text: str) -> str:
    """Write every letter that the viewer cannot show as its code, like "u8D70"; others stay as they are."""
    if text.isascii():
        return text
    return "".join(c if _is_known(ord(c)) else f"u{ord(c):04X}" for c in unicodedata.normalize("NFC", text))


def legible_names(part: Any) -> None:
    """Make the titles of a container and of all that is in it legible, in place."""
    part.name = None if part.name is None else legible(str(part.name))
    for inner in getattr(part, "contents", ()):
        if hasattr(inner, "name"):
            legible_names(inner)


def _is_known(code: int) -> bool:
    if code in WITHOUT_GLYPH or 0x7F <= code < 0xA0:
        return False
    return code == ord("\n") or any(first <= code <= last for first, last in RANGES)
