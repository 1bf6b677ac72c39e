from __future__ import annotations

import pytest

from benchmarks.studies.lost_drives import for_fitting, for_testing
from maurice_datasets.tasks import DEMO, FITTING, TASKS, TEST


def test_kidnapping_is_half_way_and_only_global_hides_the_start():
    assert [t.name for t in TASKS.values() if not t.start_known] == ["global"]
    assert TASKS["kidnapped"].kidnap_at(120, None) == 60
    assert TASKS["kidnapped"].kidnap_at(120, 119) == 119
    assert TASKS["tracking"].kidnap_at(120, None) is None


@pytest.mark.parametrize(
    ("task", "updates", "asked"),
    [("kidnapped", 1, None), ("kidnapped", 9, 9), ("kidnapped", 9, 0), ("global", 9, 4)],
)
def test_a_kidnapping_that_cannot_be_is_refused(task, updates, asked):
    with pytest.raises(ValueError, match="kidnap"):
        TASKS[task].kidnap_at(updates, asked)


def test_the_split_is_what_it_always_was():
    assert DEMO == 0
    assert (FITTING.start, FITTING.stop) == (1, 100)
    assert (TEST.start, TEST.stop) == (1000, 2000)


@pytest.mark.parametrize("seed", [1, 99])
def test_fitting_seeds_are_for_fitting_only(seed):
    assert for_fitting(seed) == seed
    with pytest.raises(ValueError, match="1000 to 1999; it is a fitting seed"):
        for_testing(seed)


@pytest.mark.parametrize("seed", [1000, 1999])
def test_test_seeds_are_for_testing_only(seed):
    assert for_testing(seed) == seed
    with pytest.raises(ValueError, match="1 to 99; it is a test seed"):
        for_fitting(seed)


@pytest.mark.parametrize("seed", [-1, 0, 100, 999, 2000])
def test_all_others_are_for_neither(seed):
    for ask in (for_fitting, for_testing):
        with pytest.raises(ValueError, match=f"found seed {seed}"):
            ask(seed)
