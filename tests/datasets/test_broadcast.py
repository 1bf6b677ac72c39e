from __future__ import annotations

import io
import json
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from maurice_datasets import simulation
from maurice_datasets.live import WAITING, Address, Broadcast, Pace, Tally, parse_address, serve
from maurice_datasets.simulation import SimulationPlan
from maurice_datasets.tasks import TASKS
from maurice_datasets.worlds.world import World
from maurice_loaders.formats.registry import open_session

HERE = Address("127.0.0.1", 0)
HEADER = b'{"header": 1}\n'
PATIENCE_S = 20.0


@contextmanager
def reader(address: Address, buffer: int | None = None) -> Iterator[socket.socket]:
    with socket.socket() as connection:
        if buffer is not None:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        connection.settimeout(PATIENCE_S)
        connection.connect((address.host, address.port))
        yield connection


def let_in(connection: socket.socket) -> io.BufferedReader:
    """Wait until the header is there: from now on nothing that is said is missed."""
    file = connection.makefile("rb")
    assert file.readline() == HEADER
    return file


def test_readers_come_and_go():
    robot = Broadcast(HERE, HEADER)
    with reader(robot.address) as first, reader(robot.address) as second:
        early = let_in(first)
        robot.say(b"one\n")
        assert early.readline() == b"one\n"
        late = let_in(second)
        robot.say(b"two\n")
        assert robot.close() == Tally(2, 0)
        assert early.read() == b"two\n"
        assert late.read().endswith(b"two\n")
    robot = Broadcast(HERE, HEADER)
    with reader(robot.address) as stays:
        lines = let_in(stays)
        with reader(robot.address) as leaves:
            let_in(leaves).close()
        for number in range(200):
            robot.say(b"%d\n" % number)
            time.sleep(0.001)
        assert robot.close().readers == 2
        assert lines.read() == b"".join(b"%d\n" % n for n in range(200))
    robot = Broadcast(HERE, HEADER)
    robot.say(b"one\n")
    assert robot.close() == Tally()


def test_slow_and_deaf_readers_stop_nobody():
    robot = Broadcast(HERE, HEADER)
    said = 4 * WAITING
    with reader(robot.address, 4096) as slow:
        lines = let_in(slow)
        begun = time.monotonic()
        for number in range(said):
            robot.say(json.dumps([number, "x" * 40_000]).encode() + b"\n")
        assert time.monotonic() - begun < PATIENCE_S  # nobody was waited for
        got = [json.loads(lines.readline()) for _ in range(WAITING // 2)]
        numbers = [number for number, _ in got]
        assert all(len(text) == 40_000 for _, text in got)
        assert numbers == sorted(set(numbers))
        tally = robot.close(0.0)
    assert tally.dropped >= said - 3 * WAITING
    robot = Broadcast(HERE, HEADER)
    with reader(robot.address, 4096) as deaf:
        let_in(deaf)
        for _ in range(4 * WAITING):
            robot.say(b"x" * 40_000 + b"\n")
        begun = time.monotonic()
        assert robot.close(0.2).dropped > 0
        assert time.monotonic() - begun < PATIENCE_S


def test_addresses_and_ports_in_use():
    assert parse_address("tcp://127.0.0.1:5005") == Address("127.0.0.1", 5005)
    assert str(parse_address("tcp://[::1]:0")) == "tcp://[::1]:0"
    robot = Broadcast(HERE, HEADER)
    try:
        with pytest.raises(OSError, match="choose another port") as refused:
            Broadcast(robot.address, HEADER)
        assert refused.value.filename == str(robot.address)
    finally:
        robot.close()


@pytest.mark.parametrize(
    "text",
    ["", "127.0.0.1:1", "udp://a:1", "tcp://a", "tcp://:1", "tcp://a:b", "tcp://a:70000", "tcp://a:1/x"],
)
def test_other_addresses_are_refused_in_one_line(text):
    with pytest.raises(ValueError, match=r"^found .*, expected tcp://HOST:PORT.*$"):
        parse_address(text)


def test_pace_waits_for_what_is_early_and_not_for_what_is_late():
    now, slept = [100.0], list[float]()

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    pace = Pace(2.0, lambda: now[0], sleep)
    pace.wait(4.0)
    now[0] += 5.0
    pace.wait(6.0)
    pace.wait(20.0)
    assert slept == [2.0, 3.0]
    Pace(0.0, lambda: now[0], sleep).wait(1e9)
    assert len(slept) == 2


def live(world: World, monkeypatch: pytest.MonkeyPatch, truth: bool) -> list[bytes]:
    """Listen to a whole session of the live robot."""
    monkeypatch.setattr(simulation, "load_world", lambda name, seed, tier: world)
    heard: list[bytes] = []
    with socket.socket() as connection:
        connection.settimeout(PATIENCE_S)

        def ready(address: Address) -> None:
            connection.connect((address.host, address.port))
            heard.append(connection.makefile("rb", buffering=0).readline())

        told: list[Tally] = []
        plan = SimulationPlan(TASKS["tracking"], updates=3)
        serve(plan, HERE, 0.0, truth=truth, ready=ready, over=told.append)
        heard.append(connection.makefile("rb").read())
    assert told == [Tally(1, 0)]
    return b"".join(heard).splitlines(keepends=True)


def test_the_live_robot_speaks_a_session_log(world, monkeypatch, tmp_path):
    log = tmp_path / "session.log"
    log.write_bytes(b"".join(live(world, monkeypatch, truth=True)))
    moments = list(open_session(log).moments())
    assert len(moments) == 3
    assert all(m.truth is not None and m.frame.image.shape == (144, 176, 3) for m in moments)
    assert open_session(log).info.survey == tmp_path / "survey" / "survey.log"


def test_without_truth_it_says_only_what_it_measures(world, monkeypatch):
    header, *lines = [json.loads(line) for line in live(world, monkeypatch, truth=False)]
    assert header["kind"] == "session"
    assert {key for r in lines for key in r} == {"t", "odometry", "encoders_m", "image", "camera"}
