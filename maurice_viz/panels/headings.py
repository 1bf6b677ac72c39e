"""The heading histogram: which way the cloud looks, all directions at once, area by weight."""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from maurice_mcl.arrays import F32, F64, U8
from maurice_mcl.records import Belief

from ..drawing.arrow import strips_of
from ..drawing.canvas import Extent
from ..drawing.raster import png, put_text, text_size
from ..entities import Phase, RunPaths
from ..style import ESTIMATE, GROUND, HEADINGS, PALE, RULER, TRUTH, heading_vector
from .panel import DrawnRun, Panel, StepUpdate, set_phase
from .views import plane_view

SECTORS = 36  # of ten degrees
RIM = 1.0  # radius of the rim; a sector's length is the root of its share, so that its area is
REACH = 1.42  # from the middle to the edge of the view, with the labels
RIM_PX = 160.0  # radius of the rim in its drawing
TEXT_PX = 17.0
LABELS = ((0, "0"), (90, "90"), (180, "180"), (270, "270"))


class HeadingsPanel(Panel):
    """Draws the cloud's headings by weight, and the arrows of estimate and truth."""

    def __init__(self, run: DrawnRun) -> None:
        self._path, self._has_truth = run.paths.headings, run.has_truth

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log the rim with its labels, colors, sizes."""
        radius = rr.components.Radius.ui_points
        rec.log(
            f"{self._path}/rim",
            rr.EncodedImage(contents=png(rim(self._has_truth)), media_type="image/png", draw_order=-10.0),
            rr.Transform3D(translation=[-REACH, -REACH, 0], scale=1 / RIM_PX),
            static=True,
        )
        shape = rr.LineStrips2D.from_fields(colors=[HEADINGS], radii=radius(1.25), draw_order=1.0)
        arrows = rr.Arrows2D.from_fields(draw_order=2.0, radii=radius([1.75, 2.5]))
        rec.log(self._path, shape, arrows, static=True)

    def draw(self, rec: rr.RecordingStream, update: StepUpdate) -> None:
        """Log the sectors and the arrows of one update."""
        poses, colors = [update.record.estimate.pose], [ESTIMATE]
        if update.moment.truth is not None:
            poses, colors = [*poses, update.moment.truth], [ESTIMATE, TRUTH]
        vectors = np.concatenate([heading_vector(float(pose[2]), RIM) for pose in poses])
        set_phase(rec, update.moment, Phase.ESTIMATE)
        rec.log(
            self._path,
            rr.LineStrips2D.from_fields(strips=strips_of([outline(update.record.weighted)])),
            rr.Arrows2D.from_fields(origins=np.zeros_like(vectors), vectors=vectors, colors=colors),
        )


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
    items = [("cloud", HEADINGS), ("estimate", ESTIMATE)] + ([("truth", TRUTH)] if has_truth else [])
    for row, (text, color) in enumerate(items):
        base = 1.7 * TEXT_PX * (row + 1)
        cv2.circle(image, (12, round(base - TEXT_PX / 2)), 7, color, -1, cv2.LINE_AA)
        put_text(image, text, 26, base, TEXT_PX, color)
    return image


def shares(belief: Belief) -> F64:
    """Return the weight (SECTORS,) that looks within each sector, the first from 0 to 10 degrees."""
    turn = belief.poses[:, 2] % np.float32(2 * np.pi) * np.float32(SECTORS / (2 * np.pi))
    sector = np.minimum(turn.astype(np.int64), SECTORS - 1)
    return np.asarray(np.bincount(sector, belief.weights, SECTORS))


def outline(belief: Belief) -> F32:
    """Return the outline (3 SECTORS, 2) as drawn, y down; the longest sector reaches the rim."""
    held = shares(belief)
    reach = np.sqrt(held / held.max())
    edges = np.arange(SECTORS + 1) * (2 * np.pi / SECTORS)
    radius = np.column_stack([np.zeros(SECTORS), reach, reach]).ravel()
    angle = np.column_stack([edges[:-1], edges[:-1], edges[1:]]).ravel()
    points = np.column_stack([radius * np.cos(angle), -radius * np.sin(angle)])
    return np.concatenate([points, points[:1]]).astype(np.float32)


def headings_view(paths: RunPaths) -> rrb.Spatial2DView:
    """Show which way the cloud looks."""
    return plane_view("Headings (deg)", f"{paths.headings}/**", Extent(-REACH, REACH, -REACH, REACH))
