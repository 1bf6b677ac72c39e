from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import FieldError
from maurice_loaders.live.intake import APART_S, SET_BACK, LiveClock

TIMES = st.floats(-1e6, 1e6, allow_nan=False)


@given(st.lists(st.one_of(TIMES, st.none()), max_size=60))
def test_times_never_fall_whatever_the_source_says(said: list[float | None]) -> None:
    clock, given_s = LiveClock(), []
    for t_s in said:
        if t_s is None:
            clock.restart()
            continue
        with suppress(FieldError):
            given_s.append(clock.time(t_s))
    assert given_s == sorted(given_s)


def test_times_are_kept_as_long_as_they_rise() -> None:
    clock = LiveClock()
    assert [clock.time(t) for t in (5.0, 5.0, 7.5)] == [5.0, 5.0, 7.5]
    clock.restart()
    assert clock.time(60.0) == 60.0


def test_a_source_that_begins_anew_goes_on_behind_what_it_said() -> None:
    clock = LiveClock()
    clock.time(100.0)
    clock.restart()
    assert clock.time(0.0) == 100.0 + APART_S
    assert clock.time(3.0) == 103.0 + APART_S


def test_one_time_that_falls_is_refused_and_a_clock_set_back_is_followed() -> None:
    clock = LiveClock()
    clock.time(3e9)  # a slip, or a clock before it was set
    for number in range(SET_BACK - 1):
        with pytest.raises(FieldError, match="not to fall"):
            clock.time(10.0 + number)
    assert clock.time(50.0) == 3e9 + APART_S
    assert clock.time(51.0) == 3e9 + APART_S + 1.0


def test_a_time_that_no_log_may_hold_is_refused() -> None:
    clock = LiveClock()
    clock.time(4e9)
    clock.restart()
    with pytest.raises(FieldError, match="up to 4e9"):
        clock.time(0.0)
