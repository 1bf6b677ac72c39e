"""Pictures: what the camera saw, its edge image, and the five best references."""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr

from maurice_mcl.arrays import U8
from maurice_mcl.sensor.descriptors.edges import edge_image

from .. import entities
from ..drawing.raster import jpeg, put_text
from ..style import MISSING, PALE

SHEET_QUALITY = 70
EDGES_QUALITY = 75  # a drawing made for the eye; the channel measures the picture itself
EDGE_GAIN = 3


def draw_camera(rec: rr.RecordingStream, image: U8) -> None:
    """Log a picture (H, W, 3) RGB and its edge image, which is what the edge channel measures."""
    draw_jpeg(rec, entities.CAMERA, jpeg(image))
    draw_jpeg(rec, entities.EDGES, jpeg(brightened(edge_image(image)), EDGES_QUALITY))


def brightened(edges: U8) -> U8:
    """Make an edge image (H, W, 3) `EDGE_GAIN` times as bright, for the eye only: most edges are faint."""
    return np.asarray(cv2.convertScaleAbs(edges, alpha=EDGE_GAIN), np.uint8)


def draw_no_camera(rec: rr.RecordingStream, shape: tuple[int, ...]) -> None:
    """Log gray in the place of camera and edges, as large (H, W, 3) as the pictures to come."""
    gray = np.full(shape, MISSING, np.uint8)
    put_text(gray, "not taken yet", shape[1] * 0.08, shape[0] / 2, shape[1] / 14, PALE)
    for path in (entities.CAMERA, entities.EDGES):
        draw_jpeg(rec, path, jpeg(gray))


def draw_sheet(rec: rr.RecordingStream, path: str, sheet: U8) -> None:
    """Log a contact sheet (H, W, 3) RGB."""
    draw_jpeg(rec, path, jpeg(sheet, SHEET_QUALITY))


def prepare_jpeg(rec: rr.RecordingStream, path: str) -> None:
    """Log once what kind of pictures will come."""
    rec.log(path, rr.EncodedImage.from_fields(media_type="image/jpeg"), static=True)


def draw_jpeg(rec: rr.RecordingStream, path: str, data: bytes) -> None:
    """Log an encoded picture."""
    rec.log(path, rr.EncodedImage.from_fields(blob=data))
