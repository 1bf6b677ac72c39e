"""A pinhole camera on a robot in the plane: where points fall in its picture, for many poses at once.

Its height above the floor is not observable from pictures taken in one plane: points and camera could all
be higher. It only moves the heights of landmarks, not the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...values import F32, F64, Bool

NEAREST_M = np.float32(0.05)  # a point nearer than this to the plane of the lens, or behind it, is not seen
FARTHEST_M = np.float32(np.inf)
NOWHERE_PX = np.float32(1e4)  # the pixel of such a point: far outside of any picture
# A distortion below zero folds what is far from the axis back into the picture: r (1 + k r^2) falls again
# where 1 + k r^2 is below this. The distortion was fitted within the picture and says nothing of there.
LEAST_BENT = 2 / 3


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Optics and mount of a camera; x right, y down, and a radial distortion 1 + k r^2."""

    width_px: int
    height_px: int
    focal_px: float
    tilt_rad: float = 0.0  # up
    distortion: float = 0.0
    yaw_rad: float = 0.0  # counter-clockwise from the robot's forward
    height_m: float = 0.0  # of the camera; only differences to it are observable

    @property
    def middle(self) -> tuple[float, float]:
        """The principal point: the middle of the picture."""
        return self.width_px / 2 - 0.5, self.height_px / 2 - 0.5

    @property
    def view_rad(self) -> float:
        """The horizontal field of view, without distortion."""
        return 2 * float(np.arctan2(self.width_px / 2, self.focal_px))

    def with_values(self, values: F64) -> PinholeCamera:
        """Return the camera with other (3,) log of the focal length, tilt and distortion."""
        log_focal, tilt, distortion = (float(v) for v in values)
        return replace(self, focal_px=float(np.exp(log_focal)), tilt_rad=tilt, distortion=distortion)

    @property
    def values(self) -> F64:
        """The log of the focal length, tilt and distortion: what is fitted."""
        return np.array([np.log(self.focal_px), self.tilt_rad, self.distortion])


def project(camera: PinholeCamera, poses: F32, points: F32) -> tuple[F32, F32]:
    """Return where points (M, 3) fall for each pose (N, 3): pixels (2, N, M), and their depth (N, M).

    Poses and points are relative to one origin. A point behind the camera, or so far from its axis that the
    distortion folds, falls far outside the picture.
    """
    pixels, depth, seen = reprojected(camera, poses, points)
    # arithmetic takes a fifth of the time of an assignment by a mask
    pixels *= seen
    pixels += NOWHERE_PX * ~seen
    return pixels, depth


def reprojected(camera: PinholeCamera, poses: F32, points: F32) -> tuple[F32, F32, Bool]:
    """Return the same pixels and depth, and which points (N, M) are seen; pixels of others say nothing.

    All are stored point by point: what is known of a point is then one number for each pass over the poses.
    """
    heading = poses[:, 2] + np.float32(camera.yaw_rad)
    c, s = np.cos(heading), np.sin(heading)
    x, y = poses[:, 0], poses[:, 1]
    cp, sp = np.float32(np.cos(camera.tilt_rad)), np.float32(np.sin(camera.tilt_rad))
    zeros, ones = np.zeros_like(c), np.ones_like(c)
    # right = s (X - x) - c (Y - y), ahead = c (X - x) + s (Y - y), and up: sums over (X, Y, 1, up)
    right = np.stack([s, -c, c * y - s * x, zeros])
    ahead = np.stack([c, s, -(c * x + s * y), zeros])
    up = np.stack([zeros, zeros, zeros, ones])
    of_points = np.ones((len(points), 4), np.float32)
    of_points[:, :2] = points[:, :2]
    np.subtract(points[:, 2], np.float32(camera.height_m), out=of_points[:, 3])
    pixels = np.empty((2, len(points), len(poses)), np.float32)
    np.matmul(of_points, right, out=pixels[0])
    np.matmul(of_points, sp * ahead - cp * up, out=pixels[1])
    depth = np.matmul(of_points, cp * ahead + sp * up, dtype=np.float32)
    seen = depth > NEAREST_M
    scale = np.clip(depth, NEAREST_M, FARTHEST_M)  # np.maximum takes three times as long
    pixels *= np.divide(np.float32(camera.focal_px), scale, out=scale)
    if camera.distortion:
        bent = pixels[0] * pixels[0]
        bent += np.multiply(pixels[1], pixels[1], out=scale)
        bent *= np.float32(camera.distortion / camera.focal_px**2)
        bent += 1
        seen &= bent > LEAST_BENT
        pixels *= bent
    pixels += np.array(camera.middle, np.float32)[:, None, None]
    return pixels.transpose(0, 2, 1), depth.T, seen.T


@dataclass(frozen=True, slots=True, eq=False)
class Linearized:
    """Projections of O pairs of pose and point, with their derivatives."""

    pixels: F64  # (O, 2)
    depth: F64  # (O,)
    by_pose: F64  # (O, 2, 3)
    by_point: F64  # (O, 2, 3)
    by_camera: F64  # (O, 2, 3) log of the focal length, tilt, distortion


def linearize(camera: PinholeCamera, poses: F64, points: F64) -> Linearized:
    """Project each point (O, 3) from its pose (O, 3), with derivatives by pose, point and camera."""
    heading = poses[:, 2] + camera.yaw_rad
    c, s = np.cos(heading), np.sin(heading)
    dx, dy = points[:, 0] - poses[:, 0], points[:, 1] - poses[:, 1]
    ahead, right, up = c * dx + s * dy, s * dx - c * dy, points[:, 2] - camera.height_m
    cp, sp = np.cos(camera.tilt_rad), np.sin(camera.tilt_rad)
    depth = cp * ahead + sp * up
    inverse = 1 / np.where(np.abs(depth) < NEAREST_M, NEAREST_M, depth)
    x, y = right * inverse, (sp * ahead - cp * up) * inverse
    f, k, square = camera.focal_px, camera.distortion, x**2 + y**2
    bent = 1 + k * square
    pixels = np.stack([camera.middle[0] + f * x * bent, camera.middle[1] + f * y * bent], axis=1)
    by_x, by_y, mixed = f * (bent + 2 * k * x * x), f * (bent + 2 * k * y * y), f * 2 * k * x * y

    def by(dx: F64, dy: F64) -> F64:
        """Return the derivative (2, O) of pixels by what moves x and y by so much."""
        return np.stack([by_x * dx + mixed * dy, mixed * dx + by_y * dy])

    by_ahead = by(-x * cp * inverse, (sp - y * cp) * inverse)
    by_right = np.stack([by_x, mixed]) * inverse
    by_point = _side_by_side(
        c * by_ahead + s * by_right,
        s * by_ahead - c * by_right,
        by(-x * sp * inverse, (-cp - y * sp) * inverse),
    )
    by_pose = by_point.copy()
    by_pose[:, :, :2] *= -1
    by_pose[:, :, 2] = (ahead * by_right - right * by_ahead).T
    by_camera = _side_by_side(
        np.stack([x, y]) * (f * bent), by(x * y, 1 + y * y), np.stack([x, y]) * (f * square)
    )
    return Linearized(pixels, depth, by_pose, by_point, by_camera)


def _side_by_side(*columns: F64) -> F64:
    """Return derivatives (O, 2, 3) of three columns (2, O)."""
    return np.ascontiguousarray(np.stack(columns).transpose(2, 1, 0))


def linearize_poses(camera: PinholeCamera, poses: F64, points: F64) -> tuple[F64, F64, Bool]:
    """Project points (K, 3) from all poses (H, 3): pixels (H, 2, K), by pose (H, 2, K, 3), and seen (H, K).

    The same as `linearize` of all pairs, by poses alone and several times faster for a few thousand pairs.
    What is behind the camera, or where the distortion folds, is not seen.
    """
    heading = poses[:, 2:] + camera.yaw_rad
    c, s = np.cos(heading), np.sin(heading)
    dx, dy = points[:, 0] - poses[:, :1], points[:, 1] - poses[:, 1:2]
    ahead, right, up = c * dx + s * dy, s * dx - c * dy, points[:, 2] - camera.height_m
    cp, sp = np.cos(camera.tilt_rad), np.sin(camera.tilt_rad)
    depth = cp * ahead + sp * up
    inverse = 1 / np.where(np.abs(depth) < NEAREST_M, NEAREST_M, depth)
    x, y = right * inverse, (sp * ahead - cp * up) * inverse
    f, k = camera.focal_px, camera.distortion
    bent = 1 + k * (x**2 + y**2)
    pixels = np.stack([camera.middle[0] + f * x * bent, camera.middle[1] + f * y * bent], axis=1)
    scale = f * inverse
    by_x, by_y, mixed = (bent + 2 * k * x * x) * scale, (bent + 2 * k * y * y) * scale, 2 * k * x * y * scale
    by_pose = np.empty((len(poses), 2, len(points), 3))
    # how far a point moves ahead and right, by x and y of the pose and by its heading
    for column, (da, dr) in enumerate(((-c, -s), (-s, c), (-right, ahead))):
        in_x, in_y = dr - x * cp * da, (sp - y * cp) * da
        by_pose[:, 0, :, column] = by_x * in_x + mixed * in_y
        by_pose[:, 1, :, column] = mixed * in_x + by_y * in_y
    return pixels, by_pose, (depth > NEAREST_M) & (bent > LEAST_BENT)


def directions(camera: PinholeCamera, pixels: F64) -> tuple[F64, F64]:
    """Return where pixels (K, 2) look: the angle from the robot's forward, and the slope up.

    The angle is counter-clockwise in the plane of the floor; the slope is height over distance there.
    """
    bent = (np.asarray(pixels, np.float64) - camera.middle) / camera.focal_px
    straight = bent
    for _ in range(5):
        straight = bent / (1 + camera.distortion * np.sum(straight**2, axis=1, keepdims=True))
    x, y = straight[:, 0], straight[:, 1]
    cp, sp = np.cos(camera.tilt_rad), np.sin(camera.tilt_rad)
    ahead, up = cp + sp * y, sp - cp * y
    return np.arctan2(-x, ahead) + camera.yaw_rad, up / np.hypot(ahead, x)
