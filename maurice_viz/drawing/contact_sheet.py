"""The five best references as one image, with captions burnt in (thesis fig. 18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from maurice_mcl.arrays import U8
from maurice_mcl.library import Library
from maurice_mcl.records import Comparison

from ..style import GROUND, MISSING, PALE, RANK, Scale
from .canvas import blank, put_text, text_size

BEST = 5
CELL_PX = 144  # width of one picture; its height follows the pictures' own shape
CAPTION_PX = 62  # three lines: rank and entry, place, heading and quality
TEXT_PX = 11.0
LINES_PX = (18, 37, 55)  # the lines' base, under the picture
ENTRY_AT_PX, QUALITY_AT_PX = 24, 78  # where in a cell these captions begin
WIDTH_OF_A_LETTER = 0.78  # in text heights, on average in a caption
NOT_KEPT = "picture not kept"
GAP_PX = 6
TRIED = 16  # pictures that are tried before a usual shape is assumed
KEPT = 640  # cells in memory, at most about 50 MB: matches come back, and reading one costs 0.5 ms


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
    """Draws sheets, and remembers the cells (all but rank and quality) of the last `KEPT` references."""

    def __init__(self, library: Library, scale: Scale) -> None:
        self.library, self.scale = library, scale
        self._cells: dict[int, U8] = {}
        self._height = cell_height(library.pictures)  # of a picture, in pixels

    def draw(self, matches: Sequence[Match]) -> U8:
        """Draw one row, always five wide so that the sheet keeps its size: (H, W, 3) RGB."""
        cells = [self._cell(match.entry) for match in matches]
        cells += [_blank(self._height)] * (BEST - len(matches))
        sheet = np.concatenate(cells, axis=1)
        for column, match in enumerate(matches):
            left, bases = column * (CELL_PX + GAP_PX), [self._height + line for line in LINES_PX]
            put_text(sheet, f"{match.rank}", left + 2, bases[0], 15.0, RANK)
            put_text(sheet, f"q {match.quality:.3f}", left + QUALITY_AT_PX, bases[2], TEXT_PX, PALE)
        return sheet[:, :-GAP_PX]

    def _cell(self, entry: int) -> U8:
        if entry not in self._cells:
            if len(self._cells) >= KEPT:
                self._cells.pop(next(iter(self._cells)))
            self._cells[entry] = self._drawn(entry)
        return self._cells[entry]

    def _drawn(self, entry: int) -> U8:
        height = self._height
        path = self.library.pictures[entry]
        thumbnail = None if path is None else thumbnail_of(path, height)
        cell = _blank(height)
        if thumbnail is None:
            width, _ = text_size(NOT_KEPT, TEXT_PX)
            put_text(cell, NOT_KEPT, (CELL_PX - width) / 2, height / 2, TEXT_PX, PALE)
        else:
            cell[:height, :CELL_PX] = thumbnail
        place, _, heading = self.scale.say_pose(self.library.poses[entry]).rpartition(", ")
        entry_px, place_px, heading_px = (height + line for line in LINES_PX)
        put_text(cell, f"entry {entry}", ENTRY_AT_PX, entry_px, TEXT_PX, PALE)
        put_text(cell, place, 2, place_px, _fitting(place), PALE)
        put_text(cell, heading, 2, heading_px, TEXT_PX, PALE)
        return cell


@lru_cache(maxsize=KEPT)
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
    kept = [path for path in pictures if path is not None]
    for path in kept[:TRIED]:
        image = read_picture(path)
        if image is not None:
            rows, columns = image.shape[:2]
            return max(1, round(CELL_PX * int(rows) / int(columns)))
    return CELL_PX * 3 // 4


def read_picture(path: Path) -> U8 | None:
    """Read a picture (H, W, 3) RGB; None if it is missing or damaged."""
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError:
        return None
    bgr = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    return None if bgr is None else np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


def _blank(height: int) -> U8:
    cell = blank(height + CAPTION_PX, CELL_PX + GAP_PX, GROUND)
    cell[:height, :CELL_PX] = MISSING
    return cell


def _fitting(text: str) -> float:
    """Return the text height at which a caption fits into its cell, estimated: measuring takes 0.1 ms."""
    return min(TEXT_PX, (CELL_PX - 4) / (WIDTH_OF_A_LETTER * len(text)))
