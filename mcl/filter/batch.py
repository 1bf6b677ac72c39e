"""Independent runs of one filter with different seeds, from one comparison of every picture.

    comparisons = compared_once(localizer.sensor, moments)
    traces = run_batch(localizer, moments, seeds=range(100), comparisons=comparisons)

What a run finds is the same as if it ran alone, bit for bit. It returns numbers, not records: a record holds
five clouds, and thousands of runs would hold millions. A run worth a look can be repeated alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sensor.ahead import Compared, KnownDescriptors, compared_ahead
from ..sensor.model import SensorModel
from ..values import F64, I32, Comparison, Estimate, FilterState, Frame, Moment, Radii, StepRecord
from .batch_step import Batch, Runs, can_batch
from .estimate import CIRCLE_M, share_within
from .localizer import RESAMPLED, Localizer

Starts = Sequence[F64 | None] | F64 | None


@dataclass(frozen=True, slots=True, eq=False)
class RunTrace:
    """One run in numbers, U updates long: what scores and tables of many runs need."""

    seed: int
    radii: Radii
    steps: I32  # (U,) of the frames
    times_s: F64  # (U,) since the session's first record
    poses: F64  # (U, 3) the scored estimates, in the map's frame
    sd_m: F64  # (U, 2) their spread along x and y
    heading_sd_rad: F64  # (U,)
    mass: F64  # (U,) share of the weight that stands behind each
    confidence: F64  # (U,) share of the weight within `radii.confidence_m`
    converged: F64  # (U,) ... within `radii.cluster_m`
    circle: F64  # (U,) ... within `CIRCLE_M`
    mean_poses: F64  # (U, 3) the weighted means of the whole cloud
    mean_sd_m: F64  # (U, 2) the spread of the whole cloud along x and y
    effective_sample_size: F64  # (U,) before resampling
    log_evidence: F64  # (U,)
    calibrated_evidence: F64  # (U,)
    particles: I32  # (U,) after the update
    parents: I32  # (U,) how many different particles these are copies of
    fresh: I32  # (U,) how many of them recovery drew
    events: tuple[tuple[str, ...], ...]  # (U,) as in `StepRecord.events`

    @property
    def updates(self) -> int:
        """The number of updates U."""
        return len(self.steps)

    def estimate(self, update: int) -> Estimate:
        """Return the scored estimate of an update, counted from 0."""
        sd_x_m, sd_y_m = self.sd_m[update].tolist()
        return Estimate(
            pose=self.poses[update],
            sd_m=(sd_x_m, sd_y_m),
            heading_sd_rad=float(self.heading_sd_rad[update]),
            mass=float(self.mass[update]),
            confidence=float(self.confidence[update]),
            converged=float(self.converged[update]),
            radii=self.radii,
        )


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
) -> tuple[RunTrace, ...]:
    """Run a filter over the same moments once per seed; return a trace for each, in order.

    `starts` is the pose (3,) at which all begin, None to spread each over all free space, or one of these for
    every seed. `comparisons` are those of the moments' pictures, where they are known (`compared_once`).
    With `states`, one a seed, every run goes on from its state instead (`branch.branched`).
    The localizer's own seed is not used; it must have a motion model (`Localizer.of_session`).
    """
    if comparisons is None:
        comparisons = compared_once(localizer.sensor, moments)
    runs = SteppedRuns.begin(localizer, seeds, starts, states)
    for moment, comparison in zip(moments, comparisons, strict=True):
        runs.advance(moment.frame, comparison)
    return runs.traces()


@dataclass(frozen=True, slots=True, eq=False)
class SteppedRuns:
    """Runs of one filter side by side, a frame at a time: for sessions that are not held in memory."""

    localizer: Localizer
    seeds: Sequence[int]
    batch: Batch | None  # None: this filter's runs are stepped one by one
    states: list[FilterState]  # of these
    numbers: _Numbers

    @classmethod
    def begin(
        cls,
        localizer: Localizer,
        seeds: Sequence[int],
        starts: Starts = None,
        states: Sequence[FilterState] | None = None,
    ) -> SteppedRuns:
        """Initialize every run; arguments as for `run_batch`."""
        begun = list(_begun(localizer, seeds, starts) if states is None else states)
        numbers = _Numbers(len(seeds), localizer.particles)
        alike = all(state.belief.size == localizer.particles for state in begun)
        if len(seeds) > 1 and alike and can_batch(localizer):
            return cls(localizer, seeds, Batch.begin(localizer, seeds, begun), [], numbers)
        return cls(localizer, seeds, None, begun, numbers)

    def advance(self, frame: Frame, comparison: Comparison) -> None:
        """Process one frame in every run."""
        self.numbers.begin(frame)
        if self.batch is not None:
            self.batch.advance(frame, comparison, self.numbers.put_some, self.numbers.put)
            return
        for run, seed in enumerate(self.seeds):  # what every batch must equal
            localizer = replace(self.localizer, seed=seed)
            self.states[run], record = localizer.step(self.states[run], frame, Compared(comparison, 0.0))
            self.numbers.put(run, record)

    def traces(self) -> tuple[RunTrace, ...]:
        """Return the runs so far."""
        return self.numbers.traces(self.seeds, self.localizer.radii)


def _begun(localizer: Localizer, seeds: Sequence[int], starts: Starts) -> list[FilterState]:
    """Initialize every run as it would alone."""
    places = [starts] * len(seeds) if starts is None or isinstance(starts, np.ndarray) else starts
    return [replace(localizer, seed=seed).initialize(at) for seed, at in zip(seeds, places, strict=True)]


SIZES = {"poses": (3,), "sd_m": (2,), "mean_poses": (3,), "mean_sd_m": (2,)}  # of the others: one number
COUNTS = ("particles", "parents", "fresh")
WITHOUT_NUMBERS = ("seed", "radii", "steps", "times_s", "events")
COLUMNS = tuple(column.name for column in fields(RunTrace) if column.name not in WITHOUT_NUMBERS)


@dataclass(slots=True)
class _Numbers:
    """The numbers of R runs while they are made: by the fields of a trace, (R, ...) for each update."""

    runs: int
    particles: int  # of a run, where nothing changes it
    updates: list[dict[str, NDArray[Any]]] = field(default_factory=list)
    events: list[list[tuple[str, ...]]] = field(default_factory=list)  # (R,) for each update
    steps: list[int] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)

    def begin(self, frame: Frame) -> None:
        """Make room for an update."""
        self.updates.append(
            {
                name: np.zeros((self.runs, *SIZES.get(name, ())), "int32" if name in COUNTS else "float64")
                for name in COLUMNS
            }
        )
        self.events.append([()] * self.runs)
        self.steps.append(frame.step)
        self.times_s.append(frame.time_s)

    def put(self, run: int, record: StepRecord) -> None:
        """Keep the numbers of a record."""
        scored, mean, parents = record.estimate, record.mean_estimate, record.parents
        own = record.belief.size if parents is None else len(np.unique(parents[parents >= 0]))
        values = {
            "poses": scored.pose,
            "sd_m": scored.sd_m,
            "heading_sd_rad": scored.heading_sd_rad,
            "mass": scored.mass,
            "confidence": scored.confidence,
            "converged": scored.converged,
            "circle": share_within(record.weighted, scored.pose, CIRCLE_M),
            "mean_poses": mean.pose,
            "mean_sd_m": mean.sd_m,
            "effective_sample_size": record.effective_sample_size,
            "log_evidence": record.log_evidence,
            "calibrated_evidence": record.calibrated_evidence,
            "particles": record.belief.size,
            "parents": own,
            "fresh": 0 if record.injected is None else int(record.injected.sum()),
        }
        for name, column in self.updates[-1].items():
            column[run] = values[name]
        self.events[-1][run] = record.events

    def put_some(self, runs: Runs, columns: dict[str, NDArray[Any]]) -> None:
        """Keep the numbers of some runs in which nothing out of the ordinary happened."""
        update, events = self.updates[-1], self.events[-1]
        update["particles"][runs] = self.particles
        for name in columns.keys() & update.keys():
            update[name][runs] = columns[name]
        for run, resampled in zip(runs.tolist(), columns["resampled"].tolist(), strict=True):
            events[run] = (RESAMPLED,) if resampled else ()

    def traces(self, seeds: Sequence[int], radii: Radii) -> tuple[RunTrace, ...]:
        """Return the runs one by one."""
        steps, times_s = np.array(self.steps, np.int32), np.array(self.times_s, np.float64)
        columns = {name: self._column(name) for name in COLUMNS}
        return tuple(
            RunTrace(
                seed=seed,
                radii=radii,
                steps=steps,
                times_s=times_s,
                events=tuple(events[run] for events in self.events),
                **{name: column[run] for name, column in columns.items()},
            )
            for run, seed in enumerate(seeds)
        )

    def _column(self, name: str) -> NDArray[Any]:
        """Return one field of all runs (R, U, ...)."""
        if not self.updates:
            return np.zeros((self.runs, 0, *SIZES.get(name, ())))
        return np.stack([update[name] for update in self.updates], axis=1)
