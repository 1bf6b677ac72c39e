"""The truth at a picture's time: exact, interpolated over at most 1 s, or unknown."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.reading.recording import Motion, Note, Picture, Record, TruthPose
from maurice_loaders.reading.time_alignment import MOST_WAITING, Aligner
from maurice_mcl.values.arrays import F64


def truth(t_s: float, *pose: float) -> TruthPose:
    return TruthPose(t_s, np.array(pose or (t_s, 2 * t_s, 0), np.float64))


def picture(t_s: float) -> Picture:
    return Picture(t_s, lambda: np.zeros((1, 1, 3), np.uint8), "a.png")


def odometry(t_s: float) -> Motion:
    return Motion(t_s, np.zeros(3))


def poses(*records: Record) -> list[F64 | None]:
    return [aligned.truth_at() for aligned in Aligner()(records)]


def test_order_is_kept_and_every_picture_comes_once() -> None:
    records = [odometry(0), picture(0.1), odometry(0.2), truth(0.5), picture(0.6), picture(0.7), truth(0.9)]
    aligned = list(Aligner()(records))
    assert [one.picture for one in aligned] == [r for r in records if isinstance(r, Picture)]
    assert [len(one.motions) for one in aligned] == [1, 1, 0]


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
    carried = Note(0.6, "kidnapped")
    assert poses(truth(0), picture(0.5), carried, picture(0.7), truth(0.9)) == [None, None]


def test_truth_at_the_time_of_a_kidnapping_holds_for_what_follows() -> None:
    before, after = poses(truth(1, 0, 0, 0), picture(1), Note(1, "kidnapped"), truth(1, 5, 5, 0), picture(1))
    assert before is not None
    assert after is not None
    assert (before[0], after[0]) == (0, 5)


def test_looks_ahead_no_further_than_needed() -> None:
    further = (odometry(0.6 + 0.1 * k) for k in itertools.count())
    aligned = next(Aligner()(itertools.chain([truth(0), picture(0.5)], further)))
    assert aligned.truth_at() is None
    assert next(further).t_s < 1.35


def test_a_clock_that_stands_still_does_not_fill_the_memory() -> None:
    standing = iter([picture(0.0)] * 3 * MOST_WAITING)
    assert next(Aligner()(standing)).truth_at() is None
    assert len(list(standing)) == 2 * MOST_WAITING - 1


def test_where_nothing_comes_truth_is_not_awaited() -> None:
    records = iter([truth(0), picture(0.5), None, truth(0.9)])
    assert next(Aligner()(records)).truth_at() is None
    assert isinstance(next(records), TruthPose)


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 8)), max_size=30))
def test_equals_the_answer_with_the_whole_log_in_hand(steps: list[tuple[bool, int]]) -> None:
    times = list(itertools.accumulate(quarter / 4 for _, quarter in steps))
    records = [truth(t) if known else picture(t) for (known, _), t in zip(steps, times, strict=True)]
    known = [record.t_s for record in records if isinstance(record, TruthPose)]
    for aligned in Aligner()(records):
        t_s, pose = aligned.picture.t_s, aligned.truth_at()
        before = max((t for t in known if t <= t_s), default=-np.inf)
        after = min((t for t in known if t >= t_s), default=np.inf)
        if after - before <= 1:
            assert pose == pytest.approx([t_s, 2 * t_s, 0])
        else:
            assert pose is None
