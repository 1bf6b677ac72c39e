"""The camera, fitted from the library itself: what its header leaves out is what makes views agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...values import F64, Camera
from .bundle import Tolerance
from .camera import PinholeCamera
from .matching import disagreement

VIEWS_DEG = (35, 42, 50, 58, 67, 77, 88, 100, 112)  # horizontal views that are tried
TILTS_DEG = tuple(range(-24, 25, 4))
FINER_STEPS = (0.5, 0.25)  # parts of those steps that are tried around the best
AGREE_PX = 4.0  # two views that disagree by less count for a camera
MOST_MATCHES = 20_000  # matches that are looked at
FOCAL_SD, FOCAL_SD_KNOWN = 0.5, 0.003  # of the log of the focal length, as stated or not
USUAL_VIEW_RAD, FOCAL_SD_USUAL = float(np.radians(60)), 0.15  # of most webcams and depth cameras
FOCAL_WIDTHS = (0.4, 4.0)  # of a fitted focal length: views of 103 to 14 degrees
TILT_SD_RAD = 0.3  # a header does not state it
DISTORTION_SD, DISTORTION_SD_KNOWN = 0.05, 0.01  # little is seen near the corners


def nominal_camera(known: Camera | None, width_px: int, height_px: int) -> PinholeCamera:
    """Return the camera as its header states it, with common values for what it does not."""
    view = known.horizontal_fov_rad if known is not None else None
    focal = width_px / 2 / np.tan((view or np.radians(55.0)) / 2)
    yaw = 0.0 if known is None else known.yaw_rad
    height = 0.0 if known is None else known.height_m or 0.0
    return PinholeCamera(width_px, height_px, float(focal), yaw_rad=yaw, height_m=height)


def is_focal_known(known: Camera | None) -> bool:
    """Tell whether a header states the focal length, by the horizontal view."""
    return known is not None and known.horizontal_fov_rad is not None


def is_usual(camera: PinholeCamera) -> bool:
    """Tell whether a lens with that focal length exists; a fit by chance agreements mostly has none."""
    low, high = FOCAL_WIDTHS
    return low * camera.width_px <= camera.focal_px <= high * camera.width_px


def with_usual_lens(known: Camera | None) -> Camera:
    """Return a camera with the horizontal view that most have."""
    return replace(known or Camera("camera"), horizontal_fov_rad=USUAL_VIEW_RAD)


def tolerance_of(known: Camera | None) -> Tolerance:
    """Return how far each value of the camera may be adjusted."""
    if is_focal_known(known):
        return Tolerance(camera=(FOCAL_SD_KNOWN, TILT_SD_RAD, DISTORTION_SD_KNOWN))
    return Tolerance(camera=(FOCAL_SD, TILT_SD_RAD, DISTORTION_SD))


def first_guess(
    nominal: PinholeCamera, focal_known: bool, poses: F64, edges: NDArray[np.intp], pixels: tuple[F64, F64]
) -> PinholeCamera:
    """Return the tilt, and the focal length unless it is known, for which most matched views agree.

    `edges` are matches (E, 4) and `pixels` where they are in either picture (E, 2).
    """
    some = np.linspace(0, len(edges) - 1, min(MOST_MATCHES, len(edges))).astype(np.intp)
    ends = (edges[some, 0], edges[some, 2])
    pixels = (pixels[0][some], pixels[1][some])

    def agreeing(values: tuple[float, float]) -> float:
        camera = nominal.with_values(np.array([values[0], values[1], 0.0]))
        return float(np.mean(disagreement(camera, poses, pixels, ends) < AGREE_PX))

    views = np.log(nominal.width_px / 2 / np.tan(np.radians(VIEWS_DEG) / 2))
    focals = [float(np.log(nominal.focal_px))] if focal_known else [float(v) for v in views]
    tilts = [float(v) for v in np.radians(TILTS_DEG)]
    best = max(((focal, tilt) for focal in focals for tilt in tilts), key=agreeing)
    focal_step, tilt_step = 0.2 * (not focal_known), tilts[1] - tilts[0]
    for part in FINER_STEPS:
        sides = (-1, 0, 1)
        nearby = {
            (best[0] + a * part * focal_step, best[1] + b * part * tilt_step) for a in sides for b in sides
        }
        best = max(sorted(nearby), key=agreeing)
    return nominal.with_values(np.array([*best, 0.0]))
