"""Bridges: a real Foxglove server in a process of its own, and a server that speaks rosbridge."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers import expect_facts
from helpers.live_peers import PICTURE, peer
from helpers.rosbridge import after_subscribing, compressed, odometry, rosbridge
from maurice_loaders.bags.source import Message, decode_json
from maurice_loaders.bags.topics import PoseTopic
from maurice_loaders.errors import InputError
from maurice_loaders.formats.registry import open_session
from maurice_loaders.live import source as live_source_module
from maurice_loaders.live import websocket as live_websocket
from maurice_loaders.live.poses import PoseHistory
from maurice_loaders.live.session import ListenOptions, LiveRecorder, LiveSession
from maurice_loaders.live.source import Patience, live_source
from maurice_loaders.live.translation import ChosenTopics, Translator
from maurice_loaders.live.websocket import HEAD, SUBPROTOCOLS
from maurice_loaders.reading.options import Reading
from maurice_mcl.values.session import Moment

pytest.importorskip("websockets")
pytest.importorskip("rosbags")
COUNT = 25
SOON = Patience(1.0)


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_source_module, "POLL_S", 0.05)
    monkeypatch.setattr(live_source_module, "LONGEST_WAIT_S", 0.2)
    monkeypatch.setattr(live_websocket, "CHOOSE_S", 0.5)


@contextmanager
def robot(encoding: str, port: int = 0, count: int = COUNT) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    pytest.importorskip("foxglove")
    script = Path(__file__).parents[2] / "helpers" / "foxglove_bridge.py"
    command = [sys.executable, str(script), str(port), encoding, str(count)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield f"ws://127.0.0.1:{process.stdout.readline().strip()}", process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


ODOMETRY = dict.fromkeys(("cdr", "json", "proto", "proto-raw", "proto-video"), "/odom")
ODOMETRY |= dict.fromkeys(("cdr-tf", "proto-tf"), "/tf:odom.base_link")


@pytest.mark.parametrize("encoding", ODOMETRY)
def test_a_robot_behind_a_foxglove_bridge_is_followed_and_recorded(encoding: str, tmp_path: Path) -> None:
    with robot(encoding) as (address, _):
        listen = ListenOptions(keep_up=False, patience=SOON)
        with LiveSession(live_source(address), listen, LiveRecorder(tmp_path)) as session:
            moments = list(islice(session.moments(), COUNT))
    assert len(moments) == COUNT
    assert session.counts.broken == 0
    guessed = f"guessed pictures from /camera/image, odometry from {ODOMETRY[encoding]},"
    assert all(text in session.info.notes[0] for text in (guessed, "also there: /rear/image"))
    assert moments[0].frame.motions.shape == (0, 3)
    for number, moment in enumerate(moments[1:], start=1):
        np.testing.assert_allclose(moment.frame.motions, [[0.05, 0.0, 0.1]], atol=1e-9)
        assert moment.frame.time_s == pytest.approx(0.05 * number, abs=1e-6)
        shade = moment.frame.image[0, (number + 16) % 32].astype(int)
        assert np.abs(shade - number * 7 % 256).max() < 12
    again = list(open_session(tmp_path / "session.log").moments())
    assert len(again) == COUNT
    assert all((a.frame.image == b.frame.image).all() for a, b in zip(again, moments, strict=True))


def test_a_bridge_that_is_killed_and_comes_back_goes_on(tmp_path: Path) -> None:
    with robot("json", count=5) as (address, process):
        got: list[Moment] = []
        listen = ListenOptions(keep_up=False, patience=Patience(30.0, silent_s=30.0))
        with LiveSession(live_source(address), listen) as session:
            moments = session.moments()
            got += [next(moments) for _ in range(5)]
            process.kill()
            process.wait()
            with robot("json", int(address.rpartition(":")[2]), count=5):
                got += [next(moments) for _ in range(5)]
    assert [len(moment.frame.motions) for moment in got] == [0, 1, 1, 1, 1, 0, 1, 1, 1, 1]
    assert got[5].events[0].startswith("gap")
    assert session.counts.gaps == 1


def test_a_topic_that_is_not_there_is_told_with_those_that_are() -> None:
    with robot("json") as (address, _):
        source = live_source(address, Reading(image_topic="/nowhere"))
        with LiveSession(source, ListenOptions(patience=SOON)) as session, pytest.raises(InputError) as told:
            list(session.moments())
    assert "found no topic /nowhere; it holds /camera/image" in str(told.value)


def test_the_truth_may_be_transforms_of_the_same_topic() -> None:
    with robot("cdr-tf", count=6) as (address, _):
        asked = Reading(odometry_topic="/tf:odom.base_link", truth_topic="/tf:map.base_link")
        with LiveSession(live_source(address, asked), ListenOptions(keep_up=False, patience=SOON)) as session:
            moments = list(islice(session.moments(), 6))
    truths = [moment.truth for moment in moments if moment.truth is not None]
    assert len(truths) >= 5
    np.testing.assert_allclose(truths[1] - truths[0], [0.0, -0.05, 0.1], atol=1e-9)
    np.testing.assert_allclose(moments[1].frame.motions, [[0.05, 0.0, 0.1]], atol=1e-9)


def test_messages_without_times_are_taken_when_the_bridge_says() -> None:
    listen = ListenOptions(keep_up=False, patience=SOON)
    with (
        robot("proto-timeless", count=6) as (address, _),
        LiveSession(live_source(address), listen) as session,
    ):
        moments = list(islice(session.moments(), 6))
    assert moments[0].events[0].startswith("clock: the bridge's times are used, because messages of")
    assert [len(moment.frame.motions) for moment in moments] == [0, 1, 1, 1, 1, 1]
    assert moments[5].frame.time_s == pytest.approx(0.25, abs=1e-6)


@pytest.mark.parametrize("offered", SUBPROTOCOLS)
def test_old_and_new_bridges_are_spoken_to_in_foxglove_s_protocol(offered: str) -> None:
    """The SDK's own server, as used above, takes the new one alone; older bridges only the old one."""
    heard = []

    def serve(connection: Any) -> None:
        heard.append(connection.subprotocol)
        channel = {"id": 7, "topic": "/image", "encoding": "json", "schemaName": "foxglove.CompressedImage"}
        connection.send(json.dumps({"op": "advertise", "channels": [channel | {"schema": ""}]}))
        wish = json.loads(connection.recv())
        heard.append(wish["subscriptions"])
        message = {"timestamp": {"sec": 5, "nsec": 0}, "format": "jpeg", "data": PICTURE}
        connection.send(HEAD.pack(1, 7, 5 * 10**9) + json.dumps(message).encode())

    listen = ListenOptions(keep_up=False, patience=SOON)
    with rosbridge(serve, [offered]) as address, LiveSession(live_source(address), listen) as session:
        assert next(session.moments()).frame.image.shape == (6, 8, 3)
    assert heard[:2] == [offered, [{"id": 7, "channelId": 7}]]


def test_a_rosbridge_of_ros_1_is_followed() -> None:
    def send(connection: Any) -> None:
        for number in range(6):  # a picture's time lies between two of odometry, and comes after both
            connection.send(odometry(100 + number, number))
            connection.send(odometry(100.5 + number, number + 0.5))
            connection.send(compressed(100.25 + number))
        connection.send("nonsense")

    with rosbridge(after_subscribing(send)) as address:
        source = live_source(address, Reading(max_dt_s=0.3))
        with LiveSession(source, ListenOptions(keep_up=False, patience=SOON)) as session:
            moments = list(session.moments())
        assert [round(m.frame.time_s, 6) for m in moments] == [0, 1, 2, 3, 4, 5]
        assert [m.frame.motions.tolist() for m in moments] == [[[0.25, 0, 0]], *[[[1.0, 0, 0]]] * 5]
        assert session.counts.broken == 1
        assert "not JSON" in str(session.problems[0])


def test_a_rosbridge_without_rosapi_is_told_by_its_name() -> None:
    def serve(connection: Any) -> None:
        for text in connection:  # rosbridge says so of a service that it does not know
            request = json.loads(text)
            answer = {"op": "service_response", "id": request["id"], "values": "unknown", "result": False}
            connection.send(json.dumps(answer))

    with (
        rosbridge(serve) as address,
        LiveSession(live_source(address), ListenOptions(patience=SOON)) as session,
        pytest.raises(InputError) as told,
    ):
        list(session.moments())
    expect_facts(
        str(told.value), "found no answer to /rosapi/topics", "rosapi", "ros2 run rosapi rosapi_node"
    )


def test_a_bridge_without_pictures_is_told_what_is_missing_and_what_is_there() -> None:
    def wait(connection: Any) -> None:
        connection.recv()

    topics = {"/odom": "nav_msgs/Odometry"}
    with (
        rosbridge(after_subscribing(wait, topics)) as address,
        LiveSession(live_source(address), ListenOptions(patience=SOON)) as session,
        pytest.raises(InputError) as told,
    ):
        list(session.moments())
    expect_facts(str(told.value), "expected pictures or scans", "it has /odom (nav_msgs/Odometry)")
    assert "expected odometry" not in str(told.value)


NO_WEBSOCKETS: dict[str, bytes] = {
    "an endless line": b"x" * 200_000,
    "random bytes": np.random.default_rng(0).bytes(3000) + b"\n\r\n\r\n",
    "another answer": b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello",
    "TLS": bytes.fromhex("16030100c8010000c40303") + bytes(190),
    "nothing": b"",
    "another protocol": b"hello\r\n\r\n",
}


@pytest.mark.parametrize("name", NO_WEBSOCKETS)
def test_a_hostile_server_is_told_in_one_line_and_nothing_is_printed(
    name: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(live_websocket, "OPEN_S", 0.3)

    def answer(connection: socket.socket) -> None:
        connection.recv(65536)  # or what is left unread would reset the connection
        connection.sendall(NO_WEBSOCKETS[name])

    with peer(answer) as address:
        source = live_source(address.replace("tcp", "ws"))
        with (
            LiveSession(source, ListenOptions(patience=Patience(0.0))) as session,
            pytest.raises(InputError) as told,
        ):
            list(session.moments())
    expected = "no WebSocket" if name == "another protocol" else "found no session log there"
    assert expected in str(told.value)
    assert "\n" not in str(told.value)
    assert capfd.readouterr() == ("", "")


def test_without_the_extra_the_message_is_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_websocket.importlib.util, "find_spec", lambda name: None)
    session = LiveSession(live_source("ws://127.0.0.1:1"))
    with session, pytest.raises(InputError, match=r"pip install 'maurice-replay\[ros\]'"):
        list(session.moments())


TOPICS = ChosenTopics("/image/compressed", PoseTopic("/odom"))


def translated(*messages: str) -> tuple[list[dict[str, Any]], Translator]:
    translator, found = Translator(0.1), []
    for message in map(json.loads, messages):
        decode = partial(decode_json, json.dumps(message["msg"]))
        said = Message(message["topic"], "nav_msgs/Odometry", 5 * 10**9, decode)
        found += list(translator.take(said, TOPICS))
    return found, translator


def test_a_picture_waits_for_the_odometry_after_it() -> None:
    found, translator = translated(odometry(1.0, 0.0), compressed(1.05))
    assert found == []
    found, translator = translated(odometry(1.0, 0.0), compressed(1.05), odometry(1.1, 1.0))
    assert [sorted(one) for one in found] == [["odometry", "t"], ["image", "t"]]
    assert found[0]["odometry"] == pytest.approx([0.5, 0.0, 0.0])
    assert not translator.problems
    found, _ = translated(odometry(0.0, 0.0), compressed(0.0))  # stamps that stand still are not used
    assert found[0]["event"].startswith("clock: the bridge's times are used")
    assert {one["t"] for one in found} == {5.0}


def test_a_picture_without_odometry_is_left_out_and_no_movement_is_lost() -> None:
    pictures = [compressed(2.05), odometry(3.0, 2.0), compressed(3.0)]
    found, translator = translated(odometry(1.0, 0.0), compressed(1.0), odometry(1.1, 0.1), *pictures)
    assert [one["t"] for one in found] == [1.0, 3.0, 3.0]
    assert found[1]["odometry"] == pytest.approx([2.0, 0.0, 0.0])
    (problem,) = translator.problems
    expect_facts(str(problem), "no odometry within 0.1 s", "--reading max_dt_s")


def test_poses_that_come_late_are_put_in_their_place() -> None:
    track = PoseHistory()
    for t_s in (1.0, 3.0, 2.0):
        track.add(t_s, np.array([t_s, 0.0, 0.0]))
    assert track.last_s == 3.0
    np.testing.assert_allclose(track.at(2.0, 0.1), [2.0, 0.0, 0.0])
    np.testing.assert_allclose(track.at(1.5, 1.0), [1.5, 0.0, 0.0])
    assert track.at(4.0, 0.5) is None


def test_what_a_bridge_announces_is_bounded_in_all() -> None:
    bridge = live_websocket.Foxglove()
    channel = {"topic": "/a", "encoding": "cdr", "schemaName": "x", "schema": "#" * (20 * 2**20)}
    bridge.hear(json.dumps({"op": "advertise", "channels": [channel | {"id": 1}]}))
    with pytest.raises(InputError, match="more than 32 MiB"):
        bridge.hear(json.dumps({"op": "advertise", "channels": [channel | {"id": 2}]}))
    assert len(bridge.topics) == 1
