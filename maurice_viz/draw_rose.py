"""The heading rose: which way the cloud looks, all directions at once."""

from __future__ import annotations

import numpy as np
import rerun as rr

from maurice_mcl.belief import Belief
from maurice_mcl.typing import F32, F64

from .entities import RunPaths
from .look import ESTIMATE, PALE, ROSE, RULER, TRUTH, heading_vector
from .strips import strips_of

PETALS = 36  # of ten degrees
RIM = 1.0  # radius of the rim; a petal's length is the root of its share, so that its area is
REACH = 1.6  # from the middle to the edge of the view, with the labels
LABELS = ((0, "0 deg"), (90, "90"), (180, "180"), (270, "270"))


def prepare_rose(rec: rr.RecordingStream, paths: RunPaths) -> None:
    """Log what does not change: the rim with its labels, colors, sizes."""
    turn = np.linspace(0, 2 * np.pi, 73)
    rim = np.column_stack([np.cos(turn), np.sin(turn)]) * RIM
    spokes = [np.array([[0, 0], rim[k]]) for k in range(0, 72, 9)]
    radius = rr.components.Radius.ui_points
    rec.log(
        f"{paths.rose}/rim",
        rr.LineStrips2D([rim, *spokes], colors=[RULER], radii=radius(0.5), draw_order=0.0),
        rr.Points2D(
            [heading_vector(np.radians(deg), 1.24)[0] for deg, _ in LABELS],
            labels=[text for _, text in LABELS],
            show_labels=True,
            colors=[PALE],
            radii=radius(0.1),
        ),
        static=True,
    )
    shape = rr.LineStrips2D.from_fields(colors=[ROSE], radii=radius(1.25), draw_order=1.0)
    arrows = rr.Arrows2D.from_fields(draw_order=2.0, radii=radius([1.75, 2.5]))
    rec.log(paths.rose, shape, arrows, static=True)


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
