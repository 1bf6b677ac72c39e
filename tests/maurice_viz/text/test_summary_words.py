"""Cells of the table that ends a replay."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

import maurice_mcl as mcl
from maurice_viz.text import summary


@pytest.fixture(scope="module")
def score():
    return mcl.score(mcl.run(mcl.make_localizer(mcl.tiny_library()), mcl.tiny_session()))


@pytest.mark.parametrize(
    ("localized_at", "says"),
    [(2, "at update 5"), (None, "at update 5, searching"), (9, "at update 5, searching")],
)
def test_a_run_that_was_lost_before_it_was_ever_localized_was_searching(score, localized_at, says):
    lost = replace(score, lost=True, lost_at_update=5, localized_at_update=localized_at)
    assert summary._lost(SimpleNamespace(score=lost)) == says
