"""With the points eliminated, the change is that of the whole system, and its covariance, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.sensor.landmarks.normal_equations import (
    DAMPING,
    LEAST_INFORMATION,
    Stated,
    WeightedViews,
    change_of,
)

POSES, POINTS = 7, 30


@pytest.fixture
def views():
    """Views of points by references, in no order; one reference and one point are in none."""
    rng = np.random.default_rng(0)
    reference, point = np.nonzero(rng.random((POSES, POINTS)) < 0.4)
    seen = (reference != 3) & (point != 11)
    order = rng.permutation(np.flatnonzero(seen))
    by = (rng.normal(0, scale, (len(order), 2, 3)) for scale in (90.0, 60.0, 200.0))
    return WeightedViews(reference[order], point[order], *by, rng.normal(0, 1, (len(order), 2)))


@pytest.fixture
def stated():
    rng = np.random.default_rng(1)
    information = np.vstack([np.full((POSES, 3), [6200.0, 6200.0, 820.0]), [4.0, 11.0, 400.0]])
    return Stated(information, rng.normal(0, 0.01, (POSES + 1, 3)))


def whole_system(views, stated):
    """The matrix and the right side of all unknowns: poses, points, camera."""
    unknowns = 3 * (POSES + POINTS + 1)
    jacobian = np.zeros((len(views.off), 2, unknowns))
    for number, (reference, point) in enumerate(zip(views.reference, views.point, strict=True)):
        jacobian[number, :, 3 * reference : 3 * reference + 3] = views.by_pose[number]
        at = 3 * (POSES + point)
        jacobian[number, :, at : at + 3] = views.by_point[number]
    jacobian[:, :, -3:] = views.by_camera
    jacobian = jacobian.reshape(-1, unknowns)
    matrix, right = jacobian.T @ jacobian, jacobian.T @ views.off.ravel()
    for at in range(3 * POSES, 3 * (POSES + POINTS), 3):
        block = matrix[at : at + 3, at : at + 3]
        block += DAMPING * (LEAST_INFORMATION + np.trace(block)) * np.eye(3)
    poses_and_camera = np.r_[0 : 3 * POSES, unknowns - 3 : unknowns]
    matrix[poses_and_camera, poses_and_camera] += stated.information.ravel()
    right[poses_and_camera] += (stated.information * stated.off).ravel()
    return matrix, right


def test_the_change_is_that_of_the_whole_system(views, stated):
    matrix, right = whole_system(views, stated)
    whole = np.linalg.solve(matrix, right)
    change = change_of(views, POINTS, stated)
    np.testing.assert_allclose(np.concatenate([change.poses, change.points]).ravel(), whole[:-3], atol=1e-8)
    np.testing.assert_allclose(change.camera, whole[-3:], atol=1e-8)
    np.testing.assert_allclose(change.camera_covariance, np.linalg.inv(matrix)[-3:, -3:], rtol=1e-8)


def test_the_order_of_views_does_not_matter(views, stated):
    order = np.argsort(views.point, kind="stable")
    names = ("reference", "point", "by_pose", "by_point", "by_camera", "off")
    sorted_views = replace(views, **{name: getattr(views, name)[order] for name in names})
    changes = change_of(views, POINTS, stated), change_of(sorted_views, POINTS, stated)
    for part, sorted_part in zip(*changes, strict=True):
        np.testing.assert_allclose(sorted_part, part, atol=1e-10)


def test_what_no_view_says_anything_of_stays_as_stated(views, stated):
    change = change_of(views, POINTS, stated)
    np.testing.assert_allclose(change.poses[3], stated.off[3], atol=1e-12)
    assert np.array_equal(change.points[11], np.zeros(3))
