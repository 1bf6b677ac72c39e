"""Which keypoints of which reference pictures show the same thing: tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, Bool, spacing, wrap
from ..ahead import on_all_cores
from .camera import PinholeCamera, directions
from .features import Keypoints

Ends = tuple[NDArray[np.intp], NDArray[np.intp]]  # (E,) each: numbers of two references

OVERLAPPING_REFERENCES = 12  # of a reference: those whose views overlap most with its own
LEAST_OVERLAP_SHARE = 0.15
FAN_RAD = np.radians([-20.0, -10.0, 0.0, 10.0, 20.0])  # sample points of a view, from its middle
FAN_SPACINGS = (1.5, 3.0, 6.0)  # how far away they are, in spacings of the library
HALF_VIEW_RAD = float(np.radians(28))  # half of what a camera is taken to see
MOST_TURNED_RAD = float(np.radians(75))  # SIFT does not recognize things seen from further around
RATIO_TEST = 0.85  # of the second distance that the first has to stay under
MOST_DESCRIPTOR_DISTANCE = 0.75  # distance of descriptors of one thing; two of length one are at most 2 apart
AGREES_PX = 9.0  # by which two views of one thing may disagree in height before anything is adjusted
NEAREST_M, FARTHEST_M = 0.1, 15.0  # of a thing from the camera
LEAST_PARALLAX_RAD = float(np.radians(1.0))  # between two views of a thing


def spread_out(poses: F64, most: int) -> NDArray[np.intp]:
    """Return the numbers of references (L, 3), at most about `most`, at places that are evenly spread.

    A place keeps all of its headings. Of the places in one square that nearest to its middle is kept.
    """
    numbers = np.arange(len(poses))
    side_m = spacing(np.unique(poses[:, :2].round(2), axis=0))
    while len(numbers) > most:
        side_m *= 1.1
        places, of_place = np.unique(poses[:, :2].round(2), axis=0, return_inverse=True)
        square = np.floor(places / side_m)
        off = np.hypot(*(places - (square + 0.5) * side_m).T)
        order = np.argsort(off, kind="stable")
        first = order[np.unique(square[order], axis=0, return_index=True)[1]]
        numbers = np.flatnonzero(np.isin(of_place.ravel(), first))
        if len(first) == 1:
            break
    return numbers


def overlapping(poses: F64, yaw_rad: float) -> NDArray[np.intp]:
    """Return pairs (P, 2) of references whose views overlap, the first number smaller.

    Of each reference (L, 3) the `NEIGHBORS` others are kept that see most of what it sees.
    """
    apart_m = max(spacing(np.unique(poses[:, :2].round(2), axis=0)), 0.2)
    ranges = np.array(FAN_SPACINGS) * apart_m
    places = len(poses)
    headings = poses[:, 2] + yaw_rad
    angles = headings[:, None, None] + FAN_RAD[:, None]
    fan = np.stack([np.cos(angles) * ranges, np.sin(angles) * ranges], axis=-1)
    fan = (fan + poses[:, None, None, :2]).reshape(places, -1, 2)  # (L, F, 2)
    pairs = []
    for i in range(places):
        near = np.flatnonzero(np.hypot(*(poses[:, :2] - poses[i, :2]).T) < ranges[-1])
        near = near[(np.abs(wrap(headings[near] - headings[i])) < MOST_TURNED_RAD) & (near != i)]
        offset = fan[i] - poses[near, None, :2]
        bearing = wrap(np.arctan2(offset[..., 1], offset[..., 0]) - headings[near, None])
        range_m = np.hypot(offset[..., 0], offset[..., 1])
        seen = (np.abs(bearing) < HALF_VIEW_RAD) & (range_m > 0.3 * apart_m) & (range_m < 1.3 * ranges[-1])
        share = seen.mean(axis=1)
        best = np.argsort(-share, kind="stable")[:OVERLAPPING_REFERENCES]
        pairs += [(min(i, j), max(i, j)) for j in near[best[share[best] >= LEAST_OVERLAP_SHARE]]]
    return np.array(sorted(set(pairs)), np.intp).reshape(-1, 2)


def pairwise(keypoints: Sequence[Keypoints], pairs: NDArray[np.intp]) -> tuple[NDArray[np.intp], F32]:
    """Match all pairs of references: (E, 4) reference and keypoint, twice, and the distances (E,)."""

    def matches_of(i: int) -> list[tuple[NDArray[np.intp], F32]]:
        others = [j for j in pairs[pairs[:, 0] == i, 1] if len(keypoints[j].pixels) > 1]
        if not others or len(keypoints[i].pixels) < 2:
            return []
        ends = np.cumsum([len(keypoints[j].pixels) for j in others])[:-1]
        # one product with all of them: many small ones cost more
        together = keypoints[i].descriptors @ np.concatenate([keypoints[j].descriptors for j in others]).T
        matches = []
        for j, product in zip(others, np.split(together, ends, axis=1), strict=True):
            a, b, near = mutual(product)
            matches.append((np.column_stack([np.full_like(a, i), a, np.full_like(b, j), b]), near))
        return matches

    none = np.zeros((0, 4), np.intp), np.zeros(0, np.float32)
    firsts = np.unique(pairs[:, 0]).tolist()
    edges, distances = zip(
        none, *(each for matches in on_all_cores(matches_of, firsts) for each in matches), strict=True
    )
    return np.concatenate(edges), np.concatenate(distances)


def mutual(product: F32) -> tuple[NDArray[np.intp], NDArray[np.intp], F32]:
    """Match by products (A, B) of descriptors: each the other's nearest and clearly nearer than the next.

    Returns the numbers of both and their distances.
    """
    line, other = np.arange(len(product)), product.argmax(axis=1)
    nearest = product[line, other]
    # the largest of each column is found in a fraction of the time of where it is
    mutually = np.flatnonzero(nearest == product.max(axis=0)[other])
    line, other, rows = line[: len(mutually)], other[mutually], product[mutually]
    near = np.sqrt(np.maximum(2 - 2 * nearest[mutually], 0))
    rows[line, other] = -1
    following = np.sqrt(np.maximum(2 - 2 * rows.max(axis=1, initial=-1), 1e-9))
    distinct = (near < RATIO_TEST * following) & (near < MOST_DESCRIPTOR_DISTANCE)
    return mutually[distinct], other[distinct], near[distinct].astype(np.float32)


def disagreement(camera: PinholeCamera, poses: F64, pixels: tuple[F64, F64], ends: Ends) -> F64:
    """Return by how many pixels two views of each match differ in height; infinite if their rays do not meet.

    `pixels` are (E, 2) in either picture, `ends` the numbers (E,) of the pictures.
    """
    angle, slope, range_m = [], [], []
    for pixel, end in zip(pixels, ends, strict=True):
        a, s = directions(camera, pixel)
        angle.append(a + poses[end, 2])
        slope.append(s)
    first, second = poses[ends[0], :2], poses[ends[1], :2]
    baseline = second - first
    across = np.sin(angle[1] - angle[0])
    safe = np.where(np.abs(across) < 1e-9, 1e-9, across)
    for other in (1, 0):
        c, s = np.cos(angle[other]), np.sin(angle[other])
        range_m.append((baseline[:, 0] * s - baseline[:, 1] * c) / safe)
    apart_m = np.abs(range_m[0] * slope[0] - range_m[1] * slope[1])
    low, high = np.minimum(*range_m), np.maximum(*range_m)
    nowhere = (low < NEAREST_M) | (high > FARTHEST_M) | (np.abs(across) < np.sin(LEAST_PARALLAX_RAD))
    return np.where(nowhere, np.inf, camera.focal_px * apart_m / np.maximum(high, NEAREST_M))


def tracks_of(edges: NDArray[np.intp], distances: F32, counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Join matches into tracks: the number of the track of every keypoint, -1 for none.

    `counts` (L,) are the keypoints of each reference; the answer runs over all of them in order. The best
    matches come first, and no track has two keypoints of one picture.
    """
    start = np.concatenate([[0], np.cumsum(counts)])
    total, owner = int(start[-1]), np.repeat(np.arange(len(counts)), counts)
    first, second = start[edges[:, 0]] + edges[:, 1], start[edges[:, 2]] + edges[:, 3]
    parent = list(range(total))
    owners: dict[int, set[int]] = {}

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for e in np.argsort(distances, kind="stable").tolist():
        a, b = root(int(first[e])), root(int(second[e]))
        if a == b:
            continue
        in_a, in_b = owners.get(a) or {int(owner[a])}, owners.get(b) or {int(owner[b])}
        if in_a & in_b:
            continue
        parent[b] = a
        owners[a] = in_a | in_b
        owners.pop(b, None)
    track = np.full(total, -1, np.intp)
    roots = np.array([root(k) for k in range(total)], np.intp) if total else np.zeros(0, np.intp)
    _, number, size = np.unique(roots, return_inverse=True, return_counts=True)
    joined: Bool = size[number] > 1
    track[joined] = np.unique(number[joined], return_inverse=True)[1]
    return track
