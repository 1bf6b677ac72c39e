"""The normal equations of a bundle adjustment, solved with the points eliminated (the Schur complement).

A view concerns one reference and one point, so what is multiplied are blocks of three by three. Three
unknowns a reference and three of the camera are left. Long tracks fill their matrix: factors in a sparse
order would hold 60 % of it. So it is factored as a full one, by Cholesky's method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import bsr_matrix

from ...values import F64

DAMPING = 1e-5  # of a point, relative to what its views say of it
LEAST_INFORMATION = 1e-6  # of a point of which they say nothing


@dataclass(frozen=True, slots=True, eq=False)
class WeightedViews:
    """O linearized views of P points from L references; all but the numbers times the root of the weight."""

    reference: NDArray[np.intp]  # (O,)
    point: NDArray[np.intp]  # (O,)
    by_pose: F64  # (O, 2, 3)
    by_point: F64  # (O, 2, 3)
    by_camera: F64  # (O, 2, 3)
    off: F64  # (O, 2) where things were seen, minus where they should be


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """What was stated of the references' poses and, in the last row, of the camera."""

    information: F64  # (L + 1, 3) one over variances
    off: F64  # (L + 1, 3) what was stated, minus what is


class Change(NamedTuple):
    """What to add for the least squares of all that is off."""

    poses: F64  # (L, 3)
    points: F64  # (P, 3)
    camera: F64  # (3,)
    camera_covariance: F64  # (3, 3) where the variance of views is one


def change_of(views: WeightedViews, points: int, stated: Stated) -> Change:
    """Solve the normal equations for the change of all that is adjusted; P is `points`."""
    reference, point, places = views.reference, views.point, len(stated.off) - 1
    besides = np.concatenate([views.by_camera, views.off[:, :, None]], axis=2)  # (O, 2, 4)
    of_pose, of_point = np.swapaxes(views.by_pose, 1, 2), np.swapaxes(views.by_point, 1, 2)
    root = _inverse_root(_sums(of_point @ views.by_point, point, points))
    by_root = views.by_point @ np.swapaxes(root, 1, 2)[point]  # by points in units of how well they are known
    shared = of_pose @ by_root  # (O, 3, 3) what pose and point share
    besides_shared = _sums(np.swapaxes(by_root, 1, 2) @ besides, point, points)  # (P, 3, 4)

    matrix = _outer_without(shared, reference, point, (places, points))  # (L + 1, 3, L + 1, 3)
    at = np.arange(places)
    matrix[at, :, at] += _sums(of_pose @ views.by_pose, reference, places)
    by_besides = _sums(of_pose @ besides - shared @ besides_shared[point], reference, places)
    of_camera = np.tensordot(besides[:, :, :3], besides, ([0, 1], [0, 1]))
    of_camera -= np.tensordot(besides_shared[:, :, :3], besides_shared, ([0, 1], [0, 1]))
    matrix[-1, :, :-1] = by_besides[:, :, :3].transpose(2, 0, 1)
    matrix[-1, :, -1] = of_camera[:, :3]
    right = np.concatenate([by_besides[:, :, 3], of_camera[None, :, 3]]) + stated.information * stated.off

    size = stated.off.size
    square = matrix.reshape(size, size)
    square[np.diag_indices(size)] += stated.information.ravel()
    sides = np.column_stack([right.ravel(), np.eye(size, 3, 3 - size)])
    # of the transpose, which LAPACK reads without a copy, it takes the upper half: the lower one of this
    factor = cho_factor(square.T, overwrite_a=True, check_finite=False)
    answer = cho_solve(factor, sides, overwrite_b=True, check_finite=False)
    poses, camera = answer[:-3, 0].reshape(-1, 3), answer[-3:, 0]
    left = besides_shared[:, :, 3] - besides_shared[:, :, :3] @ camera
    left -= _sums((poses[reference][:, None, :] @ shared)[:, 0], point, points)
    moved = (left[:, None, :] @ root)[:, 0]
    return Change(poses, moved, camera, answer[-3:, 1:])


def _inverse_root(squares: F64) -> F64:
    """Return R (P, 3, 3) of damped squares (P, 3, 3), whose inverse is R.T R."""
    least = LEAST_INFORMATION + np.trace(squares, axis1=1, axis2=2)[:, None, None]
    factor = np.linalg.cholesky(squares + DAMPING * least * np.eye(3))
    return np.asarray(np.linalg.inv(factor), np.float64)


def _outer_without(
    shared: F64, reference: NDArray[np.intp], point: NDArray[np.intp], shape: tuple[int, int]
) -> F64:
    """Return minus what the poses of L references share by P points (L + 1, 3, L + 1, 3), and zeros last."""
    places, points = shape
    order = np.argsort(reference, kind="stable")
    start = np.searchsorted(reference[order], np.arange(places + 1))
    sparse = bsr_matrix((shared[order], point[order], start), shape=(3 * places, 3 * points))
    product = sparse @ sparse.T
    outer = np.zeros((places + 1, 3, places + 1, 3))
    row = np.repeat(np.arange(places), np.diff(product.indptr))
    outer[row, :, product.indices] = -product.data
    return outer


def _sums(values: F64, of: NDArray[np.intp], count: int) -> F64:
    """Return the sums (count, ...) of the values (O, ...) that go with each number `of` (O,)."""
    columns = values.reshape(len(values), -1).T
    sums = np.empty((count, len(columns)))
    for number, column in enumerate(columns):
        sums[:, number] = np.bincount(of, column, count)
    return sums.reshape(count, *values.shape[1:])
