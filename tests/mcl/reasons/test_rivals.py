"""What a second run tells of one that is doubted without truth."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.run_tables import run_table
from maurice_mcl.reasons.causes import DATA, LIGHTING, UNKNOWN, Failure
from maurice_mcl.reasons.rivals import with_rivals
from maurice_mcl.reasons.verdict import RunVerdict
from maurice_mcl.scoring.episodes import Episode
from maurice_mcl.scoring.table import PROBABLY_LOST

HERE, THERE = np.array([1.0, 1.0, 0.0]), np.array([4.0, 1.0, 0.0])
UPDATES = 12


def at(*poses):
    """The columns of a run that stays at one pose after another, for as many updates."""
    return np.repeat([pose for pose, _ in poses], [count for _, count in poses], axis=0)


def explained(kind=UNKNOWN, *, there=THERE, knows=0.9, truth_known=False, parted=7):
    """Explain a doubt from step 9 to 12 of a run that another one parts from before."""
    tables = {
        "a": run_table(UPDATES, poses=at((HERE, UPDATES)), knows=np.full(UPDATES, 0.1)),
        "b": run_table(
            UPDATES,
            poses=at((HERE, parted - 1), (there, UPDATES + 1 - parted)),
            knows=np.full(UPDATES, knows),
        ),
    }
    failure = Failure(kind, 9, Episode(PROBABLY_LOST, 9, 12, noticed=9), truth_known=truth_known)
    verdicts = with_rivals(
        {"a": RunVerdict(updates=12, failures=(failure,)), "b": RunVerdict(updates=12)}, tables
    )
    assert verdicts["b"].failures == ()
    return failure, verdicts["a"].failures[0]


@pytest.mark.parametrize("kind", [UNKNOWN, LIGHTING])
def test_a_run_that_knows_where_it_is_elsewhere_is_the_evidence_since_they_parted(kind):
    _, failure = explained(kind)  # light, too: the pictures fit there
    assert (failure.kind, failure.first) == (UNKNOWN, 7)
    assert failure.evidence == {"rival": "b", "apart_m": pytest.approx(3.0)}


@pytest.mark.parametrize(
    "changes",
    [
        {"knows": 0.2},  # it does not know either
        {"knows": np.nan},  # nobody can tell whether it does
        {"there": HERE},  # it is at the same place
        {"kind": DATA},  # the recording tells
        {"truth_known": True},
        {"parted": 12},  # at the last of four steps
    ],
)
def test_else_it_is_none(changes):
    before, after = explained(**changes)
    assert after == before
