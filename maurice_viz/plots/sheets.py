"""Pictures without the viewer: the map of a library's ambiguity, and a sheet of a world's views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from maurice_loaders.files.writing import expect_absent, write_whole
from maurice_mcl.library.advice import LibraryAdvice
from maurice_mcl.library.quality import SelfSimilarity
from maurice_mcl.values import F64, U8, Library, spacing

from ..drawing.canvas import MAP_TEXT_SHARE, Canvas, draw_ground, jpeg, long_side, png, put_text, text_size
from ..panels.world import clipped
from ..style import DEAD, FRESH, GROUND, PALE, RGB, WALL, Scale, scale_for, shade

if TYPE_CHECKING:
    from maurice_datasets.worlds.world import World

VIEWS = 24  # on a contact sheet
SHEET_QUALITY = 80

MOST_PAIRS = 60  # lines between aliases; more cannot be distinguished
DOT = 0.32  # radius, of the distance from a place to the next
RAY = 0.46  # of a reference to add, of the same distance: it sticks out of a dot
DARKEST = 0.25  # of the scale of colors, so that the number on a dot stays readable


def draw_ambiguity(
    library: Library, similarity: SelfSimilarity, scale: Scale, advice: LibraryAdvice | None = None
) -> U8:
    """Draw (H, W, 3): walls, one dot per place, brighter the more places fit, and lines between look-alikes.

    With `advice`, rays are references to add, each in its heading: out of a place's dot, or at a new place.
    """
    canvas = draw_ground(library.arena, scale)
    image = canvas.image.copy()
    for wall in clipped(library.arena.walls, library.arena.bounds):
        start, end = _pixels(canvas, wall.reshape(2, 2), scale)
        cv2.line(image, start, end, WALL, 3, cv2.LINE_AA)
    for entry in similarity.aliased[:MOST_PAIRS].tolist():
        pair = similarity.places[similarity.place_of[[entry, similarity.alias[entry]]]]
        start, end = _pixels(canvas, pair, scale)
        cv2.line(image, start, end, DEAD, 2, cv2.LINE_AA)
    radius = max(round(DOT * scale.length(spacing(similarity.places)) / canvas.unit_per_px), 3)
    added = () if advice is None else advice.added
    for reference in added:
        place, heading = reference.pose[:2], reference.pose[2]
        tip = place + RAY * spacing(similarity.places) * np.array([np.cos(heading), np.sin(heading)])
        start, end = _pixels(canvas, np.array([place, tip]), scale)
        cv2.line(image, start, end, FRESH, 2, cv2.LINE_AA)
        cv2.circle(image, start, max(radius // 4, 2), FRESH, -1, cv2.LINE_AA)
    values = similarity.at_places(similarity.ambiguity)
    dots = list(zip(_pixels(canvas, similarity.places, scale), values.tolist(), _colors(values), strict=True))
    for (x, y), value, color in sorted(dots, key=lambda dot: dot[1]):  # the most ambiguous on top
        cv2.circle(image, (x, y), radius, color, -1, cv2.LINE_AA)
        label = f"{value:.0f}"
        height = radius * 0.8
        put_text(image, label, x - height * 0.4 * len(label), y + height / 2, height, GROUND)
    text_px = MAP_TEXT_SHARE * long_side(library.arena, scale) / canvas.unit_per_px
    what = "number of places that fit a picture taken here; lines: look-alikes"
    if added:
        what = f"number of places that fit a picture; lines: look-alikes; pink: {len(added)} to add"
    room = (image.shape[1] - 2 * text_px) / text_size(what, text_px)[0]
    put_text(image, what, text_px, 1.6 * text_px, min(room, 1.0) * text_px, PALE)
    return image


def _pixels(canvas: Canvas, xy_m: F64, scale: Scale) -> list[tuple[int, int]]:
    at = (scale.screen(xy_m) - (canvas.extent.left, canvas.extent.top)) / canvas.unit_per_px
    return [(round(x), round(y)) for x, y in at.tolist()]


def _colors(values: F64) -> list[RGB]:
    """Return the color of each dot by its value, on a logarithmic scale from the least to the largest."""
    share = np.log(values / values.min()) / max(float(np.log(values.max() / values.min())), 1e-9)
    packed = shade(DARKEST + (1 - DARKEST) * share).tolist()
    return [(rgba >> 24 & 255, rgba >> 16 & 255, rgba >> 8 & 255) for rgba in packed]


COLUMNS = 4
CAPTION_PX, GAP_PX, TEXT_PX = 16, 6, 8.0


def draw_sheet(pictures: Sequence[U8], poses: F64, scale: Scale) -> U8:
    """Draw pictures (H, W, 3) in rows of four, labeled with their poses (K, 3)."""
    rows, columns = pictures[0].shape[:2]
    high, wide = rows + CAPTION_PX + GAP_PX, columns + GAP_PX
    lines = -(-len(pictures) // COLUMNS)
    sheet = np.full((lines * high + GAP_PX, COLUMNS * wide + GAP_PX, 3), GROUND, np.uint8)
    for k, (picture, pose) in enumerate(zip(pictures, poses, strict=True)):
        top, left = k // COLUMNS * high + GAP_PX, k % COLUMNS * wide + GAP_PX
        sheet[top : top + rows, left : left + columns] = picture
        put_text(sheet, scale.say_pose(pose), left, top + rows + CAPTION_PX - 4, TEXT_PX, PALE)
    return sheet


def write_contact_sheet(
    path: Path,
    world: World,
    seed: int,
    *,
    half_resolution: bool = False,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Path:
    """Write a sheet of 24 views of a simulated world (.png or .jpg) and return its path.

    Raises InputError if the file exists (unless `force`).
    """
    from maurice_datasets.render.camera_session import survey_camera
    from maurice_datasets.surveys import one_thread, views

    expect_absent(path, force=force)
    poses, pictures = views(world, seed, VIEWS), []
    with one_thread():
        camera = survey_camera(world, seed, half_resolution=half_resolution)
        for number, pose in enumerate(poses, start=1):
            pictures.append(camera.take(number, pose))
            progress(number, len(poses), "views")
    sheet = draw_sheet(pictures, poses, scale_for("in", world.arena))
    path.parent.mkdir(parents=True, exist_ok=True)
    packed = png(sheet) if path.suffix == ".png" else jpeg(sheet, SHEET_QUALITY)
    write_whole(path, packed, force=force)
    return path
