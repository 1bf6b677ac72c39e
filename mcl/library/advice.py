"""What a library lacks, before anyone drives: places that will be confused, and which references to add.

A reference whose place is left out stands for a picture that a robot takes near it. It is confused as far as
the likelihood of the others lies beyond `FAR` spacings. References are proposed in three steps: where free
space has none within a spacing, where one of eight headings has none, and between places that are confused.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_matrix

from ..values import F64, Bool, Library, distinct_places, place_tree, wrap
from .left_out import ONE_PLACE
from .quality import DIRECTIONS, VIEW_RAD, SelfSimilarity, free_space

GAP, HEADING, AMBIGUITY = "gap", "heading", "ambiguity"
FILLED_SPACINGS = 0.75  # by a new reference: a grid of references reaches 0.71 of its spacing
LEAST_AREA_SPACINGS = 0.1  # squared, that a new reference adds at least
APART_SPACINGS = 0.5  # from a new place against ambiguity to any other
MOST_POINTS = 4000  # of free space that are looked at
MOST_ADDED = 1000
MOST_CLEARANCE_M = 0.3  # a place further from walls is free enough


@dataclass(frozen=True, slots=True)
class Confusion:
    """A reference that stands for pictures which will be taken for another place."""

    entry: int
    like: int  # the most similar far entry
    apart_m: float
    share: float  # of the likelihood that lies at far places: the probability of confusion, by one picture
    rank: int  # of the best neighbor among all entries elsewhere: 1 is right


@dataclass(frozen=True, slots=True)
class MissingHeadings:
    """A place with references, but not in all directions."""

    x_m: float
    y_m: float
    headings_rad: tuple[float, ...]  # that no reference within a spacing has


@dataclass(frozen=True, slots=True, eq=False)
class ProposedReference:
    """A reference to add."""

    pose: F64  # (3,) meters and radians
    why: str  # "gap", "heading" or "ambiguity"


@dataclass(frozen=True, slots=True)
class LibraryAdvice:
    """Where a library will mislead, and what would help."""

    confusions: tuple[Confusion, ...]  # worst first
    missing: tuple[MissingHeadings, ...]  # most headings first
    added: tuple[ProposedReference, ...]  # in the order in which they help most

    def count(self, why: str) -> int:
        """Return how many references are proposed for one reason."""
        return sum(reference.why == why for reference in self.added)


def advise(library: Library, similarity: SelfSimilarity) -> LibraryAdvice:
    """Say where a library's places will be confused, and which references to add."""
    confusions = _confusions(library, similarity)
    planned = _Planned.of(library, similarity.spacing_m)
    missing = planned.missing(similarity.places)
    planned.fill()
    planned.part(library, [confusion.entry for confusion in confusions])
    return LibraryAdvice(confusions, missing, tuple(planned.added))


def _confusions(library: Library, similarity: SelfSimilarity) -> tuple[Confusion, ...]:
    alias = similarity.alias
    apart_m = np.hypot(*(library.poses[alias, :2] - library.poses[:, :2]).T)
    return tuple(
        Confusion(
            k, int(alias[k]), float(apart_m[k]), float(similarity.confusion[k]), int(similarity.rank[k])
        )
        for k in similarity.confused.tolist()
    )


def without_reference(points: F64, poses: F64, reach_m: float) -> Bool:
    """Return (G, DIRECTIONS): whether no pose (L, 3) within reach of a point (G, 2) looks that way."""
    lacking = np.ones((len(points), DIRECTIONS), bool)
    for number, direction in enumerate(headings()):
        these = poses[np.abs(wrap(poses[:, 2] - direction)) <= VIEW_RAD / 2 + 1e-6]
        if len(these):
            lacking[:, number] = _distance(these, points) > reach_m * (1 + 1e-6)
    return lacking


def headings() -> F64:
    """Return the headings (DIRECTIONS,) that a place needs."""
    return np.asarray(wrap(np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS), np.float64)


@dataclass(slots=True, eq=False)
class _Planned:
    """References that are there or proposed, and what of the free space they leave."""

    poses: F64  # (L, 3) there
    spacing_m: float
    points: F64  # (G, 2) of free space that a robot can reach
    standing: F64  # (S, 2) those of them that are free enough to stand at
    area_m2: float  # that a point stands for
    lacking: Bool  # (G, DIRECTIONS)
    added: list[ProposedReference] = field(default_factory=list)

    @classmethod
    def of(cls, library: Library, spacing_m: float) -> _Planned:
        """Look at a library's free space."""
        grid, free, _ = free_space(library)
        clear_m = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1].ravel() * grid.cell_m
        every = max(int(np.ceil(np.sqrt(free.sum() / MOST_POINTS))), 1)
        rows, columns = np.indices(free.shape)
        on_lattice = (rows % every == 0) & (columns % every == 0)
        chosen = (free & on_lattice).ravel() if (free & on_lattice).any() else free.ravel()
        points = grid.centers()[chosen]
        _, cell = place_tree(grid.centers()).query(library.poses[:, :2])
        enough_m = min(float(np.quantile(clear_m[cell], 0.05)), MOST_CLEARANCE_M)
        standing = points[clear_m[chosen] >= enough_m]
        lacking = without_reference(points, library.poses, spacing_m)
        area_m2 = (grid.cell_m * every) ** 2
        return cls(library.poses, spacing_m, points, standing, area_m2, lacking)

    def missing(self, places: F64) -> tuple[MissingHeadings, ...]:
        """Return the places (P, 2) that lack a heading."""
        lacking = without_reference(places, self.poses, self.spacing_m)
        order = np.argsort(-lacking.sum(axis=1), kind="stable")
        return tuple(
            MissingHeadings(float(places[k, 0]), float(places[k, 1]), tuple(headings()[lacking[k]].tolist()))
            for k in order.tolist()
            if lacking[k].any()
        )

    def fill(self) -> None:
        """Propose references until no point worth it lacks a heading, those that fill most first.

        Places that are there get what they lack; new places get all headings, because a filter compares a
        particle with the nearest place, whichever headings that has.
        """
        there = distinct_places(self.poses[:, :2])[0]
        self._fill(there, without_reference(there, self.poses, ONE_PLACE * self.spacing_m))
        self._fill(self.standing, None)

    def _fill(self, candidates: F64, open_headings: Bool | None) -> None:
        """Propose references at candidates (S, 2): of these headings (S, DIRECTIONS), or all; best first."""
        if not len(candidates) or not self.lacking.any():
            return
        least = max(LEAST_AREA_SPACINGS * self.spacing_m**2 / self.area_m2, 1.0)
        near = _near(candidates, self.points, FILLED_SPACINGS * self.spacing_m)
        while len(self.added) < MOST_ADDED:
            gain = near @ self.lacking.astype(np.float64)  # (S, DIRECTIONS)
            if open_headings is not None:
                gain = gain * open_headings
            best = int(np.where(gain >= least, gain, 0.0).sum(axis=1).argmax())
            worth = gain[best] >= least
            if not worth.any():
                return
            filled = near[best].indices
            is_gap = self.lacking[filled].all(axis=1).sum() >= least
            directions = np.ones(DIRECTIONS, bool) if open_headings is None else worth
            self._add(candidates[best], directions, GAP if is_gap else HEADING)
            self.lacking[np.ix_(filled, np.flatnonzero(directions))] = False

    def part(self, library: Library, confused: list[int]) -> None:
        """Propose places beside confused references, as far from all others as there is room."""
        for entry in confused:
            poses = np.vstack([library.poses, *(reference.pose[None] for reference in self.added)])
            free = self.standing[np.hypot(*(self.standing - library.poses[entry, :2]).T) <= self.spacing_m]
            if len(self.added) >= MOST_ADDED or not len(free):
                continue
            distance_m = _distance(poses, free)
            if distance_m.max() >= APART_SPACINGS * self.spacing_m:
                self._add(free[distance_m.argmax()], np.ones(DIRECTIONS, bool), AMBIGUITY)

    def _add(self, place: F64, directions: Bool, why: str) -> None:
        for direction in headings()[directions]:
            self.added.append(ProposedReference(np.array([*place, direction]), why))


def _distance(poses: F64, points: F64) -> F64:
    """Return how far (G,) the nearest pose (L, 3) is from each point (G, 2)."""
    return np.asarray(place_tree(poses[:, :2]).query(points)[0], np.float64)


def _near(centers: F64, points: F64, reach_m: float) -> csr_matrix:
    """Return (S, G): 1 where a point is within reach of a center."""
    within = place_tree(centers).sparse_distance_matrix(place_tree(points), reach_m, output_type="coo_matrix")
    return csr_matrix((np.ones(within.nnz), (within.row, within.col)), within.shape)
