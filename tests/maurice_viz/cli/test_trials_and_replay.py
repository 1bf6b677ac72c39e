"""A run of a plan is the run that `replay` makes of the same session, filter and seed."""

from __future__ import annotations

import re
from pathlib import Path

import maurice_datasets as md
import maurice_viz as mv
from maurice_datasets.trials.rows import read_rows

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
            small_session, preset=row["label"], feature=feature, particles=60, seed=row["seed"]
        )
        score = scores.runs[0].score
        assert row["error_m"] == score.position_error_mean_m
        assert row["heading_error_rad"] == score.heading_error_mean_rad
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
