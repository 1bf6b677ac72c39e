"""Clocks of running robots that are set back, and how soon a picture that came is a moment."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.live_peers import log, peer, says, update
from helpers.recordings import assert_same_drive
from helpers.rosbridge import after_subscribing, compressed, odometry, rosbridge
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live import websocket as live_websocket
from maurice_loaders.live.clocks import MessageClock
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import Patience, live_source
from maurice_mcl.values.session import Moment

SOON = ListenOptions(keep_up=False, patience=Patience(1.0))


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "POLL_S", 0.05)
    monkeypatch.setattr(live_source_module, "LONGEST_WAIT_S", 0.2)
    monkeypatch.setattr(live_websocket, "CHOOSE_S", 0.5)


def drive(begin_s: float, seconds: float, x_m: float) -> Iterator[str]:
    """Ten poses and two pictures a second, 0.1 m from pose to pose; each picture between two poses."""
    for number in range(round(10 * seconds)):
        yield odometry(begin_s + number / 10, x_m + number / 10)
        if number % 5 == 1:
            yield compressed(begin_s + number / 10 - 0.05)


BEFORE = 10  # pictures before the clock is set back


def set_back(begin_s: float, x_m: float) -> Callable[[Any], None]:
    """A drive of 5 s from 100 s on, at whose end the clock is set back."""

    def send(connection: Any) -> None:
        for text in (*drive(100.0, 5.0, 0.0), *drive(begin_s, 5.0, x_m)):
            connection.send(text)

    return send


RESET, STEPPED, LOOPED = (0.5, 0.0), (98.5, 5.0), (100.0, 0.0)


@pytest.mark.parametrize("again", [RESET, STEPPED, LOOPED], ids=["reset", "stepped", "looped"])
def test_a_bridge_whose_clock_is_set_back_goes_on(again: tuple[float, float], tmp_path: Path) -> None:
    pytest.importorskip("websockets")
    remarks: list[str] = []
    with rosbridge(after_subscribing(set_back(*again))) as address:
        recorder = LiveRecorder(tmp_path)
        with LiveSession(live_source(address), SOON, recorder, remarks.append) as session:
            moments = list(session.moments())
    assert len(moments) == 2 * BEFORE
    assert session.problem_count == 0
    of_clock = [text for text in remarks if "clock" in text]
    back_s = 104.55 - again[0] - 0.05  # from the last picture's time to the first one's
    assert of_clock == [f"{address}: its clock was set back by {back_s:.1f} s; goes on from there"]
    # without the movement across the break, whose length nobody knows
    lengths = [float(np.abs(moment.frame.motions[:, 0]).sum()) for moment in moments]
    expected = [0.05, *[0.5] * (BEFORE - 1)]
    np.testing.assert_allclose(lengths, [*expected, 0.05, *expected[1:]], atol=1e-6)
    events = [moment.events for moment in moments]
    clock = f"clock: set back by {back_s:.1f} s; odometry across it is not known"
    assert events[BEFORE] == (clock,)
    assert not any([*events[:BEFORE], *events[BEFORE + 1 :]])
    assert_same_drive(open_session(tmp_path / "session.log"), _Came(session, moments))


class _Came:
    """Moments that came, as a session."""

    def __init__(self, session: LiveSession, moments: list[Moment]) -> None:
        self.info, self._moments = session.info, moments

    def moments(self) -> Iterator[Moment]:
        return iter(self._moments)


def test_a_message_without_a_time_is_no_leap_of_the_clock() -> None:
    pytest.importorskip("websockets")

    def send(connection: Any) -> None:
        for text in (*drive(100.0, 2.0, 0.0), compressed(0.0), *drive(102.0, 2.0, 2.0)):
            connection.send(text)

    with (
        rosbridge(after_subscribing(send)) as address,
        LiveSession(live_source(address), SOON) as session,
    ):
        moments = list(session.moments())
    assert [round(moment.frame.time_s, 6) for moment in moments] == [n / 2 for n in range(8)]
    assert [str(problem).rpartition(": ")[2] for problem in session.problems] == [
        "found no time in a message of the image, expected one"
    ]


def test_messages_out_of_order_set_no_clock_back() -> None:
    clock = MessageClock()
    taken = [message for t in (1.0, 1.2, 0.5, 1.3, 0.6, 0.7, 1.4) for message in clock.take("image", t, t)]
    assert sorted(t for _, t, _ in taken) == [0.5, 0.6, 0.7, 1.0, 1.2, 1.3, 1.4]
    assert not clock.was_set_back
    assert [clock.take("image", t, None) for t in (0.1, 0.2)] == [[], []]
    assert [t for _, t, _ in clock.take("image", 0.3, None)] == [0.1, 0.2, 0.3]
    assert clock.was_set_back


def test_a_picture_from_before_that_comes_after_is_of_neither_drive() -> None:
    clock = MessageClock()
    for t in (100.0, 100.5):
        clock.take("image", t, None)
    for t in (100.4, 100.6, 0.0, 0.1, 0.2):
        clock.take("pose", t, None)
    assert clock.was_set_back
    assert clock.take("image", 101.0, None) == []
    assert [t for _, t, _ in clock.take("image", 0.15, None)] == [0.15]


def test_a_log_whose_clock_is_set_back_goes_on_and_says_so_once() -> None:
    remarks: list[str] = []
    with (
        peer(says(log(range(100, 110)) + b"".join(update(t) for t in range(30)))) as address,
        LiveSession(live_source(address), SOON, None, remarks.append) as session,
    ):
        moments = list(session.moments())
    assert len(moments) == 10 + 30 - 9  # the first 19 records are taken for slips
    assert sum("its clock was set back by" in text for text in remarks) == 1
    assert [text for moment in moments for text in moment.events if text.startswith("clock")] == [
        "clock: set back by 100.0 s; odometry across it is not known"
    ]


def pose_line(t_s: float, x_m: float) -> bytes:
    return (json.dumps({"t": t_s, "odometry_pose": [x_m, 0.0, 0.0]}) + "\n").encode()


def test_poses_of_a_log_are_captured_as_the_motions_that_the_filter_got(tmp_path: Path) -> None:
    def picture_of(t_s: float) -> bytes:
        return update(t_s).split(b"\n", 1)[1]

    sent = log([]) + b"".join(pose_line(t, 0.3 * t) + picture_of(t + 0.5) for t in range(6))
    with peer(says(sent)) as address:
        recorder = LiveRecorder(tmp_path)
        with LiveSession(live_source(address), SOON, recorder) as session:
            moments = list(session.moments())
    assert_same_drive(open_session(tmp_path / "session.log"), _Came(session, moments))


PERIOD_S = 0.5
SOONEST_S = 0.25  # on a machine that does other things as well; a period is twice that


@pytest.mark.parametrize("truth", [False, True])
def test_a_picture_is_a_moment_when_it_came(truth: bool) -> None:
    """And not with the record after it, a period later."""
    sent: list[float] = []

    def at_two_a_second(connection: socket.socket) -> None:
        connection.sendall(log([]))
        for number in range(5):
            there = [number * 0.1, 0.0, 0.0]
            known = json.dumps({"t": number / 2, "truth": there}).encode() + b"\n" if truth else b""
            connection.sendall(known + update(number / 2))
            sent.append(time.monotonic())
            time.sleep(PERIOD_S)

    came = []
    with peer(at_two_a_second) as address, LiveSession(live_source(address), SOON) as session:
        for _ in islice(session.moments(), 5):
            came.append(time.monotonic())
    late_s = np.array(came) - sent
    assert np.max(late_s[1:]) < SOONEST_S  # the first one waits for what may tell a truth
