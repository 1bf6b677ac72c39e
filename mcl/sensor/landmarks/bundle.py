"""Where tracks are in space, and what the camera and the references' poses must be for views to agree.

A bundle adjustment (Triggs et al. 2000): references may move within the surveyor's tolerance, which also
keeps the map's frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...values import F64, Bool
from .camera import Linearized, PinholeCamera, directions, linearize
from .normal_equations import Stated, WeightedViews, change_of

# of Gauss and Newton, each round. With two, references are as near to where they really were, and so they are
# with fifteen; but the errors of drives in dim and hard light were 7 to 10 % larger.
STEPS = 3
SOFT_PX = 1.5  # residuals beyond it count less and less (Cauchy)
FARTHEST_STEP_M = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """O observations: which reference saw which point, and where in its picture."""

    reference: NDArray[np.intp]  # (O,)
    point: NDArray[np.intp]  # (O,)
    pixels: F64  # (O, 2)

    def only(self, kept: Bool) -> Views:
        """Return some of them."""
        return Views(self.reference[kept], self.point[kept], self.pixels[kept])


@dataclass(frozen=True, slots=True, eq=False)
class Tolerance:
    """Standard deviations of what may be adjusted, from what was stated."""

    place_m: float = 0.0127  # of a reference along x and y: half an inch
    heading_rad: float = float(np.radians(2.0))
    camera: tuple[float, float, float] = (1.0, 0.3, 0.1)  # log of the focal length, tilt, distortion


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """All that views depend on."""

    camera: PinholeCamera
    poses: F64  # (L, 3)
    points: F64  # (P, 3)

    def seen(self, views: Views) -> Linearized:
        """Project what was seen from where it was seen."""
        return linearize(self.camera, self.poses[views.reference], self.points[views.point])


def triangulate(camera: PinholeCamera, poses: F64, views: Views, count: int) -> F64:
    """Return where points (count, 3) are: nearest to all lines of sight in the plane, then their height."""
    angle, slope = directions(camera, views.pixels)
    angle = angle + poses[views.reference, 2]
    start = poses[views.reference, :2]
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    offset = np.sum(normal * start, axis=1)
    left = np.zeros((count, 2, 2))
    right = np.zeros((count, 2))
    np.add.at(left, views.point, normal[:, :, None] * normal[:, None, :])
    np.add.at(right, views.point, normal * offset[:, None])
    left += 1e-9 * np.eye(2)
    middle = np.zeros((count, 2))
    np.add.at(middle, views.point, start)
    seen = np.maximum(np.bincount(views.point, minlength=count), 1)
    right += 1e-9 * middle / seen[:, None]
    places = np.linalg.solve(left, right[:, :, None])[:, :, 0]
    range_m = np.hypot(*(places[views.point] - start).T)
    height = np.bincount(views.point, range_m * slope, minlength=count) / seen
    return np.column_stack([places, height + camera.height_m])


def adjust(bundle: Bundle, views: Views, nominal: Bundle, tolerance: Tolerance) -> tuple[Bundle, F64]:
    """Adjust points, poses and camera until views agree; return them with the camera's covariance (3, 3).

    `nominal` holds the poses and the camera as they were stated.
    """
    covariance = np.zeros((3, 3))
    for _ in range(STEPS):
        bundle, covariance = _step(bundle, views, nominal, tolerance)
    return bundle, covariance


def errors_px(bundle: Bundle, views: Views) -> F64:
    """Return how far (O,) each observation is from where it should be; infinite behind the camera."""
    seen = bundle.seen(views)
    return np.where(seen.depth > 0.05, np.hypot(*(seen.pixels - views.pixels).T), np.inf)


def _step(bundle: Bundle, views: Views, nominal: Bundle, tolerance: Tolerance) -> tuple[Bundle, F64]:
    """One step of Gauss and Newton with a little damping."""
    count, places = len(bundle.points), len(bundle.poses)
    seen = bundle.seen(views)
    off = views.pixels - seen.pixels
    error = np.hypot(*off.T)
    weight = np.where(seen.depth > 0.05, 1 / (1 + (error / SOFT_PX) ** 2), 0.0)
    root = np.sqrt(weight)[:, None]
    by_pose, by_point, by_camera = (
        d * root[:, :, None] for d in (seen.by_pose, seen.by_point, seen.by_camera)
    )
    weighted = WeightedViews(views.reference, views.point, by_pose, by_point, by_camera, off * root)
    change = change_of(weighted, count, _stated(bundle, nominal, tolerance))
    moved = Bundle(
        bundle.camera.with_values(bundle.camera.values + change.camera),
        bundle.poses + change.poses,
        bundle.points + np.clip(change.points, -FARTHEST_STEP_M, FARTHEST_STEP_M),
    )
    freedom = max(2 * float(weight.sum()) - 3 * (count + places + 1), 0.1 * len(error))
    # of an M-estimator (Huber 1981, 7.6): the weighted residuals over how much they change with a residual
    slope = (weight**2 * (1 - (error / SOFT_PX) ** 2) + weight) / 2
    squared = float(np.sum(weight**2 * error**2)) / freedom
    variance = squared * float(weight.mean()) / max(float(slope.mean()), 0.1) ** 2
    return moved, change.camera_covariance * max(variance, 1e-6)


def _stated(bundle: Bundle, nominal: Bundle, tolerance: Tolerance) -> Stated:
    """Return what was stated about poses and camera, how surely, and how far off it is."""
    sd = np.full(bundle.poses.shape, [tolerance.place_m, tolerance.place_m, tolerance.heading_rad])
    off = [nominal.poses - bundle.poses, nominal.camera.values - bundle.camera.values]
    return Stated(1 / np.vstack([sd, tolerance.camera]) ** 2, np.vstack(off))
