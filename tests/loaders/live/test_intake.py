"""Clocks, framing and what waits for the filter: nothing falls, nothing is lost, nothing fills the memory."""

from __future__ import annotations

import threading
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.errors import FieldError
from maurice_loaders.live.clocks import APART_S, SET_BACK, LiveClock
from maurice_loaders.live.session import MOST, Backlog
from maurice_loaders.live.source import LineCutter
from maurice_loaders.reading.recording import Motion, Note, Picture
from maurice_loaders.reading.time_alignment import Aligned, Aligner, Neighbors, joined
from maurice_mcl.values.arrays import F64
from maurice_mcl.values.geometry import compose

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


def test_times_are_kept_as_long_as_they_rise_and_those_of_a_new_beginning_go_on_behind() -> None:
    clock = LiveClock()
    assert [clock.time(t) for t in (5.0, 5.0, 7.5)] == [5.0, 5.0, 7.5]
    clock.restart()
    assert clock.time(60.0) == 60.0
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
    clock = LiveClock()
    clock.time(4e9)  # the last that a log may hold
    clock.restart()
    with pytest.raises(FieldError, match="up to 4e9"):
        clock.time(0.0)


MOST_BYTES = 12
PORTIONS = st.lists(
    st.one_of(st.binary(max_size=30), st.text("\r\n{}a", max_size=9).map(str.encode)), max_size=20
)


def cut_lines(portions: list[bytes], most: int = MOST_BYTES) -> list[tuple[int, bytes, bool, bool]]:
    cutter = LineCutter(most)
    lines = [line for portion in portions for line in cutter.feed(portion)]
    rest = cutter.rest()
    return [(x.number, x.data, x.ended, x.too_long) for x in (*lines, *([rest] if rest else []))]


@given(PORTIONS)
def test_lines_are_those_of_the_text_whatever_the_portions_and_never_too_long(portions: list[bytes]) -> None:
    whole = b"".join(portions)
    found = cut_lines(portions)
    assert found == cut_lines([whole]) == cut_lines([whole[i : i + 1] for i in range(len(whole))])
    *parts, rest = whole.split(b"\n")
    expected = [(part, True) for part in parts] + ([(rest, False)] if rest else [])
    assert found == [
        (number, part[:MOST_BYTES].rstrip(b"\r"), ended, len(part) > MOST_BYTES)
        for number, (part, ended) in enumerate(expected, 1)
    ]


def test_an_endless_line_is_told_before_it_ends_and_is_not_held() -> None:
    cutter = LineCutter(1000)
    for _ in range(5000):
        assert cutter.feed(b"x" * 1000) == []
    assert cutter.overflowing
    line = cutter.feed(b"\nnext\n")
    assert [(one.data, one.too_long) for one in line] == [(b"x" * 1000, True), (b"next", False)]
    assert not cutter.overflowing


NEVER = threading.Event()


def waiting(number: int, motions: int = 1) -> Aligned:
    picture = Picture(float(number), lambda: np.zeros((1, 1, 3), np.uint8), "", number)
    moved = [np.array([number, i, 0.1]) for i in range(motions)]
    return Aligned(picture, moved, [f"event {number}"], {}, Neighbors(), Neighbors())


def end(motions: list[F64]) -> F64:
    pose = np.zeros(3)
    for motion in motions:
        pose = compose(pose, motion)
    return pose


@given(st.lists(st.integers(0, 3), min_size=1, max_size=30), st.integers(1, 5))
def test_what_is_left_out_keeps_its_motions_and_events_in_order(motions: list[int], room: int) -> None:
    backlog = Backlog(keep_up=True, room=room)
    puts = [waiting(number, count) for number, count in enumerate(motions)]
    everything = [motion for one in puts for motion in one.motions]
    for one in puts:
        backlog.put(one, NEVER)
    backlog.close()
    got = list(backlog)
    assert len(got) + backlog.skipped == len(puts)
    assert [one.picture.line for one in got] == list(range(len(puts)))[-room:]  # the newest
    assert [m.tolist() for one in got for m in one.motions] == [m.tolist() for m in everything]
    assert [e for one in got for e in one.events] == [f"event {n}" for n in range(len(puts))]


def test_one_who_waits_for_room_waits_until_there_is_some_or_is_stopped() -> None:
    backlog, put = Backlog(keep_up=False, room=2), threading.Event()

    def putting() -> None:
        for number in range(50):
            backlog.put(waiting(number), NEVER)
        put.set()
        backlog.close()

    thread = threading.Thread(target=putting)
    thread.start()
    assert not put.wait(0.05)
    assert [one.picture.line for one in backlog] == list(range(50))
    thread.join()
    assert backlog.skipped == 0
    backlog, stop = Backlog(keep_up=False, room=1), threading.Event()
    backlog.put(waiting(0), stop)
    thread = threading.Thread(target=backlog.put, args=(waiting(1), stop))
    thread.start()
    stop.set()
    thread.join(10)
    assert not thread.is_alive()


def test_motions_and_events_that_wait_are_bounded_and_lead_to_the_same_place() -> None:
    rng = np.random.default_rng(3)
    motions = list(rng.normal(0, 0.1, (3 * MOST + 1, 3)))
    few = joined(motions, MOST)
    assert len(few) <= MOST
    np.testing.assert_allclose(end(few), end(motions), atol=1e-9)
    earlier = waiting(1)
    for number in range(2, 2 * MOST):
        later = waiting(number)
        later.follow(earlier, MOST)
        earlier = later
    assert len(earlier.events) == MOST
    assert len(earlier.motions) <= MOST
    drive = [record for k in range(3 * MOST) for record in (Motion(k, motions[k]), Note(k, f"event {k}"))]
    (aligned,) = Aligner(most=MOST)([*drive, waiting(3 * MOST).picture])
    assert (len(aligned.motions) <= 2 * MOST, aligned.events[-1]) == (True, f"event {3 * MOST - 1}")
    assert len(aligned.events) == MOST
    np.testing.assert_allclose(end(aligned.motions), end(motions[: 3 * MOST]), atol=1e-9)
