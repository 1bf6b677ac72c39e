"""Paths and tables of a saved run: what other programs read out of them."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import InputError
from maurice_loaders.export import tables
from maurice_loaders.runs.store import open_runs
from maurice_loaders.runs.writer import StepRows
from maurice_mcl.values.geometry import compose

from ..conftest import Save

CHANNELS = ("color", "edges")
POSE = st.tuples(*[st.floats(-1e6, 1e6)] * 2, st.floats(-3.14159, 3.14159)).map(np.array)
EVO = Path(sys.executable).parent


def step_at(number: int, truth: bool = True, **row: object) -> tables.ExportStep:
    """An update of which only the poses count."""
    pose = np.array([0.3 * number, 1 - 0.1 * number, 0.4 * number - 1])
    rows = StepRows({"step": number, **row}, pl.DataFrame(), pl.DataFrame())
    return tables.ExportStep(rows, 1.6e9 + 0.1 * number, 1.1 * pose + 0.05, pose if truth else None, pose / 2)


def add_all(sink: tables.Sink, steps: Iterable[tables.ExportStep]) -> None:
    for step in steps:
        sink.add(step, None)


def write_paths(folder: Path, steps: list[tables.ExportStep]) -> dict[str, Path]:
    files = tables.path_files(folder / "run.tum", tables.PATHS)
    with tables.path_sink(files) as sink:
        add_all(sink, steps)
    return files


def evo(folder: Path, *words: object) -> str:
    settings = os.environ | {"HOME": str(folder), "MPLCONFIGDIR": str(folder), "NO_COLOR": "1"}
    done = subprocess.run(
        [*map(str, words)], cwd=folder, env=settings, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@given(st.floats(0, 4e9), POSE)
def test_a_tum_line_gives_time_and_pose_back(time_s: float, pose: np.ndarray) -> None:
    t, x, y, z, qx, qy, qz, qw = map(float, tables.tum_line(time_s, pose).split(" "))
    assert (t, x, y, z, qx, qy) == (time_s, pose[0], pose[1], 0, 0, 0)
    assert 2 * np.arctan2(qz, qw) == pytest.approx(pose[2], abs=1e-12)


def test_the_estimate_has_the_name_asked_for_and_the_others_stand_beside_it(tmp_path: Path) -> None:
    files = tables.path_files(tmp_path / "a.b.tum", tables.PATHS)
    assert [file.name for file in files.values()] == ["a.b.tum", "a.b-truth.tum", "a.b-odometry.tum"]
    assert tables.path_files(tmp_path / "a.tum", ["truth"]) == {"truth": tmp_path / "a.tum"}
    found = tables.error_statistics(np.array([3.0, 4.0, 0.0]))
    assert found["mean"] == pytest.approx(7 / 3)
    assert (found["median"], found["min"], found["max"], found["sse"]) == (3, 0, 4, 25)
    assert found["rmse"] == pytest.approx((25 / 3) ** 0.5)


def test_an_update_without_truth_has_no_tum_line_of_it(tmp_path: Path) -> None:
    steps = [step_at(1), step_at(2, truth=False), step_at(3)]
    files = write_paths(tmp_path, steps)
    counts = {name: len(file.read_text().splitlines()) for name, file in files.items()}
    assert counts == {"estimate": 3, "truth": 2, "odometry": 3}
    (tmp_path / "bare").mkdir()
    files = write_paths(tmp_path / "bare", [step_at(1, truth=False)])
    assert [name for name, file in files.items() if file.exists()] == ["estimate", "odometry"]


def test_nothing_is_left_after_a_failure_and_an_old_file_stays(tmp_path: Path) -> None:
    old = tmp_path / "a.csv"
    old.write_text("mine")
    for path, told in ((old, "--force"), (tmp_path / "no" / "a.csv", "cannot be written")):
        with pytest.raises(InputError, match=told), tables.table_sink(path, CHANNELS):
            pytest.fail("was opened")
    with pytest.raises(TypeError), tables.table_sink(old, CHANNELS, force=True) as sink:
        sink.add(step_at(1, events=None, session_events=None), None)
    assert old.read_text() == "mine"
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]


def test_steps_are_those_that_were_saved(save_run: Save) -> None:
    folder, played = save_run()
    (run,) = open_runs(folder)
    steps = list(tables.export_steps(run, begin_s=100.0))
    odometry = np.zeros(3)
    for step, (moment, record) in zip(steps, played, strict=True):
        for motion in moment.frame.motions:
            odometry = compose(odometry, motion)
        assert step.time_s == moment.frame.time_s + 100
        assert step.estimate.tolist() == record.estimate.pose.tolist()
        assert step.truth is not None
        assert step.truth.tolist() == moment.truth.tolist()
        assert step.odometry == pytest.approx(odometry)
    assert [step.scored for step in steps] == [False] * 3 + [True] * 11


def test_exported_odometry_adds_movements_in_the_robots_own_frame():
    motions = [[0.3, 0.0, 0.9], [0.5, 0.1, -0.4]]
    pose = {f"{kind}_{name}": 0.0 for kind in ("estimate", "truth") for name in ("x_m", "y_m", "heading_rad")}
    steps = [
        StepRows(pose | {"time_s": 1.0, "motions": [m]}, pl.DataFrame(), pl.DataFrame()) for m in motions
    ]
    *_, last = tables.export_steps(SimpleNamespace(steps=lambda: steps))
    assert last.odometry == pytest.approx(compose(*map(np.array, motions)))


def test_csv_and_parquet_hold_the_same_table(save_run: Save, tmp_path: Path) -> None:
    folder, played = save_run()
    (run,) = open_runs(folder)
    with (
        tables.table_sink(tmp_path / "a.csv", CHANNELS) as one,
        tables.table_sink(tmp_path / "a.parquet", CHANNELS) as two,
    ):
        for step in tables.export_steps(run):
            one.add(step, None)
            two.add(step, None)
    table = pl.read_parquet(tmp_path / "a.parquet")
    assert table.columns == list(tables.table_columns(CHANNELS))
    assert table["estimate_x_m"].to_list() == [record.estimate.pose[0] for _, record in played]
    assert table["events"][0] == "; ".join(played[0][1].events)
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == table.columns
    assert [float(row["truth_y_m"]) for row in rows] == table["truth_y_m"].to_list()


def test_evo_reads_the_paths_and_finds_our_errors(tmp_path: Path) -> None:
    steps = [step_at(n) for n in range(1, 40)]
    write_paths(tmp_path, steps)
    evo(tmp_path, EVO / "evo_ape", "tum", "run-truth.tum", "run.tum", "--save_results", "theirs.zip")
    errors_m = np.array([np.hypot(*(step.estimate - step.truth)[:2]) for step in steps])
    with zipfile.ZipFile(tmp_path / "theirs.zip") as theirs:
        stats = json.loads(theirs.read("stats.json"))
    assert tables.error_statistics(errors_m) == pytest.approx(stats, abs=1e-6)


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1"])
def test_no_cell_is_a_formula_in_a_spreadsheet(text: str, tmp_path: Path) -> None:
    """Names of pictures and events are somebody else's text; numbers stay what they are."""
    step = step_at(1, session_events=[text], events=["found"], picture=text)
    with tables.table_sink(tmp_path / "a.csv", ()) as sink:
        add_all(sink, [step])
    with (tmp_path / "a.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["session_events"], row["picture"], row["events"]) == (f"'{text}", f"'{text}", "found")
    assert float(row["odometry_heading_rad"]) < 0
