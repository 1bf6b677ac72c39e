"""The record of each landmark: from where it was seen and could have been, and what it looks like."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, I32, wrap
from .bundle import Bundle, Views
from .camera import project

SOUGHT_NEARER, SOUGHT_FARTHER = 0.6, 1.6  # times the distances from which it was seen, it is sought
SOUGHT_ASIDE_RAD = float(np.radians(35.0))  # beyond the directions from which it was seen, it is sought
MARGIN_PX = 4.0  # nearer to the border of a picture a keypoint has no descriptor


@dataclass(frozen=True, slots=True, eq=False)
class Records:
    """Of P points."""

    descriptors: F32  # (P, 128)
    seen: I32  # (P,)
    could_see: I32  # (P,)
    facing_rad: F32  # (P,)
    spread_rad: F32  # (P,)
    nearest_m: F32  # (P,)
    farthest_m: F32  # (P,)


def records_of(bundle: Bundle, views: Views, descriptors: F32) -> Records:
    """Return the records of points; `descriptors` (O, 128) are those of the views."""
    count = len(bundle.points)
    mean = np.zeros((count, descriptors.shape[1]), np.float32)
    np.add.at(mean, views.point, descriptors)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    sight = bundle.poses[views.reference, :2] - bundle.points[views.point, :2]
    angle, range_m = np.arctan2(sight[:, 1], sight[:, 0]), np.hypot(sight[:, 0], sight[:, 1])
    cos, sin = (np.bincount(views.point, f(angle), count) for f in (np.cos, np.sin))
    facing = np.arctan2(sin, cos)
    spread, near, far = np.zeros(count), np.full(count, np.inf), np.zeros(count)
    np.maximum.at(spread, views.point, np.abs(wrap(angle - facing[views.point])))
    np.minimum.at(near, views.point, range_m)
    np.maximum.at(far, views.point, range_m)
    seen = np.bincount(views.point, minlength=count).astype(np.int32)
    single = (v.astype(np.float32) for v in (facing, spread, near, far))
    first = Records(mean, seen, seen, *single)
    could = np.zeros(count, np.int32)
    for pose in bundle.poses:
        could[_sought(bundle, first, pose)] += 1
    return replace(first, could_see=could)


def _sought(bundle: Bundle, records: Records, pose: F64) -> NDArray[np.intp]:
    """Return the numbers (S,) of the points that a reference at a pose (3,) could see."""
    x, y = (pose[:2] - bundle.points[:, :2]).T
    range_m = np.hypot(x, y)
    near = (range_m > SOUGHT_NEARER * records.nearest_m) & (range_m < SOUGHT_FARTHER * records.farthest_m)
    may = np.flatnonzero(near)
    turned = np.abs(wrap(np.arctan2(y[may], x[may]) - records.facing_rad[may]))
    may = may[turned < records.spread_rad[may] + SOUGHT_ASIDE_RAD]
    shifted = (bundle.points[may] - [*pose[:2], 0.0]).astype(np.float32)
    pixels, _ = project(bundle.camera, np.array([[0.0, 0.0, pose[2]]], np.float32), shifted)
    u, v = pixels[0, 0], pixels[1, 0]
    width, height = bundle.camera.width_px, bundle.camera.height_px
    inside = (u > MARGIN_PX) & (v > MARGIN_PX) & (u < width - 1 - MARGIN_PX) & (v < height - 1 - MARGIN_PX)
    seen: NDArray[np.intp] = may[inside]
    return seen
