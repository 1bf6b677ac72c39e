"""Rows grouped and compared: figures with intervals, and differences between variants run by run.

`TrialsResult` has the same as polars frames.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from maurice_loaders.errors import InputError
from maurice_mcl.values import F64, expected_one_of

from .rows import KEY, SCHEMA, TYPES, read_rows
from .statistics import (
    LEVEL,
    Clusters,
    Interval,
    Survival,
    holm,
    mean,
    p_value,
    rate_difference,
    share,
    survival,
)

NUMBERS = [
    name for name, kind in TYPES.items() if kind in (pl.Float64, pl.Int64, pl.Boolean) and name not in KEY
]
LOCALIZED = "pictures_to_localize"
TIMES = {LOCALIZED: "pictures_after", "localized_m": "after_m", "localized_s": "after_s"}  # where censored
DEFAULT = "error_mean_m"


@dataclass(frozen=True, slots=True)
class Group:
    """The runs that agree in some columns."""

    by: dict[str, Any]
    figure: Interval  # the mean, or the share of a flag
    median: float
    runs: int
    failed: int  # runs that ended in an error
    curve: Survival | None = None  # of times that may be censored


@dataclass(frozen=True, slots=True)
class Difference:
    """One group against another, on the same drives and seeds."""

    by: dict[str, Any]
    against: dict[str, Any]
    figure: Interval  # mean of the differences, run by run; of a flag, the difference of its rates
    p: float | None  # of no difference; None: too few drives for one


FIRST, EACH = "first", "each"  # what groups are compared with


@dataclass(frozen=True, slots=True, eq=False)
class TrialsResult:
    """What many runs show, as polars frames: a row for each run, means, and differences run by run.

    Intervals hold 95 %, over drives, or over the seeds of the only one.

        >>> import polars as pl
        >>> from maurice_datasets import TrialsResult
        >>> TrialsResult(pl.DataFrame({"label": ["few", "more"], "error": [None, None]}))
        TrialsResult(2 runs of few, more)
    """

    runs: pl.DataFrame  # as docs/trials.md has their columns; runs that raised an error have nulls

    def __repr__(self) -> str:
        """Return how many runs of which filters there are."""
        filters = ", ".join(self.runs["label"].unique(maintain_order=True))
        failed = len(self.runs) - self.runs["error"].null_count()
        failures = f", {failed} failed" if failed else ""
        return f"TrialsResult({len(self.runs):,} runs of {filters}{failures})"

    def mean(self, metric: str = DEFAULT, by: Sequence[str] = ("label",)) -> pl.DataFrame:
        """Return the mean of a column for each filter, of a flag its share. InputError for no such column."""
        rows = [group.by | _told(group.figure) for group in grouped(self.runs, by, metric)]
        return pl.DataFrame(rows, infer_schema_length=None)

    def paired(
        self, metric: str = DEFAULT, against: str = FIRST, by: Sequence[str] = ("label",)
    ) -> pl.DataFrame:
        """Return by how much filters differ on the same drives and seeds: from the "first", or "each" other.

        Of what is compared at once, `p_holm` is the p-value of no difference adjusted for the number of pairs
        (Holm 1979). InputError for no such column.
        """
        if against not in (FIRST, EACH):
            raise InputError(None, f"against: found {against!r}, {expected_one_of(against, (FIRST, EACH))}")
        pairs = paired(self.runs, by, metric, against)
        if not pairs:
            raise InputError(None, f"found one {' and '.join(by)}, expected two or more to compare")
        adjusted = iter(holm([pair.p for pair in pairs if pair.p is not None]))
        rows = [
            pair.by
            | {f"against_{name}": value for name, value in pair.against.items()}
            | {"difference": pair.figure.value}
            | {name: value for name, value in _told(pair.figure).items() if name != "mean"}
            | {"p": pair.p, "p_holm": None if pair.p is None else next(adjusted)}
            for pair in pairs
        ]
        return pl.DataFrame(rows, infer_schema_length=None)


def _told(figure: Interval) -> dict[str, Any]:
    """Return a figure as columns of a frame."""
    value, low, high = (
        number if np.isfinite(number) else None for number in (figure.value, figure.low, figure.high)
    )
    return {"mean": value, "low": low, "high": high, "runs": figure.count, "drives": figure.drives}


def load_trials(folder: str | Path, where: Sequence[str] = ()) -> pl.DataFrame:
    """Return the rows of a folder, with a column for every setting that its plan varies.

    `where` keeps rows with `column=value`. InputError for a folder without trials and for unknown columns.

        >>> import maurice_datasets as md
        >>> md.load_trials("trials", ["feature=color"])["error_mean_m"].mean()  # doctest: +SKIP
        0.21
    """
    rows = with_settings(read_rows(Path(folder)))
    for text in where:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(
                None, f"--where: found {text!r}, expected a column and a value, like feature=color"
            )
        rows = rows.filter(_equals(rows, _known(rows, name), value))
    return rows


def _equals(rows: pl.DataFrame, name: str, value: str) -> pl.Expr:
    """Return where a column has a value that is given as text; a number may be written in any way."""
    if rows.schema[name].is_numeric():
        try:
            return pl.col(name) == float(value)
        except ValueError:
            raise InputError(None, f"--where {name}: found {value!r}, expected a number") from None
    return pl.col(name).cast(pl.String) == (value.lower() if rows.schema[name] == pl.Boolean else value)


def with_settings(rows: pl.DataFrame) -> pl.DataFrame:
    """Return rows with a column for every setting in their JSON that is no column yet."""
    unique = rows["settings"].unique().drop_nulls().to_list()
    settings = {text: json.loads(text) for text in unique}
    names = [
        name
        for name in dict.fromkeys(key for values in settings.values() for key in values)
        if name not in SCHEMA
    ]
    for name in names:
        column = _of_one_type([values.get(name) for values in settings.values()])
        values = dict(zip(settings, column, strict=True))
        rows = rows.with_columns(rows["settings"].replace_strict(values, default=None).alias(name))
    return rows


def _of_one_type(values: list[Any]) -> list[Any]:
    """Return values as a column can hold them: whole numbers, numbers, true and false, or else texts."""
    kinds = {type(value) for value in values if value is not None}
    if kinds == {int, float}:
        return [None if value is None else float(value) for value in values]
    if len(kinds) == 1 and kinds <= {int, float, bool, str}:
        return values
    return [value if value is None or isinstance(value, str) else json.dumps(value) for value in values]


def grouped(rows: pl.DataFrame, by: Sequence[str], metric: str = DEFAULT) -> list[Group]:
    """Return a group for every combination of columns: mean or share with an interval, median, runs.

    Intervals are over drives (`clusters_of`), Student's for means, Wilson's for shares. Times to localize are
    censored at the end of a drive: their median is Kaplan and Meier's. InputError for unknown columns.

        >>> import polars as pl
        >>> from maurice_datasets.trials.table import grouped
        >>> runs = {"particles": [100, 100], "error_mean_m": [1.0, 3.0], "error": [None, None]}
        >>> rows = pl.DataFrame(runs | {"arena": [1, 2], "session": ["global", "global"], "seed": [0, 1]})
        >>> grouped(rows, ["particles"])[0].figure.value
        2.0
    """
    columns = [_known(rows, name) for name in by]
    if metric not in NUMBERS:
        raise InputError(None, f"metric: found {metric!r}, {expected_one_of(metric, NUMBERS)}")
    groups = rows.group_by(columns, maintain_order=True) if columns else [((), rows)]
    return [_group(dict(zip(columns, values, strict=True)), some, metric) for values, some in groups]


def _group(by: dict[str, Any], rows: pl.DataFrame, metric: str) -> Group:
    good = rows.filter(pl.col("error").is_null())
    failed, curve = len(rows) - len(good), None
    if metric in TIMES:
        known = good.filter(pl.col(TIMES[metric]).is_not_null())
        curve = curve_of(known, metric)
        reached = share(known[metric].is_not_null().to_numpy(), clusters_of(known))
        return Group(by, reached, curve.median, curve.at_risk, failed, curve)
    known = good.filter(pl.col(metric).is_not_null())
    values, clusters = known[metric].to_numpy(), clusters_of(known)
    if rows.schema[metric] == pl.Boolean:
        return Group(by, share(values, clusters), np.nan, len(values), failed)
    middle = float(np.median(values)) if len(values) else np.nan
    return Group(by, mean(values, clusters), middle, len(values), failed)


def curve_of(rows: pl.DataFrame, metric: str = LOCALIZED) -> Survival:
    """Return the Kaplan-Meier curve of a time that runs took, of those whose truth is known."""
    known = rows.filter(pl.col(TIMES[metric]).is_not_null())
    times, happened = (
        known.select(_limited(metric))[metric].to_numpy(),
        known[metric].is_not_null().to_numpy(),
    )
    return survival(times, happened, clusters_of(known))


def _limited(metric: str) -> pl.Expr:
    """Return a column as numbers; of a time that is censored, the end of the drive for a run without."""
    values = pl.col(metric).cast(pl.Float64)
    return values.fill_null(pl.col(TIMES[metric])) if metric in TIMES else values


def clusters_of(rows: pl.DataFrame) -> Clusters:
    """Return which runs of trials are alike: seeds of one recorded session; drives in one simulated arena.

    Rows of updates, with one `run` for each of a run's updates, are alike within that run.
    """
    recorded, session = pl.col("arena").is_null(), pl.col("session")
    place = pl.when(recorded).then(session).otherwise(pl.format("arena {}", "arena"))
    drive = pl.when(recorded).then(session).otherwise(pl.format("{} {}", "session", "seed"))
    labels = rows.select(place=place, drive=drive).to_dict()
    runs = rows["run"].to_numpy() if "run" in rows.columns else None
    return Clusters.of(labels["place"].to_numpy(), labels["drive"].to_numpy(), runs)


def paired(
    rows: pl.DataFrame, by: Sequence[str], metric: str = DEFAULT, against: str = FIRST
) -> list[Difference]:
    """Compare every group with the first, run by run: same part, session, seed and other settings.

    With `against` "each", also with those between.

    Rates have Newcombe's interval for pairs. A run that never localized counts with the whole of its drive.
    Runs that only one of the two groups holds are left out. InputError for unknown columns.

        >>> import maurice_datasets as md
        >>> rows = md.load_trials("trials")  # doctest: +SKIP
        >>> md.paired(rows, ["feature"])[0].figure.value  # doctest: +SKIP
        -0.04
    """
    columns = [_known(rows, name) for name in by]
    if metric not in NUMBERS:
        raise InputError(None, f"metric: found {metric!r}, {expected_one_of(metric, NUMBERS)}")
    whole = {"label", "variant"} & set(columns)  # these say already which settings a run has
    other = [] if whole else [name for name in _varied(rows) if name not in columns]
    same = ["part", "session", "seed", *other]
    valid_rows = rows.filter(pl.col("error").is_null() & pl.col(TIMES.get(metric, metric)).is_not_null())
    valid_rows = valid_rows.select(*dict.fromkeys([*columns, *same, "arena"]), _limited(metric))
    parts = (
        [(values, some) for values, some in valid_rows.group_by(columns, maintain_order=True)]
        if columns
        else []
    )
    differences = []
    for (first_values, first), (values, some) in combinations(parts, 2):
        if against == FIRST and first is not parts[0][1]:
            break
        both = some.join(
            first,
            on=[name for name in same if name not in columns],
            how="inner",
            suffix="_first",
            nulls_equal=True,
        )
        after, before, clusters = (
            both[metric].to_numpy(),
            both[f"{metric}_first"].to_numpy(),
            clusters_of(both),
        )
        figure, p = _difference(before, after, clusters, is_flag=rows.schema[metric] == pl.Boolean)
        named = [dict(zip(columns, names, strict=True)) for names in (values, first_values)]
        differences.append(Difference(named[0], named[1], figure, p))
    return differences


def _difference(
    before: F64, after: F64, clusters: Clusters, *, is_flag: bool
) -> tuple[Interval, float | None]:
    """Return by how much runs (N,) differ, after less before, and the p-value of no difference."""

    def at_level(level: float) -> Interval:
        if is_flag:
            return rate_difference(before > 0, after > 0, clusters, level)
        return mean(after - before, clusters, level)

    figure = at_level(LEVEL)
    return figure, p_value(at_level, 0.0) if np.isfinite(figure.low) else None


def _varied(rows: pl.DataFrame) -> list[str]:
    """Return the columns of settings."""
    keys = {key for text in rows["settings"].unique().drop_nulls() for key in json.loads(text)}
    return [name for name in rows.columns if name in keys]


def _known(rows: pl.DataFrame, name: str) -> str:
    if name not in rows.columns:
        there = ", ".join([*_varied(rows), "session", "task", "tier", "lights", "part", "label"])
        raise InputError(None, f"found no column {name!r}, expected one like {there}")
    return name
