"""The commands that a table of trials prints for a run give that run again, to the last bit."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from helpers.commands import run
from helpers.small_room import write_small_room
from helpers.small_session import write_small_session, write_small_survey
from maurice_datasets.trials.engine import run_plan
from maurice_datasets.trials.folder import TrialsFolder
from maurice_datasets.trials.plan import read_plan

SIMULATED = """
seeds = 2
[[sessions]]
task = "global"
world = "{world}"
updates = 6
lights = "dim@3"
[settings]
particles = 60
"recovery.strategy" = "none"
[[variants]]
preset = "robust"
[[variants]]
feature = "color"
sensor.weights = {{ color = 1.0, edges = 2.0 }}
"""
RECORDED = """
seeds = 2
[[sessions]]
path = "session.log"
start = "anywhere"
[grid]
particles = [20, 80]
"""


@pytest.fixture(scope="module", params=["simulated", "recorded"])
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write trials into a folder."""
    folder: Path = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        plan = SIMULATED.format(world=write_small_room(folder))
        if request.param == "recorded":
            plan = RECORDED
            write_small_survey(folder)
            write_small_session(folder)
        Path("mine.toml").write_text(plan)
        assert run_plan(read_plan(Path("mine.toml")), folder / "trials", workers=1).failed == 0
    return folder


@pytest.fixture
def trials(made: Path, monkeypatch: pytest.MonkeyPatch) -> TrialsFolder:
    monkeypatch.chdir(made)
    return TrialsFolder(made / "trials")


def test_the_commands_of_every_row_have_its_error(trials: TrialsFolder) -> None:
    drives = set()
    for row in trials.rows.iter_rows(named=True):
        commands = trials.commands_of(row)
        assert commands is not None
        *before, replay = commands.split(" && ")
        for text in before:
            if text not in drives:
                run(*shlex.split(text)[1:])
            drives.add(text)
        told = json.loads(run("replay", *shlex.split(replay)[1:], "-o", "none", "--json").stdout)
        assert told["runs"][0]["error_mean_m"] == row["error_mean_m"]


def test_the_table_prints_those_of_the_worst_run(trials: TrialsFolder) -> None:
    worst = trials.rows.sort("error_mean_m", descending=True).row(0, named=True)
    commands = trials.commands_of(worst)
    assert commands is not None
    assert commands in " ".join(run("trials", "table", trials.folder).stderr.split())


def test_what_no_command_can_show_has_none(trials: TrialsFolder) -> None:
    row = trials.rows.row(0, named=True)
    trials.parts[0]["sessions"][0]["spacing_in"] = 12
    assert trials.commands_of(row) is None
