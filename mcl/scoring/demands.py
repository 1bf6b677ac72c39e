"""What a run of a filter has to do, and whether it did: rules of `maurice-replay check` (docs/trials.md).

A run begins to search at its first update and after every kidnapping. `localized_by` updates later it has to
be localized; from there on its error counts, and it must not be lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..values import F64, Bool, Moment
from . import metrics
from .table import LOCALIZED_OF, LOST_FOR, RunTable

LOCALIZED, KEPT, ERROR, CONVERGED = "localized", "not_lost", "error", "converged"


@dataclass(frozen=True, slots=True)
class Demands:
    """What is demanded of a run; None is not demanded. `min_localized` says of how many runs.

    To be localized within `localized_by` updates and not lost after that, to be off by at most `max_error_m`
    in the mean, or to have converged within `converged_by` updates, which needs no true poses.

        >>> import maurice_mcl as mcl
        >>> mcl.Demands(max_error_m=0.3, localized_by=5).kinds
        ('localized', 'not_lost', 'error')
    """

    max_error_m: float | None = None  # mean position error, where it counts
    localized_by: int | None = None  # updates after the start, and after every kidnapping
    converged_by: int | None = None  # the same of a cloud at one place, right or wrong: needs no truth
    min_localized: float = 0.95  # of the runs, that meet each demand

    @property
    def need_truth(self) -> bool:
        """Whether true poses are needed."""
        return self.max_error_m is not None or self.localized_by is not None

    @property
    def kinds(self) -> tuple[str, ...]:
        """The demands, in the order of a table; who asks about the truth also asks not to be lost."""
        demands = {
            LOCALIZED: self.localized_by is not None,
            KEPT: self.need_truth,
            ERROR: self.max_error_m is not None,
            CONVERGED: self.converged_by is not None,
        }
        return tuple(kind for kind, has_demand in demands.items() if has_demand)

    @property
    def grace(self) -> int:
        """Updates after each start that do not count for error and loss."""
        return max(self.localized_by or 0, metrics.FIRST_SCORED - 1)

    def counting(self, updates: int, starts: Sequence[int]) -> Bool:
        """Return which updates (U,) count for error and loss: those past the time to search."""
        counts = np.ones(updates, bool)
        for start in starts:
            counts[start : start + self.grace] = False
        return counts


@dataclass(frozen=True, slots=True, eq=False)
class RunTrack:
    """One run against the truth, U updates long, as far as demands on it need it."""

    seed: int
    error_m: F64  # (U,) position error; nan where the truth is not known
    localized: Bool  # (U,) by the definitions of docs/evaluation.md, each of one update
    lost: Bool  # (U,)
    converged: Bool  # (U,)

    @classmethod
    def of(cls, run: RunTable) -> RunTrack:
        """Take what demands are on from a run's table."""
        return cls(run.seed, run.error_m, run.is_localized, run.is_off, run.is_converged)


def starts_of(moments: Sequence[Moment]) -> tuple[int, ...]:
    """Return the updates, from 0, at which a run has to find itself: the first, and after kidnappings."""
    carried = [k for k, moment in enumerate(moments) if k and moment.kidnapped]
    return (0, *carried)


@dataclass(frozen=True, slots=True)
class RunJudgement:
    """Whether one run met its demands, and the figures that show it."""

    seed: int
    met: Mapping[str, bool]  # by kind of demand
    failed_at: Mapping[str, int] = field(default_factory=dict)  # first update, from 0, that shows it
    error_mean_m: float | None = None  # where it counts
    found_after: int | None = None  # updates until localized, the worst of its starts; None: not at one
    converged_after: int | None = None
    found_at: Mapping[str, tuple[bool, ...]] = field(default_factory=dict)  # by kind: at each start, or not

    @property
    def passed(self) -> bool:
        """Whether it met all."""
        return all(self.met.values())

    @property
    def first_failed_at(self) -> int | None:
        """The first update, from 0, at which a demand is seen to fail; None for a run that met all."""
        return min(self.failed_at.values(), default=None)


def judge_run(track: RunTrack, starts: Sequence[int], demands: Demands) -> RunJudgement:
    """Judge one run."""
    results: dict[str, bool] = {}
    failed_at: dict[str, int] = {}
    counts = demands.counting(len(track.error_m), starts)
    by_kind = {LOCALIZED: track.localized, CONVERGED: track.converged}
    after_starts = {kind: _updates_after(flags, starts) for kind, flags in by_kind.items()}
    by = {LOCALIZED: demands.localized_by, CONVERGED: demands.converged_by}
    for kind in demands.kinds:
        failed = _failed(kind, track, counts, after_starts, by, starts, demands)
        results[kind] = failed is None
        if failed is not None:
            failed_at[kind] = failed
    known = counts & np.isfinite(track.error_m)
    error_mean_m = float(track.error_m[known].mean()) if known.any() else None
    judged = {
        kind: _of_judged(values, starts, len(counts), by[kind]) for kind, values in after_starts.items()
    }
    after = {kind: _worst(values) for kind, values in judged.items()}
    found_at = {kind: tuple(after is not None for after in values) for kind, values in judged.items()}
    return RunJudgement(
        track.seed, results, failed_at, error_mean_m, after[LOCALIZED], after[CONVERGED], found_at
    )


def _failed(
    kind: str,
    track: RunTrack,
    counts: Bool,
    after_starts: Mapping[str, Sequence[int | None]],
    by: Mapping[str, int | None],
    starts: Sequence[int],
    demands: Demands,
) -> int | None:
    """Return the first update, from 0, at which a demand is seen to fail; None where it is met."""
    if kind == KEPT:
        at = metrics.first_run_of((track.lost & counts).tolist(), LOST_FOR)
        return None if at is None else at - LOST_FOR
    if kind == ERROR:
        off_m, most_m = np.where(counts, track.error_m, np.nan), demands.max_error_m or 0.0
        if np.nanmean(off_m) <= most_m:
            return None
        return int(np.flatnonzero(off_m > most_m)[0])
    limit, late = by[kind] or 0, []
    for start, after in zip(starts, after_starts[kind], strict=True):
        if is_judged(start, starts, len(counts), limit) and (after is None or after > limit):
            late.append(start + limit - 1)
    return late[0] if late else None


def _of_judged(
    after_starts: Sequence[int | None], starts: Sequence[int], updates: int, limit: int | None
) -> list[int | None]:
    """Return what was found at the first start, and at those with enough updates after them."""
    judged = [start == 0 or is_judged(start, starts, updates, limit or 1) for start in starts]
    return [after for after, counts in zip(after_starts, judged, strict=True) if counts]


def is_judged(start: int, starts: Sequence[int], updates: int, limit: int) -> bool:
    """Return whether enough updates follow a start to see that a run was localized by a limit."""
    later = [other for other in starts if other > start]
    return (later[0] if later else updates) - start >= limit + LOCALIZED_OF[1] - 1


def _updates_after(flags: Bool, starts: Sequence[int]) -> list[int | None]:
    """Return after how many updates each start was found (`first_mostly`), counted from 1."""
    ends = [*starts[1:], len(flags)]
    return [metrics.first_mostly(flags[start:end]) for start, end in zip(starts, ends, strict=True)]


def _worst(updates: Sequence[int | None]) -> int | None:
    known = [count for count in updates if count is not None]
    return max(known) if len(known) == len(updates) else None
