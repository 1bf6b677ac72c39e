"""Pictures: what the camera saw, its edge image, and the five best references."""

from __future__ import annotations

import rerun as rr

from maurice_mcl.channels.edges import edge_image
from maurice_mcl.typing import U8

from . import entities
from .raster import jpeg

SHEET_QUALITY = 85


def draw_camera(rec: rr.RecordingStream, image: U8) -> None:
    """Log a picture (H, W, 3) RGB and its edge image, which is what the edge channel measures."""
    draw_jpeg(rec, entities.CAMERA, jpeg(image))
    draw_jpeg(rec, entities.EDGES, jpeg(edge_image(image)))


def draw_sheet(rec: rr.RecordingStream, path: str, sheet: U8) -> None:
    """Log a contact sheet (H, W, 3) RGB."""
    draw_jpeg(rec, path, jpeg(sheet, SHEET_QUALITY))


def draw_jpeg(rec: rr.RecordingStream, path: str, data: bytes) -> None:
    """Log an encoded picture."""
    rec.log(path, rr.EncodedImage.from_fields(blob=data, media_type="image/jpeg"))
