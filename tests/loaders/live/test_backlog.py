from __future__ import annotations

import threading

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from maurice_loaders.live.session import MOST_EVENTS, MOST_MOTIONS, Backlog, Waiting, joined
from maurice_loaders.session_log.records import PictureRecord
from maurice_mcl.arrays import F64
from maurice_mcl.geometry import compose

NEVER = threading.Event()


def waiting(number: int, motions: int = 1) -> Waiting:
    picture = PictureRecord(number, float(number), None, "", None, False, None)
    return Waiting(picture, None, [np.array([number, i, 0.1]) for i in range(motions)], [f"event {number}"])


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


def test_with_every_picture_the_one_who_puts_waits() -> None:
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


def test_one_who_waits_for_room_can_be_stopped() -> None:
    backlog, stop = Backlog(keep_up=False, room=1), threading.Event()
    backlog.put(waiting(0), stop)
    thread = threading.Thread(target=backlog.put, args=(waiting(1), stop))
    thread.start()
    stop.set()
    thread.join(10)
    assert not thread.is_alive()


def test_motions_and_events_that_wait_are_bounded_and_lead_to_the_same_place() -> None:
    rng = np.random.default_rng(3)
    motions = list(rng.normal(0, 0.1, (3 * MOST_MOTIONS + 1, 3)))
    few = joined(motions)
    assert len(few) <= MOST_MOTIONS
    np.testing.assert_allclose(end(few), end(motions), atol=1e-9)
    one = waiting(1)
    for number in range(2, 2 * MOST_EVENTS):
        later = waiting(number)
        later.follow(one)
        one = later
    assert len(one.events) == MOST_EVENTS
    assert len(one.motions) <= MOST_MOTIONS
