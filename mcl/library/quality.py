"""How good a library is, before any run: what it covers, how well it separates its places and fits a drive.

Self-similarity compares each reference with the others by the sensor model's costs in nats. It is retrieved
correctly when the most similar one elsewhere is a neighbor with nearly its heading, and aliased when a far
one is more similar than its neighbors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from ..sensor.ahead import KnownDescriptors, measured
from ..sensor.model import SensorModel
from ..values.arrays import F64, I32, U8, Bool, Progress
from ..values.geometry import rotated, wrap, wrap_angle
from ..values.library import SAME_WAY_RAD, Library
from ..values.map import Grid, make_grid
from ..values.nearest import distinct_places, place_tree, spacing
from ..values.randomness import Domain, stream
from .left_out import WIDENINGS, Index, LeftOutTable

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
    tree, wanted = place_tree(poses[:, :2]), np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    shares = []
    for entries in tree.query_ball_point(chosen, reach_m):
        turned = np.abs(wrap_angle(poses[entries, 2] - wanted[:, None]))
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
    for entry in range(len(poses)):
        others = table.others(entry)
        cost = np.asarray(table.sensor.compare_reference(entry).cost[others], np.float64)
        distance_m, turned = _to_entries(poses, entry, others)
        near = (distance_m <= NEIGHBOR_SPACINGS * spacing_m) & (turned <= SAME_WAY_RAD)
        columns.append(_look_alikes(others, cost, near, distance_m > FAR_SPACINGS * spacing_m))
        columns[-1].append(_ambiguity(place_of[others], cost))
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
    )


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


# A drive whose true poses are known: how well the library explains its pictures.
#
# The gain is the log of the likelihood at the truth over its mean at other poses: what pictures add, in nats,
# to knowing the pose as well as these are spread. Zero is knowing nothing, and below zero they mislead. The
# poses are around the truth, within one, three and ten times the radius *right*, and the library's own: along
# a path of references a picture tells little nearby, and much farther out. A library's own pictures cannot
# show this: they are compared with each other, and those of one survey err alike. So do the pictures that a
# robot takes in a row at one place, which a filter multiplies: together they are one observation.

PICTURES_A_PLACE, MOST_PICTURES = 4, 64  # read at one place, and of a whole drive
LEAST_PICTURES = 24  # of known place in free space, below which nothing is concluded
COMPARED_POSES = 256  # poses that the truth is compared with, of each spread
SPREADS = (1.0, 3.0, 10.0)  # of them, times the radius *right*; then come the library's own poses
HEADING_SD_RAD = float(np.radians(20))  # of the poses around the truth, and the turn that leaves a place
LEAST_GAIN_NATS = 0.05  # nats a picture, below which a sensor is not worth what it misleads
MUTED = 1e4  # a widening by which a likelihood says nothing, however many pictures are multiplied


@dataclass(frozen=True, slots=True, eq=False)
class DrivePicture:
    """A picture of a drive, read when it is asked for, and where it was taken."""

    read: Callable[[], U8 | None]  # (H, W, 3) RGB; None: it cannot be read
    truth: F64  # (3,) in the map's frame
    motions: F64 = field(default_factory=lambda: np.empty((0, 3)))  # (M, 3) since the one before


@dataclass(frozen=True, slots=True)
class DriveScore:
    """What the pictures of a drive say about a library and a sensor's scales."""

    pictures: int  # that were compared, of known place in free space
    gain: float  # mean nats per picture over knowing the pose to within the radius *right*; nan without any
    far_gain: float = np.nan  # the most over knowing it less well, down to not at all; nan without any
    widening: float = 1.0  # of the likelihood, so that it does not mislead; 1: it does not
    tells: bool = True  # whether it is worth using with that widening; if not, it is `MUTED`

    @property
    def muted(self) -> DriveScore:
        """The score of a camera that is not worth using."""
        return replace(self, widening=MUTED, tells=False)

    @property
    def concludes(self) -> bool:
        """Whether enough pictures were compared to say anything."""
        return self.pictures >= LEAST_PICTURES

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        gains = {name: getattr(self, name) for name in ("gain", "far_gain")}
        known = {name: gain if np.isfinite(gain) else None for name, gain in gains.items()}
        return asdict(self) | known | {"is_bad": not self.tells}


def stays(poses: F64, right_m: float) -> list[range]:
    """Divide true poses (n, 3) of a drive into stays, each within a radius and a turn of where it began."""
    found, first = list[range](), 0
    for k, pose in enumerate(poses):
        away, turned = pose[:2] - poses[first, :2], abs(wrap_angle(pose[2] - poses[first, 2]))
        if np.hypot(*away) > right_m or turned > HEADING_SD_RAD:
            found.append(range(first, k))
            first = k
    return [*found, range(first, len(poses))] if len(poses) else []


@dataclass(frozen=True, slots=True, eq=False)
class _Stay:
    """Some pictures of a stay at one place, compared."""

    rows: F64  # (T, N) log-likelihoods, at the truth first
    pictures: int  # of the stay, compared or not

    def gains(self, widening: float = 1.0) -> F64:
        """Return the gain (S,) by spread of all its pictures together, as one observation."""
        return _gains(self.rows.mean(axis=0) * (self.pictures / widening))


def score_drive(
    sensor: SensorModel,
    pictures: Sequence[DrivePicture],
    right_m: float,
    known: KnownDescriptors | None = None,
) -> DriveScore:
    """Score the pictures of a drive, in order, by a sensor's channels.

    A few places are enough where all agree with the library; otherwise more are compared.
    """
    offsets, compared = _offsets(right_m), dict[range, _Stay | None]()

    def compare(stay: range) -> _Stay | None:
        rows = [_log_likelihoods(sensor, pictures[k], offsets, known) for k in _some(stay, PICTURES_A_PLACE)]
        inside = [row for row in rows if row is not None and np.isfinite(row[0])]
        return _Stay(np.array(inside), len(stay)) if inside else None

    def at(some: Sequence[range]) -> list[_Stay]:
        compared.update((stay, compare(stay)) for stay in some if stay not in compared)
        return [found for stay in some if (found := compared[stay]) is not None]

    chosen = _chosen(stays(np.array([picture.truth for picture in pictures]), right_m))
    quick = at(_some(chosen, LEAST_PICTURES))
    if quick and (score := _score(quick)).concludes and _surely_gain(quick):
        return score
    every = at(chosen)
    if not every:
        return DriveScore(0, np.nan)
    score = _score(every)
    if not score.concludes or _gain_of(every).min() >= LEAST_GAIN_NATS:
        return score
    gains = np.array([_gain_of(every, k) for k in WIDENINGS.tolist()])  # (K, S)
    best = int(gains.mean(axis=1).argmax())
    least = LEAST_GAIN_NATS * float(np.mean([stay.pictures for stay in every]))
    tells = best < len(gains) - 1 and bool(gains[best].max() >= least)
    return replace(score, widening=float(f"{WIDENINGS[best]:.3g}")) if tells else score.muted


def _chosen(every: Sequence[range]) -> Sequence[range]:
    """Return as many stays, evenly spread, as hold no more pictures than are compared."""
    each = sum(min(len(stay), PICTURES_A_PLACE) for stay in every) / max(len(every), 1)
    return _some(every, int(MOST_PICTURES / max(each, 1)))


def _some(values: Sequence[Any], most: int) -> list[Any]:
    """Return at most so many values, evenly spread."""
    count = min(most, len(values))
    return [values[k] for k in np.linspace(0, len(values) - 1, count).round().astype(int).tolist()]


def _gain_of(some: Sequence[_Stay], widening: float = 1.0) -> F64:
    """Return the mean gain (S,) by spread of stays, each as one observation."""
    return np.asarray(np.mean([stay.gains(widening) for stay in some], axis=0), np.float64)


def _surely_gain(some: Sequence[_Stay]) -> bool:
    """Whether stays gain enough over every spread, by a standard error more than that."""
    gains = np.array([stay.gains() for stay in some])
    error = gains.std(axis=0) / np.sqrt(len(gains))
    return bool((gains.mean(axis=0) - error).min() >= LEAST_GAIN_NATS)


def _score(some: Sequence[_Stay]) -> DriveScore:
    """Return what single pictures of some stays gain; each stay counts alike."""
    gains = [np.mean([_gains(row) for row in stay.rows], axis=0) for stay in some]
    near, *far = np.mean(gains, axis=0).tolist()
    return DriveScore(sum(len(stay.rows) for stay in some), near, max(far))


def _offsets(right_m: float) -> F64:
    """Return poses (1 + S * (COMPARED_POSES - 1), 3) about the origin: itself, then those of each spread."""
    sd = np.array([right_m, right_m, HEADING_SD_RAD])
    offsets = stream(Domain.COMPARE, 0).standard_normal((COMPARED_POSES, 3)) * sd
    wider = [offsets[1:] * [spread, spread, min(spread, 3.0)] for spread in SPREADS]
    return np.concatenate([np.zeros((1, 3)), *wider])


def _log_likelihoods(
    sensor: SensorModel, picture: DrivePicture, offsets: F64, known: KnownDescriptors | None
) -> F64 | None:
    """Return the log-likelihood (N,) at the truth, which is first, at poses around it, and at references."""
    image = picture.read()
    if image is None:
        return None
    origin = sensor.library.origin
    x, y, heading = picture.truth - [*origin, 0.0]
    ahead, aside = rotated(offsets[:, 0], offsets[:, 1], heading)
    poses = np.column_stack([x + ahead, y + aside, wrap(heading + offsets[:, 2])]).astype(np.float32)
    comparison = sensor.compare(measured(image, sensor.weights, known)[0])
    around = sensor.references.at(comparison.of_references, poses, origin)
    return np.concatenate([around, comparison.log_likelihood[: sensor.library.size]]).astype(np.float64)


def _gains(row: F64) -> F64:
    """Return the gain (S,) by spread of log-likelihoods (N,); poses outside do not count."""
    ends = 1 + (COMPARED_POSES - 1) * np.arange(1, len(SPREADS) + 1)
    parts = np.split(row[1:], ends - 1)
    return np.array([_gain(np.concatenate([row[:1], part])) for part in parts])


def _gain(row: F64) -> float:
    """Return the log of the likelihood (N,) at the first pose over its mean; poses outside do not count."""
    inside = row[np.isfinite(row)]
    return float(row[0] - inside.max() - np.log(np.exp(inside - inside.max()).mean()))
