"""Columns of settings, filters of rows, and groups without truth."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

from maurice_datasets.trials.plan import read_plan
from maurice_datasets.trials.rows import RowStore
from maurice_datasets.trials.table import grouped, load_trials
from maurice_loaders.errors import InputError

SETTINGS = (
    {"sensor.sharpness": 1, "sensor.weights": {"color": 1.0}},
    {"sensor.sharpness": 2.5, "motion.model": "maurice"},
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Trials with settings of mixed types; the second of each two runs knows no truth."""
    store = RowStore.begin(tmp_path / "out", read_plan("kidnapped"), resume=False)
    names = {"part": "mine", "session": "session"}
    truth = {"error_mean_m": 1.0, "lost": True, "pictures_to_localize": 3, "pictures_after": 9}
    store.add(
        [
            {**names, "variant": number, "seed": seed, "settings": json.dumps(settings), "particles": 100}
            | ({} if seed else truth)
            for number, settings in enumerate(SETTINGS)
            for seed in (0, 1)
        ]
    )
    return tmp_path / "out"


def test_settings_of_mixed_types_become_columns(folder: Path) -> None:
    rows = load_trials(folder)
    assert rows["sensor.sharpness"].to_list() == [1.0, 1.0, 2.5, 2.5]
    assert rows["sensor.weights"].to_list() == ['{"color": 1.0}', '{"color": 1.0}', None, None]
    assert [one.by for one in grouped(rows, ["sensor.weights"])] == [
        {"sensor.weights": '{"color": 1.0}'},
        {"sensor.weights": None},
    ]


@pytest.mark.parametrize(
    ("where", "count"),
    [("sensor.sharpness=1", 2), ("sensor.sharpness=2.50", 2), ("particles=1e2", 4), ("lost=True", 2)],
)
def test_numbers_and_flags_can_be_filtered(where: str, count: int, folder: Path) -> None:
    assert len(load_trials(folder, [where])) == count


def test_a_filter_that_is_no_number_is_said(folder: Path) -> None:
    with pytest.raises(InputError, match="--where particles: found 'many', expected a number"):
        load_trials(folder, ["particles=many"])


def test_runs_without_truth_are_no_failures_to_localize(folder: Path) -> None:
    (group,) = grouped(load_trials(folder), [], "pictures_to_localize")
    assert (group.figure.value, group.figure.count, group.median) == (1.0, 2, 3.0)
    (group,) = grouped(load_trials(folder).filter(pl.col("seed") == 1), [], "pictures_to_localize")
    assert group.figure.count == 0
