"""What a row tells of a run, collected update by update, or for many runs of one filter at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np

from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.scoring.batch import SteppedRuns
from maurice_mcl.scoring.metrics import RunScore, Success, first_mostly, score_table, successes
from maurice_mcl.scoring.table import RunTable
from maurice_mcl.sensor.ahead import Compared
from maurice_mcl.sensor.model import SensorModel
from maurice_mcl.values import F64, Arena, Comparison, Moment, OccupancyMap

from .stretches import mapped_share


@dataclass(frozen=True, slots=True, eq=False)
class RunFigures:
    """One run with its scores: meters, radians, seconds."""

    run: RunTable
    score: RunScore
    success: tuple[Success, ...]  # by the thesis's two readings, since the kidnapping
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
        score, run, since = self.score, self.run, (self.kidnapped_at or 1) - 1
        driven_m, spread_m = run.driven_m, run.spread_m
        localized = first_mostly(run.is_localized[since:])
        at = None if localized is None else since + localized - 1
        begun_m, begun_s = (float(values[since]) if since else 0.0 for values in (driven_m, run.times_s))
        good = score.updates if score.lost_at_update is None else score.lost_at_update - 4
        before_loss_m = float(driven_m[good - 1]) if good > 0 else 0.0
        return {
            "updates": score.updates,
            "distance_m": score.distance_m,
            "error_mean_m": score.error_mean_m,
            "error_median_m": score.error_median_m,
            "error_final_m": score.error_final_m,
            "heading_error_mean_rad": score.heading_error_mean_rad,
            "heading_error_median_rad": score.heading_error_median_rad,
            "relative_error_m": None if score.relative is None else score.relative.position_median_m,
            "lost": score.lost,
            "lost_at_update": score.lost_at_update,
            "before_loss_m": before_loss_m if score.lost is not None else None,
            "reached": score.reached,
            "kidnapped_at_update": self.kidnapped_at,
            "pictures_to_localize": localized,
            "localized_m": None if at is None else float(driven_m[at]) - begun_m,
            "localized_s": None if at is None else float(run.times_s[at]) - begun_s,
            "pictures_after": None if score.lost is None else score.updates - since,
            "after_m": None if score.lost is None else float(driven_m[-1]) - begun_m,
            "after_s": None if score.lost is None else float(run.times_s[-1]) - begun_s,
            "right_at_end": score.right_at_end,
            "wrong_confident": score.wrong_confident_share,
            "succeeded_tenth": self._succeeded(0),
            "succeeded_circle": self._succeeded(1),
            "confidence_end": float(run.confidence[-1]),
            "sd_end_m": float(spread_m[-1]),
            "ess_share": float(run.ess_share.cumsum()[-1]) / score.updates,
            "reseeded": int((run.fresh > 0).sum()),
            "took_s": self.took_s,
            "error_m": run.error_m.tolist(),
            "heading_error_rad": run.heading_error_rad.tolist(),
            "sd_m": spread_m.tolist(),
            "confidence": run.confidence.tolist(),
        }

    def _succeeded(self, reading: int) -> bool:
        success = self.success[reading]
        return success.at_step is not None and success.failed is None


@dataclass(slots=True)
class RunTally:
    """Runs of one filter that differ in their seeds, stepped side by side: each finds what it finds alone."""

    numbers: tuple[int, ...]  # of the job's runs
    localizer: Localizer
    runs: SteppedRuns
    arena: Arena
    known_start: bool
    took_s: float = 0.0  # of each run

    @classmethod
    def begin(
        cls, numbers: Sequence[int], localizers: Sequence[Localizer], start: F64 | None, arena: Arena
    ) -> RunTally:
        """Initialize runs (R,) of localizers that differ in nothing but their seeds."""
        runs = SteppedRuns.begin(localizers[0], [localizer.seed for localizer in localizers], start)
        return cls(tuple(numbers), localizers[0], runs, arena, start is not None)

    def step(self, moment: Moment, picture: Compared) -> None:
        """Process the next update of all runs; each has its share of the time, and compares for itself."""
        start_s = perf_counter()
        self.runs.advance(moment, picture.comparison)
        self.took_s += (perf_counter() - start_s) / len(self.numbers) + picture.took_s

    def figures(self, drive: Sequence[Moment]) -> list[RunFigures]:
        """Return the figures of each run; the moments of the drive need no pictures."""
        at = kidnapped_at(drive)
        return [self._figures_of(run, at) for run in self.runs.tables()]

    def _figures_of(self, run: RunTable, at: int | None) -> RunFigures:
        return RunFigures(
            run=run,
            score=score_table(run),
            success=successes(run, self.arena.size_m, (at or 1) - 1),
            took_s=self.took_s,
            kidnapped_at=at,
            known_start=self.known_start,
        )


def kidnapped_at(drive: Sequence[Moment]) -> int | None:
    """Return the last update, from 1, before which the robot was carried away."""
    return max((number for number, moment in enumerate(drive, 1) if moment.kidnapped), default=None)


# The truth along one drive, and how well its pictures fit there: what a map of failures is made of.


@dataclass(slots=True)
class TruthRanks:
    """The rank of the truth's reference in every picture, for each of some sensor models."""

    sensors: Mapping[int, SensorModel]  # by their id
    ranks: dict[int, list[float]] = field(default_factory=dict)

    def add(self, moment: Moment, pictures: Mapping[int, Compared]) -> None:
        """Process the next moment, compared with each sensor model's library."""
        for key, sensor in self.sensors.items():
            self.ranks.setdefault(key, []).append(rank_of_truth(sensor, pictures[key].comparison, moment))

    def columns(self, sensor: SensorModel, moments: Sequence[Moment]) -> dict[str, Any]:
        """Return what a row tells of the truth, update by update."""
        truths = [moment.truth for moment in moments]
        places = [(np.nan, np.nan) if truth is None else truth[:2].tolist() for truth in truths]
        x, y = zip(*places, strict=True) if places else ((), ())
        return {"true_x_m": list(x), "true_y_m": list(y), "truth_rank": self.ranks.get(id(sensor), [])}


def mapped_shares(occupancy: OccupancyMap | None, moments: Sequence[Moment]) -> list[float] | None:
    """Return of every update's beams the share that ends where the map is known; None without a map."""
    if occupancy is None:
        return None
    return [mapped_share(occupancy, moment.frame.scan, moment.truth) for moment in moments]


def rank_of_truth(sensor: SensorModel, comparison: Comparison, moment: Moment) -> float:
    """Return the rank, from 1, of the reference nearest the truth; NaN where it is not known."""
    likely = comparison.log_likelihood
    if moment.truth is None or not len(likely):
        return np.nan
    origin = sensor.library.origin
    pose = (moment.truth - np.append(origin, 0.0)).astype(np.float32)
    (entry,) = sensor.references.entries(pose[None], origin)
    return np.nan if entry < 0 else float((likely > likely[entry]).sum() + 1)
