"""The landmark sensor: a picture's keypoints, matched to landmarks, say how likely any pose is.

It needs no reference picture while it runs: only where landmarks are, what they look like, and how often
each was found where it could have been.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

from ...values import (
    EXACT,
    F32,
    F64,
    I32,
    U8,
    Bool,
    Frame,
    PoseProposal,
    PoseSpread,
    Region,
    Shown,
    keep_freed_memory,
    place_tree,
)
from .camera import FARTHEST_M, reprojected
from .features import Keypoints, keypoints_of
from .landmark_set import LandmarkSet
from .picture import BESIDE, PICTURE, Judged
from .planar import Matched, Mode, modes_of
from .things import besides_one_thing, things_of

SHAPE_TOLERANCE = 0.01  # of its width over its height: a picture of another camera
MOST_RATIO = 0.95  # of the second distance that the first has to stay under
SAME_THING_M = 0.2  # a second landmark nearer to the first than this is the same thing
# ratios of the two distances, and the share of right matches at them, on drives in fitting arenas
RATIOS, RIGHT_SHARES = (0.55, 0.65, 0.75, 0.85, 0.92, 0.95), (0.97, 0.85, 0.62, 0.27, 0.1, 0.07)
INDEPENDENT_MATCHES = 4.0  # right ones that count in full: more share their errors; fitted on these drives
LEAST_MATCHES = 4
LEAST_SCORE_NATS = 20.0  # nats of a proposal above no agreement at all
LEAST_INLIERS = 3.5  # right matches of a proposal: two agree by construction
LEAST_MATCHES_BESIDES = 2.0  # right ones on anything but the one object with the most, which may have moved
COMPETING_NATS = 6.0  # nats below the best that another proposal may be


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkReading:
    """K matches of one picture's keypoints to landmarks, and the poses that they agree on."""

    image: U8 | None  # (H, W, 3), to be shown
    pixels: F32  # (K, 2) of the keypoints
    landmark: NDArray[np.intp]  # (K,) numbers of landmarks
    inlier: F32  # (K,) probability of being right, before anything is known of the pose
    modes: Sequence[Mode] = ()  # best first


@dataclass(frozen=True, eq=False)
class Landmarks:
    """A sensor model over landmarks; see `maurice_mcl.PoseSensor`."""

    map: LandmarkSet
    obstacles: tuple[Region, ...] = ()  # of the map: things that can be moved
    name: ClassVar[str] = "landmarks"  # the key of `sensor.weights`
    pictures: ClassVar[tuple[str, ...]] = (PICTURE, BESIDE)  # titles of those that it shows
    proposes: ClassVar[bool] = True
    in_space: ClassVar[bool] = True  # it shows marks in space

    def __post_init__(self) -> None:
        """Prepare for arrays of poses times matches, which every update makes and frees."""
        keep_freed_memory()

    @property
    def summary(self) -> str:
        """One line for tables."""
        error = f"reprojection error {self.map.agreement_px[0]:.2f} px in the median"
        return f"{self.map.size} points, {error}, focal length {self.map.fit.focal_text}"

    def read(self, frame: Frame) -> LandmarkReading | None:
        """Find the keypoints of a picture and the landmarks that they may be; None: too few.

        A picture of another size and the same shape is resized to that of the library's; of another shape it
        is another camera's, and says nothing.
        """
        image = self._resized(frame.image)
        return None if image is None else self.matched(keypoints_of(image), image)

    def _resized(self, image: U8) -> U8 | None:
        width, height = self.map.fit.camera.width_px, self.map.fit.camera.height_px
        if image.shape[:2] == (height, width):
            return image
        if abs(image.shape[1] * height - image.shape[0] * width) > SHAPE_TOLERANCE * width * image.shape[0]:
            return None
        finer = cv2.INTER_AREA if image.shape[1] > width else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(image, (width, height), interpolation=finer), np.uint8)

    def matched(self, keypoints: Keypoints, image: U8 | None = None) -> LandmarkReading | None:
        """Match keypoints to all landmarks; None: fewer than `LEAST_MATCHES`."""
        if len(keypoints.pixels) < LEAST_MATCHES:
            return None
        product = keypoints.descriptors @ self.map.descriptors.T
        rows, best = np.arange(len(product)), product.argmax(axis=1)
        nearest = product[rows, best]
        for row, same in enumerate(self._places.query_ball_point(self.map.points[best], SAME_THING_M)):
            product[row, same] = -np.inf
        following = product.max(axis=1)
        following[np.isinf(following)] = 1  # nothing is elsewhere: no test, no match
        near, far = (np.sqrt(np.maximum(2 - 2 * v, 1e-9)) for v in (nearest, following))
        ratio = near / far
        matches = np.flatnonzero(ratio < MOST_RATIO)
        # one keypoint a landmark: the nearest
        matches = matches[np.argsort(near[matches], kind="stable")]
        matches = np.sort(matches[np.unique(best[matches], return_index=True)[1]])
        if len(matches) < LEAST_MATCHES:
            return None
        inlier = np.interp(ratio[matches], RATIOS, RIGHT_SHARES).astype(np.float32)
        reading = LandmarkReading(image, keypoints.pixels[matches], best[matches], inlier)
        return replace(reading, modes=self._modes(reading))

    def to_numbers(self, reading: LandmarkReading | None) -> F64:
        """Return all of a reading but its picture, for a cache; of None nothing."""
        if reading is None:
            return np.zeros(0)
        modes = [[*mode.pose, *mode.covariance.ravel(), mode.score, *mode.right] for mode in reading.modes]
        rows = *reading.pixels.T, reading.landmark, reading.inlier, *modes
        return np.concatenate([[len(reading.landmark)], *rows])

    def of_numbers(self, numbers: F64, frame: Frame) -> LandmarkReading | None:
        """Return a frame's reading by its `to_numbers`."""
        if not len(numbers):
            return None
        count = int(numbers[0])
        x, y, landmark, inlier = numbers[1 : 1 + 4 * count].reshape(4, count)
        pixels = np.column_stack([x, y]).astype(np.float32)
        modes = [
            Mode(row[:3], row[3:12].reshape(3, 3), float(row[12]), row[13:])
            for row in numbers[1 + 4 * count :].reshape(-1, 13 + count)
        ]
        matched = pixels, landmark.astype(np.intp), inlier.astype(np.float32)
        return LandmarkReading(self._resized(frame.image), *matched, modes)

    @cached_property
    def checksum(self) -> bytes:
        """What readings depend on, but code and pictures."""
        total = hashlib.sha256()
        for name, values in sorted(self.to_arrays().items()):
            total.update(name.encode() + np.ascontiguousarray(values).tobytes())
        return total.digest()

    def log_likelihood(
        self, reading: LandmarkReading, poses: F32, origin: F64, spread: PoseSpread = EXACT
    ) -> F32:
        """Return the nats (N,) of poses (N, 3): 0 where all matches are where they should be, else below."""
        camera, area = self.map.fit.camera, self._area_px
        points = (self.map.points[reading.landmark] - [*origin, 0.0]).astype(np.float32)
        off, depth, seen = reprojected(camera, poses, points)
        seen &= self._faced(reading, poses, points)
        off -= reading.pixels.T[:, None, :]
        off *= off
        squared = off[0]
        squared += off[1]
        turned = np.float32((camera.focal_px * spread.heading_rad) ** 2)
        variance: Any = self._variance_px[reading.landmark] + turned
        if spread.position_m:
            near = np.clip(depth, np.float32(self._nearest_m), FARTHEST_M, out=depth)
            shifted = np.divide(np.float32(camera.focal_px * spread.position_m), near, out=near)
            shifted *= shifted
            variance = np.add(variance, shifted, out=shifted)
        squared /= -2 * variance
        agree = np.exp(squared, out=squared)
        agree *= seen
        odds = (1 - reading.inlier) / reading.inlier * np.float32(2 * np.pi / area)
        wrong = odds * variance
        agree += wrong
        nats = np.log(agree, out=agree).sum(axis=1) - np.log(1 + wrong).sum(axis=-1)
        return np.asarray(np.minimum(nats, 0) * np.float32(self._share(reading)), np.float32)

    def propose(self, reading: LandmarkReading) -> PoseProposal | None:
        """Return where the matches alone put the robot; None where they agree on nothing.

        Poses that a single object speaks for are marked: it may be the object that moved, not the robot.
        """
        modes = [
            mode for mode in reading.modes if mode.score > LEAST_SCORE_NATS and mode.inliers > LEAST_INLIERS
        ]
        modes = [mode for mode in modes if mode.score > modes[0].score - COMPETING_NATS]
        if not modes:
            return None
        thing = self._thing[reading.landmark]
        alone = np.array([besides_one_thing(mode.right, thing) < LEAST_MATCHES_BESIDES for mode in modes])
        score = np.array([mode.score for mode in modes]) * self._share(reading)
        weights = np.exp(score - score.max())
        covariances = np.stack([mode.covariance for mode in modes]) / self._share(reading)
        poses = np.stack([mode.pose for mode in modes])
        return PoseProposal(poses, covariances, weights / weights.sum(), alone)

    def _modes(self, reading: LandmarkReading) -> list[Mode]:
        sd = np.sqrt(self._variance_px[reading.landmark].astype(np.float64))
        points = self.map.points[reading.landmark]
        inlier = reading.inlier.astype(np.float64)
        matched = Matched(reading.pixels.astype(np.float64), points, inlier, sd)
        return modes_of(self.map.fit.camera, matched, self._area_px)

    def shown(self, reading: LandmarkReading, poses: Mapping[str, F64]) -> Shown:
        """Return matches and reprojections in the picture, landmarks on the map, and how many agree."""
        return self.shown_with(reading, poses, self.propose(reading))

    def shown_with(
        self, reading: LandmarkReading, poses: Mapping[str, F64], proposal: PoseProposal | None
    ) -> Shown:
        """Return the same for a proposal that is known: finding it takes most of the time."""
        places = np.stack([*poses.values()])
        origin = places[0, :2].copy()
        relative = (places - [*origin, 0.0]).astype(np.float32)
        nats = dict(zip(poses, self.log_likelihood(reading, relative, origin).tolist(), strict=True))
        matches = reading.pixels, reading.landmark, reading.inlier
        things = self._thing[reading.landmark], [obstacle.name for obstacle in self.obstacles]
        return Judged(self.map, reading.image, *matches, nats, proposal, *things).shown(poses)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a file."""
        return self.map.to_arrays()

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Landmarks:
        """Return the sensor of `to_arrays`. ValueError for arrays that are not."""
        return cls(LandmarkSet.from_arrays(arrays))

    def _share(self, reading: LandmarkReading) -> float:
        """Return what share of the matches' nats counts: many of them share their errors."""
        return INDEPENDENT_MATCHES / max(INDEPENDENT_MATCHES, float(reading.inlier.sum()))

    def _faced(self, reading: LandmarkReading, poses: F32, points: F32) -> Bool:
        """Return where a pose is on the side of a landmark that it was seen from: (N, K)."""
        facing = self.map.facing_rad[reading.landmark]
        c, s = np.cos(facing), np.sin(facing)
        lines = np.column_stack([c, s, -(c * points[:, 0] + s * points[:, 1])])
        places = np.stack([poses[:, 0], poses[:, 1], np.ones(len(poses), np.float32)])
        return np.asarray((lines @ places).T > 0)

    @cached_property
    def _places(self) -> cKDTree:
        return place_tree(self.map.points)

    @cached_property
    def _thing(self) -> I32:
        return things_of(self.map.points, self.obstacles)

    @cached_property
    def _variance_px(self) -> F32:
        """Variance (M,) of a reprojection along one axis: of the keypoint, and of the landmark itself."""
        range_m = np.sqrt(np.maximum(self.map.nearest_m * self.map.farthest_m, 0.01))
        own: F32 = self.map.fit.camera.focal_px * self.map.sd_m[:, 0] / range_m
        deviation = np.hypot(own, np.float32(self.map.pixel_sd))
        return np.asarray(deviation * deviation, np.float32)

    @cached_property
    def _nearest_m(self) -> float:
        return max(float(np.percentile(self.map.nearest_m, 1)) / 2, 0.05)

    @property
    def _area_px(self) -> float:
        return float(self.map.fit.camera.width_px * self.map.fit.camera.height_px)
