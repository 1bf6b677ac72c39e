"""Cards: a reference's picture over its edge picture, as one small JPEG that is kept once it was made."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.channels.edges import edge_image
from maurice_mcl.typing import U8

from .contact_sheet import KEPT, NOT_KEPT, thumbnail_of
from .draw_pictures import brightened
from .look import GROUND, MISSING, PALE
from .raster import jpeg, put_text, text_size

CARD_PX = 120  # width: with 144 px three of them were 16 kB an update
GAP_PX = 4  # between picture and edges
QUALITY = 60  # 3.8 kB a card; edges are most of it
TEXT_PX = 9.0


def card_height(cell_height: int, cell_width: int) -> int:
    """Give the height of one picture of a card, from the shape that thumbnails of this library have."""
    return max(1, round(CARD_PX * cell_height / cell_width))


@lru_cache(maxsize=KEPT)
def card_of(path: Path | None, cell_height: int, height: int) -> bytes:
    """Give the card of a reference's picture; gray with words on it where the picture is not to be had."""
    thumbnail = None if path is None else thumbnail_of(path, cell_height)
    if thumbnail is None:
        return blank_card(height, NOT_KEPT)
    picture = np.asarray(cv2.resize(thumbnail, (CARD_PX, height), interpolation=cv2.INTER_AREA), np.uint8)
    return jpeg(_stacked(picture, brightened(edge_image(picture))), QUALITY)


@lru_cache(maxsize=8)
def blank_card(height: int, words: str) -> bytes:
    """Give a card without a picture that says why."""
    gray = np.full((height, CARD_PX, 3), MISSING, np.uint8)
    width, _ = text_size(words, TEXT_PX)
    small = min(TEXT_PX, TEXT_PX * (CARD_PX - 6) / max(width, 1))
    worded = gray.copy()
    put_text(worded, words, 3, height / 2 + small / 2, small, PALE)
    return jpeg(_stacked(worded, gray), QUALITY)


def _stacked(picture: U8, edges: U8) -> U8:
    between = np.full((GAP_PX, picture.shape[1], 3), GROUND, np.uint8)
    return np.concatenate([picture, between, edges])
