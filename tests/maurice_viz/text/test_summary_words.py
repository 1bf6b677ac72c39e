"""Cells of the table that ends a replay."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import maurice_mcl as mcl
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.episodes import Episode
from maurice_viz.text import summary


@pytest.fixture(scope="module")
def score():
    return mcl.score(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))


@pytest.mark.parametrize(
    ("episodes", "says"),
    [
        ([Episode("lost", 2, 9, 2, lost=5)], "at step 5"),
        ([Episode("searching", 1, 9, lost=5)], "at step 5, searching"),
        (
            [Episode("searching", 1, 9, lost=5), Episode("lost", 20, 30, lost=23)],
            "at step 5, 1 more, searching",
        ),
        ([], "no"),
    ],
)
def test_a_run_that_was_lost_before_it_was_ever_localized_was_searching(score, episodes, says):
    verdict = RunVerdict(episodes=tuple(episodes))
    assert summary._lost(SimpleNamespace(score=score, verdict=verdict)) == says
