"""The cloud through one update, and the estimate with its trail."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from maurice_mcl.arrays import F32, F64, I32
from maurice_mcl.records import Belief, StepRecord

from ..style import DEAD, ESTIMATE, RGB, TRUTH, Scale, copy_colors, heading_vector, packed, weight_colors

PARTICLE = 1.75  # radius in points of the screen
COPIED = 0.9  # radius of a survivor with one copy; the area grows with the copies
MOST_COPIED = 9.0
DEAD_PARTICLE = 0.9
FRESH: RGB = (255, 120, 220)  # drawn anew in this step
SETTLED: RGB = (120, 124, 134)  # all others, while the fresh ones are shown
FRESH_PARTICLE = 2.5
FEW = 300  # particles where little detail is asked for
TRAIL = 25  # poses of a trail that are kept: more would bury the cloud, and cost more the longer it runs
ARROW = 0.055  # length of a heading arrow, as a share of the arena's long side


def prepare_cloud(rec: rr.RecordingStream, path: str) -> None:
    """Log what does not change: the cloud lies over the map and under the markers."""
    rec.log(path, rr.Points2D.from_fields(draw_order=20.0), static=True)


def draw_predicted(rec: rr.RecordingStream, path: str, belief: Belief, scale: Scale) -> None:
    """Log the moved cloud, colored by the weights it carries over: one color where all are equal."""
    equal = bool(np.ptp(belief.log_weights) == 0)
    rec.log(
        path,
        rr.Points2D.from_fields(
            positions=positions(belief, scale),
            colors=weight_colors(belief.log_weights[:1] if equal else belief.log_weights, belief.size),
            radii=rr.components.Radius.ui_points(PARTICLE),
        ),
    )


def draw_weighted(rec: rr.RecordingStream, path: str, belief: Belief) -> None:
    """Log the new colors of the same particles: positions are most of a recording's size."""
    rec.log(path, rr.Points2D.from_fields(colors=weight_colors(belief.log_weights)))


def draw_resampled(rec: rr.RecordingStream, path: str, record: StepRecord) -> None:
    """Log new looks of the weighted particles: sized and colored by their copies, the dead small and red.

    Copies stand where their parent stood, so nothing has moved; fresh particles come in the next phase.
    """
    copies = copies_of(record.parents, record.weighted.size)
    gone = copies == 0
    radii = np.where(gone, DEAD_PARTICLE, np.minimum(COPIED * np.sqrt(copies), MOST_COPIED))
    colors = np.where(gone, np.uint32(packed(DEAD)), copy_colors(copies))
    rec.log(
        path,
        rr.Points2D.from_fields(
            colors=colors, radii=rr.components.Radius.ui_points(radii.astype(np.float32))
        ),
    )


def draw_reseeded(rec: rr.RecordingStream, path: str, record: StepRecord, scale: Scale) -> None:
    """Log what the next step starts from: fresh particles stand out, all others are dim."""
    fresh = np.zeros(record.belief.size, bool) if record.injected is None else record.injected
    radii = np.where(fresh, FRESH_PARTICLE, PARTICLE).astype(np.float32)
    rec.log(
        path,
        rr.Points2D.from_fields(
            positions=positions(record.belief, scale),
            colors=np.where(fresh[:, None], np.array(FRESH, np.uint8), np.array(SETTLED, np.uint8)),
            radii=rr.components.Radius.ui_points(radii),
        ),
    )


def thinned(belief: Belief) -> Belief:
    """Give a few hundred particles, spread evenly over the numbering, with their weights."""
    size = belief.size
    some = np.linspace(0, size - 1, min(size, FEW)).round().astype(np.int64)
    return Belief(belief.poses[some], belief.log_weights[some] + np.log(size / len(some)), belief.origin)


def positions(belief: Belief, scale: Scale) -> F32:
    """Give the drawn positions (N, 2) of a cloud."""
    return scale.screen(belief.poses[:, :2] + belief.origin)


def copies_of(parents: I32 | None, size: int) -> NDArray[np.int64]:
    """Give how many copies each of the weighted particles (N,) left; 1 where there was no resampling."""
    if parents is None:
        return np.ones(size, np.int64)
    return np.bincount(parents[parents >= 0], minlength=size)


@dataclass(slots=True)
class PoseMarker:
    """One pose that moves: a disk, an arrow and the trail of its last `TRAIL` poses."""

    path: str
    color: RGB
    radius: float  # in points of the screen
    order: float
    _trail: deque[F32] = field(default_factory=lambda: deque(maxlen=TRAIL))

    def prepare(self, rec: rr.RecordingStream) -> None:
        """Log what does not change."""
        points, color = rr.components.Radius.ui_points, [self.color]
        disk = rr.Points2D.from_fields(colors=color, radii=points(self.radius), draw_order=self.order)
        arrow = rr.Arrows2D.from_fields(colors=color, radii=points(1.75), draw_order=self.order)
        trail = rr.LineStrips2D.from_fields(colors=color, radii=points(0.75), draw_order=self.order - 5)
        rec.log(self.path, disk, arrow, trail, static=True)

    def draw(self, rec: rr.RecordingStream, pose: F64, scale: Scale, arrow: float) -> None:
        """Log one pose (3,); `arrow` is the arrow's length in display units."""
        at = scale.screen(pose[None, :2])
        self._trail.append(at[0])
        rec.log(  # all in one: a call costs more than what it carries
            self.path,
            rr.Points2D.from_fields(positions=at),
            rr.Arrows2D.from_fields(origins=at, vectors=heading_vector(float(pose[2]), arrow)),
            rr.LineStrips2D.from_fields(strips=[np.array(self._trail)]),
        )


def truth_marker(path: str) -> PoseMarker:
    """Make the marker of the true pose: white, the larger one, so that it shows under the estimate."""
    return PoseMarker(path, TRUTH, radius=6.0, order=40.0)


def estimate_marker(path: str) -> PoseMarker:
    """Make the marker of an estimate."""
    return PoseMarker(path, ESTIMATE, radius=4.5, order=50.0)
