"""How much of the free space a library covers, in which directions, and where the gaps are."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label

from ..arrays import F64, Bool
from ..library import Library
from ..map import Grid, make_grid, place_tree
from ..sensor.references import distinct_places

DIRECTIONS = 8  # asked of each place
SAME_WAY_RAD = np.pi / 4  # a reference that looks further aside shows another view
LEAST_GAP = 0.5  # reaches squared: smaller holes are not worth driving to
MOST_GAPS = 8  # listed


@dataclass(frozen=True, slots=True)
class Gap:
    """A part of free space without any entry near."""

    x_m: float  # its point that is furthest from any entry
    y_m: float
    area_m2: float
    to_entry_m: float  # how far that point is from one


@dataclass(frozen=True, slots=True)
class Coverage:
    """What a library covers."""

    reach_m: float  # an entry stands for what is so near
    mapped: bool  # whether walls or obstacles are known; else free is what lies between the poses
    free_m2: float
    covered: float  # share of the free space that has an entry within reach
    directions: float  # share of eight directions that some entry within reach looks in, where there is one
    gaps: tuple[Gap, ...]  # largest first


def coverage_of(library: Library, reach_m: float) -> Coverage:
    """Measure how free space is covered; walls between entry and place are not looked at."""
    places = distinct_places(library.poses[:, :2])[0]
    grid = make_grid(library.arena, places)
    mapped = len(library.arena.walls) > 0 or len(library.arena.obstacles) > 0
    free = grid.free if mapped else grid.free & _between(places, grid)
    points = grid.centers()[free.ravel()]
    cell_m2 = grid.cell_m**2
    if not len(points):
        return Coverage(reach_m, mapped, 0.0, 0.0, 0.0, ())
    distance = np.asarray(place_tree(library.poses[:, :2]).query(points)[0], np.float64)
    near = distance <= reach_m
    return Coverage(
        reach_m,
        mapped,
        float(len(points) * cell_m2),
        float(near.mean()),
        _directions(library.poses, points[near], reach_m),
        _gaps(points, distance, free, reach_m, cell_m2),
    )


def _between(places: F64, grid: Grid) -> Bool:
    """Return the cells (rows, columns) within the convex hull of places (P, 2), or under its border."""
    near_zero = (places - places[0]).astype(np.float32)
    hull = places[cv2.convexHull(near_zero, returnPoints=False).ravel()]
    corners = np.round(((hull - grid.corner) / grid.cell_m - 0.5) * 256).astype(np.int32)
    inside = np.zeros(grid.shape, np.uint8)
    cv2.fillConvexPoly(inside, corners, 1, lineType=cv2.LINE_8, shift=8)
    return inside > 0


def _directions(poses: F64, points: F64, reach_m: float) -> float:
    """Return the mean share of directions that are looked in, over at most a thousand points (n, 2)."""
    if not len(points):
        return 0.0
    some = points[np.linspace(0, len(points) - 1, min(len(points), 1000)).round().astype(int)]
    tree, wanted = place_tree(poses[:, :2]), np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    shares = []
    for entries in tree.query_ball_point(some, reach_m):
        apart = np.abs((poses[entries, 2] - wanted[:, None] + np.pi) % (2 * np.pi) - np.pi)
        shares.append(float((apart.min(axis=1) <= SAME_WAY_RAD / 2 + 1e-6).mean()))
    return float(np.mean(shares))


def _gaps(points: F64, distance: F64, free: Bool, reach_m: float, cell_m2: float) -> tuple[Gap, ...]:
    """Find the holes: free cells out of reach that hang together."""
    depth = np.zeros(free.shape)
    depth[free] = distance
    holes, count = label(depth > reach_m)
    number_of = holes[free]
    gaps = []
    for number in range(1, count + 1):
        inside = np.flatnonzero(number_of == number)
        deepest = inside[distance[inside].argmax()]
        x, y = points[deepest].tolist()
        gaps.append(Gap(x, y, float(len(inside) * cell_m2), float(distance[deepest])))
    worth = [gap for gap in gaps if gap.area_m2 >= LEAST_GAP * reach_m**2]
    return tuple(sorted(worth, key=lambda gap: -gap.area_m2)[:MOST_GAPS])
