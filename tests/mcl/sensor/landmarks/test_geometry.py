"""Projection, triangulation and the robot's pose from matches: exact where nothing is noisy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.sensor.landmarks.bundle import Bundle, Views, triangulate
from maurice_mcl.sensor.landmarks.camera import PinholeCamera, directions, linearize, linearize_poses, project
from maurice_mcl.sensor.landmarks.planar import Matched, hypotheses_of, modes_of

BENT = PinholeCamera(176, 144, 180.0, tilt_rad=0.12, distortion=-0.05, yaw_rad=0.3, height_m=0.2)
POSE = np.array([0.4, -0.7, 0.9])
AREA = 176.0 * 144.0


def ahead_of(pose, camera, count, seed=0):
    """Points in view of a camera, 1 to 4 m away."""
    rng = np.random.default_rng(seed)
    angle = pose[2] + camera.yaw_rad + rng.uniform(-0.4, 0.4, count)
    away = rng.uniform(1, 4, count)
    up = camera.height_m + away * rng.uniform(-0.2, 0.4, count)
    return np.column_stack([pose[0] + away * np.cos(angle), pose[1] + away * np.sin(angle), up])


def seen_from(pose, camera, points):
    return linearize(camera, np.broadcast_to(pose, points.shape), points)


def test_both_projections_agree_for_many_poses():
    points = ahead_of(POSE, BENT, 30)
    poses = POSE + np.random.default_rng(1).normal(0, 0.05, (20, 3))
    pixels, depth = project(BENT, poses.astype(np.float32), points.astype(np.float32))
    for number, pose in enumerate(poses):
        exact = seen_from(pose, BENT, points)
        np.testing.assert_allclose(pixels[:, number].T, exact.pixels, atol=2e-3)
        np.testing.assert_allclose(depth[number], exact.depth, atol=1e-5)


def test_a_point_behind_the_camera_falls_outside():
    pixels, depth = project(BENT, np.zeros((1, 3), np.float32), np.array([[-2.0, -1.0, 0.2]], np.float32))
    assert depth[0, 0] < 0
    assert pixels[0, 0, 0] > 1000


@pytest.mark.parametrize("which", ["by_pose", "by_point", "by_camera"])
def test_derivatives_are_those_of_the_projection(which):
    points = ahead_of(POSE, BENT, 6)
    analytic = getattr(seen_from(POSE, BENT, points), which)
    for column in range(3):
        step = np.eye(3)[column] * 1e-6
        moved = {
            "by_pose": lambda s: seen_from(POSE + s, BENT, points),
            "by_point": lambda s: seen_from(POSE, BENT, points + s),
            "by_camera": lambda s: seen_from(POSE, BENT.with_values(BENT.values + s), points),
        }[which]
        numeric = (moved(step).pixels - moved(-step).pixels) / 2e-6
        np.testing.assert_allclose(analytic[:, :, column], numeric, rtol=1e-4, atol=1e-3)


def test_directions_undo_the_projection():
    points = ahead_of(POSE, BENT, 40)
    angle, slope = directions(BENT, seen_from(POSE, BENT, points).pixels)
    away = points - [*POSE[:2], BENT.height_m]
    np.testing.assert_allclose(angle + POSE[2], np.arctan2(away[:, 1], away[:, 0]), atol=1e-6)
    np.testing.assert_allclose(slope, away[:, 2] / np.hypot(away[:, 0], away[:, 1]), atol=1e-6)


def test_points_are_triangulated_exactly():
    poses = np.array([[0.0, 0.0, 0.0], [0.5, 0.2, 0.1], [0.2, -0.6, 0.2]])
    points = ahead_of(poses[0], BENT, 25)
    reference, point = np.repeat([0, 1, 2], 25), np.tile(np.arange(25), 3)
    pixels = linearize(BENT, poses[reference], points[point]).pixels
    found = triangulate(BENT, poses, Views(reference, point, pixels), 25)
    np.testing.assert_allclose(found, points, atol=1e-4)
    exact = Bundle(BENT, poses, points).seen(Views(reference, point, pixels))
    np.testing.assert_allclose(exact.pixels, pixels)


def matched_at(pose, camera, count, noise_px=0.0, wrong=0, seed=0):
    rng = np.random.default_rng(seed)
    points = ahead_of(pose, camera, count, seed)
    pixels = seen_from(pose, camera, points).pixels + noise_px * rng.standard_normal((count, 2))
    pixels[:wrong] = rng.uniform(0, 1, (wrong, 2)) * [176, 144]
    return Matched(pixels, points, np.full(count, 0.6), np.full(count, max(noise_px, 0.1)))


def test_two_exact_matches_give_the_pose():
    matched = matched_at(POSE, BENT, 6)
    found = hypotheses_of(BENT, matched)
    assert len(found) == 15
    np.testing.assert_allclose(found, np.broadcast_to(POSE, found.shape), atol=1e-5)


def test_the_pose_is_exact_although_half_the_matches_are_wrong():
    mode = modes_of(BENT, matched_at(POSE, BENT, 40, wrong=20), AREA)[0]
    np.testing.assert_allclose(mode.pose, POSE, atol=1e-4)
    assert mode.inliers == pytest.approx(20, abs=1)


def test_two_matches_are_too_few():
    assert modes_of(BENT, matched_at(POSE, BENT, 2), AREA) == []


def test_covariances_cover_the_truth():
    # the mean of 60 chi-squares with 3 degrees of freedom: 3 +- 4 standard errors of sqrt(6 / 60)
    squared = []
    for seed in range(60):
        mode = modes_of(BENT, matched_at(POSE, BENT, 25, noise_px=0.8, wrong=5, seed=seed), AREA)[0]
        off = mode.pose - POSE
        squared.append(off @ np.linalg.solve(mode.covariance, off))
    assert 3 - 4 * np.sqrt(6 / 60) < np.mean(squared) < 3 + 4 * np.sqrt(6 / 60)


@pytest.mark.parametrize("camera", [replace(BENT, distortion=0.0), BENT])
def test_many_poses_at_once_have_the_derivatives_of_each(camera):
    rng = np.random.default_rng(0)
    poses, points = rng.normal(0, 1, (7, 3)), rng.normal(0, 3, (11, 3))
    pixels, by_pose, seen = linearize_poses(camera, poses, points)
    each = linearize(camera, np.repeat(poses, 11, axis=0), np.tile(points, (7, 1)))
    np.testing.assert_allclose(pixels, each.pixels.reshape(7, 11, 2).swapaxes(1, 2), rtol=1e-12)
    each_by_pose = each.by_pose.reshape(7, 11, 2, 3).swapaxes(1, 2)
    np.testing.assert_allclose(by_pose, each_by_pose, rtol=1e-9, atol=1e-9)
    assert not seen[each.depth.reshape(7, 11) <= 0].any()
    assert 0 < seen.sum() < seen.size


def folding(camera):
    """A camera, and a point 77 degrees from its axis that the polynomial alone puts into the picture."""
    camera = replace(camera, tilt_rad=0.0, yaw_rad=0.0)
    out = 0.98 / np.sqrt(-camera.distortion)  # of this tangent, r (1 + k r^2) is small again
    return camera, np.array([[1.0, out, camera.height_m]])


def test_a_point_where_the_distortion_folds_is_not_seen():
    camera, point = folding(BENT)
    at = np.zeros((1, 3))
    folded = seen_from(at[0], camera, point).pixels[0]
    assert 0 < folded[0] < camera.width_px  # what the polynomial alone says
    pixels, _ = project(camera, at.astype(np.float32), point.astype(np.float32))
    assert pixels[0, 0, 0] > 1000
    assert not linearize_poses(camera, at, point)[2].any()


def test_what_is_seen_does_not_end_where_nothing_folds():
    camera = replace(BENT, distortion=0.05)
    points = ahead_of(POSE, camera, 30)
    pixels, _, seen = linearize_poses(camera, POSE[None], points)
    there, _ = project(camera, POSE[None].astype(np.float32), points.astype(np.float32))
    assert seen.all()
    np.testing.assert_allclose(there[:, 0], pixels[0], atol=2e-3)
