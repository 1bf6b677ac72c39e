"""What tuning looks at: distances of pictures whose place is known from all references, in blocks.

Pictures come from drives with truth, or, where there is none, from the library itself, each reference left
out in turn. Blocks are small, so that what is computed from one of them is small too; how many pictures are
taken is bounded by the size of the library.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .channels import CHANNELS
from .distances import DISTANCES
from .library import ChannelIndex, Library
from .selection import SAME_PLACE_M, NearestReference, crosses
from .session import Moment
from .tuning import Sample, true_entry
from .typing import F32, F64, I32

MOST_DISTANCES = 2**25  # numbers kept in all: 128 MiB
MOST_IN_BLOCK = 2**21  # numbers in one sample
NEIGHBORS = 9  # places tried, itself among them, for one that no wall bars
SAME_WAY_RAD = np.pi / 4 * (1 + 1e-6)  # a reference that looks further aside stands for another view

Progress = Callable[[int, int], None]  # pictures done, pictures in all


@dataclass(frozen=True, slots=True, eq=False)
class Measuring:
    """A library, and the channels and distances that its pictures are compared by."""

    library: Library
    distances: Mapping[str, str]  # channel to DISTANCES, in the order of the samples' rows

    def of(self, descriptors: Mapping[str, F32]) -> F32:
        """Give the distances (C, L) of one picture from every reference."""
        index = self.library.index
        rows = [
            DISTANCES[distance](descriptors[name], index[name]) for name, distance in self.distances.items()
        ]
        return np.asarray(rows, np.float32)

    def most_pictures(self) -> int:
        """Give how many pictures are taken at the most, so that memory stays bounded."""
        return max(1, MOST_DISTANCES // (len(self.distances) * self.library.size))


def spread_out(count: int, most: int) -> frozenset[int]:
    """Choose at most so many of the numbers 0 to count - 1, evenly; all, where there are no more."""
    return frozenset(np.linspace(0, count - 1, min(count, most)).round().astype(int).tolist())


def drive_samples(
    measuring: Measuring,
    nearest: NearestReference,
    moments: Iterable[Moment],
    taken: frozenset[int],
    progress: Progress | None = None,
) -> list[Sample]:
    """Measure those pictures of a drive whose number, from 0, is taken and whose truth is in free space."""
    pictures = _of_drive(measuring, nearest, moments, taken)
    return _blocks(_counted(pictures, len(taken), progress), measuring)


def library_samples(measuring: Measuring, most: int, progress: Progress | None = None) -> list[Sample]:
    """Take references for pictures, each compared with all others; at most so many.

    The reference that stands for the truth is at the nearest other place that no wall bars, the one there
    that looks most nearly the same way; a reference without one within 45 degrees is passed over. As it is
    a whole spacing off, where a drive's is half a spacing at the most, scales come out too wide.
    """
    stands_for = neighbors(measuring.library)
    known = np.flatnonzero(stands_for >= 0)
    chosen = [int(known[k]) for k in sorted(spread_out(len(known), most))] if len(known) else []
    pictures = (_left_out(measuring, entry, int(stands_for[entry])) for entry in chosen)
    return _blocks(_counted(pictures, len(chosen), progress), measuring)


def neighbors(library: Library) -> I32:
    """Give for every entry (L,) the one that stands for it when it is left out; -1 for none."""
    places, place_of = _places(library.poses[:, :2])
    if len(places) < 2:
        return np.full(library.size, -1, np.int32)
    beside = _beside(places, library.arena.walls)
    found = np.full(library.size, -1, np.int32)
    at_place = [np.flatnonzero(place_of == place) for place in range(len(places))]
    for entry, place in enumerate(place_of):
        if beside[place] >= 0:
            others = at_place[beside[place]]
            turn = library.poses[others, 2] - library.poses[entry, 2]
            apart = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
            if apart.min() <= SAME_WAY_RAD:
                found[entry] = others[apart.argmin()]
    return found


def _places(xy: F64) -> tuple[F64, I32]:
    rounded = np.round(xy / SAME_PLACE_M).astype(np.int64)
    _, first, place_of = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return xy[first], place_of.astype(np.int32).ravel()


def _beside(places: F64, walls: F64) -> I32:
    """Give for every place (P,) the nearest other one that no wall bars; -1 for none near."""
    near = np.asarray(cKDTree(places).query(places, k=min(NEIGHBORS, len(places)))[1])
    itself = np.arange(len(places))
    found = np.full(len(places), -1, np.int32)
    for other in near.T:
        seen = (found < 0) & (other != itself) & ~crosses(places, places[other], walls)
        found[seen] = other[seen]
    return found


def _of_drive(
    measuring: Measuring, nearest: NearestReference, moments: Iterable[Moment], taken: frozenset[int]
) -> Iterator[tuple[F32, int]]:
    for number, moment in enumerate(moments):
        if number in taken:
            entry = -1 if moment.truth is None else true_entry(nearest, measuring.library, moment.truth)
            image = moment.frame.image
            descriptors = {name: CHANNELS[name].describe(image) for name in measuring.distances}
            yield measuring.of(descriptors), entry


def _left_out(measuring: Measuring, entry: int, truth: int) -> tuple[F32, int]:
    """Compare one reference with all others: distances (C, L - 1), and where the truth's is among them."""
    index: Mapping[str, ChannelIndex] = measuring.library.index
    distances = measuring.of({name: index[name].references[entry] for name in measuring.distances})
    return np.delete(distances, entry, axis=1), truth - (truth > entry)


def _counted(
    pictures: Iterable[tuple[F32, int]], count: int, progress: Progress | None
) -> Iterator[tuple[F32, int]]:
    for done, (distances, truth) in enumerate(pictures, start=1):
        if progress:
            progress(done, count)
        if truth >= 0:
            yield distances, truth


def _blocks(pictures: Iterator[tuple[F32, int]], measuring: Measuring) -> list[Sample]:
    most = max(1, MOST_IN_BLOCK // (len(measuring.distances) * measuring.library.size))
    samples: list[Sample] = []
    rows: list[F32] = []
    truth: list[int] = []
    for distances, entry in pictures:
        rows.append(distances)
        truth.append(entry)
        if len(rows) == most:
            samples.append(_sample(rows, truth))
            rows, truth = [], []
    return [*samples, _sample(rows, truth)] if rows else samples


def _sample(rows: Sequence[F32], truth: Sequence[int]) -> Sample:
    return Sample(np.stack(rows, axis=1), np.array(truth, np.int32))
