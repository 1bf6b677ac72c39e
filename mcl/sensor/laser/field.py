"""The likelihood field: what a beam that ends in a cell is worth, summed over beams for many poses at once.

The end points of all beams for all poses are two matrix products; `cv2.remap` looks them up, with a value for
what is outside of the map, so that the field needs no padding.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, U8, Bool, OccupancyMap

BLOCK_POSES = 1000  # whose lookups stay in the cache
MOST_CELLS = 32_000  # along an axis: `cv2.remap` numbers cells by 16 bits
MOST_CELLS_APART = 1000  # distances are cut there: the square of more is no exact float32
FINE_CELLS = 4_000_000  # a map with more has its field in bytes: the lookups are bound by memory
BYTE_LEVELS = 255


def cell_distances(blocked: Bool) -> F32:
    """Return how many cells each cell (H, W) is from the nearest blocked one, at most `MOST_CELLS_APART`.

    The last bit of OpenCV's roots is not the same in every process, so they are drawn again.
    """
    return np.asarray(np.sqrt(_squares(blocked)), np.float32)


def _squares(blocked: Bool) -> F32:
    """Return the squares (H, W), whole numbers, of the same."""
    apart = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    apart = np.minimum(apart, np.float32(MOST_CELLS_APART))
    return np.asarray(np.rint(apart * apart), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """How far each cell is from the nearest of some cells, center to center, up to a bound.

    A map has few different distances: what depends on them is computed once for each.
    """

    numbers: NDArray[Any]  # (H, W) of each cell's distance
    meters: F32  # (D,) the distances, ascending

    @classmethod
    def to(cls, blocked: Bool, cell_m: float, most_m: float) -> Distances:
        """Measure from the middles of cells (H, W)."""
        most = int(min(np.ceil((most_m / cell_m) ** 2), MOST_CELLS_APART**2))
        squares = np.minimum(_squares(blocked), np.float32(most))
        numbers = squares.astype(np.uint16 if most < 2**16 else np.uint32)
        meters = np.sqrt(np.arange(most + 1, dtype=np.float32)) * np.float32(cell_m)
        return cls(numbers, np.minimum(meters, np.float32(most_m)))

    def apart_from(self, cells: Bool) -> Distances:
        """Return the same with a number of their own, the last one, for some cells (H, W)."""
        numbers = np.where(cells, np.uint32(len(self.meters)), self.numbers)
        return Distances(numbers, np.append(self.meters, self.meters[-1]))


Worth: TypeAlias = tuple[Distances, NDArray[Any]]  # of each of the distances (D,)


def largest(worth: Sequence[Worth]) -> NDArray[Any]:
    """Return the largest worth (H, W) of each cell by its distances from some kinds of cells."""
    return reduce(np.maximum, (of_each.take(apart.numbers) for apart, of_each in worth))


def look_up(values: F32 | U8, columns: F32, rows: F32, outside: float) -> NDArray[Any]:
    """Return the values of cells, whose middles are at whole numbers; `outside` where there is none."""
    border = cv2.BORDER_CONSTANT
    return cv2.remap(values, columns, rows, cv2.INTER_NEAREST, borderMode=border, borderValue=outside)


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """The worth of a beam by the cell that it ends in: `low + step * values`."""

    values: F32 | U8  # (H, W)
    low: float
    step: float
    outside: float  # the value outside of the map
    cell_m: float
    corner: F64  # (2,) of the map

    @classmethod
    def of(cls, worth: Sequence[Worth], outside: float, occupancy: OccupancyMap) -> Field:
        """Keep the largest worth of each cell: as it is, or on large maps in `BYTE_LEVELS` steps."""
        cell_m, corner = occupancy.cell_m, occupancy.corner
        if occupancy.cells.size <= FINE_CELLS:
            return cls(largest(worth), 0.0, 1.0, outside, cell_m, corner)
        low = min(max(float(nats.min()) for _, nats in worth), outside)
        high = max(*(float(nats.max()) for _, nats in worth), outside)
        step = max(high - low, 1e-9) / BYTE_LEVELS
        levels = [
            (apart, np.rint((nats - np.float32(low)) / np.float32(step)).clip(0).astype(np.uint8))
            for apart, nats in worth
        ]
        return cls(largest(levels), low, step, round((outside - low) / step), cell_m, corner)

    def sums(self, ends: F64, poses: F32, origin: F64) -> F32:
        """Return the worth (N,) of all beams that end at (K, 2) from poses (N, 3) off `origin`."""
        return sums_of((self,), ends, poses, origin)[0]

    def each(self, ends: F64, poses: F32, origin: F64) -> F32:
        """Return the worth (N, K) of every beam."""
        cells = self.cells(ends, poses, origin)
        blocks = [look_up(self.values, columns, rows, self.outside) for _, columns, rows in cells]
        values = np.concatenate(blocks)
        return np.asarray(values * np.float32(self.step) + np.float32(self.low), np.float32)

    def at(self, points: F64) -> F32:
        """Return the worth (K,) of points (K, 2) in the map's frame."""
        return self.each(points - self.corner, np.zeros((1, 3), np.float32), self.corner).ravel()

    def cells(self, ends: F64, poses: F32, origin: F64) -> Iterator[tuple[int, F32, F32]]:
        """Yield the number of the first pose of each block, and its beams' columns and rows (n, K)."""
        scale = np.float32(1 / self.cell_m)
        x, y = ends.T.astype(np.float32) * scale
        column, row = ((origin - self.corner) / self.cell_m - 0.5).astype(np.float32)
        to_column, to_row = np.ones((2, 3, len(x)), np.float32)
        to_column[0], to_row[0], to_row[1] = x, y, x
        np.negative(y, out=to_column[1])
        for start in range(0, len(poses), BLOCK_POSES):
            block = poses[start : start + BLOCK_POSES]
            place = np.empty((len(block), 3), np.float32)
            np.cos(block[:, 2], out=place[:, 0])
            np.sin(block[:, 2], out=place[:, 1])
            place[:, 2] = block[:, 0] * scale + column
            columns = place @ to_column
            place[:, 2] = block[:, 1] * scale + row
            yield start, columns, place @ to_row


def sums_of(fields: Sequence[Field], ends: F64, poses: F32, origin: F64) -> list[F32]:
    """Return the worth (N,) by each of some fields of one map: they share the cells where beams end."""
    totals = [np.empty(len(poses), np.float32) for _ in fields]
    ones = np.ones(len(ends), np.float32)
    for start, columns, rows in fields[0].cells(ends, poses, origin):
        for each, total in zip(fields, totals, strict=True):
            values = look_up(each.values, columns, rows, each.outside)
            if values.dtype == np.float32:
                np.matmul(values, ones, out=total[start : start + len(values)])
            else:  # bytes; a row or a column, by OpenCV's version
                total[start : start + len(values)] = cv2.reduce(
                    values, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F
                ).ravel()
    for each, total in zip(fields, totals, strict=True):
        total *= np.float32(each.step)
        total += np.float32(each.low * len(ends))
    return totals
