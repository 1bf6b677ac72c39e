"""One drive of a check: a filter run over it with many seeds, judged, and compared with a baseline."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from maurice_datasets.trials.engine import tables_of
from maurice_loaders.errors import InputError
from maurice_loaders.libraries.measured import known_descriptors
from maurice_loaders.reading.options import Reading
from maurice_loaders.reading.session import RecordedSession
from maurice_loaders.runs.manifest import is_saved
from maurice_loaders.runs.store import SavedRun
from maurice_loaders.session_log.header import drive_name
from maurice_mcl.scoring.batch import SeededRuns, compared_once
from maurice_mcl.scoring.demands import (
    ERROR,
    Demands,
    RunJudgement,
    RunTrack,
    is_judged,
    judge_run,
    starts_of,
)
from maurice_mcl.scoring.table import LOCALIZED_OF, TableRows
from maurice_mcl.values import Library, Moment, plain

from ...errors import Listener, OptionError, progress_of
from ...playback import FilterRun
from ...running.filters import Filter, read_as_amcl
from ...running.open import (
    make_runs,
    open_library_for,
    open_session,
    overview_of,
    remark_skipped,
)
from ...running.saved_steps import Pictures, Restored, restored_together
from ...style import Scale, scale_for
from ..convert import only_run
from . import rules
from .failure import FailedRun, Replayed, failed_recorded, failed_run
from .rules import BaselineChange, BaselineRuns, DemandResult, DriveRuns


@dataclass(frozen=True, slots=True, eq=False)
class DriveCheck:
    """What was found on one drive."""

    made: DriveRuns
    path: Path
    steps: tuple[int, ...]  # (U,) numbers of the updates
    scale: Scale
    runs: tuple[RunJudgement, ...]  # one a seed
    demands: tuple[DemandResult, ...]
    changes: tuple[BaselineChange, ...] = ()
    failure: FailedRun | None = None  # a run that failed, where the check failed
    took_s: float = 0.0
    unseen: tuple[str, ...] = ()  # what the demands cannot see, whatever the number of runs
    recorded: bool = False  # another localizer's only run: there are no more

    @property
    def session(self) -> str:
        """The name of the session."""
        return self.made.session

    @property
    def passed(self) -> bool:
        """Whether every demand holds and nothing grew worse."""
        return all(result.passed for result in self.demands) and all(result.passed for result in self.changes)

    @property
    def doubts(self) -> list[str]:
        """What so few runs, or these demands, cannot tell for certain, one line each."""
        return [*(() if self.recorded else rules.doubts(self.demands)), *self.unseen]

    @property
    def change_texts(self) -> list[str]:
        """The numbers of every change, in words."""
        return [self._text_of(change) for change in self.changes]

    def _text_of(self, change: BaselineChange) -> str:
        values = (change.before, change.now, change.difference, change.low, change.high)
        before, now, by, low, high = (self.figure(change.kind, v) for v in values)
        return (
            f"{change.title}: {before} before, {now} now, difference {by} ({low} to {high}, 95 % interval), "
            f"{change.pairs} seeds, p = {change.p:.2g}"
        )

    def figure(self, kind: str, value: float) -> str:
        """Write a figure of a change: a length, or a rate."""
        return rules.say_length(value, self.scale) if kind == ERROR else f"{value:.0%}"

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON, lengths in meters."""
        values = {
            "session": self.session,
            "path": self.path,
            "passed": self.passed,
            "updates": len(self.steps),
            "configuration": self.made.configuration,
            "demands": self.demands,
            "against": self.changes,
            "uncertain": self.doubts,
            "runs": [self._run(run) for run in self.runs],
            "failure": self.failure,
        }
        return plain(values)

    def _run(self, run: RunJudgement) -> dict[str, Any]:
        first = run.first_failed_at
        return {
            "seed": run.seed,
            "passed": run.passed,
            "met": dict(run.met),
            "error_mean_m": run.error_mean_m,
            "localized_after": run.found_after,
            "converged_after": run.converged_after,
            "first_failed_step": None if first is None else self.steps[first],
        }


@dataclass(frozen=True, slots=True)
class CheckedFilter:
    """What is checked on every drive: a filter, what is demanded of it, and what it is compared with."""

    spec: Filter
    library: Path | Library | None
    demands: Demands
    seeds: int
    baseline: BaselineRuns | None = None
    artifacts: Path | None = None
    reading: Reading = field(default_factory=Reading)


def check_drive(
    asked: CheckedFilter, source: str | Path | RecordedSession, taken: Sequence[str], listener: Listener
) -> DriveCheck:
    """Run a filter over a drive with every seed and judge it; `taken` are names of other drives.

    A saved run of a recorded localizer is judged as it is. InputError, OptionError.
    """
    start_s = time.perf_counter()
    if isinstance(source, (str, Path)) and is_saved(Path(source)):
        saved = only_run(Path(source))
        if saved.manifest.recorded:
            return replace(
                _check_recorded(saved, asked, taken, listener), took_s=time.perf_counter() - start_s
            )
    reading, (spec,) = read_as_amcl(source, asked.reading, [asked.spec], listener)
    asked = replace(asked, reading=reading, spec=spec)
    session = open_session(source, asked.reading, listener)
    keep_going = asked.reading.keep_going
    library = open_library_for(session, asked.library, keep_going=keep_going, listener=listener)
    run = make_runs(session, library, [asked.spec], listener)[0]
    moments, tracks = _run_all(run, session, asked, listener)
    name = _unique(session.info.name or drive_name(session.path), taken)
    tracked = DriveRuns(name, hashlib.sha256(run.configuration.encode()).hexdigest()[:12], tracks)
    scale = scale_for(session.info.display_units, library.arena)
    result = _check_of(tracked, session.path, scale, moments, asked, listener)
    has_truth = any(moment.truth is not None for moment in moments)
    unseen = rules.blind_spots(result.demands, has_truth=has_truth, start_known=run.start is not None)
    result = replace(result, unseen=tuple(unseen))
    if not result.passed:
        replayed = Replayed(session, library, run, result.steps)
        worst = _worst(result, asked)
        result = replace(
            result, failure=failed_run(replayed, *worst, result.session, asked.artifacts, listener)
        )
    return replace(result, took_s=time.perf_counter() - start_s)


def _unique(name: str, taken: Sequence[str]) -> str:
    names = chain([name], (f"{name} ({number})" for number in count(2)))
    return next(free for free in names if free not in taken)


def _run_all(
    run: FilterRun, session: RecordedSession, asked: CheckedFilter, listener: Listener
) -> tuple[list[Moment], tuple[RunTrack, ...]]:
    """Compare every picture once, and run the filter with every seed; pictures are not kept."""
    total, has_truth = overview_of(session, listener)
    _expect_truth(session.path, asked.demands, has_truth=has_truth)
    moments: list[Moment] = []

    def seen() -> Iterator[Moment]:
        for moment in session.moments():
            yield moment
            moments.append(moment.without_picture)
            listener.progress(len(moments), total, "compare pictures")

    comparisons = compared_once(run.localizer.sensor, seen(), known_descriptors())
    remark_skipped(session, listener)
    _expect_long_enough(session.path, moments, asked.demands)
    runs = SeededRuns(run.localizer, moments, comparisons, range(asked.seeds), run.start)
    (tables,) = tables_of([runs], progress_of(listener, f"{asked.seeds:,} runs"))
    return moments, tuple(map(RunTrack.of, tables))


def _check_recorded(
    saved: SavedRun, asked: CheckedFilter, taken: Sequence[str], listener: Listener
) -> DriveCheck:
    """Judge a recorded localizer's run by its steps."""
    if asked.spec != Filter() or asked.library is not None or asked.seeds > 1:
        only = "only demands apply, no options of a filter"
        raise OptionError(f"{saved.folder} is another localizer's run: {only}")
    manifest, moments, rows = saved.manifest, list[Moment](), TableRows()
    _expect_truth(saved.folder, asked.demands, has_truth=manifest.has_truth)
    for moment, records in restored_together([Restored(saved, None)], Pictures()):
        moments.append(moment)
        rows.add(moment, records[manifest.label])
    _expect_long_enough(saved.folder, moments, asked.demands)
    track = RunTrack.of(rows.table(manifest.seed))
    runs = DriveRuns(_unique(manifest.name, taken), manifest.configuration_sha256[:12], (track,))
    scale = scale_for(manifest.display_units, saved.arena())
    result = _check_of(runs, saved.folder, scale, moments, asked, listener)
    unseen = rules.blind_spots(result.demands, has_truth=manifest.has_truth, start_known=False)
    result = replace(result, unseen=tuple(unseen), recorded=True)
    if result.passed:
        return result
    seed, update = _worst(result, asked)
    failure = failed_recorded(saved, seed, result.steps[update], result.session, asked.artifacts)
    return replace(result, failure=failure)


def _expect_truth(path: Path, demands: Demands, *, has_truth: bool) -> None:
    if demands.need_truth and not has_truth:
        raise InputError(
            path,
            "found no true poses, which --max-error and --localized-by need; --converged-by needs none, "
            "but does not tell a right place from a wrong one",
        )


def _expect_long_enough(path: Path, moments: list[Moment], demands: Demands) -> None:
    """Refuse a drive on which a demand cannot be judged. InputError."""
    if not moments:
        raise InputError(path, "found no picture, so nothing can be checked")
    starts, updates = starts_of(moments), len(moments)
    for name, limit in (("localized", demands.localized_by), ("converged", demands.converged_by)):
        if limit is not None and not is_judged(0, starts, updates, limit):
            here = (*starts, updates)[1]
            before = "" if len(starts) == 1 else " before the kidnapping"
            length = f"found {here} steps{before}, too few to judge --{name}-by {limit}"
            raise InputError(path, f"{length}; expected at most {max(here - LOCALIZED_OF[1] + 1, 0)}")
    counted = zip(demands.counting(updates, starts).tolist(), moments, strict=True)
    if demands.need_truth and not any(counts and moment.truth is not None for counts, moment in counted):
        raise InputError(path, f"found no true pose after step {demands.grace}, so no error counts")


def _check_of(
    drive: DriveRuns,
    path: Path,
    scale: Scale,
    moments: list[Moment],
    asked: CheckedFilter,
    listener: Listener,
) -> DriveCheck:
    starts = starts_of(moments)
    runs = tuple(judge_run(track, starts, asked.demands) for track in drive.tracks)
    result = DriveCheck(
        made=drive,
        path=path,
        steps=tuple(moment.frame.step for moment in moments),
        scale=scale,
        runs=runs,
        demands=rules.demand_results(runs, asked.demands, scale),
    )
    if asked.baseline is None:
        return result
    before = asked.baseline.of(drive.session, len(moments))
    if asked.baseline.configurations[drive.session] != drive.configuration:
        listener.remark(f"{drive.session}: the filter's settings differ from those of the baseline")
    known = any(moment.truth is not None for moment in moments)
    demands = asked.demands
    if known and demands.max_error_m is None:
        demands = replace(demands, max_error_m=np.inf)  # so that errors and losses are compared
    old = {track.seed: judge_run(track, starts, demands) for track in before.values()}
    new = [judge_run(track, starts, demands) for track in drive.tracks]
    return replace(result, changes=rules.changes(old, new, demands, scale))


def _worst(result: DriveCheck, asked: CheckedFilter) -> tuple[int, int]:
    """Return seed and update, from 0, to look at: where the first demand that does not hold is first failed.

    Where only a change fails, the seed whose error grew most, at the update at which it grew most.
    """
    for demand in result.demands:
        failed = [run for run in result.runs if demand.kind in run.failed_at]
        if failed and not demand.passed:
            return failed[0].seed, failed[0].failed_at[demand.kind]
    assert asked.baseline is not None
    before = asked.baseline.of(result.session, len(result.steps))
    grown = {
        track.seed: np.nan_to_num(track.error_m - before[track.seed].error_m)
        for track in result.made.tracks
        if track.seed in before
    }
    seed = max(grown, key=lambda seed: float(grown[seed].sum()))
    return seed, int(grown[seed].argmax())
