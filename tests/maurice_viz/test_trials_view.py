"""`trials-view`: the curves of trials beside the run behind a point, the same as in its row."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from helpers.commands import failure, maurice
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.plan import read_plan
from maurice_datasets.trials.table import grouped, load_trials
from maurice_mcl.geometry import INCH_M
from maurice_viz.app.trials import chart_of, trials_view
from maurice_viz.drawing.run_chart import SIZE
from maurice_viz.entities import TRIALS_CHART, TRIALS_CHOSEN, TRIALS_RUNS, TRIALS_TEXT
from maurice_viz.listener import SilentListener
from maurice_viz.plots.material import Material

PLAN = """
seeds = 3
[[sessions]]
path = "session.log"
start = "anywhere"
[grid]
particles = [20, 80]
feature = ["color", "edges"]
"""


@pytest.fixture
def folder(small_session: Path) -> Path:
    """Trials over a recorded session: twelve runs."""
    plan = small_session.with_name("mine.toml")
    plan.write_text(PLAN)
    assert run_plan(read_plan(plan), small_session.with_name("trials")).failed == 0
    return small_session.with_name("trials")


def drawn(file: Path) -> dict[str, list[object]]:
    """The values of every entity of the trials, by its path and column."""
    found: dict[str, list[object]] = {}
    for chunk in RrdReader(file).stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            found.setdefault(f"{chunk.entity_path}:{name}", []).extend(batch.column(name).to_pylist())
    return found


def test_the_worst_run_is_made_again_to_the_last_bit(folder: Path, tmp_path: Path) -> None:
    made = trials_view(folder, to=tmp_path / "out.rrd")
    rows = load_trials(folder).sort("error_m", "seed", descending=[True, False])
    worst = rows.row(0, named=True)
    assert made.run == f"mine/{worst['session']}/{worst['variant']}/{worst['seed']}"
    assert made.is_same
    assert made.recomputed_m == worst["error_m"]
    assert made.rrd == tmp_path / "out.rrd"
    held = drawn(tmp_path / "out.rrd")
    text = str(held[f"{TRIALS_TEXT}:TextDocument:text"])
    assert "the same error, to the last bit" in text
    assert [one for one in made.worst if one not in text] == []
    assert len(made.worst) == 5
    points = [
        point
        for series in (0, 1)
        for point in held[f"{TRIALS_RUNS}/{series}:Points2D:positions"][0]  # type: ignore[index]
    ]
    (chosen,) = held[f"{TRIALS_CHOSEN}:Points2D:positions"][0]  # type: ignore[index]
    assert len(points) == 12
    assert chosen in points
    assert chosen[1] == min(y for _, y in points)  # the worst is on top
    assert f"{TRIALS_CHART}:EncodedImage:blob" in held


def test_a_run_is_chosen_by_its_name_and_another_metric(folder: Path, tmp_path: Path) -> None:
    label = load_trials(folder)["session"][0]
    words = ("--run", f"mine/{label}/1/2", "--metric", "final_error_m", "--json")
    out, _ = maurice("trials-view", folder, "-o", tmp_path / "out.rrd", *words)
    told = json.loads(out)
    assert told["run"] == f"mine/{label}/1/2"
    assert told["is_same"]
    assert "--force" in failure("trials-view", folder, "-o", tmp_path / "out.rrd")


class Warned(SilentListener):
    """Keeps warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warning(self, text: str) -> None:
        """Keep one."""
        self.warnings.append(text)


def test_a_row_that_is_not_ours_is_told(folder: Path, tmp_path: Path, monkeypatch) -> None:
    rows = load_trials(folder)
    changed = rows.with_columns(rows["error_m"] + 1e-9)
    monkeypatch.setattr(Material, "rows", changed)
    heard = Warned()
    assert not trials_view(folder, to=tmp_path / "out.rrd", listener=heard).is_same
    assert "not that of its row" in heard.warnings[-1]


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (("--run", "mine/1"), "PART/SESSION/VARIANT/SEED"),
        (("--run", "mine/session/9/9"), "expected one of its rows"),
        (("--metric", "label"), "expected one of"),
        (("--metric", "pictures_to_localize"), "expected one of"),
        (("--by", "luck"), "expected a column"),
    ],
)
def test_what_is_not_there_ends_in_one_line(folder: Path, words, wanted) -> None:
    assert wanted in failure("trials-view", folder, *words)


def test_a_chart_shows_every_run_and_the_means_of_the_table(folder: Path) -> None:
    rows = load_trials(folder)
    chart = chart_of(rows, "error_m", "particles")
    assert (chart.x_label, chart.y_label, chart.settings) == ("particles", "error (in)", [20, 80])
    assert sorted(one.name for one in chart.series) == ["color", "edges"]
    for one in chart.series:
        groups = grouped(rows.filter(rows["feature"] == one.name), ["particles"])
        wanted = {group.by["particles"]: group.figure.value / INCH_M for group in groups}
        assert {chart.settings[mean.at]: pytest.approx(mean.value) for mean in one.means} == wanted
        assert all(mean.low <= mean.value <= mean.high for mean in one.means)
    for number, one in enumerate(chart.series):
        at = chart.points(number)
        assert len(at) == len(one.values)
        assert ((at > 0) & (at < SIZE)).all()
        assert np.array_equal(np.argsort(-at[:, 1]), np.argsort(one.values))
    assert chart.draw().shape == (SIZE[1], SIZE[0], 3)
    by_name = chart_of(rows, "lost", "feature")
    assert (by_name.y_label, by_name.settings) == ("lost (%)", ["color", "edges"])
    by_name.draw()
