"""Everything in benchmarks/ can be imported, and every plan there can be read."""

from __future__ import annotations

import importlib
import runpy
import sys
from pathlib import Path

import pytest

from maurice_datasets.trials.plan import read_plan

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
OTHERS = {"peer_filters", "__main__"}  # run in the peers' environment; run below
MODULES = [file for file in sorted(BENCHMARKS.rglob("*.py")) if file.stem not in OTHERS]
PLANS = sorted((BENCHMARKS / "studies" / "plans").glob("*.toml"))


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(BENCHMARKS)))
def test_a_module_is_imported(file: Path) -> None:
    parts = file.relative_to(BENCHMARKS.parent).with_suffix("").parts
    importlib.import_module(".".join(part for part in parts if part != "__init__"))


@pytest.mark.parametrize("file", PLANS, ids=lambda file: file.stem)
def test_a_plan_is_read(file: Path) -> None:
    assert read_plan(file).runs > 0


def test_there_are_plans_for_the_tables_of_the_docs() -> None:
    assert {"results", "landmarks", "channels", "landmarks-spacing"} <= {file.stem for file in PLANS}


@pytest.mark.parametrize("name", ["benchmarks", "benchmarks.thesis"])
def test_a_command_says_how_it_is_used(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["", "--help"])
    monkeypatch.delitem(sys.modules, f"{name}.__main__", raising=False)  # which another test imports
    with pytest.raises(SystemExit):
        runpy.run_module(name, run_name="__main__")
    assert f"usage: python -m {name}" in capsys.readouterr().out
