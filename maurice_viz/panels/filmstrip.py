"""The filmstrip: of the last updates, what was seen, and the references at the truth and at the estimate.

A strip has a column an update, the latest one at the right. Columns stand in a row that only grows; at each
update the new one takes the place of the oldest, and the row as a whole is moved to the left.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import rerun as rr

from maurice_mcl.arrays import U8
from maurice_mcl.library import Library
from maurice_mcl.records import StepRecord

from ..drawing.contact_sheet import cell_height, thumbnail_of
from ..drawing.raster import jpeg, put_text, text_size
from ..entities import RunPaths
from ..style import ESTIMATE, GROUND, MISSING, PALE, RGB, TRUTH

COLUMNS = 6
CELL_PX = 144  # thumbnails are as wide as on the contact sheet
CAPTION_PX, GAP_PX, TEXT_PX = 22, 6, 12.5
ROWS: tuple[tuple[str, RGB], ...] = (("seen", PALE), ("at truth", TRUTH), ("at estimate", ESTIMATE))
QUALITY = 70


@dataclass(slots=True)
class Film:
    """Draws the filmstrip of one run."""

    paths: RunPaths
    library: Library
    has_truth: bool
    _drawn: int = 0  # columns so far
    _height: int = field(init=False)

    def __post_init__(self) -> None:
        self._height = cell_height(self.library.pictures)

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what kind of pictures will come, and gray columns where none is yet."""
        rows = len(ROWS) if self.has_truth else len(ROWS) - 1
        gray = np.concatenate([self._cell(None, "", PALE)] * rows)
        for slot in range(COLUMNS):
            kind = rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=0.0)
            rec.log(self.paths.film(slot), kind, static=True)
            rec.log(f"{self.paths.at('film', 'empty')}/{slot}", *_placed(slot, gray), static=True)

    def draw(
        self, rec: rr.RecordingStream, record: StepRecord, at_truth: int | None, at_estimate: int
    ) -> None:
        """Log the column of an update, and move the others; entries are library numbers, -1 for none."""
        slot = self._drawn % COLUMNS
        column = self._column(record, at_truth, at_estimate)
        at = self._drawn * (CELL_PX + GAP_PX)
        moved = rr.Transform3D.from_fields(translation=[at, 0, 0])
        rec.log(self.paths.film(slot), rr.EncodedImage.from_fields(blob=jpeg(column, QUALITY)), moved)
        shift = (COLUMNS - 1) * (CELL_PX + GAP_PX) - at
        rec.log(self.paths.columns, rr.Transform3D.from_fields(translation=[shift, 0, 0]))
        self._drawn += 1

    def _column(self, record: StepRecord, at_truth: int | None, at_estimate: int) -> U8:
        frame = record.frame
        small = cv2.resize(frame.image, (CELL_PX, self._height), interpolation=cv2.INTER_AREA)
        cells = [self._cell(np.asarray(small), f"step {frame.step}: seen", PALE)]
        if self.has_truth:
            cells.append(self._reference(at_truth, *ROWS[1]))
        cells.append(self._reference(at_estimate, *ROWS[2]))
        return np.concatenate(cells)

    def _reference(self, entry: int | None, name: str, color: RGB) -> U8:
        if entry is None or entry < 0:
            return self._cell(None, f"{name}: none", color)
        path = self.library.pictures[entry]
        thumbnail = None if path is None else thumbnail_of(path, self._height)
        return self._cell(thumbnail, f"{name}: {entry}", color)

    def _cell(self, picture: U8 | None, caption: str, color: RGB) -> U8:
        cell = np.full((self._height + CAPTION_PX, CELL_PX, 3), GROUND, np.uint8)
        cell[: self._height] = MISSING if picture is None else picture
        wide = text_size(caption, TEXT_PX)[0] if caption else 1
        height = min(TEXT_PX, TEXT_PX * (CELL_PX - 4) / max(wide, 1))
        put_text(cell, caption, 2, self._height + 17, height, color)
        return cell


def size_px(picture_height: int, has_truth: bool) -> tuple[int, int]:
    """Give width and height of a whole strip, for pictures so high on the contact sheet."""
    rows = len(ROWS) if has_truth else len(ROWS) - 1
    return COLUMNS * (CELL_PX + GAP_PX) - GAP_PX, rows * (picture_height + CAPTION_PX)


def _placed(slot: int, image: U8) -> tuple[rr.EncodedImage, rr.Transform3D]:
    picture = rr.EncodedImage(contents=jpeg(image), media_type="image/jpeg", draw_order=-10.0)
    return picture, rr.Transform3D(translation=[slot * (CELL_PX + GAP_PX), 0, 0])
