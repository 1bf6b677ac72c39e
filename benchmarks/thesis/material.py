"""What the figures of trials are drawn from: rows, timings, and runs recomputed from a row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from maurice_datasets.trials.drives import Drive, open_drive
from maurice_datasets.trials.folder import MissingRuns as MissingRuns
from maurice_datasets.trials.folder import Row as Row
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.plan import SessionSpec
from maurice_datasets.trials.statistics import LEVEL, Interval, mean
from maurice_mcl.filter.localizer import Localizer, run
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.library import Library
from maurice_mcl.values.records import StepRecord
from maurice_mcl.values.session import Moment

from .example import DrivePictures
from .timing import read_timing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXAMPLE = SessionSpec(
    "global", task="global", updates=60, arenas=20
)  # of figures about one drive: seed 0, not chosen
TRACKING = SessionSpec(
    "tracking", task="tracking", updates=120, arenas=20
)  # the same of figures with a known start

MOST_DRIVES = 10  # that are rendered again for what is shown of pictures: 2 s each


@dataclass(frozen=True, slots=True)
class ThesisFigure:
    """A figure: its number in the thesis, our title, and how it is drawn from trials."""

    number: int
    title: str
    draw: Callable[[Material], Figure]


@dataclass(frozen=True)
class Material(TrialsFolder):
    """A folder of trials, and the one drive from which figures of pictures and clouds are drawn."""

    @cached_property
    def timing(self) -> pl.DataFrame:
        """What features and updates cost."""
        timing = read_timing(self.folder)
        if timing is None:
            raise MissingRuns(self.folder, "holds no timing; python -m benchmarks.thesis measures it")
        return timing

    @cached_property
    def drive(self) -> Drive:
        """The example: a simulated global localization, the first of the seeds."""
        return open_drive(self.spec(EXAMPLE), 0)

    @cached_property
    def tracking(self) -> Drive:
        """The example with a known start."""
        return open_drive(self.spec(TRACKING), 0)

    @cached_property
    def pictures(self) -> DrivePictures:
        """The pictures of the example."""
        return DrivePictures(self.drive)

    @cached_property
    def several(self) -> tuple[DrivePictures, ...]:
        """The pictures of the example and of the next drives, for how much its figures depend on chance."""
        seeds = min(self.rows["seed"].n_unique(), MOST_DRIVES)
        more = (DrivePictures(open_drive(self.spec(EXAMPLE), seed)) for seed in range(1, seeds))
        return (self.pictures, *more)

    @property
    def library(self) -> Library:
        """The library of the example."""
        return self.drive.bench.library

    def spec(self, usual: SessionSpec) -> SessionSpec:
        """Return the session of that label as the folder's plan has it, so that quick trials stay quick."""
        for part in self.parts:
            for session in part["sessions"]:
                if session["label"] == usual.label:
                    return SessionSpec(**session)
        return usual

    def localizer(self, **settings: Any) -> Localizer:
        """Return a filter for the example; settings are keys of a plan, with _ for a dot."""
        return self.localizer_on(self.drive, 0, **settings)

    def localizer_on(self, drive: Drive, seed: int, **settings: Any) -> Localizer:
        """Return a filter for a drive."""
        named = {key.replace("__", "."): value for key, value in settings.items()}
        return replace(drive.bench.localizer(named), seed=seed).of_session(drive.session)

    def run_of(self, row: Row) -> Iterator[tuple[Moment, StepRecord]]:
        """Run again the run behind a row: the same, bit for bit."""
        drive = self.drive_of(row)
        return run(self.localizer_of(row), drive.session, drive.start)

    def steps(self, **settings: Any) -> Iterator[tuple[Moment, StepRecord]]:
        """Run a filter over the example again."""
        return run(self.localizer(**settings), self.drive.session, self.drive.start)


def over_drives(values: Sequence[F64], level: float = LEVEL) -> Interval:
    """Return the mean over drives of what each drive's pictures (P,) show; pictures of a drive are alike."""
    return mean(np.array([ranks.mean() for ranks in values]), level=level)
