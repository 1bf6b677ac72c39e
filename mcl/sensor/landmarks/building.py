"""Landmarks of a library: found, matched, triangulated, adjusted together, and each with its record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, I32, U8, Camera, Library, NamedProgress, keep_freed_memory
from ..ahead import on_all_cores
from ..descriptors.registry import reduced
from .bundle import Bundle, Tolerance, Views, adjust, errors_px, triangulate
from .calibration import (
    AGREE_PX,
    FOCAL_SD_KNOWN,
    FOCAL_SD_USUAL,
    first_guess,
    is_focal_known,
    is_usual,
    nominal_camera,
    tolerance_of,
    with_usual_lens,
)
from .camera import PinholeCamera
from .features import Keypoints, keypoints_of
from .landmark_set import CameraFit, LandmarkSet
from .matching import AGREES_PX, disagreement, overlapping, pairwise, spread_out, tracks_of
from .records import Records, records_of
from .sensor import Landmarks

ROUNDS_PX = (15.0, 6.0, 4.0)  # observations that are further off are dropped, round by round
LEAST_REFERENCES = 8
MOST_REFERENCES = 1500  # the adjustment takes the cube of them
CHANCE_SHARE = 0.2  # of matches seen from two sides: 0.3 to 0.5 agree with right poses, 0.08 to 0.25 else
LEAST_LANDMARKS = 50
MOST_LANDMARKS = 8000
FARTHEST_SD_M = 0.25  # of a landmark along the line of sight: worse ones say little and are dropped


@dataclass(frozen=True, slots=True)
class NoLandmarks:
    """Why a library has none."""

    reason: str  # "found 3 references with pictures, expected 8 or more"


@dataclass(frozen=True, slots=True, eq=False)
class _Matched:
    """References, and E matches between pairs of them."""

    keypoints: Sequence[Keypoints]  # (L,)
    poses: F64  # (L, 3)
    edges: NDArray[np.intp]  # (E, 4) reference and keypoint, twice
    distances: F32  # (E,)
    pixels: tuple[F64, F64]  # (E, 2) in either picture

    @property
    def views(self) -> tuple[F64, NDArray[np.intp], tuple[F64, F64]]:
        """Return what a camera is guessed from."""
        return self.poses, self.edges, self.pixels

    def disagreement(self, camera: PinholeCamera) -> F64:
        """Return by how many pixels (E,) a match's two views differ; infinite if their rays do not meet."""
        return disagreement(camera, self.poses, self.pixels, (self.edges[:, 0], self.edges[:, 2]))

    def agreement(self, camera: PinholeCamera) -> float:
        """Return the share of matches whose views agree, of those whose rays meet."""
        off = self.disagreement(camera)
        return float(np.sum(off < AGREE_PX) / max(np.sum(np.isfinite(off)), 1))


def build_landmarks(
    library: Library,
    camera: Camera | None,
    read: Callable[[int], U8 | None],
    progress: NamedProgress | None = None,
) -> Landmarks | NoLandmarks:
    """Build the landmark sensor of a library; `read` returns the picture of a reference by its number.

    `camera` is what is known of it; None: nothing, then it is fitted. Pictures have to be of one size: others
    than the first are left out. Of a larger library `MOST_REFERENCES` are used, evenly spread: closer ones
    see nothing new.
    """
    used = spread_out(library.poses, MOST_REFERENCES)
    progress = progress or (lambda done, total, what: None)
    keypoints, size = _keypoints(used, read, progress)
    progress(0, 1, "landmarks adjusted")
    landmarks = landmarks_of(keypoints, size or (0, 0), library.poses[used], camera)
    progress(1, 1, "landmarks adjusted")
    if isinstance(landmarks, NoLandmarks):
        return landmarks
    poses = library.poses.astype(np.float64)
    poses[used] = landmarks.poses
    view_of = landmarks.view_of.copy()
    view_of[:, 0] = used[view_of[:, 0]]
    return Landmarks(replace(landmarks, poses=poses, view_of=view_of))


def landmarks_of(
    keypoints: Sequence[Keypoints], size: tuple[int, int], poses: F64, camera: Camera | None
) -> LandmarkSet | NoLandmarks:
    """Find landmarks from the keypoints of references at poses (L, 3), in pictures of a size (H, W)."""
    usable = sum(len(points.pixels) > 0 for points in keypoints)
    if usable < LEAST_REFERENCES:
        advice = f"expected {LEAST_REFERENCES} or more in pictures of one size"
        return NoLandmarks(f"found {usable} references with keypoints, {advice}")
    nominal = nominal_camera(camera, size[1], size[0])
    matched = _matched(keypoints, poses, overlapping(poses, nominal.yaw_rad))
    if len(matched.edges) < LEAST_LANDMARKS:
        return NoLandmarks(
            f"found {len(matched.edges)} matches between references: their views do not overlap"
        )
    known = is_focal_known(camera)
    start = first_guess(nominal, known, *matched.views)
    if (share := matched.agreement(start)) < CHANCE_SHARE:
        found_share = f"found that {share:.0%} of the matches seen from two sides agree"
        return NoLandmarks(f"{found_share}, as by chance: check the references' poses")
    landmarks = _found(matched, start, nominal, camera)
    if known or (isinstance(landmarks, LandmarkSet) and is_usual(landmarks.fit.camera)):
        return landmarks
    usual = with_usual_lens(camera)
    nominal = nominal_camera(usual, size[1], size[0])
    return _assumed(_found(matched, first_guess(nominal, True, *matched.views), nominal, usual))


def _assumed(landmarks: LandmarkSet | NoLandmarks) -> LandmarkSet | NoLandmarks:
    """Say of landmarks that their focal length was not measured at all."""
    if isinstance(landmarks, NoLandmarks):
        return landmarks
    sd = np.array([FOCAL_SD_USUAL, *landmarks.fit.sd[1:]])
    return replace(landmarks, fit=CameraFit(landmarks.fit.camera, sd, focal_known=False, focal_assumed=True))


def _found(
    matched: _Matched, start: PinholeCamera, nominal: PinholeCamera, camera: Camera | None
) -> LandmarkSet | NoLandmarks:
    """Find landmarks with a camera to start from; what a header states of it hardly changes."""
    agrees = matched.disagreement(start) < AGREES_PX
    counts = np.array([len(points.pixels) for points in matched.keypoints], np.intp)
    track = tracks_of(matched.edges[agrees], matched.distances[agrees], counts)
    if track.max(initial=-1) + 1 < LEAST_LANDMARKS:
        return _too_few(track.max(initial=-1) + 1)
    stated = replace(nominal, tilt_rad=start.tilt_rad) if is_focal_known(camera) else start
    bundle = Bundle(stated, matched.poses, np.zeros((0, 3)))
    return _adjusted(matched.keypoints, track, start, bundle, tolerance_of(camera))


def _too_few(count: int) -> NoLandmarks:
    return NoLandmarks(f"found {count} landmarks that references agree on, expected {LEAST_LANDMARKS}")


def _keypoints(
    used: NDArray[np.intp], read: Callable[[int], U8 | None], progress: NamedProgress
) -> tuple[list[Keypoints], tuple[int, int] | None]:
    """Return the keypoints of some references, none where its picture is missing or of another size.

    Pictures are looked at on all cores, as OpenCV lets other threads run; the answer does not depend on it.
    """

    def look(number: int) -> tuple[Keypoints, tuple[int, int] | None]:
        image = read(number)
        if image is None:
            return none, None
        small = reduced(image)
        return keypoints_of(small), (small.shape[0], small.shape[1])

    none, pictures = keypoints_of(np.zeros((8, 8, 3), np.uint8)), []
    keep_freed_memory()  # of OpenCV, from picture to picture
    for count, picture in enumerate(on_all_cores(look, used.tolist()), 1):
        pictures.append(picture)
        progress(count, len(used), "landmarks")
    size = next((each for _, each in pictures if each is not None), None)
    return [points if each == size else none for points, each in pictures], size


def _matched(keypoints: Sequence[Keypoints], poses: F64, pairs: NDArray[np.intp]) -> _Matched:
    edges, distances = pairwise(keypoints, pairs)
    start = np.cumsum([0, *(len(points.pixels) for points in keypoints)])
    pixels = np.concatenate([points.pixels for points in keypoints]).astype(np.float64)
    ends = pixels[start[edges[:, 0]] + edges[:, 1]], pixels[start[edges[:, 2]] + edges[:, 3]]
    return _Matched(keypoints, poses, edges, distances, ends)


def _adjusted(
    keypoints: Sequence[Keypoints],
    track: NDArray[np.intp],
    start: PinholeCamera,
    nominal: Bundle,
    tolerance: Tolerance,
) -> LandmarkSet | NoLandmarks:
    """Triangulate the tracks of all keypoints and adjust them, dropping what does not agree."""
    owner = np.repeat(np.arange(len(keypoints)), [len(points.pixels) for points in keypoints])
    pixels = np.concatenate([points.pixels for points in keypoints]).astype(np.float64)
    descriptors = np.concatenate([points.descriptors for points in keypoints])
    at = np.flatnonzero(track >= 0)
    views = Views(owner[at], track[at], pixels[at])
    points = triangulate(start, nominal.poses, views, int(track.max()) + 1)
    bundle, covariance = adjust(Bundle(start, nominal.poses, points), views, nominal, tolerance)
    for limit_px in ROUNDS_PX:
        bundle, views, at = _pruned(bundle, views, at, limit_px)
        if len(bundle.points) < LEAST_LANDMARKS:
            return _too_few(len(bundle.points))
        bundle, covariance = adjust(bundle, views, nominal, tolerance)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0))
    fit = CameraFit(bundle.camera, sd, tolerance.camera[0] <= FOCAL_SD_KNOWN)
    return _landmark_set(bundle, views, records_of(bundle, views, descriptors[at]), fit)


def _pruned(
    bundle: Bundle, views: Views, at: NDArray[np.intp], limit_px: float
) -> tuple[Bundle, Views, NDArray[np.intp]]:
    """Drop observations that are too far off, and points that fewer than two references see then."""
    good = errors_px(bundle, views) < limit_px
    # one observation a reference and point
    twice = np.bincount(views.point[good], minlength=len(bundle.points)) >= 2
    good &= twice[views.point]
    views, at = views.only(good), at[good]
    number = np.cumsum(twice) - 1
    views = Views(views.reference, number[views.point], views.pixels)
    return Bundle(bundle.camera, bundle.poses, bundle.points[twice]), views, at


def _landmark_set(bundle: Bundle, views: Views, records: Records, fit: CameraFit) -> LandmarkSet:
    """Keep the best, with their records."""
    error = errors_px(bundle, views)
    # a point takes three of the equations of its n views; 1.1774 is the median of a Rayleigh distribution
    views_of = records.seen[views.point].astype(np.float64)
    pixel_sd = float(max(np.median(error * np.sqrt(2 * views_of / (2 * views_of - 3))) / 1.1774, 0.3))
    sd_m = _deviations(bundle, views, records, pixel_sd)
    good = (sd_m[:, 1] < FARTHEST_SD_M) & (records.farthest_m > 0)
    order = np.argsort(-records.seen, kind="stable")
    best = np.sort(order[good[order]][:MOST_LANDMARKS])
    could: I32 = np.maximum(records.could_see, records.seen)
    number = np.full(len(bundle.points), -1, np.int32)
    number[best] = np.arange(len(best))
    kept_views = views.only(number[views.point] >= 0)
    return LandmarkSet(
        fit=fit,
        points=bundle.points[best],
        descriptors=records.descriptors[best].astype(np.float16).astype(np.float32),
        sd_m=sd_m[best],
        seen=records.seen[best],
        could_see=could[best],
        facing_rad=records.facing_rad[best],
        spread_rad=records.spread_rad[best],
        nearest_m=records.nearest_m[best],
        farthest_m=records.farthest_m[best],
        poses=bundle.poses,
        pixel_sd=pixel_sd,
        agreement_px=np.percentile(error, [50, 75, 90]),
        view_of=np.column_stack([kept_views.reference, number[kept_views.point]]).astype(np.int32),
        view_px=kept_views.pixels.astype(np.float32),
    )


def _deviations(bundle: Bundle, views: Views, records: Records, pixel_sd: float) -> F32:
    """Return the standard deviations (P, 2) of where points are: across the line of sight, and along it."""
    by_point = bundle.seen(views).by_point
    inner = np.zeros((len(bundle.points), 3, 3))
    np.add.at(inner, views.point, np.swapaxes(by_point, 1, 2) @ by_point)
    covariance = np.linalg.inv(inner + 1e-6 * np.eye(3)) * pixel_sd**2
    c, s = np.cos(records.facing_rad), np.sin(records.facing_rad)
    along = np.stack([c, s, np.zeros_like(c)], axis=1)
    across = np.stack([-s, c, np.zeros_like(c)], axis=1)
    variances = [np.einsum("pi,pij,pj->p", axis, covariance, axis) for axis in (across, along)]
    deviations: F32 = np.sqrt(np.maximum(np.stack(variances, axis=1), 0)).astype(np.float32)
    return deviations
