"""Independent runs of one filter with different seeds, from one comparison of every picture.

    comparisons = compared_once(localizer.sensor, moments)
    tables = run_batch(localizer, moments, seeds=range(100), comparisons=comparisons)

`SeededRuns` is the same as a value, which can be divided and sent to other processes
(`maurice_datasets.trials.engine.tables_of`). What a run finds is the same as if it ran alone, bit for bit.
It returns tables, not records: a record holds five clouds, and thousands of runs would hold millions. A run
worth a look can be repeated alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..filter.batch_step import Batch, can_batch
from ..filter.localizer import Localizer
from ..sensor.ahead import Compared, KnownDescriptors, compared_ahead
from ..sensor.model import SensorModel
from ..values import F64, Comparison, FilterState, Moment
from .table import RunTable, TableRows

Starts = Sequence[F64 | None] | F64 | None
STEPPED_AT_ONCE = 65_536  # particles of a part of seeded runs: two blocks of a batch, and some megabytes


def compared_once(
    sensor: SensorModel, moments: Iterable[Moment], known: KnownDescriptors | None = None
) -> tuple[Comparison, ...]:
    """Compare every picture with the library, on a second thread: for many batches over one session.

    Pictures in `known` are not measured again.
    """
    return tuple(pictures[0].comparison for _, pictures in compared_ahead([sensor], moments, known))


def run_batch(
    localizer: Localizer,
    moments: Sequence[Moment],
    seeds: Sequence[int],
    starts: Starts = None,
    comparisons: Sequence[Comparison] | None = None,
    states: Sequence[FilterState] | None = None,
) -> tuple[RunTable, ...]:
    """Run a filter over the same moments once per seed; return a table for each, in order.

    `starts` is the pose (3,) at which all begin, None to spread each over all free space, or one of these for
    every seed. `comparisons` are those of the moments' pictures, where they are known (`compared_once`).
    With `states`, one a seed, every run goes on from its state instead (`branch.branched`).
    The localizer's own seed is not used; it must have a motion model (`Localizer.of_session`).
    """
    if comparisons is None:
        comparisons = compared_once(localizer.sensor, moments)
    runs = SteppedRuns.begin(localizer, seeds, starts, states)
    for moment, comparison in zip(moments, comparisons, strict=True):
        runs.advance(moment, comparison)
    return runs.tables()


@dataclass(frozen=True, slots=True, eq=False)
class SeededRuns:
    """Runs of one filter over one drive with several seeds, as they are asked for."""

    localizer: Localizer  # with a motion model; its own seed is not used
    moments: Sequence[Moment]  # their pictures are not needed
    comparisons: Sequence[Comparison]  # of the moments' pictures
    seeds: Sequence[int]
    start: F64 | None = None  # (3,) at which all begin; None: anywhere
    states: Sequence[FilterState] | None = None  # one a seed, from which they go on instead

    @property
    def particles(self) -> int:
        """The number of particles that are moved, in all updates of all runs together."""
        return self.localizer.particles * len(self.seeds) * len(self.moments)

    def parts(self) -> Iterator[SeededRuns]:
        """Yield the same runs in parts, a few seeds each, so that neither memory nor a core has too much."""
        size = max(STEPPED_AT_ONCE // self.localizer.particles, 1)
        for first in range(0, len(self.seeds), size):
            some = slice(first, first + size)
            states = None if self.states is None else self.states[some]
            yield replace(self, seeds=self.seeds[some], states=states)

    def tables(self) -> tuple[RunTable, ...]:
        """Make the runs; return a table for each seed, in order."""
        return run_batch(self.localizer, self.moments, self.seeds, self.start, self.comparisons, self.states)


@dataclass(frozen=True, slots=True, eq=False)
class SteppedRuns:
    """Runs of one filter side by side, a frame at a time: for sessions that are not held in memory."""

    localizer: Localizer
    seeds: Sequence[int]
    batch: Batch | None  # None: this filter's runs are stepped one by one
    states: list[FilterState]  # of these
    rows: TableRows

    @classmethod
    def begin(
        cls,
        localizer: Localizer,
        seeds: Sequence[int],
        starts: Starts = None,
        states: Sequence[FilterState] | None = None,
    ) -> SteppedRuns:
        """Initialize every run; arguments as for `run_batch`."""
        first_states = list(_begun(localizer, seeds, starts) if states is None else states)
        known = starts if isinstance(starts, np.ndarray) else None
        rows = TableRows(len(seeds), known, localizer.particles, localizer.radii)
        alike = all(state.belief.size == localizer.particles for state in first_states)
        if len(seeds) > 1 and alike and can_batch(localizer):
            return cls(localizer, seeds, Batch.begin(localizer, seeds, first_states), [], rows)
        return cls(localizer, seeds, None, first_states, rows)

    def advance(self, moment: Moment, comparison: Comparison) -> None:
        """Process one frame in every run."""
        frame = moment.frame
        self.rows.begin(moment)
        if self.batch is not None:
            self.batch.advance(frame, comparison, self.rows.put_some, self.rows.put)
            return
        for run, seed in enumerate(self.seeds):  # what every batch must equal
            localizer = replace(self.localizer, seed=seed)
            self.states[run], record = localizer.step(self.states[run], frame, Compared(comparison, 0.0))
            self.rows.put(run, record)

    def tables(self) -> tuple[RunTable, ...]:
        """Return the runs so far."""
        return self.rows.tables(self.seeds)


def _begun(localizer: Localizer, seeds: Sequence[int], starts: Starts) -> list[FilterState]:
    """Initialize every run as it would alone."""
    places = [starts] * len(seeds) if starts is None or isinstance(starts, np.ndarray) else starts
    return [replace(localizer, seed=seed).initialize(at) for seed, at in zip(seeds, places, strict=True)]
