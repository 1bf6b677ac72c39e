"""Error budgets: what each part of a filter costs, over the seeds of one drive or over many drives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.reasons.budget import (
    AS_IS,
    LIBRARY,
    MOTION,
    PARTS,
    SAMPLING,
    SENSOR,
    BudgetLine,
    budget_line,
    with_perfect,
)
from maurice_mcl.scoring.batch import SeededRuns, compared_once
from maurice_mcl.values import F64, Moment, Plain, Progress, Session, plain

from .engine import tables_of
from .statistics import Clusters, Interval, mean, share

COSTS = {
    MOTION: "odometry",
    SENSOR: "sensor model",
    LIBRARY: "distance between references",
    SAMPLING: "number of particles",
}


@dataclass(frozen=True, slots=True)
class BudgetPart(Plain):
    """What remains of the error with one part made perfect, and so what the part costs."""

    also = ("costs",)
    part: str  # one of `maurice_mcl.reasons.budget.PARTS`
    error: Interval  # meters: position error, mean over updates 4 to the last
    cost: Interval | None  # meters: what it takes off, on the same drives and seeds; None: nothing is perfect
    lost: Interval  # share of the runs that were ever lost

    @property
    def costs(self) -> str:
        """What the cost is due to; empty where nothing is perfect."""
        return COSTS.get(self.part, "")


@dataclass(frozen=True, slots=True)
class ErrorBudget:
    """An error budget: its first part is the filter as it is. Lengths are in meters."""

    name: str  # of the session or folder
    filter: str  # the run's label
    display_units: str
    drives: int
    parts: tuple[BudgetPart, ...]

    @property
    def costliest(self) -> BudgetPart | None:
        """The part that costs most; None where no cost is above zero with 95 % confidence."""
        sure = [part for part in self.parts if part.cost is not None and part.cost.low > 0]
        return max(sure, key=lambda part: part.cost.value if part.cost else 0.0, default=None)

    def to_json(self) -> dict[str, Any]:
        """Return all figures as plain values."""
        most = self.costliest
        return plain(self) | {"costliest": None if most is None else most.costs}


@dataclass(frozen=True, slots=True, eq=False)
class BudgetDrive:
    """The runs over one drive, and where it is."""

    runs: SeededRuns
    place: int  # its arena: drives in it are alike

    @classmethod
    def of(
        cls, localizer: Localizer, session: Session, start: F64 | None, seeds: Sequence[int], place: int
    ) -> BudgetDrive:
        """Compare the pictures of a session once; none is kept."""
        moments = list[Moment]()

        def seen() -> Iterator[Moment]:
            for moment in session.moments():
                yield moment
                moments.append(moment.without_picture)

        comparisons = compared_once(localizer.sensor, seen())
        return cls(SeededRuns(localizer, moments, comparisons, seeds, start), place)


def budget_of(
    name: str, label: str, units: str, drives: Sequence[BudgetDrive], progress: Progress | None = None
) -> ErrorBudget:
    """Run every drive with each part made perfect; intervals are over drives, or seeds of one."""
    runs = [with_perfect(part, drive.runs) for part in PARTS for drive in drives]
    tables = iter(tables_of(runs, progress))
    lines = {part: [budget_line(part, next(tables)) for _ in drives] for part in PARTS}
    places, numbers = (
        np.repeat(labels, [len(drive.runs.seeds) for drive in drives])
        for labels in ([drive.place for drive in drives], range(len(drives)))
    )
    parts = tuple(_part(part, lines, Clusters.of(places, numbers)) for part in PARTS)
    return ErrorBudget(name, label, units, len(drives), parts)


def _part(part: str, lines: Mapping[str, Sequence[BudgetLine]], clusters: Clusters) -> BudgetPart:
    def errors(of: str) -> F64:
        return np.concatenate([line.errors_m for line in lines[of]])

    known = np.isfinite(errors(AS_IS))
    before = errors(SENSOR if part == LIBRARY else AS_IS)
    cost = None if part == AS_IS else mean((before - errors(part))[known], clusters[known])
    lost = share(np.concatenate([line.lost for line in lines[part]]), clusters)
    return BudgetPart(part, mean(errors(part)[known], clusters[known]), cost, lost)
