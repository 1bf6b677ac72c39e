"""What the robot saw: the camera's picture, its edges, and a strip of the last updates."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.arrays import F64, U8
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.descriptors.edges import edge_image

from .. import entities
from ..drawing.arrow import blob_of, places_of, row_of
from ..drawing.canvas import EDGE_GAIN, Extent, blank, brightened, jpeg, put_text, shrunk, text_size
from ..drawing.contact_sheet import (
    CAPTIONS,
    CELL_PX,
    GAP_PX,
    INKS,
    QUALITY,
    cell_height,
    no_picture,
    reference_jpeg,
)
from ..drawing.indexed import write
from ..entities import Phase, RunPaths
from ..scene import SceneInfo
from ..style import GROUND, MISSING, PALE, RGB, TRUTH
from .panel import DrawnRun, Panel, StepUpdate, set_phase, set_phase_only
from .views import picture_view, plane_view

EDGES_QUALITY = 75  # for display; the channel measures the picture itself


class CameraPanel(Panel):
    """Draws the picture of each update, and its edges."""

    def prepare(self, rec: rr.RecordingStream) -> None:
        prepare_camera(rec)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the picture; in the very first phase, before a picture is taken, a gray one."""
        image = update.moment.frame.image
        if update.whole and update.is_first:
            set_phase_only(rec, update.moment, Phase.PREDICT)
            gray = np.full(image.shape, MISSING, np.uint8)
            height, width = image.shape[:2]
            put_text(gray, "not taken yet", width * 0.08, height / 2, width / 14, PALE)
            for path in (entities.CAMERA, entities.EDGES):
                draw_jpeg(rec, path, jpeg(gray))
        set_phase(rec, update.moment, Phase.MEASURE)
        draw_camera(rec, image)


def prepare_camera(rec: rr.RecordingStream) -> None:
    """Log the media type of camera and edges, static."""
    for path in (entities.CAMERA, entities.EDGES):
        prepare_jpeg(rec, path)


def draw_camera(rec: rr.RecordingStream, image: U8) -> None:
    """Log a picture (H, W, 3) RGB and its edge image, which the edge channel measures."""
    draw_jpeg(rec, entities.CAMERA, jpeg(image))
    draw_jpeg(rec, entities.EDGES, jpeg(brightened(edge_image(image)), EDGES_QUALITY))


def prepare_jpeg(rec: rr.RecordingStream, path: str, order: float | None = None) -> None:
    """Log the media type, static."""
    kind = rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=order)
    rec.log(path, kind, static=True)


def draw_jpeg(rec: rr.RecordingStream, path: str, data: bytes) -> None:
    """Log an encoded picture."""
    rec.log(path, row_of(rr.EncodedImage, blob=blob_of(data)))


@dataclass(slots=True)
class CaptionedPicture:
    """A picture in a cell, over its caption. Only what changed is logged."""

    path: str
    height: int  # of the picture, in pixels
    _shown: dict[str, bytes] = field(default_factory=dict)  # by entity

    def prepare(self, rec: rr.RecordingStream, left: float, top: float) -> None:
        """Log where it is and what is drawn, static."""
        for path, kind, at in (
            (self.path, "image/jpeg", [left, top, 0]),
            (f"{self.path}/caption", "image/png", [0, self.height, 0]),
        ):
            picture = rr.EncodedImage.from_fields(media_type=kind, draw_order=0.0)
            rec.log(path, picture, rr.Transform3D(translation=at), static=True)

    def draw(self, rec: rr.RecordingStream, picture: bytes, caption: bytes) -> None:
        """Log a JPEG and a PNG."""
        for path, data in ((self.path, picture), (f"{self.path}/caption", caption)):
            if self._shown.get(path) != data:
                rec.log(path, row_of(rr.EncodedImage, blob=blob_of(data)))
                self._shown[path] = data


COLUMNS = 6
CAPTION_PX, TEXT_PX = 22, 12.5
ROWS = ("seen", "at truth", "at estimate")


class FilmstripPanel(Panel):
    """Draws the last updates: the picture, and the references at the truth and at the estimate.

    A strip has one column per update, the latest at the right. Columns are in a row that only grows: at each
    update the new one replaces the oldest, and the row is moved to the left.
    """

    def __init__(self, run: DrawnRun) -> None:
        assert run.finder is not None  # this panel is only made where the library has entries
        super().__init__(run)
        self._finder, self._has_truth = run.finder, run.has_truth
        self._drawn = 0  # columns so far
        self._height = cell_height(run.library.pictures)
        rows = range(len(ROWS) if self._has_truth else len(ROWS) - 1)
        self._cells = [
            [CaptionedPicture(run.paths.film_cell(slot, row), self._height) for row in rows]
            for slot in range(COLUMNS)
        ]

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log where cells are, and gray columns in place of updates to come."""
        rows, cell = len(self._cells[0]), self._height + CAPTION_PX
        gray = blank(rows * cell, CELL_PX, GROUND)
        for row in range(rows):
            gray[row * cell : row * cell + self._height] = MISSING
        for slot, cells in enumerate(self._cells):
            for row, one in enumerate(cells):
                one.prepare(rec, 0, row * cell)
            picture = rr.EncodedImage(contents=jpeg(gray), media_type="image/jpeg", draw_order=-10.0)
            place = rr.Transform3D(translation=[slot * (CELL_PX + GAP_PX), 0, 0])
            rec.log(self._paths.at("film", "empty", str(slot)), picture, place, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        if not update.whole or not len(update.record.sighting.comparison.quality):
            return
        set_phase(rec, update.moment, Phase.WEIGHT)
        slot, at = self._drawn % COLUMNS, self._drawn * (CELL_PX + GAP_PX)
        rec.log(self._paths.film(slot), row_of(rr.Transform3D, translation=places_of([at, 0, 0])))
        self._draw_cells(rec, slot, update.record, update.moment.truth)
        shift = (COLUMNS - 1) * (CELL_PX + GAP_PX) - at
        rec.log(self._paths.columns, row_of(rr.Transform3D, translation=places_of([shift, 0, 0])))
        self._drawn += 1

    def _draw_cells(self, rec: rr.RecordingStream, slot: int, record: StepRecord, truth: F64 | None) -> None:
        """Log what was seen and the references, one under the other."""
        frame, cells = record.frame, self._cells[slot]
        small = shrunk(frame.image, CELL_PX, self._height)
        cells[0].draw(rec, jpeg(small, QUALITY), _caption(f"step {frame.step}", PALE))
        if self._has_truth:
            at_truth = None if truth is None else self._finder.entry_at(truth)
            self._draw_reference(rec, cells[1], at_truth, ROWS[1], TRUTH)
        at_estimate = self._finder.entry_at(record.estimate.pose)
        self._draw_reference(rec, cells[-1], at_estimate, ROWS[2], self._run.color)

    def _draw_reference(
        self, rec: rr.RecordingStream, cell: CaptionedPicture, entry: int | None, name: str, color: RGB
    ) -> None:
        if entry is None or entry < 0:
            cell.draw(rec, no_picture(self._height), _caption(f"{name}: none", color))
        else:
            picture = reference_jpeg(self._library.pictures[entry], self._height)
            cell.draw(rec, picture, _caption(f"{name}: {entry}", color))


@lru_cache(maxsize=256)
def _caption(text: str, color: RGB) -> bytes:
    image = np.full((CAPTION_PX, CELL_PX), INKS[color], np.uint8)
    wide = text_size(text, TEXT_PX)[0]
    height = min(TEXT_PX, TEXT_PX * (CELL_PX - 4) / max(wide, 1))
    write(image, text, 2, 17, height, INKS[color])
    return CAPTIONS.png(image)


def camera_view(title: str = "") -> rrb.Spatial2DView:
    """Show what the robot saw."""
    return picture_view(f"{title or 'Camera'} (px)", entities.CAMERA)


def edges_view() -> rrb.Spatial2DView:
    """Show the edge image of what the robot saw."""
    return picture_view(f"Edges x {EDGE_GAIN} (px)", entities.EDGES)


def filmstrip_view(paths: RunPaths, scene: SceneInfo) -> rrb.Spatial2DView:
    """Show what was seen in the last updates, over the references at the truth and at the estimate."""
    rows = len(ROWS) if scene.has_truth else len(ROWS) - 1
    width, height = COLUMNS * (CELL_PX + GAP_PX) - GAP_PX, rows * (scene.picture_height + CAPTION_PX)
    name = f"Last {COLUMNS} updates: picture over references"
    return plane_view(name, f"{paths.at('film')}/**", Extent(0, width, 0, height))
