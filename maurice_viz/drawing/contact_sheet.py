"""The five best references, each a picture over its caption (thesis fig. 18).

A reference is encoded once: its picture comes back often. Captions are drawn at every update, in palette
colors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from maurice_loaders.errors import PictureError
from maurice_loaders.files.pictures import decode_picture, picture_file
from maurice_mcl.sensor.descriptors.histograms import edge_image
from maurice_mcl.values import U8, Comparison, Library

from ..style import GROUND, MISSING, PALE, RANK, RGB, RUN_COLORS, TRUTH, Scale
from .canvas import blank, brightened, jpeg, put_text, shrunk, text_size
from .indexed import IndexedColors, write

BEST = 5
CELL_PX = 144  # width of one picture; its height follows the pictures' own shape
CAPTION_PX = 62  # three lines: rank and entry, place, heading and quality
TEXT_PX = 11.0
LINE = 1.7  # heights of a text from one line to the next
LINES_PX = (18, 37, 55)  # the lines' base, under the picture
ENTRY_AT_PX, QUALITY_AT_PX = 24, 78  # where in a cell these captions begin
WIDTH_OF_A_LETTER = 0.78  # in text heights, on average in a caption
NOT_KEPT = "picture not kept"
GAP_PX = 6
TRIED_PICTURES = 16  # pictures that are tried before a usual shape is assumed
CACHED_REFERENCES = (
    640  # references in memory as JPEGs, about 4 kB each: matches come back, and reading one costs 0.5 ms
)
CACHED_THUMBNAILS = (
    16  # pictures in memory before they are encoded: several drawings of one update show the same
)
JPEG_QUALITY = 70  # of their pictures

# a card: a picture over its edges, to be compared with others
CARD_PX = 120  # width: with 144 px three of them were 16 kB an update
CARD_GAP_PX = 4  # between picture and edges
CARD_QUALITY = 60  # 3.8 kB a card; edges are most of it
CARD_TEXT_PX = 9.0

CAPTIONS = IndexedColors(of_letters=True)
INKS: dict[RGB, int] = {color: CAPTIONS.ramp(GROUND, color) for color in (PALE, RANK, TRUTH, *RUN_COLORS)}


@dataclass(frozen=True, slots=True)
class Match:
    """One of the best references: `rank` 1 is the best, `quality` lies between 0 and 1."""

    rank: int
    entry: int
    quality: float


def best_matches(comparison: Comparison) -> tuple[Match, ...]:
    """Return the best entries, best first; fewer than five if the library has fewer."""
    ranking = comparison.best(BEST).tolist()
    return tuple(
        Match(rank, entry, float(comparison.quality[entry])) for rank, entry in enumerate(ranking, 1)
    )


class ContactSheet:
    """Draws the pictures and captions of references."""

    def __init__(self, library: Library, scale: Scale) -> None:
        self.library, self.scale = library, scale
        self.height = cell_height(library.pictures)  # of a picture, in pixels
        self._poses: dict[int, tuple[str, str]] = {}  # place and heading in words, by entry

    def picture(self, entry: int) -> bytes:
        """Return a reference's picture as a JPEG."""
        return reference_jpeg(self.library.pictures[entry], self.height)

    def caption(self, match: Match) -> bytes:
        """Draw three lines as a PNG: rank and entry, place, heading and quality."""
        if match.entry not in self._poses:
            place, _, heading = self.scale.say_pose(self.library.poses[match.entry]).rpartition(", ")
            self._poses[match.entry] = place, heading
        image = _caption_of(match.entry, *self._poses[match.entry]).copy()
        write(image, f"{match.rank}", 2, LINES_PX[0], 15.0, INKS[RANK])
        write(image, f"q {match.quality:.3f}", QUALITY_AT_PX, LINES_PX[2], TEXT_PX, INKS[PALE])
        return CAPTIONS.png(image)


@lru_cache(maxsize=CACHED_REFERENCES)
def _caption_of(entry: int, place: str, heading: str) -> U8:
    """Draw what every caption of a reference has."""
    image = np.full((CAPTION_PX, CELL_PX), INKS[PALE], np.uint8)
    first, second, third = LINES_PX
    write(image, f"entry {entry}", ENTRY_AT_PX, first, TEXT_PX, INKS[PALE])
    write(image, place, 2, second, _fitting(place), INKS[PALE])
    write(image, heading, 2, third, TEXT_PX, INKS[PALE])
    return image


@lru_cache(maxsize=CACHED_REFERENCES)
def reference_jpeg(path: Path | None, height: int) -> bytes:
    """Return a reference's picture in a cell's size as a JPEG; gray with words if it is not available."""
    thumbnail = None if path is None else thumbnail_of(path, height)
    return no_picture(height, NOT_KEPT) if thumbnail is None else jpeg(thumbnail, JPEG_QUALITY)


@lru_cache(maxsize=8)
def no_picture(height: int, words: str = "") -> bytes:
    """Return what stands in place of a picture, as a JPEG, with words in one or more lines."""
    gray, lines = blank(height, CELL_PX, MISSING), words.split("\n")
    widest_px = max(text_size(line, TEXT_PX)[0] for line in lines)
    tall = TEXT_PX * min(1.0, (CELL_PX - 4) / max(widest_px, 1), height / (LINE * TEXT_PX * len(lines)))
    for number, line in enumerate(lines):
        base = height / 2 + tall / 2 + (number - (len(lines) - 1) / 2) * LINE * tall
        put_text(gray, line, (CELL_PX - text_size(line, tall)[0]) / 2, base, tall, PALE)
    return jpeg(gray, JPEG_QUALITY)


@lru_cache(maxsize=8)
def no_caption(height: int) -> bytes:
    """Return an empty caption, as a PNG."""
    return CAPTIONS.png(np.full((height, CELL_PX), INKS[PALE], np.uint8))


@lru_cache(maxsize=CACHED_THUMBNAILS)
def thumbnail_of(path: Path, height: int) -> U8 | None:
    """Return a picture in a cell's size (height, CELL_PX, 3), read-only and cached; None if unreadable."""
    image = read_picture(path)
    if image is None:
        return None
    small = cv2.resize(image, (CELL_PX, height), interpolation=cv2.INTER_LINEAR)
    small.flags.writeable = False
    return np.asarray(small, np.uint8)


def cell_height(pictures: Sequence[Path | None]) -> int:
    """Return the height in pixels of a picture in its cell, by the shape of the first readable one."""
    paths = [path for path in pictures if path is not None]
    for path in paths[:TRIED_PICTURES]:
        image = read_picture(path)
        if image is not None:
            rows, columns = image.shape[:2]
            return max(1, round(CELL_PX * int(rows) / int(columns)))
    return CELL_PX * 3 // 4


def card_height(pictures: Sequence[Path | None]) -> int:
    """Return the height in pixels of each of the two pictures of a card."""
    return max(1, round(CARD_PX * cell_height(pictures) / CELL_PX))


def read_picture(path: Path) -> U8 | None:
    """Read a picture (H, W, 3) RGB; None if it is missing or damaged."""
    try:
        return decode_picture(picture_file(path))
    except PictureError:
        return None


def _fitting(text: str) -> float:
    """Return the text height at which a caption fits into its cell, estimated: measuring takes 0.1 ms."""
    return min(TEXT_PX, (CELL_PX - 4) / (WIDTH_OF_A_LETTER * len(text)))


@lru_cache(maxsize=CACHED_REFERENCES)
def card_of(path: Path | None, cell_height: int, height: int) -> bytes:
    """Return the card of a reference's picture; gray with a reason if the picture is not available."""
    thumbnail = None if path is None else thumbnail_of(path, cell_height)
    if thumbnail is None:
        return blank_card(height, NOT_KEPT)
    picture = shrunk(thumbnail, CARD_PX, height)
    return jpeg(_stacked(picture, brightened(edge_image(picture))), CARD_QUALITY)


def edges_of(image: U8) -> bytes:
    """Return the edges of a picture (H, W, 3) as those on a card."""
    picture = shrunk(image, CARD_PX, max(1, round(CARD_PX * image.shape[0] / image.shape[1])))
    return jpeg(brightened(edge_image(picture)), CARD_QUALITY)


@lru_cache(maxsize=8)
def blank_card(height: int, words: str) -> bytes:
    """Return a card with the reason why it has no picture."""
    gray = blank(height, CARD_PX, MISSING)
    width, _ = text_size(words, CARD_TEXT_PX)
    small = min(CARD_TEXT_PX, CARD_TEXT_PX * (CARD_PX - 6) / max(width, 1))
    worded = gray.copy()
    put_text(worded, words, 3, height / 2 + small / 2, small, PALE)
    return jpeg(_stacked(worded, gray), CARD_QUALITY)


def _stacked(picture: U8, edges: U8) -> U8:
    between = blank(CARD_GAP_PX, picture.shape[1], GROUND)
    return np.concatenate([picture, between, edges])
