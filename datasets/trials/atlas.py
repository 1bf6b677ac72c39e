"""A failure atlas: where on the floor runs go wrong, and how far their confidence can be trusted.

The floor of every arena is cut into square spots. A spot has the updates of all runs whose true position was
in it, so its figures are those of the place, whatever the estimate was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import polars as pl

from maurice_loaders.errors import InputError

from .rows import KEY
from .statistics import Interval, share
from .table import clusters_of

LISTS = ("error_m", "confidence", "true_x_m", "true_y_m", "truth_rank")
MOST_RUNS = 8  # that are kept of a spot: those with the largest errors there
BINS = 10  # of the reliability diagram
LEAST_UPDATES = 20  # of a bin that is shown
UPDATES = "updates"


@dataclass(frozen=True, slots=True)
class ReliabilityBin:
    """The updates whose confidence lay between two values."""

    low: float
    high: float
    confidence: float  # mean
    right: Interval  # share of them that were correct; the interval is over drives
    updates: int


@dataclass(frozen=True, slots=True, eq=False)
class FailureAtlas:
    """Spots and reliability of some runs.

    `spots` has a row for each spot of each arena: `arena`, `column` and `row` (its number along x and y), the
    number of `updates` and `runs`, the `error_median_m`, the share of updates that were `wrong`, the median
    `rank` of the truth's reference, and of runs that began or were carried to it the median
    `pictures_to_localize` and how many did `start` there. `runs` holds the worst runs of each spot.
    """

    spot_m: float
    spots: pl.DataFrame
    runs: pl.DataFrame  # arena, column, row, part, session, variant, seed, label, update, error_m
    reliability: tuple[ReliabilityBin, ...]
    wrong_confident: float  # share of all updates
    count: int  # runs


def failure_atlas(rows: pl.DataFrame, spot_m: float) -> FailureAtlas:
    """Put all updates of trials (`load_trials`) on the floor, in spots of that width.

    Raises InputError for rows without true positions.

        >>> from maurice_datasets.trials.atlas import failure_atlas
        >>> failure_atlas(load_trials("trials"), 0.5).spots.columns[:3]  # doctest: +SKIP
        ['arena', 'column', 'row']
    """
    complete = pl.col("true_x_m").list.len() == pl.col("error_m").list.len()
    known = rows.filter(pl.col("error").is_null() & complete)
    updates = _updates(known, spot_m)
    if updates.is_empty():
        raise InputError(None, "found no true positions in these trials, which say where errors were made")
    place = ["arena", "column", "row"]
    spots = updates.group_by(place).agg(
        pl.len().alias(UPDATES),
        pl.struct(KEY).n_unique().alias("runs"),
        pl.col("error_m").median().alias("error_median_m"),
        (pl.col("error_m") > pl.col("right_m")).mean().alias("wrong"),
        pl.col("truth_rank").drop_nans().median().alias("rank"),
    )
    spots = spots.join(_starts(updates), on=place, how="left").sort(place)
    by_run = updates.group_by([*place, *KEY, "label"]).agg(
        pl.col("update").get(pl.col("error_m").arg_max()), pl.col("error_m").max().alias("error_m")
    )
    worst = by_run.sort("error_m", descending=True).group_by(place, maintain_order=True).head(MOST_RUNS)
    mean = known["wrong_confident"].mean()
    sure = mean if isinstance(mean, float) else 0.0
    return FailureAtlas(spot_m, spots, worst, reliability(updates), sure, len(known))


def _updates(rows: pl.DataFrame, spot_m: float) -> pl.DataFrame:
    """Return a row for each update with a true position, with its spot."""
    numbers = pl.int_ranges(1, pl.col("error_m").list.len() + 1).alias("update")
    columns = ["arena", "label", "right_m", "kidnapped_at_update", "pictures_to_localize"]
    long = rows.select(*KEY, *columns, *LISTS, numbers).explode(*LISTS, "update")
    long = long.filter(pl.col("true_x_m").is_not_nan() & pl.col("error_m").is_not_nan())
    return long.with_columns(
        pl.col("arena").is_not_null().alias("simulated"),
        pl.col("arena").fill_null(0),
        (pl.col("true_x_m") / spot_m).floor().cast(pl.Int32).alias("column"),
        (pl.col("true_y_m") / spot_m).floor().cast(pl.Int32).alias("row"),
    )


def _starts(updates: pl.DataFrame) -> pl.DataFrame:
    """Return, for each spot in which a search began, the median pictures that it took; infinite: never."""
    starts = updates.filter(pl.col("update") == pl.col("kidnapped_at_update").fill_null(1))
    took = pl.col("pictures_to_localize").cast(pl.Float64).fill_null(np.inf)
    return starts.group_by("arena", "column", "row").agg(
        took.median().alias("pictures_to_localize"), pl.len().alias("starts")
    )


def reliability(updates: pl.DataFrame) -> tuple[ReliabilityBin, ...]:
    """Return how often updates of each confidence were correct; bins with few updates are left out."""
    binned = updates.select(
        (pl.col("confidence") * BINS).floor().clip(0, BINS - 1).cast(pl.Int64).alias("bin"),
        *("confidence", "session", "seed"),
        pl.when(pl.col("simulated")).then(pl.col("arena")).alias("arena"),
        pl.struct(KEY).hash().alias("run"),
        (pl.col("error_m") <= pl.col("right_m")).alias("right"),
    )
    bins = []
    for (number,), some in sorted(binned.group_by("bin"), key=lambda pair: pair[0]):
        if len(some) < LEAST_UPDATES:
            continue
        mean = some["confidence"].mean()
        assert isinstance(number, int)
        bins.append(
            ReliabilityBin(
                low=number / BINS,
                high=(number + 1) / BINS,
                confidence=float(mean) if isinstance(mean, float) else 0.0,
                right=share(some["right"].to_numpy(), clusters_of(some)),
                updates=len(some),
            )
        )
    return tuple(bins)
