"""How good a library is, before any run: what it covers, and how well it separates its places.

Self-similarity compares each reference with the others by the sensor model's costs in nats. It is retrieved
correctly when the most similar one elsewhere is a neighbor with nearly its heading, and aliased when a far
one is more similar than its neighbors.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..values.arrays import F64, I32, Bool, Progress
from ..values.geometry import wrap, wrap_angle
from ..values.library import SAME_WAY_RAD, Library
from ..values.map import Grid, make_grid
from ..values.nearest import distinct_places, place_tree, spacing
from .left_out import Index, LeftOutTable

# Coverage: how much of the free space, in which directions, and where the gaps are.

DIRECTIONS = 8  # tested at each place
VIEW_RAD = np.pi / 4  # a reference turned further shows another view
LEAST_GAP_REACHES = 0.5  # times the reach squared: smaller gaps are not reported
MOST_GAPS = 8  # listed


@dataclass(frozen=True, slots=True)
class Gap:
    """A part of free space without any entry near."""

    x_m: float  # the point furthest from any entry
    y_m: float
    area_m2: float
    to_entry_m: float  # distance of that point to an entry


@dataclass(frozen=True, slots=True)
class Coverage:
    """What a library covers."""

    reach_m: float  # an entry covers poses within this distance
    mapped: bool  # whether walls or obstacles are known; else the hull of the poses is free
    free_m2: float
    covered: float  # share of the free space that has an entry within reach
    directions: float  # mean share of eight directions covered, where an entry is within reach
    gaps: tuple[Gap, ...]  # largest first


def coverage_of(library: Library, reach_m: float) -> Coverage:
    """Measure how free space is covered, ignoring walls between entry and place."""
    grid, free, mapped = free_space(library)
    points = grid.centers()[free.ravel()]
    cell_m2 = grid.cell_m**2
    if not len(points):
        return Coverage(reach_m, mapped, 0.0, 0.0, 0.0, ())
    distance = np.asarray(place_tree(library.poses[:, :2]).query(points)[0], np.float64)
    near = distance <= reach_m
    directions = _directions(library.poses, points[near], reach_m)
    gaps = _gaps(points, distance, free, reach_m, cell_m2)
    return Coverage(reach_m, mapped, float(len(points) * cell_m2), float(near.mean()), directions, gaps)


def free_space(library: Library) -> tuple[Grid, Bool, bool]:
    """Return a grid, which of its cells a robot can reach from the references, and whether a map says so.

    Where no wall is known, free space is the hull of the references.
    """
    places = distinct_places(library.poses[:, :2])[0]
    grid = make_grid(library.arena, places)
    mapped = len(library.arena.walls) > 0 or len(library.arena.obstacles) > 0
    return grid, grid.free if mapped else grid.free & _between(places, grid), mapped


def _between(places: F64, grid: Grid) -> Bool:
    """Return the cells (rows, columns) within the convex hull of places (P, 2), or under its border."""
    near_zero = (places - places[0]).astype(np.float32)
    hull = places[cv2.convexHull(near_zero, returnPoints=False).ravel()]
    corners = np.round(((hull - grid.corner) / grid.cell_m - 0.5) * 256).astype(np.int32)
    inside = np.zeros(grid.shape, np.uint8)
    cv2.fillConvexPoly(inside, corners, 1, lineType=cv2.LINE_8, shift=8)
    return inside > 0


def _directions(poses: F64, points: F64, reach_m: float) -> float:
    """Return the mean share of directions covered, over at most a thousand points (n, 2)."""
    if not len(points):
        return 0.0
    chosen = points[np.linspace(0, len(points) - 1, min(len(points), 1000)).round().astype(int)]
    tree, headings = place_tree(poses[:, :2]), np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    shares = []
    for entries in tree.query_ball_point(chosen, reach_m):
        turned = np.abs(wrap_angle(poses[entries, 2] - headings[:, None]))
        shares.append(float((turned.min(axis=1) <= VIEW_RAD / 2 + 1e-6).mean()))
    return float(np.mean(shares))


def _gaps(points: F64, distance: F64, free: Bool, reach_m: float, cell_m2: float) -> tuple[Gap, ...]:
    from scipy.ndimage import label  # a replay needs none of it

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
    worth = [gap for gap in gaps if gap.area_m2 >= LEAST_GAP_REACHES * reach_m**2]
    return tuple(sorted(worth, key=lambda gap: -gap.area_m2)[:MOST_GAPS])


# Self-similarity: how like each other a library's places look.

NEIGHBOR_SPACINGS = 1.6  # diagonal ones included
FAR_SPACINGS = 3.0  # further entries are other places
CONFUSED_SHARE = 0.5  # of the likelihood elsewhere, above which an entry with an alias is confused
REACH_RINGS: F64 = np.array([0.5, 0.75, 1.05, 1.6, 2.2, 3.2, 5, 8, 12])  # spacings at which likeness is asked
REACH_NATS = 1.0  # by which a picture is more like entries in its reach than like the median of all


@dataclass(frozen=True, slots=True, eq=False)
class SelfSimilarity:
    """The comparison of a library's L entries with each other, over P distinct places."""

    spacing_m: float  # median distance from an entry to the next one of similar heading
    places: F64  # (P, 2) the middle of the entries at each place
    place_of: I32  # (L,)
    retrieved: F64  # (L,) 1 where the most similar entry at another place is a neighbor, else 0; nan for none
    alias: I32  # (L,) the most similar far entry; -1 for none
    margin: F64  # (L,) nats by which that is less similar than the best neighbor; below 0: aliased; nan
    ambiguity: F64  # (L,) effective number of places that fit as well: exp of the entropy, 1 or more
    confusion: F64  # (L,) share of the likelihood elsewhere that lies at far entries
    rank: I32  # (L,) of the best neighbor among all entries elsewhere, far ones counted; 1 is right
    reach_m: float  # how far a picture still looks like its reference; 0: no entry elsewhere does

    @property
    def confused(self) -> I32:
        """Entries with an alias and most of their likelihood at far entries, those with the most first."""
        worst = np.argsort(-self.confusion, kind="stable")
        is_so = (self.confusion > CONFUSED_SHARE) & (self.margin < 0)
        return np.asarray(worst[is_so[worst]], np.int32)

    @property
    def is_sparse(self) -> bool:
        """Whether the next entry of a similar heading is farther than a picture looks like its reference."""
        return self.spacing_m > self.reach_m

    @property
    def aliased(self) -> I32:
        """Entries with a far entry more similar than any neighbor, worst first."""
        entries = np.flatnonzero(self.margin < 0)
        return np.asarray(entries[np.argsort(self.margin[entries], kind="stable")], np.int32)

    @property
    def retrieved_right(self) -> float:
        """The share of entries whose retrieved entry is a neighbor."""
        known = self.retrieved[np.isfinite(self.retrieved)]
        return float(known.mean()) if len(known) else 0.0

    def at_places(self, values: F64) -> F64:
        """Return the mean (P,) of some values (L,) at each place."""
        count = np.bincount(self.place_of, minlength=len(self.places))
        total = np.bincount(self.place_of, values, len(self.places))
        return np.asarray(total / np.maximum(count, 1))


def self_similarity_of(table: LeftOutTable, progress: Progress | None = None) -> SelfSimilarity:
    """Read every row of a library's leave-one-out table."""
    poses, place_of = table.sensor.library.poses, table.place_of
    spacing_m = max(spacing(table.places), _spacing(table))
    columns: list[list[float]] = []
    likeness: list[F64] = []  # (n, 2) of each entry: distance to others of its heading, nats over the median
    for entry in range(len(poses)):
        others = table.others(entry)
        cost = np.asarray(table.sensor.compare_reference(entry).cost[others], np.float64)
        distance_m, turned = _to_entries(poses, entry, others)
        near = (distance_m <= NEIGHBOR_SPACINGS * spacing_m) & (turned <= SAME_WAY_RAD)
        columns.append(_look_alikes(others, cost, near, distance_m > FAR_SPACINGS * spacing_m))
        columns[-1].append(_ambiguity(place_of[others], cost))
        likeness.append(_likeness(distance_m, turned, cost))
        if progress:
            progress(entry + 1, len(poses))
    retrieved, alias, rank, margin, confusion, ambiguity = np.array(columns).T
    return SelfSimilarity(
        spacing_m=spacing_m,
        places=table.places,
        place_of=place_of,
        retrieved=retrieved,
        alias=alias.astype(np.int32),
        margin=margin,
        ambiguity=ambiguity,
        confusion=confusion,
        rank=rank.astype(np.int32),
        reach_m=_reach_m(np.concatenate(likeness), spacing_m),
    )


def _likeness(distance_m: F64, turned: F64, cost: F64) -> F64:
    """Return (n, 2): how far others of a similar heading are, and by how many nats they look alike."""
    same = turned <= SAME_WAY_RAD
    return (
        np.column_stack([distance_m[same], np.median(cost) - cost[same]]) if len(cost) else np.empty((0, 2))
    )


def _reach_m(likeness: F64, spacing_m: float) -> float:
    """Return how far a picture still looks like its reference, from pairs (n, 2) in growing rings."""
    reach_m, (distance_m, nats) = 0.0, likeness.T
    for outer_m in (REACH_RINGS * spacing_m).tolist():
        ring = (distance_m > reach_m) & (distance_m <= outer_m)
        if ring.any() and np.median(nats[ring]) < REACH_NATS:
            return reach_m
        reach_m = outer_m if ring.any() else reach_m
    return reach_m


def _spacing(table: LeftOutTable) -> float:
    """Return the median distance to the nearest entry elsewhere with a similar heading; 0 for none."""
    nearest, poses = list[float](), table.sensor.library.poses
    for entry in range(len(poses)):
        distance_m, turned = _to_entries(poses, entry, table.others(entry))
        if (turned <= SAME_WAY_RAD).any():
            nearest.append(float(distance_m[turned <= SAME_WAY_RAD].min()))
    return float(np.median(nearest)) if nearest else 0.0


def _to_entries(poses: F64, entry: int, others: Index) -> tuple[F64, F64]:
    """Return distances (n,) in meters and angles (n,) in radians from one entry to others."""
    step = poses[others] - poses[entry]
    return np.hypot(step[:, 0], step[:, 1]), np.abs(wrap(step[:, 2]))


def _look_alikes(others: Index, cost: F64, near: Bool, far: Bool) -> list[float]:
    """Return `retrieved`, `alias`, `rank`, `margin` and `confusion` of one entry, from costs (n,)."""
    if not len(others):
        return [np.nan, -1, 1, np.nan, 0.0]
    retrieved = float(near[cost.argmin()])
    if not far.any():
        return [retrieved, -1, 1, np.nan, 0.0]
    share = np.exp(cost.min() - cost)
    confusion = float(share[far].sum() / share.sum())
    alias = int(others[far][cost[far].argmin()])
    if not near.any():
        return [retrieved, alias, 1, np.nan, confusion]
    best = cost[near].min()
    rank = 1 + int((cost[far] < best).sum())
    return [retrieved, alias, rank, float(cost[far].min() - best), confusion]


def _ambiguity(place_of: I32, cost: F64) -> float:
    """Return how many places fit: exp of the entropy of the places' shares of the likelihood; 1 for none."""
    if not len(cost):
        return 1.0
    share = np.bincount(place_of, np.exp(cost.min() - cost))
    share = share[share > 0] / share.sum()
    return float(np.exp(-(share @ np.log(share))))
