"""What the figures of trials are drawn from: rows, timings, and runs recomputed from a row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from maurice_datasets.trials.controls import filter_for
from maurice_datasets.trials.drives import Drive, arena_of, open_drive
from maurice_datasets.trials.plan import SessionSpec
from maurice_datasets.trials.rows import read_plan_of
from maurice_datasets.trials.statistics import LEVEL, Interval, mean
from maurice_datasets.trials.table import load_trials
from maurice_datasets.trials.timing import read_timing
from maurice_loaders.errors import InputError
from maurice_mcl.arrays import F64
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.library import Library
from maurice_mcl.map import Arena
from maurice_mcl.records import StepRecord
from maurice_mcl.session import Moment

from .example import DrivePictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXAMPLE = SessionSpec("global", task="global", updates=60)  # of figures about one drive: seed 0, not chosen
TRACKING = SessionSpec("tracking", task="tracking", updates=120)  # the same of figures with a known start

MOST_DRIVES = 5  # that are rendered again for the spread of figures about pictures: 5 s each


class NothingToDraw(InputError):
    """The folder does not hold what a figure needs; the text says which plan makes it."""


@dataclass(frozen=True, slots=True)
class ThesisFigure:
    """A figure: its number in the thesis, our title, and how it is drawn from trials."""

    number: int
    title: str
    draw: Callable[[Material], Figure]


@dataclass(frozen=True)
class Material:
    """A folder of trials, and the one drive from which figures of pictures and clouds are drawn."""

    folder: Path

    @cached_property
    def rows(self) -> pl.DataFrame:
        """All rows that did not fail."""
        return load_trials(self.folder).filter(pl.col("error").is_null())

    @cached_property
    def timing(self) -> pl.DataFrame:
        """What features and updates cost."""
        try:
            return read_timing(self.folder)
        except InputError:
            raise NothingToDraw(
                self.folder, "holds no timing; maurice-replay trials timing makes it"
            ) from None

    @cached_property
    def parts(self) -> list[str]:
        """The parts of the folder's plan, in order."""
        return [part["name"] for part in read_plan_of(self.folder)["parts"]]

    def part(self, name: str, **wanted: Any) -> pl.DataFrame:
        """Return the rows of a part in which columns have some values; NothingToDraw where there are none."""
        rows = self.rows.filter(pl.col("part") == name)
        for column, value in wanted.items():
            rows = rows.filter(pl.col(column) == value) if column in rows.columns else rows.clear()
        if rows.is_empty():
            raise NothingToDraw(
                self.folder, f"holds no runs of {name}; maurice-replay trials {name} makes them"
            )
        return rows

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
        for part in read_plan_of(self.folder)["parts"]:
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

    def steps(self, **settings: Any) -> Iterator[tuple[Moment, StepRecord]]:
        """Run a filter over the example again."""
        return steps_of(self.localizer(**settings), self.drive)

    def drive_of(self, row: dict[str, Any]) -> Drive:
        """Return the drive of the run behind a row."""
        return _drive(SessionSpec(**self._asked(row)[1]), row["seed"])

    def arena_of(self, row: dict[str, Any]) -> Arena:
        """Return the map of the run behind a row."""
        return arena_of(SessionSpec(**self._asked(row)[1]), row["seed"])

    def localizer_of(self, row: dict[str, Any]) -> Localizer:
        """Return the filter of the run behind a row."""
        settings = settings_of(self._asked(row)[0], row["variant"])
        return filter_for(self.drive_of(row), settings, row["seed"])

    def run_of(self, row: dict[str, Any]) -> Iterator[tuple[Moment, StepRecord]]:
        """Run again the run behind a row: the same, bit for bit."""
        return steps_of(self.localizer_of(row), self.drive_of(row))

    def _asked(self, row: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the part and the session of the folder's plan that a row is of."""
        for part in read_plan_of(self.folder)["parts"]:
            for session in part["sessions"]:
                if part["name"] == row["part"] and session["label"] == row["session"]:
                    return part, session
        raise NothingToDraw(self.folder, f"holds no session {row['session']!r} of a part {row['part']!r}")


@lru_cache(2)
def _drive(spec: SessionSpec, seed: int) -> Drive:
    """Return a drive; the last two are kept, because their pictures take longer to render than to use."""
    return open_drive(spec, seed)


def steps_of(localizer: Localizer, drive: Drive) -> Iterator[tuple[Moment, StepRecord]]:
    """Yield every moment of a drive with its record."""
    state = localizer.initialize(drive.start)
    for moment in drive.session.moments():
        state, record = localizer.step(state, moment.frame)
        yield moment, record


def over_drives(values: Sequence[F64], level: float = LEVEL) -> Interval:
    """Return the mean over drives of what each drive's pictures (P,) show; pictures of a drive are alike."""
    return mean(np.array([one.mean() for one in values]), level=level)


def settings_of(part: dict[str, Any], variant: int) -> dict[str, Any]:
    """Return what a variant of a stored plan sets."""
    from maurice_datasets.trials.plan import Variant, Variants

    held = part["variants"]
    listed = tuple(Variant(one["label"], one["settings"]) for one in held["listed"])
    return dict(Variants(held["settings"], held["grid"], listed)[variant].settings)
