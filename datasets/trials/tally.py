"""What a row tells of a run, collected update by update, or for many runs of one filter at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from maurice_mcl.filter.batch import SteppedRuns
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.scoring.metrics import RunErrors, RunScore, Scorer, SuccessJudge, first_mostly
from maurice_mcl.scoring.trace_score import DrivenPath, score_trace, trace_errors
from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.map import Arena
from maurice_mcl.values.records import FilterState, StepRecord
from maurice_mcl.values.session import Moment


@dataclass(frozen=True, slots=True, eq=False)
class RunFigures:
    """One run of U updates in numbers: meters, radians, seconds."""

    score: RunScore  # with both readings of success
    errors: RunErrors
    sd_m: F64  # (U,) of the cloud
    confidence: F64  # (U,)
    driven_m: F64  # (U,)
    times_s: F64  # (U,)
    ess_share: F64  # (U,) effective sample size over the number of particles
    reseeded: int  # updates with fresh particles
    took_s: float
    kidnapped_at: int | None  # update, from 1
    known_start: bool

    @property
    def tracks(self) -> bool:
        """Whether the run began at the true pose and nobody carried the robot away."""
        return self.known_start and self.kidnapped_at is None

    @property
    def failed(self) -> bool:
        """Whether the run failed: it was lost, or where it does not track, is not right at its end.

        This is the thesis's (3.6.2, figure 37). A run without truth did not fail.
        """
        return self.score.lost is True if self.tracks else self.score.right_at_end is False

    def row(self) -> dict[str, Any]:
        """Return all figures; None where the truth is not known."""
        found, since = self.score, (self.kidnapped_at or 1) - 1
        localized = first_mostly(self.errors.localized[since:])
        at = None if localized is None else since + localized - 1
        begun_m, begun_s = (
            float(values[since]) if since else 0.0 for values in (self.driven_m, self.times_s)
        )
        good = found.updates if found.lost_at_update is None else found.lost_at_update - 4
        before_loss_m = float(self.driven_m[good - 1]) if good > 0 else 0.0
        return {
            "updates": found.updates,
            "distance_m": found.distance_m,
            "error_m": found.position_error_mean_m,
            "error_median_m": found.position_error_median_m,
            "final_error_m": found.position_error_final_m,
            "heading_error_rad": found.heading_error_mean_rad,
            "heading_error_median_rad": found.heading_error_median_rad,
            "relative_error_m": None if found.relative is None else found.relative.position_median_m,
            "lost": found.lost,
            "lost_at_update": found.lost_at_update,
            "before_loss_m": before_loss_m if found.lost is not None else None,
            "reached": found.reached,
            "kidnapped_at_update": self.kidnapped_at,
            "pictures_to_localize": localized,
            "localized_m": None if at is None else float(self.driven_m[at]) - begun_m,
            "localized_s": None if at is None else float(self.times_s[at]) - begun_s,
            "pictures_after": None if found.lost is None else found.updates - since,
            "after_m": None if found.lost is None else float(self.driven_m[-1]) - begun_m,
            "after_s": None if found.lost is None else float(self.times_s[-1]) - begun_s,
            "right_at_end": found.right_at_end,
            "wrong_confident": found.wrong_confident_share,
            "succeeded_tenth": self._succeeded(0),
            "succeeded_circle": self._succeeded(1),
            "confidence_end": float(self.confidence[-1]),
            "sd_end_m": float(self.sd_m[-1]),
            "ess_share": float(self.ess_share.cumsum()[-1]) / found.updates,
            "reseeded": self.reseeded,
            "took_s": self.took_s,
            "off_m": self.errors.off_m.tolist(),
            "sd_m": self.sd_m.tolist(),
            "confidence": self.confidence.tolist(),
        }

    def _succeeded(self, reading: int) -> bool:
        found = self.score.success[reading]
        return found.at_step is not None and found.failed is None


@dataclass(slots=True)
class RunTally:
    """One run that is stepped alone; keeps a few numbers per update and no cloud."""

    number: int  # of the job's runs
    localizer: Localizer
    state: FilterState
    judge: SuccessJudge
    known_start: bool
    scorer: Scorer = field(default_factory=Scorer)
    values: list[tuple[float, float, float]] = field(default_factory=list)  # sd, confidence, ESS
    fresh: int = 0
    took_s: float = 0.0

    @classmethod
    def begin(cls, number: int, localizer: Localizer, start: F64 | None, arena: Arena) -> RunTally:
        """Initialize a run."""
        judge = SuccessJudge(arena.size_m)
        return cls(number, localizer, localizer.initialize(start), judge, start is not None)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the job's runs that are stepped here."""
        return (self.number,)

    def step(self, moment: Moment, picture: Compared) -> None:
        """Process the next update."""
        self.state, record = self.localizer.step(self.state, moment.frame, picture)
        self.add(moment, record)

    def add(self, moment: Moment, record: StepRecord) -> None:
        """Keep the numbers of an update."""
        truth = moment.truth
        self.scorer.add(record.estimate, truth, moment.frame.motions)
        self.judge.add(record, truth)
        sd_m = float(np.hypot(*record.mean_estimate.sd_m))
        ess_share = record.effective_sample_size / record.weighted.size
        self.values.append((sd_m, record.estimate.confidence, ess_share))
        self.fresh += record.injected is not None
        self.took_s += sum(record.took_s.values())

    def figures(self, drive: Sequence[Moment]) -> list[RunFigures]:
        """Return the run's figures; the moments of the drive need no pictures."""
        path = DrivenPath.of(drive)
        sd_m, confidence, ess_share = np.array(self.values, np.float64).T
        return [
            RunFigures(
                score=replace(self.scorer.result(), success=self.judge.result()),
                errors=self.scorer.errors(),
                sd_m=sd_m,
                confidence=confidence,
                driven_m=path.driven_m,
                times_s=path.times_s,
                ess_share=ess_share,
                reseeded=self.fresh,
                took_s=self.took_s,
                kidnapped_at=kidnapped_at(drive),
                known_start=self.known_start,
            )
        ]


@dataclass(slots=True)
class BatchTally:
    """Runs of one filter that differ in their seeds, stepped as one array: each finds what it finds alone."""

    numbers: tuple[int, ...]  # of the job's runs
    localizer: Localizer
    runs: SteppedRuns
    arena: Arena
    known_start: bool
    took_s: float = 0.0  # of each run

    @classmethod
    def begin(
        cls, numbers: Sequence[int], localizers: Sequence[Localizer], start: F64 | None, arena: Arena
    ) -> BatchTally:
        """Initialize runs (R,) of localizers that differ in nothing but their seeds."""
        runs = SteppedRuns.begin(localizers[0], [one.seed for one in localizers], start)
        return cls(tuple(numbers), localizers[0], runs, arena, start is not None)

    def step(self, moment: Moment, picture: Compared) -> None:
        """Process the next update of all runs; each has its share of the time, and compares for itself."""
        began = perf_counter()
        self.runs.advance(moment.frame, picture.comparison)
        self.took_s += (perf_counter() - began) / len(self.numbers) + picture.took_s

    def figures(self, drive: Sequence[Moment]) -> list[RunFigures]:
        """Return the figures of each run; the moments of the drive need no pictures."""
        path = DrivenPath.of(drive)
        return [
            RunFigures(
                score=score_trace(trace, path, self.arena),
                errors=trace_errors(trace, path),
                sd_m=np.hypot(trace.mean_sd_m[:, 0], trace.mean_sd_m[:, 1]),
                confidence=trace.confidence,
                driven_m=path.driven_m,
                times_s=path.times_s,
                ess_share=trace.effective_sample_size / self.localizer.particles,
                reseeded=int((trace.fresh > 0).sum()),
                took_s=self.took_s,
                kidnapped_at=kidnapped_at(drive),
                known_start=self.known_start,
            )
            for trace in self.runs.traces()
        ]


def kidnapped_at(drive: Sequence[Moment]) -> int | None:
    """Return the last update, from 1, before which the robot was carried away."""
    told = [number for number, one in enumerate(drive, 1) if one.kidnapped]
    return told[-1] if told else None
