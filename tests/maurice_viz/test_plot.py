"""Columns of runs over time: what is drawn is what the table holds."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

import maurice_viz as mv
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders import InputError
from maurice_viz.style import LOST, RUN_COLORS


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plotted")
    write_small_survey(folder)
    drive = write_small_session(folder, carried_at=7)
    filters = [mv.Filter(particles=n) for n in (50, 60)]
    return mv.compare(drive, filters=filters, save_run=folder / "kept")


def test_lines_are_the_columns_in_the_colors_of_the_runs(runs):
    figure = mv.plot(runs, "error_m", "localized")
    assert [axes.get_ylabel() for axes in figure.axes] == ["error (m)", "localized"]
    for (_, steps), line, color in zip(
        runs.steps.group_by("label", maintain_order=True), figure.axes[0].lines, RUN_COLORS, strict=False
    ):
        assert np.array_equal(line.get_ydata(), steps["error_m"].to_numpy())
        assert np.array_equal(line.get_xdata(), steps["time_s"].to_numpy())
        assert line.get_color() == tuple(part / 255 for part in color)
    carried = figure.axes[0].lines[2]
    assert carried.get_color() == tuple(part / 255 for part in LOST)
    assert set(carried.get_xdata()) == set(runs.steps.filter(runs.steps["kidnapped"])["time_s"])


def test_a_saved_run_is_drawn_as_the_run_itself(runs):
    now, saved = mv.plot(runs, "spread_m"), mv.plot(runs.saved_run, "spread_m")
    for before, after in zip(now.axes[0].lines, saved.axes[0].lines, strict=True):
        assert np.allclose(before.get_ydata(), after.get_ydata())


def test_what_cannot_be_drawn_is_one_line(runs):
    with pytest.raises(InputError, match="found no numbers 'eror_m'"):
        mv.plot(runs, "eror_m")
    with pytest.raises(InputError, match="error_m is not known at any step"):
        mv.plot(runs.steps.with_columns(error_m=pl.lit(None, pl.Float64)))
    with pytest.raises(InputError, match="without the steps of a run"):
        mv.plot(runs.steps.drop("label"))
