"""The truth at a picture's time: exact, interpolated over at most 1 s, or unknown."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.session_log.records import (
    MAX_WAITING,
    EventRecord,
    OdometryRecord,
    PictureRecord,
    Record,
    TruthRecord,
    with_truth,
)
from maurice_mcl.values.arrays import F64


def truth(t_s: float, *pose: float) -> TruthRecord:
    return TruthRecord(0, t_s, np.array(pose or (t_s, 2 * t_s, 0), np.float64))


def picture(t_s: float) -> PictureRecord:
    return PictureRecord(0, t_s, "a.png", None, None, False, None)


def odometry(t_s: float) -> OdometryRecord:
    return OdometryRecord(0, t_s, np.zeros(3), None)


def poses(*records: Record) -> list[F64 | None]:
    return [pose for record, pose in with_truth(records) if isinstance(record, PictureRecord)]


def test_order_is_kept_and_only_pictures_are_answered() -> None:
    records = [odometry(0), picture(0.1), odometry(0.2), truth(0.5), picture(0.6), picture(0.7), truth(0.9)]
    answered = list(with_truth(records))
    assert [record for record, _ in answered] == records
    assert all(pose is None for record, pose in answered if not isinstance(record, PictureRecord))


@pytest.mark.parametrize("order", [0, 1])
def test_the_same_time_counts_before_and_after(order: int) -> None:
    records = [truth(5, 1, 2, 9), picture(5)]
    (pose,) = poses(*(records[::-1] if order else records))
    assert pose is not None
    assert pose.tolist() == [1, 2, 9]


def test_between_two_truths_lies_a_pose() -> None:
    (pose,) = poses(truth(0, 0, 0, 0), picture(0.5), truth(1, 2, 4, 1))
    assert pose == pytest.approx([1, 2, 0.5])
    (pose,) = poses(truth(0, 0, 0, 3), picture(0.5), truth(1, 0, 0, -3))  # headings go the short way round
    assert pose is not None
    assert abs(pose[2]) == pytest.approx(np.pi)
    assert 2.2 - 1.2 > 1  # by rounding
    assert poses(truth(1.2), picture(1.6), truth(2.2))[0] is not None


def test_nothing_is_guessed_further_off_beyond_the_ends_and_across_a_kidnapping() -> None:
    assert poses(truth(0), picture(0.5), truth(1.01)) == [None]
    assert poses(picture(0), truth(0.1), picture(0.2)) == [None, None]
    carried = EventRecord(0, 0.6, "kidnapped")
    assert poses(truth(0), picture(0.5), carried, picture(0.7), truth(0.9)) == [None, None]


def test_truth_at_the_time_of_a_kidnapping_holds_for_what_follows() -> None:
    before, after = poses(
        truth(1, 0, 0, 0), picture(1), EventRecord(0, 1, "kidnapped"), truth(1, 5, 5, 0), picture(1)
    )
    assert before is not None
    assert after is not None
    assert (before[0], after[0]) == (0, 5)


def test_looks_ahead_no_further_than_needed() -> None:
    further = (odometry(0.6 + 0.1 * k) for k in itertools.count())
    answers = with_truth(itertools.chain([truth(0), picture(0.5)], further))
    next(answers)
    assert next(answers)[1] is None
    assert next(further).t_s < 1.35


def test_a_clock_that_stands_still_does_not_fill_the_memory() -> None:
    standing = iter([picture(0.0)] * 3 * MAX_WAITING)
    assert next(with_truth(standing))[1] is None
    assert len(list(standing)) == 2 * MAX_WAITING - 1


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 8)), max_size=30))
def test_equals_the_answer_with_the_whole_log_in_hand(steps: list[tuple[bool, int]]) -> None:
    times = list(itertools.accumulate(quarter / 4 for _, quarter in steps))
    records = [truth(t) if known else picture(t) for (known, _), t in zip(steps, times, strict=True)]
    for record, pose in with_truth(records):
        if isinstance(record, PictureRecord):
            known = [r.t_s for r in records if isinstance(r, TruthRecord)]
            before = max((t for t in known if t <= record.t_s), default=-np.inf)
            after = min((t for t in known if t >= record.t_s), default=np.inf)
            if after - before <= 1:
                assert pose == pytest.approx([record.t_s, 2 * record.t_s, 0])
            else:
                assert pose is None
