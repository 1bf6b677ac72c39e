"""How runs compare over a drive, in words and in the table: what is averaged, and what that can tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.comparison import ComparisonResult, difference_of
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.metrics import score_table
from maurice_mcl.scoring.table import TableRows
from maurice_viz.playback import RunResult
from maurice_viz.style import UNITS, Scale
from maurice_viz.text.comparison import drive_words
from maurice_viz.text.summary import paired_rows, to_json

INCHES = Scale(UNITS["in"])
FIRST = RunResult("a", score_table(TableRows().table()), None)
LOST = RunVerdict(updates=80, episodes=(Episode("lost", 41, 80, 41, lost=44),))


def against(values, **more):
    """Return the words and the first cell of the table for differences of errors (n,) in meters."""
    paired = ComparisonResult(difference_of(np.array(values)), None, 0.1, 0.2, None)
    run = RunResult("b", score_table(TableRows().table()), None, against="a", paired=paired)
    first = replace(FIRST, **more)
    return drive_words([first, run], INCHES), paired_rows([first, run], UNITS["in"])[0][1][1]


@pytest.mark.parametrize(
    ("values", "facts", "cell"),
    [
        (
            [-0.05 - 0.001 * (k % 3) for k in range(117)],
            ["**2.0 in closer** on average, closer at every one of 117 steps", "hardly chance"],
            "-2.0",
        ),
        (
            [-0.02 - 0.001 * (k // 40) ** 8 for k in range(117)],  # one stretch has most of it
            ["closer at every one of 117 steps, 6 blocks of 19 that count as one each: hardly chance"],
            "[all 6 blocks agree]",
        ),
        (
            [-0.05] * 4,
            ["closer at every one of 4 steps, which count one each: **may be chance**"],
            "[undecided]",
        ),
        ([0.05] * 9, ["farther at every one of 9 steps", "hardly chance"], "[all 9 blocks agree]"),
        ([-0.1, 0.05] * 5, ["closer at 5 of 10 steps: **may be chance**", "steps are few"], "[undecided]"),
    ],
)
def test_where_every_step_agrees_its_blocks_are_the_sample(values, facts, cell):
    text, written = against(values)
    for fact in facts:
        assert fact in text
    assert cell in written


def test_of_a_run_that_was_lost_there_is_no_average():
    text, written = against([-0.9] * 40 + [0.1] * 5, verdict=LOST)
    assert "`b` is closer at 40 of 45 steps. No average, as `a` was lost from step 41." in text
    assert "chance" not in text
    assert written == "one was lost"
    paired = ComparisonResult(difference_of(np.full(9, 0.1)), None, 0.1, 0.2, None)
    others = [replace(FIRST, label=label, against="a", paired=paired) for label in "bc"]
    text = drive_words([replace(FIRST, verdict=LOST), *others], INCHES)
    assert text.endswith(" No averages, as `a` was lost from step 41."), "once, not of each run"


def test_json_has_each_figure_under_its_own_name():
    position, heading = (difference_of(np.arange(30.0) * times) for times in (0.01, 0.02))
    paired = ComparisonResult(position, heading, apart_mean_m=0.1, apart_most_m=0.2, parted_at=7)
    (_, run) = to_json([FIRST, replace(FIRST, label="b", against="a", paired=paired)], INCHES)["runs"]
    told = run["against_first"]
    assert (told["label"], told["parted_at_step"]) == ("a", 7)
    assert (told["apart_mean_m"], told["apart_most_m"]) == (0.1, 0.2)
    assert told["position_error"]["difference_mean_m"] == pytest.approx(0.145)
    assert told["heading_error"]["difference_mean_rad"] == pytest.approx(0.29)
    assert (told["position_error"]["better"], told["position_error"]["worse"]) == (0, 29)
