"""The thesis's success in table and JSON, for live runs as a collector sees them."""

from dataclasses import replace

import pytest
from rich.console import Console

from maurice_mcl.analysis.metrics import Scorer, Success
from maurice_viz.cli.replay import to_table
from maurice_viz.playback import RunResult
from maurice_viz.style import units_named
from maurice_viz.text.summary import to_json

ROWS = ("localized (thesis, sd < 10 %)", "localized (thesis, one foot)")


def _result(*success):
    return RunResult("one", replace(Scorer().result(), success=success), None)


def _cells(result):
    console = Console(width=100)
    with console.capture() as capture:
        console.print(to_table([result], units_named("in"), "drive"))
    lines = [[c.strip() for c in line.strip("│").split("│")] for line in capture.get().splitlines()]
    found = {line[0]: line[1] for line in lines if len(line) == 2}
    return [found[row] for row in ROWS]


SHOWN = {
    "update 24, 100.0 in, 215 s": Success("circle", 24, 2.54, 215.2),
    "left the truth at 30": Success("circle", 24, 2.54, 215.2, "left", 30),
    "no, 5 min over": Success("circle", failed="time", failed_at_update=40),
    "no": Success("circle"),
}


@pytest.mark.parametrize("shown", SHOWN)
def test_the_row_says_when_or_how_it_failed(shown):
    assert _cells(_result(Success("tenth"), SHOWN[shown])) == ["no", shown]


def test_json_has_all_of_it():
    assert _cells(_result()) == ["-", "-"]
    assert to_json([_result()])["runs"][0]["thesis_success"] == {}
    found = to_json([_result(Success("tenth"), SHOWN["left the truth at 30"])])["runs"][0]["thesis_success"]
    nothing = dict.fromkeys(("at_update", "at_m", "at_s", "failed", "failed_at_update"))
    expected = {"at_update": 24, "at_m": 2.54, "at_s": 215.2, "failed": "left", "failed_at_update": 30}
    assert found == {"tenth": nothing, "circle": expected}
