"""The five best references as one image, with captions burnt in (thesis fig. 18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from maurice_mcl.library import Library
from maurice_mcl.records import Sighting
from maurice_mcl.typing import U8

from .look import GROUND, PALE, RANK, RGB, Scale
from .raster import put_text, text_size

BEST = 5
CELL_PX = 240  # width of one picture; its height follows the pictures' own shape
CAPTION_PX = 64
TEXT_PX = 12.0
GAP_PX = 8
KEPT = 128  # thumbnails in memory, about 15 MB: neighbors in time match the same entries
MISSING: RGB = (48, 50, 56)


@dataclass(frozen=True, slots=True)
class Cell:
    """What is said about one reference."""

    rank: int  # 1 is best
    entry: int
    quality: float
    pose: str


def best_cells(sighting: Sighting, library: Library, scale: Scale) -> tuple[Cell, ...]:
    """Give the best entries, best first; fewer than five where the library has fewer."""
    return tuple(
        Cell(rank, int(entry), float(sighting.quality[entry]), scale.say_pose(library.poses[entry]))
        for rank, entry in enumerate(sighting.ranking()[:BEST], 1)
    )


@dataclass(slots=True)
class ContactSheet:
    """Draws sheets, and remembers the thumbnails of the last `KEPT` pictures."""

    pictures: Sequence[Path | None]
    _thumbnails: dict[int, U8 | None] = field(default_factory=dict)
    _height: int | None = None  # of a picture, in pixels: that of the first one that could be read

    def draw(self, cells: Sequence[Cell]) -> U8:
        """Draw one row of cells, always five wide so that the sheet does not jump: (H, W, 3) RGB."""
        thumbnails = [self.thumbnail(cell.entry) for cell in cells]
        height = self._height or CELL_PX * 3 // 4
        columns = [_column(c, t, height) for c, t in zip(cells, thumbnails, strict=True)]
        columns += [_blank(height + CAPTION_PX)] * (BEST - len(cells))
        return np.concatenate(columns, axis=1)[:, :-GAP_PX]

    def thumbnail(self, entry: int) -> U8 | None:
        """Give a reference picture `CELL_PX` wide; None when there is none or it cannot be read."""
        if entry not in self._thumbnails:
            if len(self._thumbnails) >= KEPT:
                self._thumbnails.pop(next(iter(self._thumbnails)))
            self._thumbnails[entry] = self._read(self.pictures[entry])
        return self._thumbnails[entry]

    def _read(self, path: Path | None) -> U8 | None:
        image = read_picture(path) if path is not None else None
        if image is None:
            return None
        if self._height is None:
            self._height = max(1, round(CELL_PX * image.shape[0] / image.shape[1]))
        return np.asarray(cv2.resize(image, (CELL_PX, self._height), interpolation=cv2.INTER_AREA), np.uint8)


def read_picture(path: Path) -> U8 | None:
    """Read a picture (H, W, 3) RGB; None when it is missing or broken."""
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError:
        return None
    bgr = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    return None if bgr is None else np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


def _blank(height: int) -> U8:
    return np.full((height, CELL_PX + GAP_PX, 3), GROUND, np.uint8)


def _column(cell: Cell, thumbnail: U8 | None, height: int) -> U8:
    column = _blank(height + CAPTION_PX)
    column[:height, :CELL_PX] = MISSING if thumbnail is None else thumbnail
    if thumbnail is None:
        text = "picture not kept"
        put_text(column, text, (CELL_PX - text_size(text, TEXT_PX)[0]) / 2, height / 2, TEXT_PX, PALE)
    put_text(column, f"{cell.rank}", 2, height + 27, 20.0, RANK)
    put_text(column, f"entry {cell.entry}", 32, height + 25, TEXT_PX + 1, PALE)
    quality = f"q = {cell.quality:.3f}"
    put_text(column, quality, CELL_PX - text_size(quality, TEXT_PX + 1)[0], height + 25, TEXT_PX + 1, PALE)
    put_text(column, cell.pose, 2, height + 53, _fitting(cell.pose), PALE)
    return column


def _fitting(text: str) -> float:
    """Give the text height at which a caption fits into its cell."""
    return min(TEXT_PX, TEXT_PX * CELL_PX / text_size(text, TEXT_PX)[0])
