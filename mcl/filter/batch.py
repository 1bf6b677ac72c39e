"""Independent runs of one filter with different seeds, from one comparison of every picture.

    comparisons = compared_once(localizer.sensor, moments)
    traces = run_batch(localizer, moments, seeds=range(100), comparisons=comparisons)

What a run finds is the same as if it ran alone, bit for bit. It returns numbers, not records: a record holds
five clouds, and thousands of runs would hold millions. A run worth a look can be repeated alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import F64, I32
from ..radii import Radii
from ..records import Comparison, Estimate, StepRecord
from ..sensor.ahead import Compared, compared_ahead
from ..sensor.model import SensorModel
from ..session import Moment
from .batch_step import Batch, Runs, can_batch
from .estimate import CIRCLE_M, share_within
from .localizer import RESAMPLED, Localizer


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


def compared_once(sensor: SensorModel, moments: Iterable[Moment]) -> tuple[Comparison, ...]:
    """Compare every picture with the library, on a second thread: for many batches over one session."""
    return tuple(pictures[0].comparison for _, pictures in compared_ahead([sensor], moments))


def run_batch(
    localizer: Localizer,
    moments: Sequence[Moment],
    seeds: Sequence[int],
    starts: Sequence[F64 | None] | F64 | None = None,
    comparisons: Sequence[Comparison] | None = None,
) -> tuple[RunTrace, ...]:
    """Run a filter over the same moments once per seed; return a trace for each, in order.

    `starts` is the pose (3,) at which all begin, None to spread each over all free space, or one of these for
    every seed. `comparisons` are those of the moments' pictures, where they are known (`compared_once`).
    The localizer's own seed is not used; it must have a motion model (`Localizer.of_session`).
    """
    if comparisons is None:
        comparisons = compared_once(localizer.sensor, moments)
    places = [starts] * len(seeds) if starts is None or isinstance(starts, np.ndarray) else starts
    numbers = _Numbers.make(len(seeds), len(moments), localizer.particles)
    if len(seeds) and can_batch(localizer):
        _together(Batch.begin(localizer, seeds, places), moments, comparisons, numbers)
    else:
        for run, (seed, start) in enumerate(zip(seeds, places, strict=True)):
            _alone(replace(localizer, seed=seed), moments, start, comparisons, numbers, run)
    return numbers.traces(seeds, localizer.radii, moments)


SIZES = {"poses": (3,), "sd_m": (2,), "mean_poses": (3,), "mean_sd_m": (2,)}  # of the others: one number
COUNTS = ("particles", "parents", "fresh")
WITHOUT_NUMBERS = ("seed", "radii", "steps", "times_s", "events")


@dataclass(frozen=True, slots=True)
class _Numbers:
    """The numbers of R runs while they are made."""

    columns: dict[str, NDArray[Any]]  # (R, U, ...) by the fields of a trace
    events: list[list[tuple[str, ...]]]  # (R, U)
    particles: int  # of a run, where nothing changes it

    @classmethod
    def make(cls, runs: int, updates: int, particles: int) -> _Numbers:
        """Return R runs of U updates, all zero."""
        names = [f.name for f in fields(RunTrace) if f.name not in WITHOUT_NUMBERS]
        columns = {
            name: np.zeros((runs, updates, *SIZES.get(name, ())), "int32" if name in COUNTS else "float64")
            for name in names
        }
        return cls(columns, [[()] * updates for _ in range(runs)], particles)

    def put(self, update: int, run: int, record: StepRecord) -> None:
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
        for name, column in self.columns.items():
            column[run, update] = values[name]
        self.events[run][update] = record.events

    def put_some(self, update: int, runs: Runs, found: dict[str, NDArray[Any]]) -> None:
        """Keep the numbers of an update in which nothing out of the ordinary happened to some runs."""
        self.columns["particles"][runs, update] = self.particles
        for name, column in self.columns.items():
            if name in found:
                column[runs, update] = found[name]
        for run, resampled in zip(runs.tolist(), found["resampled"].tolist(), strict=True):
            self.events[run][update] = (RESAMPLED,) if resampled else ()

    def traces(self, seeds: Sequence[int], radii: Radii, moments: Sequence[Moment]) -> tuple[RunTrace, ...]:
        """Return the runs one by one."""
        steps = np.array([moment.frame.step for moment in moments], np.int32)
        times_s = np.array([moment.frame.time_s for moment in moments], np.float64)
        return tuple(
            RunTrace(
                seed=seed,
                radii=radii,
                steps=steps,
                times_s=times_s,
                events=tuple(self.events[run]),
                **{name: column[run] for name, column in self.columns.items()},
            )
            for run, seed in enumerate(seeds)
        )


def _together(
    batch: Batch, moments: Sequence[Moment], comparisons: Sequence[Comparison], numbers: _Numbers
) -> None:
    """Run all filters of a batch side by side, update by update."""
    for update, (moment, comparison) in enumerate(zip(moments, comparisons, strict=True)):
        put, put_record = partial(numbers.put_some, update), partial(numbers.put, update)
        batch.advance(moment.frame, comparison, put, put_record)


def _alone(
    localizer: Localizer,
    moments: Sequence[Moment],
    start: F64 | None,
    comparisons: Sequence[Comparison],
    numbers: _Numbers,
    run: int,
) -> None:
    """Run one filter update by update: what every batch must equal."""
    state = localizer.initialize(start)
    for update, (moment, comparison) in enumerate(zip(moments, comparisons, strict=True)):
        state, record = localizer.step(state, moment.frame, Compared(comparison, 0.0))
        numbers.put(update, run, record)
