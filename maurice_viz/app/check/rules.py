"""From runs to a decision: which demands hold, in how many runs, and whether that is worse than a baseline.

The rules are in docs/trials.md: a demand holds where enough of the runs meet it; a change fails where a test
of the paired differences says that it is for the worse.
"""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from maurice_datasets.trials import statistics
from maurice_datasets.trials.statistics import Interval
from maurice_loaders.errors import InputError
from maurice_mcl.scoring.demands import CONVERGED, ERROR, KEPT, LOCALIZED, Demands, RunJudgement, RunTrack
from maurice_mcl.values import F64, Plain

from ...style import Scale

ROUNDING = 1e-9  # of a rate
LEAST_PAIRS = 6  # with fewer no test of rates can tell anything
WORSE_P = 0.05  # p-value, of both sides: so 2.5 % of the checks in which nothing changed fail
SAME_ERROR_M = 0.001  # a difference of mean errors below it is none: another machine rounds otherwise


@dataclass(frozen=True, slots=True)
class DemandResult(Plain):
    """One demand on all runs of a drive."""

    also = ("rate", "passed", "is_certain")
    kind: str  # "localized", "not_lost", "error" or "converged"
    title: str  # "mean error at most 30 cm"
    found: str  # the figure behind it, in words
    met: int  # runs that meet it
    runs: int
    needed: float  # the rate that is demanded
    low: float  # 95 percent interval of the rate
    high: float

    @property
    def rate(self) -> float:
        """The share of runs that meet it."""
        return self.met / self.runs

    @property
    def passed(self) -> bool:
        """Whether enough runs meet it: at least the demanded share."""
        return self.rate >= self.needed - ROUNDING

    @property
    def is_certain(self) -> bool:
        """Whether the interval of the rate lies on one side of the demanded one."""
        return self.low >= self.needed - ROUNDING if self.passed else self.high < self.needed

    @property
    def text(self) -> str:
        """The result in one line."""
        runs = f"{self.met} of {self.runs} run{'s' * (self.runs > 1)}"
        return f"{self.title}: met by {runs}, {self.needed:.0%} needed; {self.found}"


@dataclass(frozen=True, slots=True)
class BaselineChange(Plain):
    """How a figure changed since a baseline, over the same seeds."""

    also = ("passed",)
    title: str
    kind: str
    before: float
    now: float
    difference: float
    low: float  # 95 percent interval of the paired difference
    high: float
    pairs: int
    p: float  # of no change, adjusted for the number of figures that are compared

    @property
    def passed(self) -> bool:
        """Whether nothing shows that it grew worse: an error that grew, or a rate that fell."""
        worse = self.difference > SAME_ERROR_M if self.kind == ERROR else self.difference < -ROUNDING
        return not (worse and self.p < WORSE_P)


def demand_results(runs: Sequence[RunJudgement], demands: Demands, scale: Scale) -> tuple[DemandResult, ...]:
    """Count the runs that meet each demand."""
    results = []
    for kind in demands.kinds:
        met = sum(run.met[kind] for run in runs)
        share = statistics.rate(met, len(runs))
        results.append(
            DemandResult(
                kind,
                title_of(kind, demands, scale),
                FOUND[kind](runs, scale),
                met,
                len(runs),
                demands.min_localized,
                share.low,
                share.high,
            )
        )
    return tuple(results)


def title_of(kind: str, demands: Demands, scale: Scale) -> str:
    """Return a demand in a few words: "localized by step 20"."""
    if kind == LOCALIZED:
        return f"localized by step {demands.localized_by}"
    if kind == CONVERGED:
        return f"converged by step {demands.converged_by}"
    if kind == ERROR:
        return f"mean error at most {say_length(demands.max_error_m or 0.0, scale)}"
    return "not lost" if demands.localized_by is None else "not lost from then on"


def say_length(length_m: float, scale: Scale) -> str:
    """Write a length to three digits: an error may be far below what a map is drawn with."""
    return f"{scale.length(length_m):.3g} {scale.units.name}"


def _after(after: Sequence[int | None], found_at: Sequence[Sequence[bool]], what: str) -> str:
    """Say how long runs searched, and of those that were not found at every start, at which they were not."""
    known = [count for count in after if count is not None]
    parts = [f"after {np.median(known):g} (median), {max(known)} at worst"] if known else []
    counts = Counter(_missed(reached) for reached in found_at if not all(reached))
    parts += [
        f"{outcome.format(what)} in {count} run{'s' * (count > 1)}" for outcome, count in counts.items()
    ]
    return ", ".join(parts)


def _missed(reached: Sequence[bool]) -> str:
    if not any(reached):
        return "never {}"
    return "not {} again after a kidnapping" if reached[0] else "not {} before a kidnapping"


def _localized(runs: Sequence[RunJudgement], scale: Scale) -> str:
    return _after([run.found_after for run in runs], [run.found_at[LOCALIZED] for run in runs], "localized")


def _converged(runs: Sequence[RunJudgement], scale: Scale) -> str:
    after = [run.converged_after for run in runs]
    return _after(after, [run.found_at[CONVERGED] for run in runs], "converged")


def _error(runs: Sequence[RunJudgement], scale: Scale) -> str:
    errors_m = [run.error_mean_m for run in runs if run.error_mean_m is not None]
    if len(errors_m) == 1:
        return say_length(errors_m[0], scale)
    average, worst = (say_length(length_m, scale) for length_m in (float(np.mean(errors_m)), max(errors_m)))
    return f"{average} on average, {worst} at worst"


def _lost(runs: Sequence[RunJudgement], scale: Scale) -> str:
    lost = [run.seed for run in runs if KEPT in run.failed_at]
    more = f" and {len(lost) - 3} more" if len(lost) > 3 else ""
    return f"lost with seed {', '.join(map(str, lost[:3]))}{more}" if lost else "never lost"


Words = Callable[[Sequence[RunJudgement], Scale], str]
FOUND: Mapping[str, Words] = {LOCALIZED: _localized, KEPT: _lost, ERROR: _error, CONVERGED: _converged}


def doubts(results: Sequence[DemandResult]) -> list[str]:
    """Return in a line each what so few runs cannot tell for certain, and of which demands."""
    titles_of: dict[str, list[str]] = {}
    for result in results:
        if result.runs < 2 or result.is_certain or (result.passed and result.needed >= 1):
            continue  # no number of runs shows that all meet it
        advice = f"{enough(result.needed)} runs without a failure would show {result.needed:.0%}"
        if not result.passed:
            advice = f"{result.needed:.0%} is not excluded, and more --seeds would tell"
        met = f"met by {result.met} of {result.runs} runs"
        text = f"{met}, so the rate is {result.low:.0%} to {result.high:.0%}; {advice}"
        titles_of.setdefault(text, []).append(result.title)
    return [f"{', '.join(titles)}: {text}" for text, titles in titles_of.items()]


def blind_spots(results: Sequence[DemandResult], *, has_truth: bool, start_known: bool) -> list[str]:
    """Return in a line each what runs that are sure of a place do not show."""
    titles = [result.title for result in results if result.kind == CONVERGED]
    if not titles:
        return []
    spots = []
    if not has_truth:
        right = "without true poses a run that is sure of a wrong place meets it too"
        spots.append(f"{titles[0]}: {right}; `diagnose` says where a run was probably lost")
    if start_known:
        spots.append(
            f"{titles[0]}: the start is given, so runs are sure at once; --start global asks for a search"
        )
    return spots


def enough(needed: float) -> int:
    """Return how many runs, all meeting a demand, have a Wilson interval above the demanded rate."""
    return math.ceil(statistics.Z * statistics.Z * needed / (1 - needed))


def changes(
    before: Mapping[int, RunJudgement], now: Sequence[RunJudgement], demands: Demands, scale: Scale
) -> tuple[BaselineChange, ...]:
    """Compare runs with those of a baseline by seed; those whose seed it lacks are left out.

    Mean errors are tested by Student's t, rates by McNemar's exact test, all together by Holm's adjustment.
    """
    pairs = [(before[run.seed], run) for run in now if run.seed in before]
    changed = []
    means_m = [(a.error_mean_m, b.error_mean_m) for a, b in pairs]
    errors = [pair for pair in means_m if None not in pair]
    if errors:
        old, new = np.array(errors, np.float64).T
        p = statistics.p_value(partial(statistics.mean, new - old, None), SAME_ERROR_M)
        changed.append(_change("mean error", ERROR, old, new, statistics.mean(new - old), p))
    for kind in (name for name in demands.kinds if name != ERROR):
        old, new = np.array([[a.met[kind], b.met[kind]] for a, b in pairs], np.float64).T
        difference, title = statistics.rate_difference(old > 0, new > 0), title_of(kind, demands, scale)
        changed.append(_change(title, kind, old, new, difference, statistics.sign_flip(new - old)))
    adjusted = statistics.holm([change.p for change in changed])
    return tuple(replace(change, p=p) for change, p in zip(changed, adjusted, strict=True))


def _change(title: str, kind: str, old: F64, new: F64, by: Interval, p: float) -> BaselineChange:
    before, now = float(old.mean()), float(new.mean())
    return BaselineChange(title, kind, before, now, by.value, by.low, by.high, by.count, p)


# The baseline: the runs of an earlier check, seed by seed, as a Parquet file.

FLAGS = ("localized", "lost", "converged")
SCHEMA: Mapping[str, Any] = {
    "session": pl.String,
    "seed": pl.Int64,
    "configuration": pl.String,
    "version": pl.String,
    "error_m": pl.List(pl.Float64),
    **dict.fromkeys(FLAGS, pl.List(pl.Boolean)),
}


@dataclass(frozen=True, slots=True, eq=False)
class DriveRuns:
    """All runs over one drive."""

    session: str  # its name
    configuration: str  # hash of the filter's settings
    tracks: tuple[RunTrack, ...]  # one a seed


@dataclass(frozen=True, slots=True, eq=False)
class BaselineRuns:
    """The runs of an earlier check, by session and seed."""

    file: Path
    tracks: Mapping[str, Mapping[int, RunTrack]]
    configurations: Mapping[str, str]  # hash of the filter's settings, by session

    def of(self, session: str, updates: int) -> Mapping[int, RunTrack]:
        """Return the runs of a drive by seed. InputError where there are none, or of another drive."""
        tracks = self.tracks.get(session)
        if tracks is None:
            names = ", ".join(map(repr, self.tracks))
            raise InputError(
                self.file, f"found runs of {names}, and none of {session!r}; save a baseline of it"
            )
        lengths = {len(track.error_m) for track in tracks.values()}
        if lengths != {updates}:
            was = ", ".join(map(str, sorted(lengths)))
            what = f"found runs of {session!r} with {was} steps, and it has {updates} now"
            raise InputError(self.file, f"{what}: another drive; save a new baseline")
        return tracks


def baseline_bytes(drives: Iterable[DriveRuns]) -> bytes:
    """Return the runs of a check as a Parquet file."""
    rows = [
        {
            "session": drive.session,
            "seed": track.seed,
            "configuration": drive.configuration,
            "version": version("maurice-replay"),
            "error_m": track.error_m.tolist(),
            **{name: getattr(track, name).tolist() for name in FLAGS},
        }
        for drive in drives
        for track in drive.tracks
    ]
    content = io.BytesIO()
    pl.DataFrame(rows, schema=dict(SCHEMA)).write_parquet(content, compression="zstd")
    return content.getvalue()


def read_baseline(file: Path) -> BaselineRuns:
    """Read what `baseline_bytes` made. InputError for anything else."""
    if not file.is_file():
        raise InputError(file, "there is no such file; make one with `check -o FILE.parquet`")
    expected = "expected a baseline that `check -o FILE.parquet` has written"
    try:
        rows = pl.read_parquet(file).rename({"off_m": "error_m"}, strict=False)  # as 0.2.0 named it
    except (OSError, pl.exceptions.PolarsError) as problem:
        raise InputError(file, f"cannot be read ({str(problem).splitlines()[0]}); {expected}") from None
    if dict(rows.schema) != dict(SCHEMA):
        raise InputError(file, f"found the columns {', '.join(rows.columns)}; {expected}")
    if not len(rows) or any(rows[name].null_count() for name in SCHEMA):
        raise InputError(file, f"found {'empty values' if len(rows) else 'no run'}; {expected}")
    tracks: dict[str, dict[int, RunTrack]] = {}
    configurations: dict[str, str] = {}
    for row in rows.iter_rows(named=True):
        error_m = np.array([np.nan if value is None else value for value in row["error_m"]], np.float64)
        flags = [np.array(row[name], bool) for name in FLAGS]
        if {len(flag) for flag in flags} != {len(error_m)}:
            raise InputError(
                file, f"found a run of {row['session']!r} whose columns differ in length; {expected}"
            )
        tracks.setdefault(row["session"], {})[row["seed"]] = RunTrack(row["seed"], error_m, *flags)
        configurations[row["session"]] = row["configuration"]
    return BaselineRuns(file, tracks, configurations)
