"""The quality of every reference for one picture against its number, as a small drawing (thesis fig. 17)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from maurice_mcl.arrays import F32, U8

from ..style import EMPTY, GROUND, NODE, PALE, RANK, RGB, RULER, RUN_COLORS, TRUTH
from .canvas import text_size
from .indexed import IndexedColors, write

CHART_PX = (620, 122)  # width and height
LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 28, 6, 18, 18  # around the dots
TEXT_PX = 8.5
TICKS = ((0.0, "0"), (0.5, "0.5"), (1.0, "1"))  # of quality
GAP_PX = 14  # between two words above

COLORS = IndexedColors()
_FIELD, _DOT, _LINE = COLORS.flat(EMPTY), COLORS.flat(NODE), COLORS.flat(RULER)
_OUTSIDE = COLORS.ramp(GROUND, PALE)
INKS: dict[RGB, int] = {color: COLORS.ramp(GROUND, color) for color in (TRUTH, RANK, *RUN_COLORS)}
_FULL = {color: COLORS.flat(color) for color in INKS}


@dataclass(frozen=True, slots=True)
class MarkedEntry:
    """A reference that the chart points out."""

    name: str
    entry: int
    color: RGB


class QualityChart:
    """Draws the qualities of the references of one library; what does not change is drawn once."""

    def __init__(self, entries: int) -> None:
        width, height = CHART_PX
        self._left, self._right = LEFT_PX, width - RIGHT_PX - 1
        self._top, self._bottom = TOP_PX, height - BOTTOM_PX - 1
        self.columns = np.linspace(self._left + 2, self._right - 3, entries).round().astype(np.intp)
        self._ground = self._with_axes(entries)

    def rows(self, quality: F32) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Return the row of each quality (L,): 1 at the top."""
        reach = self._bottom - self._top - 4
        return np.asarray((self._bottom - 2 - quality * reach).round(), np.intp)

    def draw(self, quality: F32, marked: Sequence[MarkedEntry]) -> U8:
        """Draw qualities (L,) and the marked references, the last on top, as numbers of COLORS (H, W)."""
        image = self._ground.copy()
        rows = self.rows(quality)
        for down, right in ((0, 0), (1, 0), (0, 1), (1, 1)):
            image[rows + down, self.columns + right] = _DOT
        left = float(self._left)
        for one in marked:
            row, column = rows[one.entry], self.columns[one.entry]
            image[self._top : self._bottom : 3, column] = _FULL[one.color]
            image[max(row - 2, self._top) : row + 4, column - 2 : column + 4] = _FULL[one.color]
            rank = 1 + int((quality > quality[one.entry]).sum())
            words = f"{one.name} {one.entry}: {quality[one.entry]:.2f}, rank {rank}"
            write(image, words, left, TOP_PX - 6, TEXT_PX, INKS[one.color])
            left += text_size(words, TEXT_PX)[0] + GAP_PX
        return image

    def _with_axes(self, entries: int) -> U8:
        width, height = CHART_PX
        image = np.full((height, width), _OUTSIDE, np.uint8)
        image[self._top : self._bottom + 1, self._left : self._right + 1] = _FIELD
        for value, label in TICKS:
            row = int(self.rows(np.array([value], np.float32))[0])
            image[row, self._left : self._right + 1] = _LINE
            write(image, label, self._left - 4 - text_size(label, TEXT_PX)[0], row + 4, TEXT_PX, _OUTSIDE)
        last = max(entries - 1, 0)
        ends = ((0, "entry 0"), (last // 2, str(last // 2)), (last, str(last)))
        for entry, label in ends if entries > 2 else ends[:1]:
            at = self.columns[entry] - text_size(label, TEXT_PX)[0] / 2
            most = width - 2 - text_size(label, TEXT_PX)[0]
            write(image, label, min(max(at, self._left), most), height - 5, TEXT_PX, _OUTSIDE)
        return image
