"""Where on a map one scan was taken: correlative scan matching over all poses, from coarse to fine.

A box of poses is rated by the most that its poses near the middle could be worth, read from a pyramid of
max-pooled fields, and the best boxes are divided, as in branch and bound (Olson, ICRA 2009 and 2015; Hess et
al., ICRA 2016). Pooled over the entire box a rating would be a bound, and so loose that among a limited
number of boxes the true one drowns: pooled over half of it, as many boxes find the true pose in 98 instead of
80 of 100 scans.

The coarsest boxes are all rated, also those of a large map: boxes of several meters would lose the true one
in half of the scans. Each point adds a shifted picture of the map to the ratings of all boxes of a heading,
which takes a tenth of the time that looking each of them up would. Besides the best boxes of all, the best of
each tile are divided: where cells are occupied here and there, as outdoors behind windows, all boxes have the
highest rating.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, I16, I64, UNKNOWN, Bool, OccupancyMap, PoseProposal, wrap_angle
from .field import Distances, largest
from .models import SIGMA_M, UNKNOWN_NATS, laser_map, worth_of
from .parameters import LaserParameters
from .rays import Rays
from .reading import LEAST_HITS

MOST_POINTS = 60  # of a scan that are compared, evenly chosen
REACH_M = 25.0  # points farther off are left out: the field's margin is as wide
MOST_CELLS = 2**22  # of the field; finer maps are coarsened
MOST_PADDED = 6 * 2**22  # with its margin, which takes more cells the finer they are
LEAF_M, HEADINGS = 0.1, 384  # side of the smallest boxes, and how many headings they have
COARSEST = 3  # levels above the smallest boxes, each with twice the side and turn
KEPT_BOXES = (1000, 2000, 4000)  # boxes of the smallest but one level and those above that are divided
KEPT_OF_TILE = (4, 4, 8)  # the same of each tile, also where others are better
TILE = 4  # the coarsest boxes along its side
ROOM_M, ROOM_SHARE = 0.45, 0.6  # a robot is in a square of this side that is free to such a share
STEPS_A_NAT = 200  # of the coarsest ratings, which are whole numbers of 16 bits
RULED_OUT = np.iinfo(np.int16).min  # the rating where no robot can be
POOLED_SHARE = 0.5  # of a box, around its middle
BLOCK_BOXES = 1024
# Of pooled layers: cells in one of theirs along an axis, and how many of those are pooled.
POOLED = ((1, 1), (1, 2), *((2**power, 4) for power in range(8)))
FAR_M = 1.0  # from what is occupied: beams that end farther off are worth the same

FIRST_MATCHES = 200  # of the best poses, whose beams are followed through the map to see which others count
MOST_MATCHES = 4000  # poses that count; of more, as along corridors, evenly chosen ones
THROUGH_M = 0.4  # a beam that the map would have ended by so much earlier went through a wall
THROUGH_NATS = -1.0  # of such a beam
WINDOW_NATS = 8.0  # poses so far below the best one count nothing
MOST_MODES, MOST_LEFT_OUT = 20, 0.05  # and share of the likelihood that may be in none of them
# of a scan's errors: fitted so that covariances and weights hold on four logs, with maps of other scans too
INDEPENDENT_BEAMS = 30.0
MODE_M, MODE_RAD = 0.6, float(np.radians(12))  # poses nearer to a mode's best one are part of it


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """The poses of a fine grid where a scan fits best, the best first."""

    poses: F64  # (N, 3) in the map's frame
    nats: F64  # (N,) log-likelihoods, of as many beams as are independent
    cell: F64  # (3,) sides of the grid in meters, meters and radians

    def proposal(self) -> PoseProposal:
        """Return the modes of the likelihood, with its mass, mean and covariance around each.

        Where a scan fits in more places than there may be modes, as along a corridor, modes are wider.
        """
        near = self.nats > self.nats[0] - WINDOW_NATS
        poses, mass = self.poses[near], np.exp(self.nats[near] - self.nats[0])
        radius_m, parts = MODE_M, _parts(poses, MODE_M)
        while mass[parts < 0].sum() > MOST_LEFT_OUT * mass.sum():
            radius_m *= 2
            parts = _parts(poses, radius_m)
        means, covariances, weights = list[F64](), list[F64](), list[float]()
        for number in range(parts.max() + 1):
            inside = np.flatnonzero(parts == number)
            away = _away(poses[inside], poses[inside[0]])
            share = mass[inside] / mass[inside].sum()
            mean = share @ away
            off = away - mean
            means.append(poses[inside[0]] + mean)
            covariances.append((off.T * share) @ off + np.diag(self.cell**2 / 12))
            weights.append(float(mass[inside].sum()))
        modes = np.array(means)
        modes[:, 2] = wrap_angle(modes[:, 2])
        return PoseProposal(modes, np.array(covariances), np.array(weights) / sum(weights))


def _parts(poses: F64, radius_m: float) -> I64:
    """Return the number (N,) of the mode that each pose (N, 3) is part of; -1 where modes ran out.

    A mode is what is near its best pose, the best of those left.
    """
    parts, left = np.full(len(poses), -1), np.ones(len(poses), bool)
    for number in range(MOST_MODES):
        if not left.any():
            break
        away = _away(poses, poses[np.argmax(left)])
        part = left & (np.hypot(away[:, 0], away[:, 1]) < radius_m) & (np.abs(away[:, 2]) < MODE_RAD)
        parts[part] = number
        left &= ~part
    return parts


def _away(poses: F64, pose: F64) -> F64:
    away = poses - pose
    away[:, 2] = wrap_angle(away[:, 2])
    return away


@dataclass(frozen=True, slots=True, eq=False)
class _Layer:
    """A field, pooled: cells hold the most worth within `reach_m` of their middle along each axis."""

    worth: F32  # (cells,) row after row
    columns: int
    margin: int  # cells around the map
    cell_m: float
    reach_m: float


@dataclass(frozen=True, eq=False)
class Matcher:
    """A map, prepared for finding where scans were taken. Robots are in free cells; unknown ones are neutral.

    A search takes 30 to 100 ms. Maps of more than 4 million cells (100 m by 100 m at 5 cm) are coarsened, so
    that time and memory are bounded.
    """

    occupancy: OccupancyMap

    def propose(self, points: F64, mount: F64 | None = None) -> PoseProposal | None:
        """Return where a robot was whose scan hit points (K, 2) in its frame; None where they do not tell.

        `mount` (3,) is the laser's pose on the robot.
        """
        matches = self.search(points, mount)
        return None if matches is None else matches.proposal()

    def search(self, points: F64, mount: F64 | None = None) -> Matches | None:
        """Return the poses where a scan fits best; None where too few points are hit or no cell is free."""
        points = points[np.hypot(*points.T) < REACH_M]
        mount = np.zeros(3) if mount is None else mount
        if len(points) < LEAST_HITS or not self._room.any():
            return None
        count = min(len(points), MOST_POINTS)
        points = points[(2 * np.arange(count) + 1) * len(points) // (2 * count)]
        boxes = self._coarsest(points)
        for level in reversed(range(COARSEST)):
            boxes = self._divided(boxes, level)
            if level:
                boxes = boxes[:, _best(boxes, self._rated(boxes, points, level), level)]
        share = min(1.0, INDEPENDENT_BEAMS / count)
        nats = self._rated(boxes, points, 0) * np.float32(share)
        order = np.argsort(-nats, kind="stable")
        boxes, nats = boxes[:, order], nats[order]
        first = slice(FIRST_MATCHES)
        through = THROUGH_NATS * share * self._through(self._poses(boxes[:, first]), points, mount)
        best = float((nats[first] + through).max())
        near = max(int(np.count_nonzero(nats > best - WINDOW_NATS)), min(FIRST_MATCHES, len(nats)))
        some = np.arange(near)[:: -(-near // MOST_MATCHES)]
        poses = self._poses(boxes[:, some])
        total = nats[some] + THROUGH_NATS * share * self._through(poses, points, mount)
        order = np.argsort(-total, kind="stable")
        cell = np.array([self._leaf_m, self._leaf_m, 2 * np.pi / HEADINGS])
        return Matches(poses[order], total[order], cell)

    def _poses(self, boxes: I64) -> F64:
        """Return the middles (N, 3) of the smallest boxes."""
        rows, columns, turns = boxes
        x_m, y_m = self.occupancy.corner[:, None] + (np.stack([columns, rows]) + 0.5) * self._leaf_m
        return np.column_stack([x_m, y_m, wrap_angle((turns + 0.5) * (2 * np.pi / HEADINGS))])

    # The search: boxes are rows, columns and turns (3, N) on a grid that depends on their level.

    def _coarsest(self, points: F64) -> I64:
        """Return the best boxes of the coarsest level."""
        free, headings = self._free(COARSEST), _headings(COARSEST)
        height, width = free.shape
        shifts = self._shifts(points)
        ratings = np.zeros((headings, height, width), np.int16)
        for turn, rating in enumerate(ratings):
            for phases, places in shifts:
                first_row, row, first_column, column = places[turn]
                rating += phases[first_row, first_column, row : row + height, column : column + width]
        ratings[:, ~free] = RULED_OUT
        best = _largest(ratings.ravel(), KEPT_BOXES[-1])
        best = np.union1d(best, _of_tiles(ratings, KEPT_OF_TILE[-1]))
        turns, rows, columns = np.unravel_index(best, ratings.shape)
        boxes = np.stack([rows, columns, turns])
        return boxes[:, free[rows, columns]]

    def _shifts(self, points: F64) -> list[tuple[I16, list[list[int]]]]:
        """Return for each point a layer by phases, and for each turn where in it the ratings begin."""
        turn_rad = 2 * np.pi / _headings(COARSEST)
        headings = (np.arange(_headings(COARSEST)) + 0.5) * turn_rad
        cos, sin = np.cos(headings), np.sin(headings)
        shifts = list[tuple[I16, list[list[int]]]]()
        for number, (x_m, y_m) in zip(self._layer_of(points, COARSEST).tolist(), points, strict=True):
            layer, phases = self._layers[number], self._phases(number)
            stride, x, y = len(phases), x_m / layer.cell_m, y_m / layer.cell_m
            middle = layer.margin + stride // 2
            row, column = np.floor([sin * x + cos * y, cos * x - sin * y]).astype(int) + middle
            places = np.stack([row % stride, row // stride, column % stride, column // stride], axis=1)
            shifts.append((phases, places.tolist()))
        return shifts

    def _phases(self, number: int) -> I16:
        """Return a layer as pictures (S, S, rows, columns) with a cell for each of the coarsest boxes."""
        if number not in self._pictures:
            layer = self._layers[number]
            steps = np.rint(layer.worth * np.float32(STEPS_A_NAT)).astype(np.int16)
            stride = round(self._leaf_m * 2**COARSEST / layer.cell_m)
            blocks = _blocks(steps.reshape(-1, layer.columns), stride, 0)
            self._pictures[number] = np.ascontiguousarray(blocks.transpose(1, 3, 0, 2))
        return self._pictures[number]

    @cached_property
    def _pictures(self) -> dict[int, I16]:
        return {}

    def _layer_of(self, points: F64, level: int) -> I64:
        """Return the layers (K,) in which points (K, 2) are looked up: pooled as far as a box moves them."""
        if not level:
            return np.zeros(len(points), np.int64)
        side_m, turn_rad = self._leaf_m * 2**level, 2 * np.pi / _headings(level)
        away_m = POOLED_SHARE / 2 * (side_m + np.hypot(*points.T) * turn_rad)
        reaches = [layer.reach_m - layer.cell_m for layer in self._layers[1:-1]]  # less what is rounded
        return np.asarray(1 + np.searchsorted(reaches, away_m))

    def _divided(self, boxes: I64, level: int) -> I64:
        """Return the parts of boxes that are now at `level` in which a robot can be."""
        eight = np.stack(np.unravel_index(np.arange(8), (2, 2, 2)))
        parts = (2 * boxes[:, :, None] + eight[:, None]).reshape(3, -1)
        free = self._free(level)
        rows, columns, _ = parts
        inside = (rows < free.shape[0]) & (columns < free.shape[1])
        parts = parts[:, inside]
        return parts[:, free[parts[0], parts[1]]]

    def _rated(self, boxes: I64, points: F64, level: int) -> F32:
        """Return the nats of boxes (3, N): of their middles at level 0, else the most near them."""
        side_m, turn_rad = self._leaf_m * 2**level, 2 * np.pi / _headings(level)
        which = self._layer_of(points, level)
        order = np.argsort(boxes[2], kind="stable")
        rows, columns, turns = boxes[:, order]
        headings = (np.arange(_headings(level)) + 0.5) * turn_rad
        cos, sin = np.cos(headings)[:, None], np.sin(headings)[:, None]
        total = np.zeros(len(order), np.float32)
        for number in np.unique(which):
            layer, (x, y) = self._layers[number], points[which == number].T / self._layers[number].cell_m
            scale = side_m / layer.cell_m
            within = 0.5 * scale % 1 if scale >= 1 else 0.5  # a cell, where boxes have their middles
            ends = np.floor(sin * x + cos * y + within) * layer.columns + np.floor(cos * x - sin * y + within)
            ends = ends.astype(np.int32)
            row, column = (
                ((index + 0.5) * scale).astype(np.int32) + layer.margin for index in (rows, columns)
            )
            place, ones = row * np.int32(layer.columns) + column, np.ones(len(x), np.float32)
            for start in range(0, len(order), BLOCK_BOXES):
                part = slice(start, start + BLOCK_BOXES)
                cells = ends[turns[part]]
                cells += place[part, None]
                with np.errstate(invalid="ignore"):  # a BLAS may flag what it pads with
                    total[part] += layer.worth.take(cells, mode="clip") @ ones
        nats = np.empty_like(total)
        nats[order] = total
        return nats

    def _through(self, poses: F64, points: F64, mount: F64) -> I64:
        """Return how many beams (N,) to points (K, 2) pass through walls from poses (N, 3)."""
        beams = points - mount[:2]
        measured_m = np.hypot(*beams.T)
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        lasers = poses + np.stack(
            [cos * mount[0] - sin * mount[1], sin * mount[0] + cos * mount[1], 0 * cos], axis=1
        )
        expected_m = self._rays.cast(lasers, np.arctan2(beams[:, 1], beams[:, 0]), float(measured_m.max()))
        through: I64 = (measured_m > expected_m + THROUGH_M).sum(axis=1)
        return through

    # What is made of the map once.

    @cached_property
    def _factor(self) -> int:
        """How many of the map's cells along an axis are one of the field."""
        sides = np.array(self.occupancy.cells.shape)
        padded = sides + 2 * REACH_M / self.occupancy.cell_m
        shares = sides.prod() / MOST_CELLS, padded.prod() / MOST_PADDED
        return max(1, int(np.ceil(np.sqrt(max(shares)))))

    @property
    def _cell_m(self) -> float:
        return self.occupancy.cell_m * self._factor

    @property
    def _leaf_m(self) -> float:
        """The side of the smallest boxes: a power of two cells, so that boxes divide the layers evenly."""
        return self._cell_m * float(2 ** max(0, round(math.log2(LEAF_M / self._cell_m))))

    @cached_property
    def _free_boxes(self) -> dict[int, Bool]:
        return {}

    def _free(self, level: int) -> Bool:
        """Return in which boxes (rows, columns) of a level a robot can be."""
        if level not in self._free_boxes:
            side = round(self._leaf_m * 2**level / self.occupancy.cell_m)
            self._free_boxes[level] = _any(self._room, side)
        return self._free_boxes[level]

    @cached_property
    def _room(self) -> Bool:
        """Which cells (H, W) are free, and most of those around them: not a single ray's."""
        free = self.occupancy.free
        cells = round(ROOM_M / self.occupancy.cell_m) // 2 * 2 + 1
        return np.asarray(free & (cv2.blur(free.astype(np.float32), (cells, cells)) >= ROOM_SHARE))

    @cached_property
    def _rays(self) -> Rays:
        return laser_map(self.occupancy, LaserParameters()).open_rays

    @cached_property
    def _layers(self) -> list[_Layer]:
        """The field, and the field pooled around every, every second, fourth, ... of its cells."""
        occupied = _any(self.occupancy.occupied, self._factor)
        known = occupied | _any(self.occupancy.free, self._factor)
        cells = np.where(known, occupied, UNKNOWN).astype(np.uint8)
        grid = OccupancyMap(cells, self._cell_m, self.occupancy.corner)
        walls, edges = (Distances.to(cells, self._cell_m, FAR_M) for cells in (grid.occupied, grid.unknown))
        worth = largest(worth_of(walls, edges, SIGMA_M))
        return [self._layer(worth, stride, pooled) for stride, pooled in ((1, 0), *POOLED)]

    def _layer(self, worth: F32, stride: int, pooled: int) -> _Layer:
        """Pool the field over blocks of `stride` cells, and `pooled` blocks around each."""
        blocks = cv2.dilate(
            _blocks(worth, stride, UNKNOWN_NATS).max(axis=(1, 3)), np.ones((2 * pooled + 1,) * 2)
        )
        cell_m = stride * self._cell_m
        margin = int(REACH_M / cell_m) + pooled + 2
        padded: F32 = np.pad(blocks, margin, constant_values=UNKNOWN_NATS).astype(np.float32, copy=False)
        return _Layer(padded.ravel(), padded.shape[1], margin, cell_m, (pooled + 0.5) * cell_m)


def _largest(values: NDArray[Any], count: int) -> I64:
    """Return the numbers of the largest of some values (N,), at most `count` of them."""
    if len(values) <= count:
        return np.arange(len(values))
    return np.asarray(np.argpartition(values, len(values) - count)[-count:])


def _of_tiles(ratings: I16, count: int) -> I64:
    """Return flat numbers of the coarsest ratings (T, H, W): of each tile the best `count` places."""
    _, height, width = ratings.shape
    turns = ratings.argmax(axis=0)
    best = np.take_along_axis(ratings, turns[None], axis=0)[0]
    numbers = turns * (height * width) + np.arange(height * width).reshape(height, width)
    tiles = _blocks(best, TILE, RULED_OUT).transpose(0, 2, 1, 3).reshape(-1, TILE * TILE)
    numbers = _blocks(numbers, TILE, 0).transpose(0, 2, 1, 3).reshape(-1, TILE * TILE)
    which = np.argpartition(tiles, TILE * TILE - count, axis=1)[:, -count:]
    kept = np.take_along_axis(tiles, which, axis=1) > RULED_OUT
    return np.asarray(np.take_along_axis(numbers, which, axis=1)[kept])


def _best(boxes: I64, ratings: F32, level: int) -> I64:
    """Return which boxes (3, N) of a level are divided: the best of all, and of each tile."""
    best = _largest(ratings, KEPT_BOXES[level - 1])
    if len(best) == len(ratings):
        return best
    rows, columns = boxes[:2] // (TILE << (COARSEST - level))
    tiles = rows * (columns.max() + 1) + columns
    order = np.lexsort((-ratings, tiles))
    first = np.searchsorted(tiles[order], tiles[order])  # of the same tile
    return np.union1d(best, order[np.arange(len(order)) - first < KEPT_OF_TILE[level - 1]])


def _headings(level: int) -> int:
    return HEADINGS >> level


def _any(cells: Bool, side: int) -> Bool:
    """Return whether any of `side` x `side` cells is true."""
    return np.asarray(_blocks(cells, side, False).any(axis=(1, 3)))


def _blocks(cells: NDArray[Any], side: int, beyond: float) -> NDArray[Any]:
    """Return blocks of cells, (rows, side, columns, side), with a value for what is beyond the grid."""
    height, width = cells.shape
    padded = np.pad(cells, ((0, -height % side), (0, -width % side)), constant_values=beyond)
    return padded.reshape(padded.shape[0] // side, side, -1, side)
