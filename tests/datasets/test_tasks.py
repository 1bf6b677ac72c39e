import pytest

from maurice_datasets.tasks import TASKS


def test_kidnapping_is_half_way_and_only_global_hides_the_start() -> None:
    assert [t.name for t in TASKS.values() if not t.start_known] == ["global"]
    assert TASKS["kidnapped"].kidnap_at(120, None) == 60
    assert TASKS["kidnapped"].kidnap_at(120, 119) == 119
    assert TASKS["tracking"].kidnap_at(120, None) is None


@pytest.mark.parametrize(
    ("task", "updates", "asked"),
    [("kidnapped", 1, None), ("kidnapped", 9, 9), ("kidnapped", 9, 0), ("global", 9, 4)],
)
def test_a_kidnapping_that_cannot_be_is_refused(task: str, updates: int, asked: int | None) -> None:
    with pytest.raises(ValueError, match="kidnap"):
        TASKS[task].kidnap_at(updates, asked)
