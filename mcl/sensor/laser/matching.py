"""Where on a map one scan was taken: correlative scan matching over all poses, from coarse to fine.

A box of poses is rated by the most that its poses near the middle could be worth, read from a pyramid of
max-pooled fields, and the best boxes are divided, as in branch and bound (Olson, ICRA 2009 and 2015; Hess et
al., ICRA 2016). Pooled over the entire box a rating would be a bound, and so loose that among a limited
number of boxes the true one drowns: pooled over half of it, as many boxes find the true pose in 98 instead of
80 of 100 scans.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, I64, UNKNOWN, Bool, OccupancyMap, PoseProposal, wrap_angle
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
LEVELS_ABOVE = 3  # the smallest boxes, each with twice the side and turn; more on large maps
MOST_ROOTS = 120_000  # boxes of the coarsest level
KEPT_BOXES = (1000, 2000, 4000, 8000)  # boxes of the smallest but one level and those above that are divided
POOLED_SHARE = 0.5  # of a box, around its middle
BLOCK_BOXES = 1024
POOLED_CELLS, LAYERS = 4, 8  # cells around each one in a pooled layer; layers, each with cells twice as wide
FAR_M = 1.0  # from what is occupied: beams that end farther off are worth the same

MOST_MATCHES = 1000  # of the best poses, whose beams are followed through the map
THROUGH_M = 0.4  # a beam that the map would have ended by so much earlier went through a wall
THROUGH_NATS = -1.0  # of such a beam
WINDOW_NATS = 8.0  # poses so far below the best one count nothing
MOST_MODES = 20
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
        """Return the modes of the likelihood, with its mass, mean and covariance around each."""
        near = self.nats > self.nats[0] - WINDOW_NATS
        poses, mass = self.poses[near], np.exp(self.nats[near] - self.nats[0])
        left = np.ones(len(poses), bool)
        means, covariances, weights = list[F64](), list[F64](), list[float]()
        while left.any() and len(means) < MOST_MODES:
            best = poses[np.argmax(left)]
            away = poses - best
            away[:, 2] = wrap_angle(away[:, 2])
            part = left & (np.hypot(away[:, 0], away[:, 1]) < MODE_M) & (np.abs(away[:, 2]) < MODE_RAD)
            share = mass[part] / mass[part].sum()
            mean = share @ away[part]
            off = away[part] - mean
            means.append(best + mean)
            covariances.append((off.T * share) @ off + np.diag(self.cell**2 / 12))
            weights.append(float(mass[part].sum()))
            left &= ~part
        modes = np.array(means)
        modes[:, 2] = wrap_angle(modes[:, 2])
        return PoseProposal(modes, np.array(covariances), np.array(weights) / sum(weights))


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

    A search takes about 60 ms. Maps of more than 4 million cells (100 m by 100 m at 5 cm) are coarsened, so
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
        if len(points) < LEAST_HITS or not self.occupancy.free.any():
            return None
        count = min(len(points), MOST_POINTS)
        points = points[(2 * np.arange(count) + 1) * len(points) // (2 * count)]
        independent = min(1.0, INDEPENDENT_BEAMS / count)
        boxes, level = self._roots()
        while level:
            rating = self._rated(boxes, points, level)
            most = KEPT_BOXES[min(level, len(KEPT_BOXES)) - 1]
            if len(rating) > most:
                order = np.argpartition(-rating, most)
                boxes = boxes[:, order[:most]]
            level -= 1
            boxes = self._divided(boxes, level)
        nats = self._rated(boxes, points, 0)
        best = np.argsort(-nats, kind="stable")[:MOST_MATCHES]
        rows, columns, turns = boxes[:, best]
        x_m, y_m = self.occupancy.corner[:, None] + (np.stack([columns, rows]) + 0.5) * self._leaf_m
        turn_rad = 2 * np.pi / HEADINGS
        poses = np.column_stack([x_m, y_m, wrap_angle((turns + 0.5) * turn_rad)])
        through = self._through(poses, points, np.zeros(3) if mount is None else mount)
        total = (nats[best] + THROUGH_NATS * through) * independent
        order = np.argsort(-total, kind="stable")
        cell = np.array([self._leaf_m, self._leaf_m, turn_rad])
        return Matches(poses[order], total[order], cell)

    # The search: boxes are rows, columns and turns (3, N) on a grid that depends on their level.

    def _roots(self) -> tuple[I64, int]:
        """Return the boxes to begin with, and their level."""
        level = LEVELS_ABOVE
        while self._free(level).sum() * _headings(level) > MOST_ROOTS:
            level += 1
        rows, columns = np.nonzero(self._free(level))
        turns = np.repeat(np.arange(_headings(level)), len(rows))
        return np.stack([np.tile(rows, _headings(level)), np.tile(columns, _headings(level)), turns]), level

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
        away_m = POOLED_SHARE / 2 * (side_m + np.hypot(*points.T) * turn_rad)
        reaches = [layer.reach_m - layer.cell_m for layer in self._layers[1:-1]]  # less what is rounded
        which = 1 + np.searchsorted(reaches, away_m) if level else np.zeros(len(points), np.int64)
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
        return self._cell_m * max(1, round(LEAF_M / self._cell_m))

    @cached_property
    def _free_boxes(self) -> dict[int, Bool]:
        return {}

    def _free(self, level: int) -> Bool:
        """Return in which boxes (rows, columns) of a level a robot can be."""
        if level not in self._free_boxes:
            side = round(self._leaf_m * 2**level / self.occupancy.cell_m)
            self._free_boxes[level] = _any(self.occupancy.free, side)
        return self._free_boxes[level]

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
        pooled = (self._layer(worth, 2**power, POOLED_CELLS) for power in range(LAYERS))
        return [self._layer(worth, 1, 0), *pooled]

    def _layer(self, worth: F32, stride: int, pooled: int) -> _Layer:
        """Pool the field over blocks of `stride` cells, and `pooled` blocks around each."""
        blocks = cv2.dilate(
            _blocks(worth, stride, UNKNOWN_NATS).max(axis=(1, 3)), np.ones((2 * pooled + 1,) * 2)
        )
        cell_m = stride * self._cell_m
        margin = int(REACH_M / cell_m) + pooled + 2
        padded: F32 = np.pad(blocks, margin, constant_values=UNKNOWN_NATS).astype(np.float32, copy=False)
        return _Layer(padded.ravel(), padded.shape[1], margin, cell_m, (pooled + 0.5) * cell_m)


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
