"""One value of a saved run replaced at a time: every command goes on, or ends in one line that says why."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import maurice_viz as mv
from helpers.commands import failure
from helpers.small_session import write_small_session, write_small_survey
from maurice_loaders.errors import InputError
from maurice_loaders.runs.store import open_run

NAN, INF = math.nan, math.inf
WRONG: dict[Any, list[Any]] = {
    pl.Float64: [NAN, INF, -INF, 1e300, -7.0],
    pl.Float32: [NAN, INF, -INF, 3e38, -7.0],
    pl.Int32: [-(2**31), 2**31 - 1, -1, 0],
    pl.String: ["", "x" * 10_000],
    pl.Boolean: [True],
    pl.List(pl.List(pl.Float64)): [
        [], [None], [[]], [[1.0]], [[1.0, 2.0]], [[1.0] * 4], [[NAN, 0.0, 0.0]], [[1e300, 0.0, 0.0]],
        [[None, 0.0, 0.0]], [[0.0] * 3, [1.0]],
    ],
    pl.List(pl.String): [[None], [""], []],
    pl.List(pl.Int32): [[None], [-1], list(range(100)), []],
    pl.List(pl.Float32): [[None], [NAN], [INF], []],
}  # fmt: skip
TABLES = ("steps", "particles", "renewed")
Damage = tuple[str, str, Any]  # table, column, value


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of four updates and six particles."""
    folder = tmp_path_factory.mktemp("damage")
    write_small_survey(folder)
    settings = {"recovery.strategy": "sensor", "recovery.sensor.evidence": -700.0}  # compares, never draws
    mv.replay(
        write_small_session(folder, updates=4),
        filter=mv.Filter(particles=6, settings=settings),
        save_run=folder / "kept",
    )
    return folder / "kept"


@pytest.fixture
def bad(kept: Path, tmp_path: Path) -> Path:
    """A copy of the run, to be damaged."""
    return Path(shutil.copytree(kept, tmp_path / "bad"))


def damages(kept: Path) -> Iterator[Damage]:
    for table in TABLES:
        for column, kind in pl.read_parquet(part(kept, table)).schema.items():
            for value in (None, *WRONG[kind]):
                yield table, column, value


def part(folder: Path, table: str) -> Path:
    return folder / table / "00000001.parquet"


@cache
def whole(file: Path) -> pl.DataFrame:
    return pl.read_parquet(file)


def replace(kept: Path, bad: Path, damage: Damage, rows: list[int]) -> None:
    """Write the run with one value replaced in some rows of a table, and all else as it was."""
    table, column, value = damage
    for name in TABLES:
        shutil.copyfile(part(kept, name), part(bad, name))
    frame = whole(part(kept, table))
    values = frame[column].to_list()
    for row in rows:
        values[row] = value
    changed = frame.with_columns(pl.Series(column, values, dtype=frame.schema[column]))
    changed.write_parquet(part(bad, table))


def commands(run: Path) -> Iterator[Callable[[], object]]:
    yield lambda: mv.events(run, routine=True)
    yield lambda: mv.explain(run, 2)
    yield lambda: mv.replay(run)
    yield lambda: mv.verify(run)
    yield lambda: mv.export(run, [run / "a.csv", run / "a.tum"], force=True)
    yield lambda: mv.report(run, run / "a.html", force=True)


def defects(run: Path) -> list[Exception]:
    """Let each command go on or refuse the run in one line; return what else they raise."""
    found = []
    for command in commands(run):
        try:
            command()
        except InputError:
            pass
        except Exception as defect:
            found.append(defect)
    return found


def is_refused(run: Path) -> bool:
    try:
        list(open_run(run).steps())
    except InputError as problem:
        return str(run) in str(problem) and "expected" in str(problem)
    return False


def test_a_value_that_a_column_cannot_hold_is_refused_where_it_is_read(kept: Path, bad: Path) -> None:
    known = {"truth_x_m", "truth_y_m", "truth_heading_rad"}
    passed = set()
    for damage in damages(kept):
        replace(kept, bad, damage, [1])
        if not is_refused(bad):
            passed.add(f"{damage[1]} {damage[2]!r:.20}")
            assert damage[2] is not None
            assert (
                not isinstance(damage[2], float)
                or abs(damage[2]) == 7
                or damage[2] == INF * -1
                or (damage[1].endswith("heading_sd_rad"))
            ), damage
    assert not passed & {f"motions {value!r:.20}" for value in WRONG[pl.List(pl.List(pl.Float64))][1:]}
    assert not {f"{name} None" for name in known} & passed


@pytest.mark.parametrize(
    "damage",
    [
        ("steps", "step", None),
        ("steps", "time_s", INF),
        ("steps", "motions", [[1.0]]),
        ("steps", "estimate_heading_rad", NAN),
        ("renewed", "parent", -(2**31)),
    ],
    ids=lambda damage: damage[1],
)
def test_every_command_says_so_in_one_line(kept: Path, bad: Path, damage: Damage) -> None:
    replace(kept, bad, damage, [1])
    for words in (
        ["inspect", bad],
        [bad, "-o", "none"],
        ["export", bad, "-o", "a.csv"],
        ["report", bad],
        ["explain", bad],
        ["verify", bad],
    ):
        line = failure(*words)
        assert f"{damage[0]}/00000001.parquet: found {damage[1]}" in line
        assert ("step 1" if damage[0] == "renewed" else "step 2") in line
        assert "expected" in line


@pytest.mark.slow
def test_what_is_read_all_the_same_stops_no_command(kept: Path, bad: Path) -> None:
    for damage in damages(kept):
        for rows in ([1], list(range(4))):
            replace(kept, bad, damage, rows)
            if not is_refused(bad):
                assert defects(bad) == [], damage


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("place", ["device", "pipe", "folder"])
def test_only_files_are_read(bad: Path, table: str, place: str) -> None:
    file = part(bad, table)
    file.unlink()
    if place == "device":
        file.symlink_to("/dev/zero")
    elif place == "pipe":
        os.mkfifo(file)
    else:
        file.mkdir()
    with pytest.raises(InputError, match="found no regular file, expected a Parquet file"):
        open_run(bad)


def test_times_that_fall_are_refused(kept: Path, bad: Path) -> None:
    replace(kept, bad, ("steps", "time_s", 1.0), [2])
    with pytest.raises(InputError, match=r"found time_s 1 at step 3, expected at least 3"):
        list(open_run(bad).steps())


@pytest.mark.parametrize("text", ["", "null", "{}", '{"bounds_m": [0, 0, 1]}'])
def test_a_damaged_map_is_one_line_whatever_else_is_there(bad: Path, text: str) -> None:
    """It is needed only where the library is gone."""
    (bad / "map.json").write_text(text)
    assert "map.json: is no map" in failure(bad, "-o", "none")
