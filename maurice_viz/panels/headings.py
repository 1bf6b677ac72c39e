"""The heading rose: which way the cloud looks, all directions at once."""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr

from maurice_mcl.arrays import F32, F64, U8
from maurice_mcl.records import Belief

from ..drawing.arrow import strips_of
from ..drawing.raster import png, put_text, text_size
from ..entities import RunPaths
from ..style import ESTIMATE, GROUND, PALE, ROSE, RULER, TRUTH, heading_vector

PETALS = 36  # of ten degrees
RIM = 1.0  # radius of the rim; a petal's length is the root of its share, so that its area is
REACH = 1.42  # from the middle to the edge of the view, with the labels
RIM_PX = 160.0  # radius of the rim in its drawing
TEXT_PX = 17.0
LABELS = ((0, "0"), (90, "90"), (180, "180"), (270, "270"))


def prepare_rose(rec: rr.RecordingStream, paths: RunPaths, has_truth: bool) -> None:
    """Log what does not change: the rim with its labels, colors, sizes."""
    radius = rr.components.Radius.ui_points
    rec.log(
        f"{paths.rose}/rim",
        rr.EncodedImage(contents=png(rim(has_truth)), media_type="image/png", draw_order=-10.0),
        rr.Transform3D(translation=[-REACH, -REACH, 0], scale=1 / RIM_PX),
        static=True,
    )
    shape = rr.LineStrips2D.from_fields(colors=[ROSE], radii=radius(1.25), draw_order=1.0)
    arrows = rr.Arrows2D.from_fields(draw_order=2.0, radii=radius([1.75, 2.5]))
    rec.log(paths.rose, shape, arrows, static=True)


def rim(has_truth: bool) -> U8:
    """Draw the rim (H, W, 3) RGB with its spokes and labels, and the key in two corners."""
    size = round(2 * REACH * RIM_PX)
    image = np.full((size, size, 3), GROUND, np.uint8)
    middle = np.array([size / 2, size / 2])
    cv2.circle(image, (size // 2, size // 2), round(RIM * RIM_PX), RULER, 2, cv2.LINE_AA)
    for turn in np.arange(8) * np.pi / 4:
        end = middle + heading_vector(float(turn), RIM * RIM_PX)[0]
        cv2.line(image, (size // 2, size // 2), (round(end[0]), round(end[1])), RULER, 1, cv2.LINE_AA)
    for deg, text in LABELS:
        width, height = text_size(text, TEXT_PX)
        x, y = middle + heading_vector(np.radians(deg), 1.2 * RIM_PX)[0]
        put_text(image, text, x - width / 2, y + height / 2, TEXT_PX, PALE)
    items = [("cloud", ROSE), ("estimate", ESTIMATE)] + ([("truth", TRUTH)] if has_truth else [])
    for row, (text, color) in enumerate(items):
        base = 1.7 * TEXT_PX * (row + 1)
        cv2.circle(image, (12, round(base - TEXT_PX / 2)), 7, color, -1, cv2.LINE_AA)
        put_text(image, text, 26, base, TEXT_PX, color)
    return image


def draw_rose(
    rec: rr.RecordingStream, paths: RunPaths, belief: Belief, estimate: F64, truth: F64 | None
) -> None:
    """Log the cloud's headings by weight, and the arrows of estimate and truth, if that is known."""
    poses, colors = [estimate], [ESTIMATE]
    if truth is not None:
        poses, colors = [estimate, truth], [ESTIMATE, TRUTH]
    vectors = np.concatenate([heading_vector(float(pose[2]), RIM) for pose in poses])
    rec.log(
        paths.rose,
        rr.LineStrips2D.from_fields(strips=strips_of([petals(belief)])),
        rr.Arrows2D.from_fields(origins=np.zeros_like(vectors), vectors=vectors, colors=colors),
    )


def shares(belief: Belief) -> F64:
    """Give the weight (PETALS,) that looks within each petal, the first from 0 to 10 degrees."""
    turn = belief.poses[:, 2] % np.float32(2 * np.pi) * np.float32(PETALS / (2 * np.pi))
    petal = np.minimum(turn.astype(np.int64), PETALS - 1)
    return np.asarray(np.bincount(petal, belief.weights, PETALS))


def petals(belief: Belief) -> F32:
    """Give the outline (3 PETALS, 2) of the rose, as drawn, y down; the longest petal reaches the rim."""
    held = shares(belief)
    reach = np.sqrt(held / held.max())
    edges = np.arange(PETALS + 1) * (2 * np.pi / PETALS)
    radius = np.column_stack([np.zeros(PETALS), reach, reach]).ravel()
    angle = np.column_stack([edges[:-1], edges[:-1], edges[1:]]).ravel()
    outline = np.column_stack([radius * np.cos(angle), -radius * np.sin(angle)])
    return np.concatenate([outline, outline[:1]]).astype(np.float32)
