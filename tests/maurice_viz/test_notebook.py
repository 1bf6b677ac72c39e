"""What notebooks call: frames of a saved run, the run in Rerun's widget, and the notebook in docs."""

from __future__ import annotations

import importlib.util
import inspect
import json
import os
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from rerun.chunk import RrdReader

import maurice_viz as mv
from helpers.commands import maurice
from maurice_loaders.errors import InputError

NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebook.ipynb"


class Widget:
    """Stands in for Rerun's widget: it keeps what is sent to it."""

    def __init__(self, *, width: Any, height: Any, theme: str) -> None:
        assert theme == "dark"
        self.size, self.sent = (width, height), b""
        self.hears: list[Callable[[str], None]] = []
        self.places: list[tuple[str, int, bool]] = []

    def _on_raw_event(self, hear: Callable[[str], None]) -> None:
        self.hears.append(hear)

    def set_time_ctrl(self, timeline: str, *, sequence: int, play: bool) -> None:
        self.places.append((timeline, sequence, play))

    def send_rrd(self, data: bytes) -> None:
        self.sent += data

    def content(self, folder: Path) -> RrdReader:
        file = folder / f"shown-{id(self)}.rrd"
        file.write_bytes(self.sent)
        return RrdReader(file)


@pytest.fixture
def displayed(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return what is displayed below the cell, in order: texts and widgets."""
    things: list[Any] = []
    viewer, display = types.ModuleType("rerun_notebook"), types.ModuleType("IPython.display")
    viewer.Viewer, display.Markdown, display.display = Widget, str, things.append  # type: ignore[attr-defined]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    monkeypatch.setitem(sys.modules, "rerun_notebook", viewer)
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.delenv("RERUN_NOTEBOOK_ASSET", raising=False)
    return things


def rows_of(reader: RrdReader) -> int:
    return sum(chunk.to_record_batch().num_rows for chunk in reader.stream())


def test_results_are_those_of_the_command(small_session):
    printed, _ = maurice(
        "compare", small_session, "--particles", "150", "--save-run", "both", "-o", "none", "--json"
    )
    frame = mv.results("both")
    assert frame["label"].to_list() == ["color", "blended"]
    for row, run in zip(frame.iter_rows(named=True), json.loads(printed)["runs"], strict=True):
        flat = {key: value for key, value in run.items() if key in row}
        assert len(flat) > 12
        assert {key: row[key] for key in flat} == flat
        assert row["thesis_success_tenth_at_step"] == run["thesis_success"]["tenth"]["at_step"]


def test_traces_are_those_of_the_run(small_session):
    maurice(small_session, "--particles", "150", "--save-run", "kept", "-o", "none")
    frame = mv.traces(Path("kept"))
    steps = pl.read_parquet("kept/steps/*.parquet")
    assert frame["step"].to_list() == list(range(1, 15))
    assert frame["label"].unique().to_list() == ["blended"]
    for name in ("estimate_x_m", "truth_heading_rad", "calibrated_evidence", "effective_sample_size"):
        assert frame[name].to_list() == steps[name].to_list()
    off = np.hypot(frame["estimate_x_m"] - frame["truth_x_m"], frame["estimate_y_m"] - frame["truth_y_m"])
    assert np.allclose(frame["error_m"], off)
    # the odometry of this drive is exact, so that added up it is the truth
    assert np.allclose(frame["odometry_x_m"], frame["truth_x_m"])
    assert (frame["ess_share"] * 150 - frame["effective_sample_size"]).abs().max() < 1e-9


def test_extras_and_unknown_values(tmp_path, small_session, monkeypatch):
    lines = [line for line in small_session.read_text().splitlines() if '"truth"' not in line]
    small_session.write_text("\n".join(lines) + "\n")
    maurice(small_session, "--particles", "50", "--save-run", "kept", "-o", "none")
    frame = mv.traces("kept")
    assert frame["error_m"].null_count() == frame.height == frame["truth_x_m"].null_count()
    assert mv.results("kept")["error_mean_m"].to_list() == [None]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'maurice-replay\[notebook\]'"):
        mv.show("kept")


def test_what_cannot_be_shown_is_an_input_error(tmp_path, displayed):
    with pytest.raises(InputError, match="expected a saved run"):
        mv.results(tmp_path)
    with pytest.raises(InputError, match="no such recording"):
        mv.show(tmp_path / "no.rrd")
    with pytest.raises(InputError, match="expected a saved run"):
        mv.show(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        mv.show(tmp_path / "no.log")


def test_a_recording_is_shown_whole_below_its_verdict(small_session, tmp_path, displayed):
    maurice(small_session, "--particles", "50", "-o", "a.rrd")
    mv.show("a.rrd", width=800, height=600)
    verdict, viewer = displayed
    assert "Look at **step" in verdict
    assert viewer.size == (800, 600)
    assert os.environ["RERUN_NOTEBOOK_ASSET"] == "serve-local"
    assert viewer.sent == (tmp_path / "a.rrd").read_bytes()
    for event in ("recording_open", "timeline_change", "timeline_change"):  # the second is the user's
        viewer.hears[0](json.dumps({"type": event}))
    ((timeline, step, play),) = viewer.places
    assert (timeline, play) == ("step", False)
    assert f"Look at **step {step}." in verdict


def test_the_widget_takes_what_it_is_given():
    """Without the widget's package there is nothing to compare with."""
    widget = pytest.importorskip("rerun_notebook").Viewer
    given = inspect.signature(widget).parameters
    assert {"width", "height", "theme"} <= set(given)
    assert callable(widget.send_rrd)
    assert callable(widget._on_raw_event)
    assert callable(widget.set_time_ctrl)


def test_a_saved_run_and_a_session_are_drawn_and_shown(small_session, tmp_path, displayed, capsys):
    maurice(small_session, "--particles", "50", "--feature", "color", "--save-run", "kept", "-o", "none")
    mv.show("kept", layout="overview")
    mv.show(small_session, filter=mv.Filter("color", particles=50))
    assert not "".join(capsys.readouterr())
    saved, replayed = (one.content(tmp_path) for one in displayed if isinstance(one, Widget))
    assert "/color/belief/particles" in {str(chunk.entity_path) for chunk in replayed.stream()}
    assert rows_of(saved) == rows_of(replayed)
    assert not list(tmp_path.glob("*.rrd.*"))


@pytest.mark.slow
def test_the_notebook_of_the_documentation_runs(monkeypatch):
    """Execute its cells one after the other, all but the widget."""
    monkeypatch.setattr(mv, "show", lambda *args, **options: None, raising=False)
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    space: dict[str, Any] = {}
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) == 5
    for cell in cells:
        exec(compile(cell, str(NOTEBOOK), "exec"), space)
    assert space["errors"].columns == ["step", "color", "best"]
    assert space["errors"].height == 40


def test_the_notebook_is_executed_and_says_nothing_of_where():
    text = NOTEBOOK.read_text(encoding="utf-8")
    notebook = json.loads(text)
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["execution_count"] for cell in cells)
    assert sum(bool(cell["outputs"]) for cell in cells) >= 2  # frames; a widget leaves none
    assert len(text) < 40_000
    assert "widgets" not in notebook["metadata"]
    for place in ("/tmp", "/home", "/root", "/Users", "localhost", "127.0.0.1"):
        assert place not in text
