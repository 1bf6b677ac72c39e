"""Spots, worst runs and reliability of trials, reckoned on rows made by hand."""

from __future__ import annotations

import math

import polars as pl
import pytest

from maurice_datasets.trials.atlas import failure_atlas
from maurice_datasets.trials.rows import TYPES
from maurice_datasets.trials.statistics import rate
from maurice_loaders.errors import InputError

NAN = float("nan")


def rows(*runs: dict[str, object]) -> pl.DataFrame:
    usual = {"part": "p", "session": "s", "variant": 0, "label": "blended", "arena": 1, "right_m": 0.5}
    return pl.DataFrame([dict.fromkeys(TYPES) | usual | one for one in runs], schema=TYPES)


def run(seed: int, xs: list[float], off_m: list[float], **more: object) -> dict[str, object]:
    lists = {"true_x_m": xs, "true_y_m": [0.1] * len(xs), "error_m": off_m, "truth_rank": [3.0] * len(xs)}
    return {"seed": seed, **lists, "confidence": [0.95] * len(xs), "wrong_confident": 0.25, **more}


TWO = rows(
    run(0, [0.1, 0.2, 1.5, 1.6], [0.1, 0.2, 2.0, 4.0], pictures_to_localize=2),
    run(1, [0.3, 0.4, 1.7, NAN], [0.3, 0.4, 0.2, NAN]),
)


def test_a_spot_has_the_updates_whose_truth_was_in_it() -> None:
    spots = failure_atlas(TWO, 1.0).spots
    assert spots.select("arena", "column", "row", "updates", "runs").rows() == [
        (1, 0, 0, 4, 2),
        (1, 1, 0, 3, 2),
    ]
    assert spots["error_median_m"].to_list() == pytest.approx([0.25, 2.0])
    assert spots["wrong"].to_list() == pytest.approx([0.0, 2 / 3])
    assert spots["rank"].to_list() == [3.0, 3.0]


def test_searches_belong_to_the_spot_where_they_began() -> None:
    spots = failure_atlas(TWO, 1.0).spots
    assert spots["starts"].to_list() == [2, None]
    assert spots["pictures_to_localize"][0] == math.inf  # one of two never localized: the median is between
    carried = rows(run(0, [0.1, 1.5], [0.1, 0.1], kidnapped_at_update=2, pictures_to_localize=4))
    assert failure_atlas(carried, 1.0).spots["pictures_to_localize"].to_list() == [None, 4.0]


def test_the_worst_runs_of_a_spot_come_first_with_their_update() -> None:
    worst = failure_atlas(TWO, 1.0).runs.filter(pl.col("column") == 1)
    assert worst.select("seed", "update").rows() == [(0, 4), (1, 3)]
    assert worst["error_m"].to_list() == pytest.approx([4.0, 0.2])


def test_reliability_is_the_share_of_correct_updates_by_confidence() -> None:
    many = rows(*[run(seed, [0.5] * 4, [0.1, 0.1, 0.1, 0.9]) for seed in range(6)])
    (found,) = failure_atlas(many, 1.0).reliability
    assert (found.low, found.high, found.updates) == (0.9, 1.0, 24)
    assert found.right.value == 0.75
    whole = rate(18, 24)  # of updates that had nothing to do with one another
    assert found.right.low <= whole.low < whole.high <= found.right.high
    assert failure_atlas(many, 1.0).wrong_confident == 0.25
    assert failure_atlas(TWO, 1.0).reliability == ()  # too few updates to say


def test_rows_without_true_positions_are_refused() -> None:
    with pytest.raises(InputError, match="no true positions"):
        failure_atlas(rows({"seed": 0, "error_m": [0.1], "confidence": [1.0]}), 1.0)
