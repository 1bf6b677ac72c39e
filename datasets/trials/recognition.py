"""How often a drive's pictures find the right reference, with intervals: the figures of place recognition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from maurice_mcl.library.retrieval import TOGETHER, Ranking, Retrieval, area_of
from maurice_mcl.values import plain, plain_value

from .statistics import Clusters, Interval, jackknife, rate_difference, share

FIRST = (1, 5, 10)  # references among which the right one is asked for
MOST_POINTS = 200  # of a curve in JSON


@dataclass(frozen=True, slots=True, eq=False)
class ChannelRecall:
    """How often one way to compare finds the right reference."""

    name: str  # a channel, or all in use together
    is_used: bool  # whether the feature compares by it
    recall: Mapping[int, Interval]  # among the first so many
    area: Interval  # under precision over recall
    median_rank: float  # of the first right reference, from 1
    rank_90: float  # that nine in ten have at most
    ranking: Ranking

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON; of long curves some points."""
        recall, precision = self.ranking.curve()
        some = np.unique(np.linspace(0, len(recall) - 1, min(len(recall), MOST_POINTS)).round().astype(int))
        curve = {"recall": recall[some].tolist(), "precision": precision[some].tolist()}
        rows = {f"recall_at_{first}": plain(value) for first, value in self.recall.items()}
        ranks = {"median_rank": plain_value(self.median_rank), "rank_90": plain_value(self.rank_90)}
        return {
            "name": self.name,
            "used": self.is_used,
            **rows,
            "area": plain(self.area),
            **ranks,
            "curve": curve,
        }


@dataclass(frozen=True, slots=True, eq=False)
class PlaceRecognition:
    """What a drive's pictures find in a library: by each channel alone, and by those in use together."""

    ways: tuple[ChannelRecall, ...]  # all together first, then those in use, then what the library also holds
    without: Mapping[str, Interval]  # channel in use to what recall at 1 gains without it
    pictures: int  # that were looked up
    right: int  # of these, those that have a right reference: all figures are of these
    stretches: int  # of the drive, by which intervals are
    right_m: float

    @classmethod
    def of(cls, retrieval: Retrieval, used: Sequence[str]) -> PlaceRecognition:
        """Return the figures of a drive that was looked up; intervals are by stretch of the drive."""
        alike = Clusters.of(retrieval.stretch, retrieval.stretch)
        names = sorted(retrieval.alone, key=lambda name: name not in used)
        every = {TOGETHER: retrieval.together} if len(used) > 1 else {}
        every |= {name: retrieval.alone[name] for name in names}
        ways = tuple(
            _recall_of(name, name in (*used, TOGETHER), ranking, alike) for name, ranking in every.items()
        )
        first = retrieval.together.among(1)
        without = {
            name: rate_difference(first, ranking.among(1), alike)
            for name, ranking in retrieval.without.items()
        }
        count = len(retrieval.stretch)
        return cls(ways, without, retrieval.pictures, count, alike.count if count else 0, retrieval.right_m)

    @property
    def worst(self) -> str | None:
        """The channel in use without which the right reference is found most often; None: each one helps."""
        gains = {name: gain.value for name, gain in self.without.items() if gain.value > 0}
        return max(gains, key=lambda name: gains[name]) if gains else None

    @property
    def hurting(self) -> tuple[str, ...]:
        """Those channels in use without which it is found more often beyond chance, the worst first."""
        gains = {name: gain for name, gain in self.without.items() if gain.low > 0}
        return tuple(sorted(gains, key=lambda name: -gains[name].value))

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, in meters."""
        return {
            "pictures": self.pictures,
            "with_a_right_reference": self.right,
            "stretches": self.stretches,
            "right_m": self.right_m,
            "ways": [way.to_json() for way in self.ways],
            "gain_without": {name: plain(gain) for name, gain in self.without.items()},
            "worst": self.worst,
            "hurting": list(self.hurting),
        }


def _recall_of(name: str, is_used: bool, ranking: Ranking, alike: Clusters) -> ChannelRecall:
    recall = {first: share(ranking.among(first), alike) for first in FIRST}
    area = jackknife(lambda used: area_of(ranking[used]), alike)
    area = replace(area, low=max(area.low, 0.0), high=min(area.high, 1.0))  # NaN stays
    ranks = ranking.rank
    middle, most = np.quantile(ranks, (0.5, 0.9)).tolist() if len(ranks) else (np.nan, np.nan)
    return ChannelRecall(name, is_used, recall, area, middle, most, ranking)
