"""The split between library and drive is a partition, less what the guard takes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.importing.pictures import nearest_m, split_runs, spread
from maurice_loaders.importing.pose_table import PoseRow, pose_runs


def row(number: int, x: float, y: float = 0.0) -> PoseRow:
    return PoseRow(number, number + 2, f"{number}.jpg", np.array([x, y, 0.0]))


def line_of(count: int, step_m: float, copies: int = 1) -> list[list[PoseRow]]:
    return pose_runs([row(k, step_m * (k // copies)) for k in range(count * copies)])


def numbers(rows: tuple[PoseRow, ...]) -> list[int]:
    return [r.number for r in rows]


def test_every_third_run_is_the_session_from_the_first() -> None:
    split = split_runs(line_of(8, 1.0), 3, 0.0, 1, 1)
    assert numbers(split.session) == [0, 3, 6]
    assert numbers(split.library) == [1, 2, 4, 5, 7]
    assert (split.session_runs, split.guarded_runs) == (3, 0)


def test_the_guard_takes_what_is_near_to_any_session_pose_seen_or_unseen() -> None:
    split = split_runs(line_of(9, 0.4), 4, 0.5, 1, 1)
    assert numbers(split.session) == [0, 4, 8]
    assert numbers(split.library) == [2, 6]
    assert split.guarded_runs == 4
    back_again = [[row(0, 0)], [row(1, 3)], [row(2, 6)], [row(3, 9)], [row(4, 2.8)]]
    assert numbers(split_runs(back_again, 4, 0.5, 1, 1).library) == [2, 3]


def test_the_guard_does_not_ask_where_one_looks() -> None:
    turned = PoseRow(1, 3, "b", np.array([0.1, 0.0, np.pi]))
    assert split_runs([[row(0, 0)], [turned]], 2, 0.5, 1, 1).library == ()


def test_nearest_reference_is_of_every_session_picture() -> None:
    split = split_runs(line_of(5, 1.0, copies=3), 4, 0.5, 2, 1)
    assert len(split.session) == 4
    assert split.nearest_reference_m().tolist() == [1, 1, 1, 1]


@given(
    st.lists(st.tuples(st.floats(0, 9), st.floats(0, 9)), min_size=1, max_size=40),
    st.integers(2, 6),
    st.floats(0, 3),
)
def test_nothing_of_the_library_is_within_the_guard(
    places: list[tuple[float, float]], every: int, guard_m: float
) -> None:
    runs = pose_runs([row(k, x, y) for k, (x, y) in enumerate(places)])
    split = split_runs(runs, every, guard_m, 1, 1)
    assert not set(numbers(split.session)) & set(numbers(split.library))
    assert len(split.session) + len(split.library) + split.guarded_runs == len(runs)
    assert all(split.nearest_reference_m() >= guard_m)


@pytest.mark.parametrize(
    ("length", "most", "chosen"),
    [(1, 1, [0]), (5, 1, [2]), (6, 1, [3]), (3, 5, [0, 1, 2]), (10, 2, [2, 7]), (9, 3, [1, 4, 7])],
)
def test_spread(length: int, most: int, chosen: list[int]) -> None:
    assert [r.number for r in spread([row(k, 0) for k in range(length)], most)] == chosen


def test_the_nearest_of_none_is_infinitely_far() -> None:
    assert nearest_m(np.zeros((2, 2)), np.zeros((0, 2))).tolist() == [np.inf, np.inf]
