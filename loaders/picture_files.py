"""Pictures that lie in a folder: by which endings they are known, and in which order they come."""

from __future__ import annotations

from pathlib import Path

from .file_names import natural_order

PICTURES = (".jpg", ".jpeg", ".png", ".webp", ".bmp")  # endings, in lower case


def pictures_in(folder: Path) -> list[Path]:
    """Give the pictures of a folder in natural order."""
    return natural_order(one for one in folder.iterdir() if one.suffix.lower() in PICTURES)
