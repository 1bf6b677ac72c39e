"""What is demanded of a run: localized in time, not lost after that, off by little; where that counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from maurice_mcl.scoring.demands import (
    CONVERGED,
    ERROR,
    KEPT,
    LOCALIZED,
    Demands,
    RunTrack,
    judge_run,
    starts_of,
)
from maurice_mcl.values.session import Frame, Moment

UPDATES = 40
ALL = Demands(max_error_m=0.3, localized_by=10, converged_by=10)


def track(found_at: int = 4, **changed: object) -> RunTrack:
    """A run that is 3 m off and lost before an update, counted from 1, and then localized, 0.1 m off."""
    late = np.arange(1, UPDATES + 1) >= found_at
    good = RunTrack(0, np.where(late, 0.1, 3.0), late, ~late, np.ones(UPDATES, bool))
    return replace(good, **changed)


def test_a_run_that_finds_itself_in_time_meets_all_demands():
    found = judge_run(track(10), [0], ALL)
    assert found.passed
    assert (found.found_after, found.converged_after, found.first_failed_at) == (10, 1, None)
    assert found.error_mean_m == pytest.approx(0.1)  # what was off while it searched does not count


def test_one_update_too_late_fails_at_the_last_update_that_was_allowed():
    found = judge_run(track(11), [0], ALL)
    assert found.met == {LOCALIZED: False, KEPT: True, ERROR: True, CONVERGED: True}
    assert found.failed_at == {LOCALIZED: 9}


def test_a_loss_counts_from_its_first_update_and_raises_the_mean_error():
    off = (np.arange(UPDATES) >= 20) & (np.arange(UPDATES) < 30)
    found = judge_run(track(error_m=np.where(off, 2.0, 0.1), lost=off, localized=~off), [0], ALL)
    assert found.met == {LOCALIZED: True, KEPT: False, ERROR: False, CONVERGED: True}
    assert found.failed_at == {KEPT: 20, ERROR: 20}
    short = np.arange(UPDATES) // 3 == 7  # three updates in a row are no loss
    assert judge_run(track(lost=short), [0], ALL).met[KEPT]


def test_after_a_kidnapping_the_time_to_search_begins_again():
    lost = (np.arange(UPDATES) >= 20) & (np.arange(UPDATES) < 27)
    run = track(error_m=np.where(lost, 5.0, 0.1), lost=lost, localized=~lost)
    assert not judge_run(run, [0], ALL).passed
    assert judge_run(run, [0, 20], ALL).passed
    assert judge_run(run, [0, 20], ALL).found_after == 8
    again = judge_run(run, [0, 20], replace(ALL, localized_by=7))
    assert again.failed_at == {LOCALIZED: 26}


def test_a_run_is_told_apart_that_was_localized_and_not_again_after_a_kidnapping():
    early, late = np.arange(UPDATES) < 20, np.arange(UPDATES) >= 22
    for localized, expected in ((early, (True, False)), (late, (False, True)), (early | late, (True, True))):
        found = judge_run(track(localized=localized), [0, 20], ALL)
        assert found.found_at[LOCALIZED] == expected
        assert (found.found_after is None) == (not all(expected))


def test_a_kidnapping_too_late_in_the_drive_is_not_judged():
    run = track(localized=np.arange(UPDATES) < 30)
    assert not judge_run(run, [0, 30], replace(ALL, localized_by=6)).met[LOCALIZED]
    late = judge_run(run, [0, 31], replace(ALL, localized_by=6))
    assert late.met[LOCALIZED]  # five more are needed
    assert late.found_after == 1  # and it is in no figure


def test_updates_without_truth_are_in_no_error():
    off_m = np.where(np.arange(UPDATES) % 2, 0.1, np.nan)
    assert judge_run(track(error_m=off_m), [0], ALL).error_mean_m == pytest.approx(0.1)


def test_who_asks_about_the_truth_also_asks_not_to_be_lost():
    assert Demands(max_error_m=1).kinds == (KEPT, ERROR)
    assert Demands(converged_by=3).kinds == (CONVERGED,)
    assert Demands().kinds == ()


def test_searches_start_at_the_beginning_and_at_kidnappings():
    moments = [
        Moment(Frame(step, float(step), np.zeros((0, 3)), np.zeros((1, 1, 3), np.uint8), ""), None, events)
        for step, events in enumerate([("kidnapped",), (), ("kidnapped 2 m",), ("lights out",)], start=1)
    ]
    assert starts_of(moments) == (0, 2)
