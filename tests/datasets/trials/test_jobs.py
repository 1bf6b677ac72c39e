"""One job of trials: its runs are stepped as one array, and one that fails does not end the others."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from maurice_datasets.trials.plan import read_plan
from maurice_datasets.trials.rows import MEASURED
from maurice_datasets.trials.runs import Job, Row, jobs_of, run_job
from maurice_datasets.trials.tally import RunFigures, RunTally
from maurice_loaders.errors import InputError
from maurice_mcl.filter.localizer import Localizer
from maurice_mcl.scoring.batch import SteppedRuns
from maurice_mcl.sensor.ahead import compared_ahead
from maurice_mcl.values.session import Frame, Moment

PLAN = """
seeds = 3
[[sessions]]
path = "session.log"
[settings]
particles = 50
[grid]
feature = ["color", "edges"]
"resampling.scheme" = ["systematic", "multinomial"]
[[variants]]
preset = "thesis"
[[variants]]
"recovery.strategy" = "augmented"
[[variants]]
"motion_outliers.share" = 0.1
[[variants]]
"resampling.adaptive" = true
[[variants]]
control = "shuffled references"
[[variants]]
control = "motion constants +30 %"
"""


@pytest.fixture
def job(small_session: Path) -> Job:
    """Three seeds of filters of every kind."""
    file = small_session.with_name("mine.toml")
    file.write_text(PLAN)
    (job,) = jobs_of(read_plan(file), set())
    return job


def untimed(rows: list[Row]) -> list[Row]:
    return [{name: value for name, value in row.items() if name not in MEASURED} for row in rows]


def test_runs_that_differ_in_their_seeds_are_stepped_as_one_array(
    job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    stepped: list[int] = []
    step = RunTally.step

    def counted(self: RunTally, *words: Any) -> None:
        stepped.append(len(self.numbers))
        step(self, *words)

    monkeypatch.setattr(RunTally, "step", counted)
    together = run_job(job)
    assert stepped.count(3) == 8 * 14  # all filters but the one of changing size and the control, 14 pictures
    stepped.clear()
    alone = [row for asked in job.asked for row in run_job(replace(job, asked=(asked,)))]
    assert set(stepped) == {1}
    assert untimed(together) == untimed(alone)
    assert all(row["took_s"] > 0 and row["error"] is None for row in together)


def test_a_run_that_fails_is_not_the_end_of_its_batch(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    undisturbed = untimed(run_job(job))
    advance, step = SteppedRuns.advance, Localizer.step

    def fails_together(self: SteppedRuns, moment: Moment, *words: Any) -> None:
        if moment.frame.step == 5 and len(self.seeds) > 1:
            raise ValueError("one of them")
        advance(self, moment, *words)

    def fails_alone(self: Localizer, state: Any, frame: Frame, *words: Any) -> Any:
        if (frame.step, self.seed) == (5, 1):
            raise ValueError("this one")
        return step(self, state, frame, *words)

    monkeypatch.setattr(SteppedRuns, "advance", fails_together)
    monkeypatch.setattr(Localizer, "step", fails_alone)
    for row, before in zip(untimed(run_job(job)), undisturbed, strict=True):
        if row["seed"] == 1:
            where = r"ValueError in maurice_mcl\.scoring\.batch, line \d+: this one"
            assert re.fullmatch(where, row["error"])
        else:
            assert row == before


def test_a_recording_that_ends_in_damage_fails_its_runs_once(
    job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []

    def damaged(sensors: Any, moments: Iterator[Moment], known: Any) -> Iterator[Any]:
        read.append(1)
        yield from islice(compared_ahead(sensors, moments), 3)
        raise InputError(None, "cut short")

    monkeypatch.setattr("maurice_datasets.trials.runs.compared_ahead", damaged)
    assert {row["error"] for row in run_job(job)} == {"cut short"}
    assert len(read) == 1


def test_why_runs_failed_is_sought_in_one_pass_over_the_drive(
    job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []

    def counted(*words: Any) -> Iterator[Any]:
        read.append(1)
        yield from compared_ahead(*words)

    monkeypatch.setattr("maurice_datasets.trials.runs.compared_ahead", counted)
    monkeypatch.setattr(RunFigures, "failed", property(lambda figures: figures.score.updates > 0))
    together = run_job(job)
    assert len(read) == 2
    alone = [row for asked in job.asked for row in run_job(replace(job, asked=(asked,)))]
    assert untimed(together) == untimed(alone)
    assert all(row["failure"] for row in together)
