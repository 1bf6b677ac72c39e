"""`budget`: its table, its JSON and its sentence say the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from helpers.commands import failure, run
from helpers.small_session import write_small_session, write_small_survey

TYPED = ("--particles", "50", "--seeds", "2")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("budget")
    write_small_survey(folder)
    return write_small_session(folder, updates=7)


@pytest.fixture(scope="module")
def budget(log: Path) -> dict[str, Any]:
    return dict(json.loads(run("budget", log, *TYPED, "--json").stdout))


def test_the_table_and_json_say_the_same(log: Path, budget: dict[str, Any]) -> None:
    shown = run("budget", log, *TYPED).stdout
    assert budget["parts"][0]["part"] == "as it is"
    for part in budget["parts"]:
        assert f"{part['error']['value']:.2f}" in shown
    assert (budget["costliest"] or "No cost") in shown


def test_without_truth_it_says_so(tmp_path: Path) -> None:
    write_small_survey(tmp_path)
    assert "found no truth" in failure("budget", write_small_session(tmp_path, truth=False))


def test_seeds_of_a_recorded_session_are_one_drive(log: Path, budget: dict[str, Any], tmp_path: Path) -> None:
    plan = log.with_name("mine.toml")
    plan.write_text('seeds = 2\n[[sessions]]\npath = "session.log"\n[settings]\nparticles = 50\n')
    run("trials", "run", plan, "-o", tmp_path / "out", "--workers", "1")
    ours = json.loads(run("budget", tmp_path / "out", "--json").stdout)
    assert (ours["drives"], ours["display_units"]) == (1, budget["display_units"])
    assert ours["parts"] == budget["parts"]
