"""The leave-one-out table: a library's own pictures, each compared with the entries at all other places.

Such a picture stands for one that a robot takes where nothing was surveyed. Whatever a library's own pictures
tell about it comes from this table: whether its places can be told apart (`score_places`), what looks
alike (`quality`, `advice`), and scales and weights of channels that are fitted to it (`fitting.sensor`).

The log score of a picture is the log of the probability that it alone assigns to its stand-in, the entry of
similar heading at the nearest other place, under a uniform prior. Intervals are by place, as the errors of
pictures at one place are correlated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sensor.model import SensorModel
from ..sensor.references import NearestReference
from ..values import (
    F32,
    F64,
    I32,
    INCH_M,
    Library,
    crosses,
    distinct_places,
    place_tree,
    plain,
    spacing,
    wrap_angle,
)

Index = NDArray[np.intp]

LEAST_PROBABILITY = 1e-6  # so that one picture costs at most 13.8 nats
NEIGHBORS = 9  # places tried, including itself, for one without a wall in between
STAND_IN_TURN_RAD = np.pi / 4 * (1 + 1e-6)  # a reference turned further shows another view
ONE_PLACE = 0.75  # spacings: nearer entries are at one place
LEAST_SPACING_M, LEAST_SPACING_OF_MAP = 0.25, 0.1  # between places: the smaller of both
MOST_CLUSTERED = 4000  # entries; in larger libraries only equal positions are one place

MOST_PICTURES, FEWEST_PICTURES = 64, 16
MOST_COMPARED = 60_000  # entries in all, which bounds the time: about 0.1 s for 624 entries
ENOUGH_PLACES = 20  # with fewer, the gain over knowing nothing has to be significant
FITTED_SPACING_M = 18 * INCH_M  # of the libraries that the scales were fitted on
SPARSE_SPACINGS = 1.5  # times that
MEAN_OF_GRID = 0.3826  # spacings from a point to the nearest node of a square grid, in the mean
MOST_MEASURED = 5000  # cells of free space
CONFIDENCE = 0.95
WIDENINGS: F64 = np.geomspace(1, 100, 41)
STRETCHES: F64 = np.geomspace(1, 32, 16)
PRIOR_PLACES = 20  # that our scales count as, so that few places say little
LEAST_STRETCH = 1.05  # a factor below this is none


@dataclass(frozen=True, slots=True)
class PlaceScore:
    """What a library's own pictures say about places that are left out, in nats per picture."""

    places: int
    pictures: int  # that were left out; 0: there are no two places that see each other
    score: float  # mean log score; nan without pictures
    blind: float  # that of knowing nothing
    widening: float  # of the scales, so that the sensor is not overconfident; 1: they hold here
    stretched: Mapping[str, float] = field(default_factory=dict)  # channel to factor of its scale, above 1

    @property
    def worse_than_nothing(self) -> bool:
        """Whether the score is below that of knowing nothing."""
        return self.pictures > 0 and self.score < self.blind

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON."""
        score = plain(self, "worse_than_nothing")
        return {"log_score": score.pop("score"), "knowing_nothing": score.pop("blind"), **score}


def even_spacing_m(nearest: NearestReference) -> float:
    """Return the spacing of a square grid of places that the free space is as far from, in the mean."""
    grid, cells = nearest.grid, np.flatnonzero(nearest.place_of_cell[:-1] >= 0)
    if not len(cells):
        return 0.0
    cells = cells[np.linspace(0, len(cells) - 1, min(len(cells), MOST_MEASURED)).astype(int)]
    row, column = np.divmod(cells, grid.shape[1])
    centers = grid.corner + grid.cell_m * (np.column_stack([column, row]) + 0.5)
    far_m = np.linalg.norm(centers - nearest.places[nearest.place_of_cell[cells]], axis=1)
    return float(far_m.mean()) / MEAN_OF_GRID


def is_sparse(nearest: NearestReference) -> bool:
    """Whether free space is much farther from places than in the libraries that our scales were fitted on."""
    return even_spacing_m(nearest) > SPARSE_SPACINGS * FITTED_SPACING_M


@dataclass(frozen=True, eq=False)
class LeftOutTable:
    """A row for each of L references: as if it were a picture, compared with those at all other places.

    Rows are computed on demand, as a large library's would not fit into memory.
    """

    sensor: SensorModel  # by its channels
    places: F64  # (P, 2) the middle of the entries at each place
    place_of: I32  # (L,) the place of each entry

    @classmethod
    def of(cls, sensor: SensorModel) -> LeftOutTable:
        """Return the table of a sensor's library."""
        return cls(replace(sensor, index={}), *clustered(sensor.library))

    def others(self, entry: int) -> Index:
        """Return the entries (n,) at all places but that of an entry."""
        return np.flatnonzero(self.place_of != self.place_of[entry])

    @cached_property
    def stand_ins(self) -> I32:
        """For every entry (L,) the one of similar heading at the nearest other visible place, or -1."""
        library = self.sensor.library
        stand_in = np.full(library.size, -1, np.int32)
        if len(self.places) < 2:
            return stand_in
        places, walls = self.places, library.arena.walls
        (beside,) = library.keep("beside 1", [places, walls], lambda: (_beside(places, walls),))
        at_place = [np.flatnonzero(self.place_of == place) for place in range(len(self.places))]
        for entry, place in enumerate(self.place_of):
            if beside[place] >= 0:
                others = at_place[beside[place]]
                turned = np.abs(wrap_angle(library.poses[others, 2] - library.poses[entry, 2]))
                if turned.min() <= STAND_IN_TURN_RAD:
                    stand_in[entry] = others[turned.argmin()]
        return stand_in

    def tested(self, most: int) -> Index:
        """Return at most so many of the entries with a stand-in, evenly spread."""
        known = np.flatnonzero(self.stand_ins >= 0)
        chosen: Index = np.linspace(0, len(known) - 1, min(len(known), most)).round().astype(np.intp)
        return known[chosen]


def score_places(table: LeftOutTable, *, fit: bool = False) -> PlaceScore:
    """Score some rows of the table, in bounded time for any library.

    With `fit`, the scale of each channel is fitted, too. A stand-in is a whole spacing off, a drive's picture
    half of one, so the fit is too wide: its logarithm is drawn toward ours, less so with more places.
    """
    places, sensor, tested = table.places, table.sensor, _Rows.of(table)
    if not len(tested.groups) or tested.groups.max() < 1:
        return PlaceScore(len(places), 0, np.nan, np.nan, 1.0)
    gains, nothing = tested.gains(1.0), float(tested.by_place(tested.blind).mean())
    dense = len(places) >= ENOUGH_PLACES and spacing(places) <= SPARSE_SPACINGS * FITTED_SPACING_M
    bound = mean if dense else lower_bound
    widening = 1.0
    if bound(gains) < 0:
        widening = float(WIDENINGS[np.argmax([bound(tested.gains(k)) for k in WIDENINGS.tolist()])])
    log_score = nothing + float(gains.mean())
    result = PlaceScore(len(places), len(tested.costs), log_score, nothing, float(f"{widening:.3g}"))
    if not fit or len(places) < ENOUGH_PLACES:
        return result
    trust = len(places) / (len(places) + PRIOR_PLACES)
    usual = [(k, name) for k, name in enumerate(sensor.weights) if sensor.parameters.is_usual(name)]
    factors = {name: float(f"{tested.stretch(k) ** trust:.3g}") for k, name in usual}
    return replace(
        result, stretched={name: factor for name, factor in factors.items() if factor > LEAST_STRETCH}
    )


SCALES_TRIED: F64 = np.geomspace(1e-3, 1, 61)  # of the usual distance between two references


def fitted_scale(table: LeftOutTable) -> float:
    """Return the distance that costs a nat, of a sensor's only channel at scale 1: of the best log score.

    A stand-in is a whole spacing off, a drive's picture half of one, so it is rather too wide.
    """
    tested = _Rows.of(table)
    distances = [cost[0] for cost in tested.alone]
    usual = float(np.median(np.concatenate(distances))) if distances else 0.0
    if usual <= 0:
        return 1.0
    pairs = [(cost[None], np.array([k])) for cost, k in zip(distances, tested.truth, strict=True)]

    def score(scale: float) -> float:
        return mean(tested.by_place(np.concatenate([log_scores(cost / scale, k) for cost, k in pairs])))

    return float(f"{max((usual * SCALES_TRIED).tolist(), key=score):.3g}")


def mean(values: F64) -> float:
    """Return the mean of values (P,)."""
    return float(values.mean())


def lower_bound(values: F64) -> float:
    """Return the lower confidence bound of the mean of values (P,), by Student."""
    from scipy.special import stdtrit

    error = float(values.std(ddof=1) / np.sqrt(len(values)))
    return mean(values) - float(stdtrit(len(values) - 1, CONFIDENCE)) * error


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Some rows of the table, by the sensor's likelihood."""

    costs: list[F64]  # n of them, in nats
    alone: list[F64]  # n of them (C, ...), by every channel alone
    truth: I32  # (n,) which of the entries compared with is the stand-in
    groups: I32  # (n,) place of each picture, numbered among those tested

    @classmethod
    def of(cls, table: LeftOutTable) -> _Rows:
        """Compare up to `MOST_PICTURES`, fewer in large libraries."""
        costs, alone, truth = list[F64](), list[F64](), list[int]()
        most = max(MOST_COMPARED // table.sensor.library.size, FEWEST_PICTURES)
        tested = table.tested(min(most, MOST_PICTURES))
        for entry in tested.tolist():
            others, comparison = table.others(entry), table.sensor.compare_reference(entry)
            costs.append(-np.asarray(comparison.log_likelihood[others], np.float64))
            alone.append(np.asarray(comparison.channel_cost[:, others], np.float64))
            truth.append(int(np.searchsorted(others, table.stand_ins[entry])))
        groups = np.unique(table.place_of[tested], return_inverse=True)[1]
        return cls(costs, alone, np.array(truth, np.int32), groups.astype(np.int32))

    @property
    def blind(self) -> F64:
        """The log score (n,) of knowing nothing."""
        return -np.log([len(cost) for cost in self.costs])

    def by_place(self, values: F64) -> F64:
        """Return the mean (G,) of values (n,) at each place."""
        return np.asarray(np.bincount(self.groups, values) / np.bincount(self.groups))

    def stretch(self, channel: int) -> float:
        """Return the factor of a channel's scale that has the best log score, the channel alone."""
        pairs = [(cost[channel][None], np.array([k])) for cost, k in zip(self.alone, self.truth, strict=True)]

        def score(factor: float) -> float:
            return mean(self.by_place(np.concatenate([log_scores(c / factor, k) for c, k in pairs])))

        return float(STRETCHES[np.argmax([score(factor) for factor in STRETCHES.tolist()])])

    def gains(self, widening: float) -> F64:
        """Return by how much each place (G,) does better than knowing nothing."""
        pairs = zip(self.costs, self.truth, strict=True)
        scores = [log_scores(cost[None] / widening, np.array([truth])) for cost, truth in pairs]
        return self.by_place(np.concatenate(scores) - self.blind)


def log_scores(cost: F64 | F32, truth: I32) -> F64:
    """Return the log score (T,) of costs (T, L) in nats."""
    logits = -cost + cost.min(axis=1, keepdims=True)
    log_total = np.log(np.exp(logits).sum(axis=1))
    scores = logits[np.arange(len(truth)), truth] - log_total
    return np.asarray(np.maximum(scores, np.log(LEAST_PROBABILITY)))


def _beside(places: F64, walls: F64) -> I32:
    """Return for every place (P,) the nearest other visible one; -1 for none near."""
    near = np.asarray(place_tree(places).query(places, k=min(NEIGHBORS, len(places)))[1])
    itself = np.arange(len(places))
    beside = np.full(len(places), -1, np.int32)
    for other in near.T:
        seen = (beside < 0) & (other != itself) & ~crosses(places, places[other], walls)
        beside[seen] = other[seen]
    return beside


def clustered(library: Library) -> tuple[F64, I32]:
    """Return the places (P, 2) of a library, nearly equal ones as one, and the place of each entry (L,)."""
    distinct, place_of = distinct_places(library.poses[:, :2])
    if library.size > MOST_CLUSTERED:
        return distinct, place_of
    least = min(LEAST_SPACING_M, LEAST_SPACING_OF_MAP * max(library.arena.size_m))
    return places_of(library.poses[:, :2], max(spacing(distinct), least))


def places_of(xy: F64, size_m: float) -> tuple[F64, I32]:
    """Cluster positions (L, 2), each around its first member: centers (P, 2), place of each (L,)."""
    firsts, place_of = np.empty((0, 2)), np.empty(len(xy), np.int32)
    for number, at in enumerate(xy):
        distance_m = np.hypot(*(firsts - at).T)
        if not len(firsts) or distance_m.min() > ONE_PLACE * size_m:
            place_of[number] = len(firsts)
            firsts = np.vstack([firsts, at])
        else:
            place_of[number] = distance_m.argmin()
    count = np.bincount(place_of)
    middles = [np.bincount(place_of, xy[:, k]) / count for k in (0, 1)]
    return np.column_stack(middles), place_of
