"""Trials: a run of a plan is the run that `replay` makes, and tables are readable."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table

import maurice_datasets as md
import maurice_viz as mv
from maurice_datasets.trials.rows import read_rows
from maurice_datasets.trials.statistics import Interval
from maurice_datasets.trials.table import Difference, Group
from maurice_viz.cli.trials import _differences, _groups

PLAN = """
seeds = 2
[[sessions]]
path = "session.log"
[[variants]]
label = "thesis"
preset = "thesis"
particles = 60
[[variants]]
label = "robust"
preset = "robust"
particles = 60
feature = "edges"
"""


def test_a_row_has_the_figures_of_a_replay(small_session: Path, tmp_path: Path) -> None:
    file = small_session.with_name("mine.toml")
    file.write_text(PLAN)
    md.run_plan(md.read_plan(file), tmp_path / "out")
    for row in read_rows(tmp_path / "out").iter_rows(named=True):
        feature = "edges" if row["label"] == "robust" else None
        scores = mv.replay(
            small_session, filter=mv.Filter(row["label"], feature=feature, particles=60, seed=row["seed"])
        )
        score = scores.runs[0].score
        assert row["error_mean_m"] == score.error_mean_m
        assert row["heading_error_mean_rad"] == score.heading_error_mean_rad
        assert row["heading_error_median_rad"] == score.heading_error_median_rad
        assert row["wrong_confident"] == score.wrong_confident_share
        assert row["lost"] == score.lost


def test_the_page_of_ones_own_trials_holds_what_every_variant_reached(
    small_session: Path, tmp_path: Path
) -> None:
    file = small_session.with_name("mine.toml")
    file.write_text(PLAN)
    md.run_plan(md.read_plan(file), tmp_path / "out")
    page = mv.trials_report(tmp_path / "out", tmp_path / "page.html").read_text()
    assert re.search(r">robust</td><td[^>]*>2</td>", page)
    assert "Position error, mean (m)" in page
    assert "maurice-replay trials run mine.toml -o trials" in page
    assert "thesis says" not in page
    assert "<img" not in page


KNOWN = Interval(0.254, 0.127, 0.508, 20, 20)
NOT_KNOWN = Interval(float("nan"), float("nan"), float("nan"), 0)
BY = {"feature": "color", "resampling.scheme": "systematic", "part": "global-localization"}


def printed(table: Table, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width, markup=False)
    console.print(table)
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize(
    ("metric", "title", "value", "limits"),
    [
        ("error_mean_m", "error mean (in)", "10.0", "5.0 to 20.0"),
        ("heading_error_mean_rad", "heading error mean (deg)", "14.6", "7.3 to 29.1"),
        ("took_s", "took (s)", "0.3", "0.1 to 0.5"),
        ("confidence_end", "confidence end", "0.25", "0.13 to 0.51"),
        ("right_at_end", "right at end (%)", "25.4", "12.7 to 50.8"),
        ("pictures_to_localize", "pictures to localize", "25.4", "12.7 to 50.8"),
        ("localized_m", "localized (in)", "25.4", "12.7 to 50.8"),
    ],
)
def test_units(metric: str, title: str, value: str, limits: str) -> None:
    lines = printed(_groups([Group(BY, KNOWN, 0.254, 20, 0)], metric)).splitlines()
    assert lines[0].strip() == title
    assert value in lines[4]
    assert limits in lines[4]


def test_three_keys_fit_into_80_columns() -> None:
    shown = printed(_groups([Group(BY, KNOWN, 0.254, 20, 0)], "error_mean_m"))
    row = next(line for line in shown.splitlines() if "color" in line)
    for text in (*BY.values(), "5.0 to 20.0"):
        assert text in row


def test_what_is_not_known_is_a_dash() -> None:
    shown = printed(_groups([Group({"feature": None}, NOT_KNOWN, float("nan"), 0, 4)], "error_mean_m"))
    assert "nan" not in shown
    assert "None" not in shown
    assert "failed" in shown


def test_differences_of_pictures_are_pictures() -> None:
    apart = Difference({"feature": "edges"}, {"feature": "color"}, Interval(2.0, 1.0, 3.0, 7, 7), 0.001)
    shown = printed(_differences([apart], "pictures_to_localize"))
    assert "less that of color" in shown.splitlines()[0]
    assert "whole drive" in " ".join(shown.split())
    assert max(map(len, shown.splitlines())) <= 80  # a title that is longer is cut off there
    assert "+2.0" in shown
