"""A sheet of views of a simulated world, each with its pose under it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from maurice_mcl.typing import F64, U8

from .look import GROUND, PALE, Scale
from .raster import put_text

COLUMNS = 4
CAPTION_PX, GAP_PX, TEXT_PX = 16, 6, 8.0


def draw_sheet(pictures: Sequence[U8], poses: F64, scale: Scale) -> U8:
    """Draw pictures (H, W, 3) in rows of four, labelled with their poses (K, 3)."""
    rows, columns = pictures[0].shape[:2]
    high, wide = rows + CAPTION_PX + GAP_PX, columns + GAP_PX
    lines = -(-len(pictures) // COLUMNS)
    sheet = np.full((lines * high + GAP_PX, COLUMNS * wide + GAP_PX, 3), GROUND, np.uint8)
    for k, (picture, pose) in enumerate(zip(pictures, poses, strict=True)):
        top, left = k // COLUMNS * high + GAP_PX, k % COLUMNS * wide + GAP_PX
        sheet[top : top + rows, left : left + columns] = picture
        put_text(sheet, scale.say_pose(pose), left, top + rows + CAPTION_PX - 4, TEXT_PX, PALE)
    return sheet
