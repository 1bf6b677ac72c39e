"""What the robot saw: the camera's picture, its edges, and a strip of the last updates."""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.arrays import U8
from maurice_mcl.records import StepRecord
from maurice_mcl.sensor.descriptors.edges import edge_image

from .. import entities
from ..drawing.arrow import blob_of, row_of
from ..drawing.canvas import EDGE_GAIN, Extent, blank, brightened, jpeg, put_text, text_size
from ..drawing.contact_sheet import CELL_PX, cell_height, thumbnail_of
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


COLUMNS = 6
CAPTION_PX, GAP_PX, TEXT_PX = 22, 6, 12.5
ROWS = ("seen", "at truth", "at estimate")
FILM_QUALITY = 70


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

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the media type, and gray columns in place of updates to come."""
        rows = len(ROWS) if self._has_truth else len(ROWS) - 1
        gray = np.concatenate([self._cell(None, "", PALE)] * rows)
        for slot in range(COLUMNS):
            prepare_jpeg(rec, self._paths.film(slot), order=0.0)
            picture = rr.EncodedImage(contents=jpeg(gray), media_type="image/jpeg", draw_order=-10.0)
            place = rr.Transform3D(translation=[slot * (CELL_PX + GAP_PX), 0, 0])
            rec.log(self._paths.at("film", "empty", str(slot)), picture, place, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        record, truth = update.record, update.moment.truth
        if not update.whole or not len(record.sighting.comparison.quality):
            return
        at_truth = None if truth is None else self._finder.entry_at(truth)
        at_estimate = self._finder.entry_at(record.estimate.pose)
        set_phase(rec, update.moment, Phase.WEIGHT)
        slot = self._drawn % COLUMNS
        column = self._column(record, at_truth, at_estimate)
        at = self._drawn * (CELL_PX + GAP_PX)
        moved = rr.Transform3D.from_fields(translation=[at, 0, 0])
        picture = row_of(rr.EncodedImage, blob=blob_of(jpeg(column, FILM_QUALITY)))
        rec.log(self._paths.film(slot), picture, moved)
        shift = (COLUMNS - 1) * (CELL_PX + GAP_PX) - at
        rec.log(self._paths.columns, rr.Transform3D.from_fields(translation=[shift, 0, 0]))
        self._drawn += 1

    def _column(self, record: StepRecord, at_truth: int | None, at_estimate: int) -> U8:
        frame = record.frame
        small = cv2.resize(frame.image, (CELL_PX, self._height), interpolation=cv2.INTER_AREA)
        cells = [self._cell(np.asarray(small), f"step {frame.step}", PALE)]
        if self._has_truth:
            cells.append(self._reference(at_truth, ROWS[1], TRUTH))
        cells.append(self._reference(at_estimate, ROWS[2], self._run.color))
        return np.concatenate(cells)

    def _reference(self, entry: int | None, name: str, color: RGB) -> U8:
        if entry is None or entry < 0:
            return self._cell(None, f"{name}: none", color)
        path = self._library.pictures[entry]
        thumbnail = None if path is None else thumbnail_of(path, self._height)
        return self._cell(thumbnail, f"{name}: {entry}", color)

    def _cell(self, picture: U8 | None, caption: str, color: RGB) -> U8:
        cell = blank(self._height + CAPTION_PX, CELL_PX, GROUND)
        cell[: self._height] = MISSING if picture is None else picture
        wide = text_size(caption, TEXT_PX)[0] if caption else 1
        height = min(TEXT_PX, TEXT_PX * (CELL_PX - 4) / max(wide, 1))
        put_text(cell, caption, 2, self._height + 17, height, color)
        return cell


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
