"""Match circles: at every library node one circle a heading, its area the likelihood (thesis fig. 34)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr
from scipy.spatial import cKDTree

from maurice_mcl.arrays import F32, F64
from maurice_mcl.library import Library
from maurice_mcl.records import Comparison

from ..drawing.contact_sheet import BEST
from ..entities import RunPaths
from ..style import CIRCLE, RANK, Scale
from .world import distinct_places

OFFSET = 0.33  # of a circle from its node, in node spacings, along the heading
LARGEST = 0.13  # radius of the best entry's circle, in node spacings: neighbors just touch
LEAST_SPACING = 0.085  # share of the arena's long side: circles of nodes that are nearer together overlap
SMALLEST = 0.012  # so that every entry can be seen to be there


@dataclass(frozen=True, slots=True, eq=False)
class Circles:
    """Where the circles stand, and how large the largest is; made once from the library."""

    centers: F32  # (L, 2) drawn
    spacing: float  # between nodes, or what it is drawn as, in display units

    def prepare(self, rec: rr.RecordingStream, paths: RunPaths) -> None:
        """Log what does not change: places and colors."""
        circles = rr.Points2D.from_fields(positions=self.centers, colors=[CIRCLE], draw_order=3.0)
        rec.log(paths.circles, circles, static=True)
        ranks = [str(rank) for rank in range(1, BEST + 1)]
        best = rr.Points2D.from_fields(colors=[RANK], labels=ranks, show_labels=True, draw_order=30.0)
        rec.log(paths.best, best, static=True)

    def draw(self, rec: rr.RecordingStream, paths: RunPaths, comparison: Comparison) -> None:
        """Log the sizes, and where the five best are."""
        share = np.sqrt(relative_likelihood(comparison.log_likelihood))  # so that the area is the likelihood
        radii = np.maximum(share * np.float32(LARGEST), np.float32(SMALLEST))
        rec.log(paths.circles, rr.Points2D.from_fields(radii=radii * np.float32(self.spacing)))
        best = comparison.best(BEST)
        sizes = radii[best] * np.float32(self.spacing)
        rec.log(paths.best, rr.Points2D.from_fields(positions=self.centers[best], radii=sizes))

    def draw_none(self, rec: rr.RecordingStream, paths: RunPaths) -> None:
        """Leave all circles out, for updates that are not drawn whole."""
        rec.log(paths.circles, rr.Points2D.from_fields(radii=[0.0]))
        rec.log(paths.best, rr.Points2D.from_fields(positions=np.zeros((0, 2), np.float32), labels=[]))


def circles_for(library: Library, scale: Scale) -> Circles:
    """Place one circle an entry, off its node along its heading."""
    spacing_m = max(node_spacing(library.poses), LEAST_SPACING * max(library.arena.size_m))
    heading = library.poses[:, 2]
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    centers = scale.screen(library.poses[:, :2] + OFFSET * spacing_m * along)
    return Circles(centers, scale.length(spacing_m))


def node_spacing(poses: F64) -> float:
    """Give the median distance in metres from a node to the next; half a metre when there is only one."""
    places = distinct_places(poses)
    if len(places) < 2:
        return 0.5
    nearest = np.asarray(cKDTree(places).query(places, k=2)[0])
    return float(np.median(nearest[:, 1]))


def relative_likelihood(log_likelihood: F32) -> F32:
    """Give each entry's likelihood (L,) as a share of the best one's; all 0 when none is possible."""
    top = log_likelihood.max()
    if not np.isfinite(top):
        return np.zeros_like(log_likelihood)
    return np.asarray(np.exp(log_likelihood - top), np.float32)
